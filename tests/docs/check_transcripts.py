#!/usr/bin/python3
"""Runs the command lines of a document and compares their output with the output in the document.

check_transcripts.py BUILD_FOLDER SOURCE_FOLDER DOCUMENT [--begin-with FOLDER] [--in FOLDER]
                     [--makes FILE] [--write]

documents.py describes the blocks of a document. In the output of a command, `...` matches any number of
lines. All commands of a document run in one scratch folder, in order, with `graspmap` in PATH and links
to `data`, `pipelines`, `scripts` and `tests` of the source folder.

--begin-with FOLDER  copies the files of FOLDER into the scratch folder first
--in FOLDER          uses FOLDER as the scratch folder; it is emptied first and kept
--makes FILE         requires that the commands write FILE
--write              replaces the output in the document by the output of the commands

Exits with 77 if no block could be run.
"""

import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

from documents import Document

SOURCE_LINKS = ("data", "pipelines", "scripts", "tests")


def matches(expected, actual):
    """Returns True if the lines are equal; `...` matches any number of lines."""
    pattern = "".join(
        "(?:.*\n)*" if line.strip() == "..." else re.escape(line.rstrip()) + "[ ]*\n"
        for line in expected)
    return re.fullmatch(pattern, "".join(line + "\n" for line in actual)) is not None


def run_command(command, folder, environment):
    """Runs a command line and returns (exit code, lines)."""
    run = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, text=True,
                         stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                         stderr=subprocess.STDOUT, errors="replace", check=False)
    return run.returncode, [line.rstrip() for line in run.stdout.splitlines()]


def run_document(document, folder, environment, write):
    """Returns (number of commands that were run, number of failed commands)."""
    count = failed = 0
    changes = []
    for block in document.consoles():
        if block.skipped():
            print(f"{document.path.name}:{block.number}: not run: {block.skipped()}")
            continue
        for transcript in block.transcripts():
            count += 1
            code, actual = run_command(transcript.command, folder, environment)
            expected = list(transcript.output)
            while expected and not expected[-1].strip():
                expected.pop()
            right = matches(expected, actual)
            if write and code == 0 and not right:
                first = transcript.first_output - 1
                changes.append((first, first + len(expected), actual))
            elif code != 0 or not right:
                failed += 1
                print(f"{document.path.name}:{transcript.number}: $ {transcript.command}\n"
                      f"  exit code {code}; it prints")
                print("".join(f"    {line}\n" for line in actual), end="", flush=True)
    if changes:
        lines = document.path.read_text(encoding="utf-8").splitlines()
        for first, end, actual in reversed(changes):
            lines[first:end] = actual
        document.path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return count, failed


def prepare(folder, source, begin_with):
    """Copies the files of `begin_with` into the scratch folder and links folders of the source."""
    if begin_with:
        for entry in begin_with.iterdir():
            if entry.is_dir() and not entry.is_symlink():
                shutil.copytree(entry, folder / entry.name, symlinks=True)
            elif not entry.is_symlink():
                shutil.copy2(entry, folder / entry.name)
    for name in SOURCE_LINKS:
        os.symlink(source / name, folder / name)


def main():
    parser = argparse.ArgumentParser()
    for name in ("build", "source", "document"):
        parser.add_argument(name, type=lambda text: pathlib.Path(text).resolve())
    for name in ("--begin-with", "--in"):
        parser.add_argument(name, type=lambda text: pathlib.Path(text).resolve(),
                            dest=name[2:].replace("-", "_") + "_folder")
    parser.add_argument("--makes")
    parser.add_argument("--write", action="store_true")
    words = parser.parse_args()
    environment = dict(os.environ, PATH=f"{words.build}:{os.environ['PATH']}", LC_ALL="C.UTF-8")
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        if words.in_folder:
            folder = words.in_folder
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        prepare(folder, words.source, words.begin_with_folder)
        count, failed = run_document(Document(words.document), folder, environment,
                                     words.write)
        if count and words.makes and not (folder / words.makes).is_file():
            failed += 1
            print(f"{words.document.name}: its commands leave no {words.makes}")
    if failed:
        return 1
    return 0 if count else 77


if __name__ == "__main__":
    sys.exit(main())
