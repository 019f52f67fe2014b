"""What the benchmarks of whole commands share: figures of a run, and tables in a page."""

import os
import subprocess
import sys
import time


def measure(words, folder=None):
    """(wall s, processor s, peak resident MiB) of a command; ends if it fails."""
    start = time.monotonic()
    process = subprocess.Popen(words, cwd=folder)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - start
    if process.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: ended with {process.returncode}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def put_into_page(page, name, text):
    """Puts the text between the marks of the benchmark `scripts/bench NAME`."""
    begin = f"<!-- {name}: written by scripts/bench {name} -->"
    end = f"<!-- end of {name} -->"
    content = page.read_text(encoding="utf-8")
    if begin not in content or end not in content:
        sys.exit(f"{page}: the marks of this table are not there: {begin} ... {end}")
    before, rest = content.split(begin, 1)
    page.write_text(before + begin + "\n\n" + text + "\n\n" + end + rest.split(end, 1)[1],
                    encoding="utf-8")
