"""What a Markdown document holds: fenced blocks, command lines, code in its sentences, links.

Blocks fenced as ```console hold `$ COMMAND` lines, each followed by its output, standard output and
error together. Words after `console` say when the block is run; a colon and a reason may follow:

  console                      always
  console data                 where GRASPMAP_DATA names the real data
  console long: REASON         where GRASPMAP_LONG_DOCS is set
  console elsewhere: REASON    never here; its command lines are still checked against --help
"""

import os
import pathlib
import re

FENCE = re.compile(r"\s*(```+|~~~+)\s*(.*)$")


class Transcript:
    """A command line of a block, and what the document says that it prints."""

    def __init__(self, number, command):
        self.number = number
        self.command = command
        self.first_output = number + 1
        self.output = []


class Block:
    """A fenced block: its line number, the fence's language, its conditions, reason and lines."""

    def __init__(self, number, info):
        words, _, reason = info.partition(":")
        words = words.split()
        self.number = number
        self.language = words[0] if words else ""
        self.conditions = words[1:]
        self.reason = reason.strip()
        self.lines = []

    def skipped(self):
        """Why the block is not run here, or nothing."""
        if "elsewhere" in self.conditions:
            return self.reason
        if "data" in self.conditions and not os.environ.get("GRASPMAP_DATA"):
            return "GRASPMAP_DATA names no data"
        if "long" in self.conditions and not os.environ.get("GRASPMAP_LONG_DOCS"):
            return "GRASPMAP_LONG_DOCS is not set"
        return ""

    def transcripts(self):
        """Each command of a console block."""
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
    """A document's blocks, and its other lines as (line number, text)."""

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
        """Its console blocks."""
        return [block for block in self.blocks if block.language == "console"]

    def code_spans(self):
        """(line number, line, code) of each `code` in its sentences and tables."""
        return [(number, line, code.strip().replace("\\|", "|")) for number, line in self.prose
                for code in re.findall(r"`([^`]+)`", line)]

    def links(self):
        """(line number, target) of each link and picture."""
        pattern = r"\]\(([^()\s]+(?:\([^()\s]*\))?)\)|<img[^>]*\ssrc=\"([^\"]+)\""
        return [(number, markdown or html) for number, line in self.prose
                for markdown, html in re.findall(pattern, re.sub(r"`[^`]*`", "", line))]

    def anchors(self):
        """The names of its headings, as web views of repositories make them."""
        headings = [re.match(r"#+\s+(.*?)\s*#*$", line) for _, line in self.prose]
        return {re.sub(r"[^\w\- ]", "", heading.group(1)).lower().replace(" ", "-")
                for heading in headings if heading}
