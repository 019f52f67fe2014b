#!/usr/bin/python3
"""Runs the command lines of a document and compares what they print with what it shows.

check_transcripts.py BUILD_FOLDER SOURCE_FOLDER DOCUMENT

Blocks fenced as ```console hold `$ COMMAND` lines, each followed by its output, standard output and
error together; `...` stands for any number of lines. All commands of a document run in one scratch
folder, in order, with `graspmap` on the PATH and the source's `data` and `pipelines` in it. Commands
that name $GRASPMAP_DATA run only where it is set.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile


def transcripts(text):
    """(line number, command, expected lines) of every command of every console block."""
    found = []
    inside = False
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("```"):
            inside = line.strip() == "```console"
        elif inside and line.startswith("$ "):
            found.append((number, line[2:], []))
        elif inside and found and found[-1][1].endswith("\\"):
            found[-1] = (found[-1][0], found[-1][1][:-1] + line, found[-1][2])
        elif inside and found:
            found[-1][2].append(line)
    return found


def matches(expected, actual):
    """Whether the lines are equal, `...` standing for any of them."""
    pattern = "".join(
        "(?:.*\n)*" if line.strip() == "..." else re.escape(line.rstrip()) + "[ ]*\n"
        for line in expected)
    return re.fullmatch(pattern, "".join(line + "\n" for line in actual)) is not None


def main():
    build, source, document = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
    environment = dict(os.environ, PATH=f"{build}:{os.environ['PATH']}", LC_ALL="C.UTF-8")
    failed = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name in ("data", "pipelines"):
            os.symlink(source / name, pathlib.Path(scratch) / name)
        for number, command, expected in transcripts(document.read_text()):
            if "$GRASPMAP_DATA" in command and not os.environ.get("GRASPMAP_DATA"):
                continue
            run = subprocess.run(["bash", "-c", command], cwd=scratch, env=environment, text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
            actual = [line.rstrip() for line in run.stdout.splitlines()]
            while expected and not expected[-1].strip():
                expected.pop()
            if run.returncode != 0 or not matches(expected, actual):
                failed += 1
                print(f"{document.name}:{number}: $ {command}\n  exit code {run.returncode}; it prints")
                print("".join(f"    {line}\n" for line in actual), end="")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
