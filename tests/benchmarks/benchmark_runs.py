"""Code shared by the benchmarks of commands: metrics of a run, and tables in a page."""

import argparse
import os
import pathlib
import subprocess
import sys
import time


def measure(words, folder=None):
    """Returns (wall s, processor s, peak resident MiB) of a command; exits if it fails."""
    start = time.monotonic()
    process = subprocess.Popen(words, cwd=folder)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - start
    if process.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: ended with {process.returncode}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def scan_options(description, seeds):
    """Parses the command line of the benchmarks that simulate and refine scans."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", default=seeds)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--page", type=pathlib.Path)
    options = parser.parse_args()
    options.graspmap = (options.build / "graspmap").resolve()
    options.seeds = list(map(int, options.seeds.split(",")))
    options.folder.mkdir(parents=True, exist_ok=True)
    return options


def put_into_page(page, name, text):
    """Replaces the text between the marks of the benchmark `scripts/bench NAME` in a page."""
    begin = f"<!-- {name}: written by scripts/bench {name} -->"
    end = f"<!-- end of {name} -->"
    content = page.read_text(encoding="utf-8")
    if begin not in content or end not in content:
        sys.exit(f"{page}: the marks of this table are not there: {begin} ... {end}")
    before, rest = content.split(begin, 1)
    page.write_text(before + begin + "\n\n" + text + "\n\n" + end + rest.split(end, 1)[1],
                    encoding="utf-8")
