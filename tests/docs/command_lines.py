"""Checks command lines of graspmap and of the pipelines against `--help` and the make files."""

import pathlib
import re
import shlex
import subprocess

SEPARATORS = {"|", "||", "&&", ";", "&", ">", ">>", "<", "2>", "2>&1", "do", "then", "done", "fi"}
OPTION_LINE = re.compile(r"  (-\w,)?(--[\w-]+)((?:,--[\w-]+)*)(?:\{\w+\})?(?: ([^\s=]+))?")
PLACEHOLDER = re.compile(r"[A-Z]|[$|*<]|\.\.")


def words_of(line):
    """Splits a line into words approximately as a shell does. Separators are separate words."""
    try:
        words = shlex.split(line, comments=True)
    except ValueError:
        words = line.split()
    found = []
    for word in words:
        word = re.sub(r"^[$]?\(+", "", word)
        bare = re.sub(r"[;)]+$", "", word)
        found.append(bare)
        if bare != word:
            found.append(";")
    return found


class Program:
    """Commands of a built graspmap with their options, from --help."""

    def __init__(self, executable):
        self.executable = str(executable)
        self.commands = re.findall(r"^  ([a-z][\w-]*)  ", self._help("--help"), re.MULTILINE)
        self.kinds = {name: self._names("WHAT:", name, "--help") for name in self.commands}
        self._options = {}

    def _help(self, *words):
        return subprocess.run([self.executable, *words], text=True, capture_output=True,
                              check=True).stdout

    def _names(self, title, *words):
        _, _, rest = self._help(*words).partition(f"\n{title}\n")
        return re.findall(r"^  ([a-z][\w-]*)  ", rest.partition("\n\n")[0], re.MULTILINE)

    def options(self, command):
        """Returns {option: choices} of `score`, `simulate scan`, ...; an empty list allows any value."""
        if command not in self._options:
            found = {}
            for line in self._help(*command.split(), "--help").splitlines():
                match = OPTION_LINE.match(line)
                if not match:
                    continue
                choices = (match.group(4) or "").split("|")
                usable = len(choices) > 1 and not re.search("[A-Z]", match.group(4))
                names = [match.group(2)] + match.group(3).split(",")[1:]
                for name in names + ([match.group(1)[:-1]] if match.group(1) else []):
                    found[name] = choices if usable else []
            self._options[command] = found
        return self._options[command]

    def all_options(self):
        """Returns the options of all commands."""
        return set().union({"--help", "--version"}, *(
            self.options(f"{name} {kind}".strip())
            for name in self.commands for kind in self.kinds[name] or [""]))

    def command_of(self, words):
        """Returns the command of words, for example `score` of ["score", "TERRAIN"], or an empty text."""
        if not words or words[0] not in self.commands:
            return ""
        kinds = self.kinds[words[0]]
        if not kinds:
            return words[0]
        return f"{words[0]} {words[1]}" if len(words) > 1 and words[1] in kinds else ""

    def faults(self, words):
        """Returns the faults of the words between `graspmap` and the next command."""
        if not words or words[0] in SEPARATORS or words[0] in ("--help", "--version"):
            return []
        if PLACEHOLDER.search(words[0]):
            return []
        if words[0] not in self.commands:
            return [f"graspmap has no command {words[0]}"]
        command = self.command_of(words)
        if not command:
            known = len(words) < 2 or words[1].startswith("-") or PLACEHOLDER.search(words[1])
            return [] if known else [f"{words[0]} has no {words[1]}"]
        return self.option_faults(command, words[len(command.split()):])

    def option_faults(self, command, words):
        """Returns the faults of the options among a command's words."""
        options = self.options(command)
        found = []
        for place, word in enumerate(words):
            if word in SEPARATORS:
                break
            option, _, value = word.partition("=")
            if not re.fullmatch(r"--[a-z][\w-]*|-[a-z]", option):
                continue
            if option not in options:
                found.append(f"{command} has no option {option}")
            elif options[option]:
                value = value or (words[place + 1] if place + 1 < len(words) else "")
                if value and not PLACEHOLDER.search(value) and value not in options[option]:
                    found.append(f"{command} {option} takes {'|'.join(options[option])}, "
                                 f"not {value}")
        return found


def make_faults(words, source):
    """Returns the faults of the words of a `make -f FILE VARIABLE=...`."""
    if "-f" not in words[:-1]:
        return []
    name = words[words.index("-f") + 1].removeprefix("/usr/share/graspmap/")
    if PLACEHOLDER.search(name):
        return []
    if not (source / name).is_file():
        return [f"there is no {name}"]
    texts = {}
    waiting = [source / name]
    while waiting:
        path = waiting.pop()
        if path in texts or not path.is_file():
            continue
        texts[path] = path.read_text(encoding="utf-8")
        waiting += [path.parent / other for other in re.findall(r"[\w/]+\.mk", texts[path])]
        waiting += [source / "pipelines" / other for other in re.findall(r"\w+\.mk", texts[path])]
    found = []
    for word in words:
        if word in SEPARATORS:
            break
        match = re.match(r"([A-Z_]+)=", word)
        if match and not any(re.search(rf"\b{match.group(1)}\b", text) for text in texts.values()):
            found.append(f"{name} has no variable {match.group(1)}")
    return found


def line_faults(line, program, source):
    """Returns the faults of a command line: commands, options, choices, make files, scripts."""
    words = words_of(line)
    found = []
    for place, word in enumerate(words):
        rest = words[place + 1:]
        if word == "graspmap" or word.endswith("/graspmap"):
            found += program.faults(rest)
        elif word == "make":
            found += make_faults(rest, source)
        elif re.fullmatch(r"scripts/[\w-]+", word) and not (pathlib.Path(source) / word).is_file():
            found.append(f"there is no {word}")
    return found
