"""Parser of Markdown documents: fenced blocks, command lines, code in sentences, links.

Blocks fenced as ```console contain `$ COMMAND` lines, each followed by its standard output and error.
Words after `console` are the conditions for running the block; a colon and a reason may follow:

  console                      always
  console data                 if GRASPMAP_DATA is the folder of the real data
  console long: REASON         if GRASPMAP_LONG_DOCS is set
  console elsewhere: REASON    never; its command lines are checked against --help
"""

import os
import pathlib
import re

FENCE = re.compile(r"\s*(```+|~~~+)\s*(.*)$")


class Transcript:
    """Command line of a block, with its output in the document."""

    def __init__(self, number, command):
        self.number = number
        self.command = command
        self.first_output = number + 1
        self.output = []


class Block:
    """Fenced block: line number, language, conditions, reason and lines."""

    def __init__(self, number, info):
        words, _, reason = info.partition(":")
        words = words.split()
        self.number = number
        self.language = words[0] if words else ""
        self.conditions = words[1:]
        self.reason = reason.strip()
        self.lines = []

    def skipped(self):
        """Returns the reason why the block is not run, or an empty text."""
        if "elsewhere" in self.conditions:
            return self.reason
        if "data" in self.conditions and not os.environ.get("GRASPMAP_DATA"):
            return "GRASPMAP_DATA names no data"
        if "long" in self.conditions and not os.environ.get("GRASPMAP_LONG_DOCS"):
            return "GRASPMAP_LONG_DOCS is not set"
        return ""

    def transcripts(self):
        """Returns the commands of a console block with their output."""
        found = []
        for number, line in self.lines:
            if line.startswith("$ "):
                found.append(Transcript(number, line[2:]))
            elif found and not found[-1].output and found[-1].command.endswith("\\"):
                found[-1].command = found[-1].command[:-1] + line.strip()
                found[-1].first_output = number + 1
            elif found:
                found[-1].output.append(line)
        return found


class Document:
    """Blocks of a document, and its other lines as (line number, text)."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.blocks = []
        self.prose = []
        fence = None
        for number, line in enumerate(self.path.read_text(encoding="utf-8").splitlines(), start=1):
            match = FENCE.match(line)
            if fence is None and match:
                fence = match.group(1)
                self.blocks.append(Block(number, match.group(2)))
            elif fence is not None and match and match.group(1) == fence and not match.group(2):
                fence = None
            elif fence is not None:
                self.blocks[-1].lines.append((number, line))
            else:
                self.prose.append((number, line))
        self.open_fence = fence is not None

    def consoles(self):
        """Returns the console blocks."""
        return [block for block in self.blocks if block.language == "console"]

    def code_spans(self):
        """Returns (line number, line, code) of each `code` in sentences and tables."""
        return [(number, line, code.strip().replace("\\|", "|")) for number, line in self.prose
                for code in re.findall(r"`([^`]+)`", line)]

    def links(self):
        """Returns (line number, target) of each link and image."""
        pattern = r"\]\(([^()\s]+(?:\([^()\s]*\))?)\)|<img[^>]*\ssrc=\"([^\"]+)\""
        return [(number, markdown or html) for number, line in self.prose
                for markdown, html in re.findall(pattern, re.sub(r"`[^`]*`", "", line))]

    def anchors(self):
        """Returns the anchors of the headings, as web views of repositories generate them."""
        headings = [re.match(r"#+\s+(.*?)\s*#*$", line) for _, line in self.prose]
        return {re.sub(r"[^\w\- ]", "", heading.group(1)).lower().replace(" ", "-")
                for heading in headings if heading}
