"""Corpus of broken inputs, and damage that applies to any format."""
import hashlib
import os
import pathlib
import random
import shutil
from dataclasses import dataclass


@dataclass
class Case:
    kind: str      # claimed kind: the key of commands.ACCEPTS
    name: str      # name of the fault
    path: pathlib.Path
    refused: bool  # contains nothing valid: exit code 0 is an error

    @property
    def title(self):
        return f"{self.kind}/{self.name}"


class Corpus:
    """Folder with one subfolder per case, which contains "broken" + the extension of the format."""

    def __init__(self, folder, good, seed):
        self.folder = pathlib.Path(folder)
        self.good = pathlib.Path(good)
        self.seed = seed
        self.cases = []

    def random(self, *words):
        """Returns the random generator of a case, so that a new case changes no other case."""
        return random.Random("/".join([str(self.seed), *words]))

    def path(self, kind, name, extension, refused=False):
        """Adds a case and returns its path."""
        folder = self.folder / f"{kind}.{name}"
        folder.mkdir(parents=True)
        case = Case(kind, name, folder / ("broken" + extension), refused and kind not in self.PATIENT)
        self.cases.append(case)
        return case.path

    # Kinds in which one broken file is skipped, or an empty file is valid.
    PATIENT = ("board", "scenario")

    def add(self, kind, name, extension, content, refused=False):
        """Adds a case of one file. True: it contains nothing valid."""
        if isinstance(content, str):
            content = content.encode()
        self.path(kind, name, extension, refused).write_bytes(content)

    def copy(self, kind, name, source, extension="", refused=False):
        """Adds a case as a copy of a good folder or file."""
        path = self.path(kind, name, extension, refused)
        source = self.good / source
        if source.is_dir():
            shutil.copytree(source, path, ignore=shutil.ignore_patterns("progress"))
        else:
            shutil.copy(source, path)
        return path

    def digest(self):
        """Returns the SHA-256 of all file names and contents."""
        total = hashlib.sha256()
        for root, folders, files in os.walk(self.folder):
            folders.sort()
            for name in sorted(files):
                path = pathlib.Path(root, name)
                total.update(str(path.relative_to(self.folder)).encode() + b"\0")
                if path.is_file() and not path.is_symlink() and os.access(path, os.R_OK):
                    with open(path, "rb") as file:
                        total.update(file.read(1 << 24))
        return total.hexdigest()


def damaged_bytes(data, draw):
    """Returns (name, bytes, True if it must be rejected) of damage that applies to any file."""
    size = len(data)
    at = draw.randrange(size // 4, size)
    flipped = bytearray(data)
    for _ in range(max(8, size // 500)):
        flipped[draw.randrange(size)] ^= 1 << draw.randrange(8)
    early = bytearray(data)
    for _ in range(3):
        early[draw.randrange(min(size, 120))] ^= 1 << draw.randrange(8)
    torn = bytearray(data)
    torn[at // 2:at // 2 + 64] = bytes(len(torn[at // 2:at // 2 + 64]))
    return [
        ("empty", b"", True),
        ("one byte", data[:1], True),
        ("cut early", data[:draw.randrange(2, min(60, size))], False),
        ("cut", data[:at], False),
        ("cut by one byte", data[:-1], False),
        ("bits flipped", bytes(flipped), False),
        ("bits flipped early", bytes(early), False),
        ("zeros inside", bytes(torn), False),
        ("bytes put in", data[:at] + draw.randbytes(17) + data[at:], False),
        ("bytes left out", data[:at // 3] + data[at // 3 + 5:], False),
        ("twice", data + data, False),
        ("zeros", bytes(300), True),
        ("noise", draw.randbytes(700), True),
        ("0xff", b"\xff" * 300, True),
    ]


def damage_file(corpus, kind, source, label, extension=None, leave_out=()):
    """Adds all general damage of one good file."""
    extension = extension or pathlib.Path(source).suffix
    data = (corpus.good / source).read_bytes()
    for name, content, refused in damaged_bytes(data, corpus.random(kind, label)):
        if name not in leave_out:
            corpus.add(kind, f"{label} {name}", extension, content, refused)


def damage_text(corpus, kind, source, label, extension=None):
    """Adds damage that applies to text files."""
    extension = extension or pathlib.Path(source).suffix
    text = (corpus.good / source).read_text()
    add = lambda name, content, refused=False: corpus.add(kind, f"{label} {name}", extension, content, refused)
    add("UTF-16", b"\xff\xfe" + text.encode("utf-16-le"))
    add("UTF-8 BOM", b"\xef\xbb\xbf" + text.encode())
    add("CRLF", text.replace("\n", "\r\n"))
    add("CR", text.replace("\n", "\r"))
    add("NUL bytes", text.replace(" ", "\0").replace(",", "\0,"))
    add("long line", text + "x" * 3_000_000)
    add("escape codes", text.replace("0", "\x1b[31m0\x1b[0m"))
    add("Latin-1", text.encode() + b"\xe4\xf6\xfc\n")
