#!/usr/bin/python3
"""Every command on every broken input.

hostile_test.py GRASPMAP SOURCE_FOLDER [SANITIZED]

Makes small good inputs with graspmap, breaks them in every way of damage_*.py (seeded: the same bytes
each time) and gives them to the commands that take such a file. Each run must end
 - with exit code 0, 1 or 3 (2 too with a file of another kind), within 10 s of processor time and 500 MB of memory;
 - after a failure, with one line on stderr, after warnings, that names the file and the reason, and
   with an earlier output as it was, to the inode;
 - with no file beside the outputs or the inputs that was not there before.
Without FULL: each file in its commonest places and a sample of the rest. FULL=1: each file in each
place that fits its kind, and a sample of files of other kinds in every place. JOBS: how many at a time;
SEED: of damage and samples; ONLY: a part of a title to run alone; KEEP=FOLDER: to work in and leave.
"""
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import commands
import corpus
import damage_geometry
import damage_places
import damage_scans
import damage_texts
import good_inputs

CPU_S = 10
NOBODY = 65534
WALL_S = 90  # limit on a loaded machine
MEMORY_MB = 500
ADDRESS_SPACE = 12 << 30
FILE_SIZE = 1 << 30
SAMPLE = 60      # number of runs sampled from those that the short run omits
FOREIGN = 12     # files of other kinds per use

# Messages of libraries or of the C++ runtime do not explain an error to a user.
RAW = re.compile(r"bad_alloc|basic_string|vector::|map::at|_M_|stoi|stod|bad_\w+_access|std::|Eigen|json\.exception|"
                 r"yaml-cpp|boost|assert|\[pcl|vtk[A-Z]|cv::|OpenCV\(|SQLITE_|filesystem error|Success$")


class Findings:
    def __init__(self):
        self.lock = threading.Lock()
        self.lines = []
        self.runs = 0
        self.codes = {}
        self.peak_mb = 0
        self.peak_s = 0.0

    def note(self, code, megabytes, seconds, problems, title, text):
        with self.lock:
            self.runs += 1
            self.codes[code] = self.codes.get(code, 0) + 1
            self.peak_mb = max(self.peak_mb, megabytes)
            self.peak_s = max(self.peak_s, seconds)
            for problem in problems:
                self.lines.append(f"{problem}: {title}")
                print(f"{problem}: {title}\n    exit code {code}, {megabytes} MB, {seconds:.1f} s: {text[-600:]!r}", flush=True)


def snapshot(folder):
    """Returns the files with inode and time, which change if a file is rewritten."""
    found = {}
    for root, folders, files in os.walk(folder):
        for name in folders + files:
            path = os.path.join(root, name)
            state = os.lstat(path)
            found[os.path.relpath(path, folder)] = (
                None if name in folders else (state.st_ino, state.st_size, state.st_mtime_ns))
    return found


class Place:
    """Folder of a use with earlier good outputs, recreated if a run changed it."""

    def __init__(self, use, template, folder):
        self.use, self.template, self.folder = use, template, folder
        self.renew()

    def renew(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(self.template, self.folder)
        if os.geteuid() == 0:  # some runs have the user nobody
            for root, _, files in os.walk(self.folder):
                for name in [root] + [os.path.join(root, file) for file in files]:
                    os.chown(name, NOBODY, NOBODY)
        self.before = snapshot(self.folder)


def run(words, folder, as_nobody, sanitized):
    """Returns (exit code, or 128 + number of the signal, stdout, stderr, MB, processor seconds)."""
    prefix = [] if sanitized else ["/usr/bin/prlimit", f"--as={ADDRESS_SPACE}", f"--fsize={FILE_SIZE}", f"--cpu={4 * CPU_S}"]
    if as_nobody:
        prefix = ["/usr/bin/setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"] + prefix
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(prefix + words, cwd=folder, stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                   start_new_session=True)
        hung = threading.Timer(WALL_S, lambda: os.killpg(process.pid, signal.SIGKILL))
        hung.start()
        _, status, usage = os.wait4(process.pid, 0)
        hung.cancel()
        process.returncode = 0
        code = 128 + os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read(1 << 20))
        return code, texts[0], texts[1], usage.ru_maxrss // 1024, usage.ru_utime + usage.ru_stime


def problems_of_text(code, stderr, names):
    """Returns the faults of the output of a run; `names` are those of its inputs."""
    found = []
    try:
        text = stderr.decode()
    except UnicodeDecodeError:
        return ["stderr is no UTF-8"]
    if re.search(r"[\x00-\x09\x0b-\x1f\x7f]", text):
        found.append("control characters on stderr")
    lines = text.splitlines()
    said = re.compile(r"graspmap [a-z -]+: (info|warning): ")
    errors = [line for line in lines if re.match(r"graspmap [a-z -]+: error: .", line)]
    if any(not said.match(line) for line in lines if line not in errors):
        found.append("a stray line on stderr")
    if code == 0:
        return found + (["errors in spite of exit code 0"] if errors else [])
    if len(errors) != 1 or lines[-1] != errors[0]:
        return found + ["not one error line at the end"]
    if not any(name in errors[0] for name in names):
        found.append("the file is not named")
    if RAW.search(errors[0].rsplit("/broken", 1)[-1]):
        found.append("a raw reason")
    if len(errors[0]) > 1500:
        found.append("an endless line")
    return found


def check(graspmap, good, case, place, findings, sanitized):
    use = place.use
    words = [word.replace("{x}", str(case.path)).replace("{good}", str(good)) for word in use.words]
    inputs = snapshot(case.path.parent) if case.path.parent.is_dir() else {}
    as_nobody = case.name == "not readable" and os.geteuid() == 0
    code, stdout, stderr, megabytes, seconds = run([graspmap] + words, place.folder, as_nobody, sanitized)
    # The error must name the broken file or one beside it, a file that it names or contradicts, or the
    # flag or the output that does not accept it.
    names = [str(case.path.parent), str(good), "/dev/zero", "/etc/passwd"]
    names += [word for word in words if word.startswith("--")]
    if not fits(case, use):
        names += [word for word in words if word.startswith("out")]
    found = problems_of_text(code, stderr, names)
    # A file of another kind may select another usage of the command, with other arguments.
    if code not in ((0, 1, 3) if fits(case, use) else (0, 1, 2, 3)):
        found.append("a crash" if code > 127 else f"exit code {code}")
    # info describes files that other commands reject. It reads bags as completely as they do.
    lenient = use.words[0] == "info" and use.kinds != ("bag",)
    if code == 0 and case.refused and use.main and fits(case, use) and not lenient:
        found.append("not refused")
    if not sanitized and seconds > CPU_S:
        found.append("too slow")
    if not sanitized and megabytes > MEMORY_MB:
        found.append("too much memory")
    after = snapshot(place.folder)
    changed = after != place.before
    if code != 0 and changed:
        found.append("an earlier output was touched by a failed run")
    if any(name.rsplit("/", 1)[-1].startswith(".") or ".partial" in name for name in after if name not in place.before):
        found.append("a temporary file was left")
    if case.path.parent.is_dir() and snapshot(case.path.parent) != inputs:
        found.append("the inputs' folder was changed")
    if changed or found:
        place.renew()
    text = stderr.decode(errors="replace")
    findings.note(code, megabytes, seconds, found, f"{case.title} | {use.name}", text)
    if os.environ.get("LOG"):
        with findings.lock, open(os.environ["LOG"], "a") as log:
            log.write(f"{code}\t{megabytes}\t{seconds:.2f}\t{case.title}\t{use.name}\t{text[-900:]!r}\n")


def make_corpus(folder, good, seed):
    """Returns (cases, digest)."""
    broken = corpus.Corpus(folder, good, seed)
    for part in (damage_geometry, damage_scans, damage_texts, damage_places):
        part.make(broken)
    return broken.cases, broken.digest()


def apart(work, *arguments):
    """Creates the corpus in a separate process, whose memory would count for programs started later."""
    with ProcessPoolExecutor(1) as process:
        return process.submit(work, *arguments).result()


def fits(case, use):
    return case.kind in use.kinds


def planned(cases, seed, full):
    """Returns (case, use) pairs."""
    draw = random.Random(f"{seed}/runs")
    common, rest = [], []
    for case in cases:
        for use in commands.USES:
            if fits(case, use):
                (common if use.main else rest).append((case, use))
    foreign = [(case, use) for use in commands.USES
               for case in draw.sample([case for case in cases if not fits(case, use)], FOREIGN)]
    if full:
        return common + rest + foreign
    first = {}
    for case, use in common:
        first.setdefault(id(case), []).append((case, use))
    short = [draw.choice(pairs) for pairs in first.values()]
    without = [pair for pair in rest if id(pair[0]) not in first]
    others = [pair for pair in common + rest + foreign if pair not in short]
    return short + draw.sample(without, min(len(without), 30)) + draw.sample(others, SAMPLE)


def templates(graspmap, good, folder, jobs):
    """Writes the outputs of each use for a good input."""
    def make(number):
        use, place = commands.USES[number], folder / str(number)
        place.mkdir(parents=True)
        words = [word.replace("{x}", str(good / use.example)).replace("{good}", str(good)) for word in use.words]
        done = subprocess.run([graspmap] + words, cwd=place, capture_output=True, text=True, check=False)
        return "" if done.returncode == 0 else f"of a good input: graspmap {' '.join(words)}: {done.stderr}"

    with ThreadPoolExecutor(jobs) as pool:
        failed = "".join(pool.map(make, range(len(commands.USES))))
    if failed:
        raise SystemExit(failed)
    return {use.name: folder / str(number) for number, use in enumerate(commands.USES)}


def main():
    graspmap, source = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
    sanitized = len(sys.argv) > 3 and bool(sys.argv[3])
    seed, full, only = os.environ.get("SEED", "1"), bool(os.environ.get("FULL")), os.environ.get("ONLY", "")
    jobs = int(os.environ.get("JOBS", os.cpu_count() or 1))
    keep = os.environ.get("KEEP")
    scratch = pathlib.Path(keep or tempfile.mkdtemp(prefix="graspmap_hostile_"))
    scratch.mkdir(exist_ok=True)
    scratch.chmod(0o755)
    began = time.monotonic()
    try:
        good = scratch / "good"
        if not good.exists():
            good_inputs.make(good, graspmap, source)
        shutil.rmtree(scratch / "corpus", ignore_errors=True)
        cases, digest = apart(make_corpus, scratch / "corpus", good, seed)
        if not full and not only and not keep:
            if apart(make_corpus, scratch / "again", good, seed)[1] != digest:
                raise SystemExit("the same seed makes other files")
            shutil.rmtree(scratch / "again")
        shutil.rmtree(scratch / "earlier", ignore_errors=True)
        earlier = templates(graspmap, good, scratch / "earlier", jobs)
        pairs = [pair for pair in planned(cases, seed, full or only)
                 if only in f"{pair[0].title} | {pair[1].name}"]
        findings = Findings()
        by_use = {}
        for case, use in pairs:
            by_use.setdefault(use.name, []).append((case, use))
        shutil.rmtree(scratch / "work", ignore_errors=True)

        # One run at a time per folder; long lists use several folders.
        def work(number, some):
            place = Place(some[0][1], earlier[some[0][1].name], scratch / "work" / str(number))
            for case, _ in some:
                check(graspmap, good, case, place, findings, sanitized)

        chunks = [some[at:at + 25] for some in by_use.values() for at in range(0, len(some), 25)]
        random.Random(seed).shuffle(chunks)
        with ThreadPoolExecutor(jobs) as pool:
            for done in [pool.submit(work, number, some) for number, some in enumerate(chunks)]:
                done.result()
        print(f"{len(cases)} broken inputs, {len(commands.USES)} places, {findings.runs} runs in "
              f"{time.monotonic() - began:.0f} s; exit codes {dict(sorted(findings.codes.items()))}; at most "
              f"{findings.peak_mb} MB and {findings.peak_s:.1f} s of processor time; {len(findings.lines)} findings")
        return 1 if findings.lines else 0
    finally:
        if not keep:
            shutil.rmtree(scratch, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
