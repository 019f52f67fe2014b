#!/usr/bin/python3
"""Checks all documents of the source folder without running their command lines.

check_documents.py BUILD_FOLDER SOURCE_FOLDER [RUN_DOCUMENT...]

- Each command line in a fenced block is in a `console` block after `$ `. Each document with such blocks is
  among RUN_DOCUMENT, the documents that check_transcripts.py runs.
- Commands, options, their choices, variables of make files and scripts exist, in blocks and in `code`
  within sentences.
- Links lead to existing files and headings.
- Each command has a page in tools/manual with its image. The index lists the page, and the gallery shows
  the image.
"""

import pathlib
import re
import sys

from command_lines import Program, line_faults, words_of
from documents import Document

COMMAND_LINE = re.compile(
    r"(\$ |graspmap(?![:.])\b[^:]*(\s|$)|make -f|scripts/\w|build/\S*graspmap |cmake |ctest |g?db |apt)")
CONDITIONS = {"data", "long", "elsewhere"}
# Options of other programs that documents mention without the program.
FOREIGN_OPTIONS = {"--install", "--prefix", "--requeue", "--array", "--cpus-per-task", "--mem",
                   "--time", "--output_type"}
MANUAL = pathlib.PurePath("tools/manual")
LARGEST_PICTURE = 60_000
SMALLEST_PICTURE = 2_000


class Checker:
    def __init__(self, build, source, run_documents):
        self.source = source
        self.program = Program(build / "graspmap")
        self.run_documents = run_documents
        self.all_options = self.program.all_options() | FOREIGN_OPTIONS
        self.anchors = {}
        self.faults = []
        self.command_lines = 0

    def fault(self, path, number, text):
        self.faults.append(f"{path.relative_to(self.source)}:{number}: {text}")

    def check_blocks(self, document):
        if document.open_fence:
            self.fault(document.path, document.blocks[-1].number, "a block that does not end")
        for block in document.blocks:
            if block.language == "console":
                self.check_console(document, block)
                continue
            for number, line in block.lines:
                if COMMAND_LINE.match(line.strip()):
                    self.fault(document.path, number,
                               "a command line outside of a ```console block: " + line.strip())
        name = str(document.path.relative_to(self.source))
        if name not in self.run_documents and any(
                "elsewhere" not in block.conditions for block in document.consoles()):
            self.fault(document.path, 1, "no test runs its command lines")

    def check_console(self, document, block):
        for word in set(block.conditions) - CONDITIONS:
            self.fault(document.path, block.number, f"unknown condition {word}")
        if {"long", "elsewhere"} & set(block.conditions) and not block.reason:
            self.fault(document.path, block.number, "a block that is not run needs a reason")
        transcripts = block.transcripts()
        if not transcripts:
            self.fault(document.path, block.number, "a console block without a `$ ` line")
        for transcript in transcripts:
            number = transcript.number
            self.command_lines += 1
            self.check_line(document, number, transcript.command)
            if "GRASPMAP_DATA" in transcript.command and not block.conditions:
                self.fault(document.path, number, "a command that needs data requires ```console data")
            for line in transcript.output:
                if re.match(r"graspmap [a-z-]+ (?!\S+:)|make -f", line):
                    self.fault(document.path, number, "a command line without `$ `: " + line)

    def check_line(self, document, number, line):
        for text in line_faults(line, self.program, self.source):
            self.fault(document.path, number, text)

    def contexts(self, document, line, words):
        """Returns the commands whose option a code span may name: the command of the span, of the table
        row, or of the page and of the line. An empty list allows any command."""
        own = self.program.command_of(words)
        if own:
            return [own]
        row = re.match(r"\s*\| *`([^`]+)`", line)
        if row and self.program.command_of(words_of(row.group(1))):
            spans = re.findall(r"`([^`]+)`", line)
            return [name for name in (self.program.command_of(words_of(span)) for span in spans)
                    if name]
        if document.path.parent == self.source / MANUAL \
                and document.path.stem in self.program.commands:
            names = {document.path.stem, *re.findall(r"\]\(([\w-]+)\.md", line),
                     *re.findall(r"`([\w-]+)`", line)} & set(self.program.commands)
            return [f"{name} {kind}".strip() for name in sorted(names)
                    for kind in self.program.kinds[name] or [""]]
        return []

    def in_script(self, line, option):
        """Returns True if a script that the line names has the option."""
        paths = [self.source / name for name in re.findall(r"`(scripts/[\w-]+)", line)]
        return any(path.is_file() and option in path.read_text(encoding="utf-8")
                   for path in paths)

    def check_spans(self, document):
        for number, line, code in document.code_spans():
            words = words_of(code)
            if not words:
                continue
            if words[0] in ("graspmap", "make") or words[0].startswith("scripts/") \
                    or words[0].endswith("/graspmap"):
                self.check_line(document, number, code)
                continue
            own = self.program.command_of(words)
            if own:
                for text in self.program.option_faults(own, words[len(own.split()):]):
                    self.fault(document.path, number, text)
                continue
            if not re.match("--[a-z]", words[0]):
                continue
            option = words[0].partition("=")[0].partition("|")[0]
            contexts = self.contexts(document, line, words)
            if contexts and all(option not in self.program.options(name) for name in contexts):
                self.fault(document.path, number, f"{', '.join(contexts)}: no option {option}")
            elif option not in self.all_options and not self.in_script(line, option):
                self.fault(document.path, number, f"no command has an option {option}")

    def check_links(self, document):
        for number, target in document.links():
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            path = (document.path.parent / name).resolve() if name else document.path
            if not path.exists() or self.source not in [path, *path.parents]:
                self.fault(document.path, number, f"the link {target} leads nowhere")
            elif anchor and path.suffix == ".md":
                if path not in self.anchors:
                    self.anchors[path] = Document(path).anchors()
                if anchor not in self.anchors[path]:
                    self.fault(document.path, number, f"no heading #{anchor} in {path.name}")

    def check_manual(self):
        folder = self.source / MANUAL
        index = Document(folder / "README.md")
        listed = {target for _, target in index.links()}
        gallery = Document(folder / "GALLERY.md")
        exhibits = " ".join(line for _, line in gallery.prose)
        for name in self.program.commands:
            page = folder / f"{name}.md"
            if not page.is_file():
                self.fault(index.path, 1, f"the command {name} has no page")
                continue
            if page.name not in listed:
                self.fault(index.path, 1, f"it does not list {page.name}")
            shown = {target for _, target in Document(page).links()}
            names = {f"pictures/{name}.png", f"pictures/{name}.jpg"} & shown
            if len(names) != 1:
                self.fault(page, 1, f"it does not show pictures/{name}.png or .jpg")
                continue
            picture = names.pop()
            if f"({picture})" not in exhibits:
                self.fault(gallery.path, 1, f"it does not show the picture of {name}")
            picture = folder / picture
            if picture.is_file():
                size = picture.stat().st_size
                if not SMALLEST_PICTURE <= size <= LARGEST_PICTURE:
                    self.fault(page, 1, f"{picture.name} has {size} bytes")
        for page in folder.glob("*.md"):
            if page.stem not in [*self.program.commands, "README", "GALLERY"]:
                self.fault(page, 1, "there is no such command")


def documents_of(source):
    """Returns all documents outside of builds and hidden folders."""
    return [path for path in sorted(source.rglob("*.md"))
            if not any(part == "build" or part.startswith(".")
                       for part in path.relative_to(source).parts)]


def main():
    build, source = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    checker = Checker(build, source, set(sys.argv[3:]))
    for path in documents_of(source):
        document = Document(path)
        checker.check_blocks(document)
        checker.check_spans(document)
        checker.check_links(document)
    checker.check_manual()
    for name in checker.run_documents:
        if not (source / name).is_file():
            checker.fault(source / name, 1, "a test runs it, but it does not exist")
    print("".join(f"{fault}\n" for fault in checker.faults), end="")
    print(f"{checker.command_lines} command lines in console blocks, {len(checker.faults)} faults")
    return 1 if checker.faults else 0


if __name__ == "__main__":
    sys.exit(main())
