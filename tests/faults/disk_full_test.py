#!/usr/bin/python3
"""Runs every command that writes files on a full disk.

disk_full_test.py GRASPMAP SOURCE_FOLDER

Each command runs three times on a small disk (a tmpfs in a mount namespace): with enough space, with no
free space, and with half the space of its outputs. The second and third run must
 - exit with 1 and print one line that names a file and reports that the disk is full (the third run may
   instead write all outputs, if the space suffices);
 - leave every earlier file unchanged and write no other file.
Commands that write to standard output must fail in the same way on /dev/full. Exits with 77 if no disk
can be mounted. Runs each command once or twice, or with FULL=1 each use of it in
tests/hostile/commands.py. ONLY selects the commands that contain this text.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "hostile"))
import commands
import good_inputs

SKIPPED = 77
PAGE = 4096
REASON = re.compile(r"No space left on device|database or disk is full|[Dd]isk full")
MORE = [
    "convert {good}/terrain.pcd -o out.ply",
    "convert {good}/terrain.pcd -o out.pcd --encoding ascii",
    "convert {good}/mesh.ply -o out.stl",
    "convert {good}/mesh.ply -o out.off",
    "convert {good}/mesh.ply -o out.ply --encoding ascii",
    "convert {good}/mesh.ply -o out.vtp",
    "convert {good}/poses.tum -o out.tum",
    "simulate scan {good}/mesh.ply --camera {good}/camera.yaml --frames 5 --depth-format float -o out.db",
    "refine {good}/scan.db --feature-cache off --report out.json -o out.colmap",
    "refine {good}/scan.db --report out.txt -o out.g2o",
    "texture {good}/mesh.ply --scan {good}/scan.db --frame ground-truth --texture-size 256 -o out.obj",
    "texture {good}/mesh.ply --scan {good}/scan.db --frame ground-truth --texture-size 256 -o out.glb",
    "analyze {good}/map.pcd {good}/map.pcd -o out",
    "compare {good}/terrain.pcd {good}/mesh.ply --image out.png",
    "calibrate {good}/pictures --report out -o out.yaml",
    "mask --sections -o out.png",
    "mask -o out.pcd",
    "convert {good}/map.tiles -o out.csv",
    "analyze {good}/map.pcd -o out",
    "convert {good}/map.bag --topic /merged_pcd -o out.csv",
    "convert {good}/rig -o out.bag",
]
PRINTING = [
    "info {good}/scan.db",
    "info {good}/map.pcd --json",
    "compare {good}/terrain.pcd {good}/mesh.ply",
    "mesh {good}/terrain.pcd --cell-size 0.05 --report -o out.ply",
    "compare --edges {good}/mesh.ply",
    "info {good}/rig.bag",
    "score --print-config",
    "score --help",
    "simulate --help",
    "--help",
    "--version",
]
# Outputs that contain the run time and therefore differ between runs.
WITH_TIMES = (".json", ".txt", ".html")


def mounted_disks():
    """Returns True if this process is in a separate mount namespace and may mount."""
    return os.environ.get("GRASPMAP_TEST_MOUNTS") == "1"


def enter_namespace():
    probe = ["sh", "-c", "mount -t tmpfs -o size=64k none /mnt"]
    # The first command needs user namespaces, the second root.
    for line in (["unshare", "--mount", "--map-root-user"], ["unshare", "--mount"]):
        if shutil.which("unshare") and subprocess.run(line + probe, capture_output=True, check=False).returncode == 0:
            os.environ["GRASPMAP_TEST_MOUNTS"] = "1"
            os.execvp("unshare", line + [sys.executable] + sys.argv)
    print("skipped: no disk can be mounted here (unshare --mount)")
    sys.exit(SKIPPED)


def snapshot(folder):
    found = {}
    for root, folders, files in os.walk(folder):
        for name in folders:
            found[os.path.relpath(os.path.join(root, name), folder)] = None
        for name in files:
            path = pathlib.Path(root, name)
            found[os.path.relpath(path, folder)] = path.read_bytes()
    return found


def differences(before, after):
    for name in sorted(before.keys() | after.keys()):
        if name not in after:
            yield f"{name} is gone"
        elif name not in before:
            yield f"{name} was not there before"
        elif before[name] != after[name] and not name.endswith(WITH_TIMES):
            yield f"{name} has changed"
        elif before[name] and not after[name]:
            yield f"{name} is empty"


class Disk:
    def __init__(self, place):
        self.place = place
        place.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "none", str(place)], check=True)
        self.folder = place / "run"

    def empty(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()

    def leave(self, free):
        """Fills the disk up to `free` bytes with a file outside of the folder."""
        filler = self.place / "filler"
        filler.unlink(missing_ok=True)
        left = os.statvfs(self.place)
        bytes_left = left.f_bavail * left.f_frsize - free
        with open(filler, "wb") as file:
            os.posix_fallocate(file.fileno(), 0, max(bytes_left, 1))

    def make_room(self):
        (self.place / "filler").unlink(missing_ok=True)


class Test:
    def __init__(self, graspmap, scratch):
        self.graspmap, self.scratch = graspmap, scratch
        self.good = scratch / "good"
        self.disk = Disk(scratch / "disk")
        self.failures = []
        self.runs = 0
        self.refused = 0

    def run(self, line, **how):
        words = line.replace("{good}", str(self.good)).split()
        self.runs += 1
        return subprocess.run([self.graspmap] + words, cwd=self.disk.folder, stdin=subprocess.DEVNULL, text=True,
                              stderr=subprocess.PIPE, check=False, **{"stdout": subprocess.DEVNULL, **how})

    def expect(self, holds, line, what, run):
        if not holds:
            self.failures.append(f"{line}: {what}")
            print(f"{line}: {what}\n    exit code {run.returncode}: {run.stderr!r}", flush=True)

    def expect_clear_error(self, line, run):
        errors = [one for one in run.stderr.splitlines() if ": error: " in one]
        self.expect(run.returncode == 1, line, "not exit code 1", run)
        self.expect(len(errors) == 1 and run.stderr.rstrip("\n").endswith(errors[0]), line, "not one line of error", run)
        self.expect(len(errors) == 1 and REASON.search(errors[0]), line, "does not say that the disk is full", run)
        named = re.search(r": error: (\S+|standard output): ", errors[0] if errors else "")
        self.expect(named and ".partial" not in run.stderr, line, "names no file, or one that is gone", run)

    def writing(self, line):
        self.disk.make_room()
        self.disk.empty()
        first = self.run(line)
        if first.returncode == 3 and line not in MORE:
            return False  # the command fails on the good inputs
        if first.returncode != 0:
            self.expect(False, line, "fails on a disk with room", first)
            return False
        before = snapshot(self.disk.folder)
        size = sum(-(-len(content) // PAGE) * PAGE for content in before.values() if content is not None)
        for free in (0, size // 2 // PAGE * PAGE):
            self.disk.leave(free)
            title = f"{line} ({free} bytes left)"
            run = self.run(line)
            # A complete store has nothing to write.
            if (free == 0 and "out.tiles" not in line) or run.returncode != 0:
                self.refused += 1
                self.expect_clear_error(title, run)
            if "--force" in line and "out.tiles" in line:
                continue  # a restarted store is emptied first, since the disk may hold only one
            after = snapshot(self.disk.folder)
            for difference in differences(before, after):
                self.expect(False, title, difference, run)
        return True

    def new(self, line):
        """Checks a run without earlier outputs: it leaves no file."""
        self.disk.make_room()
        self.disk.empty()
        self.disk.leave(0)
        run = self.run(line)
        self.expect_clear_error(line + " (new)", run)
        # A tile store can be resumed.
        left = [name for name in snapshot(self.disk.folder) if not re.match(r"out\.(tiles|txt\.features|g2o\.features)", name)]
        self.expect(not left, line + " (new)", f"leaves {left}", run)

    def printing(self, line):
        self.disk.make_room()
        self.disk.empty()
        with open("/dev/full", "w", encoding="ascii") as full:
            run = self.run(line, stdout=full)
        self.expect_clear_error(line + " > /dev/full", run)
        self.expect("standard output: cannot be written" in run.stderr, line, "names not standard output", run)


def main():
    if not mounted_disks():
        enter_namespace()
    graspmap, source = sys.argv[1], pathlib.Path(sys.argv[2])
    only = os.environ.get("ONLY", "")
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="disk_full_"))
    try:
        test = Test(graspmap, scratch)
        good_inputs.make(test.good, graspmap, source)
        lines = []
        for one in commands.USES:
            line = " ".join(one.words).replace("{x}", "{good}/" + one.example)
            if " out" in line and line not in lines and (one.main or "FULL" in os.environ):
                lines.append(line)
        for line in [one for one in lines + MORE if only in one]:
            if test.writing(line):
                test.new(line)
        for line in [one for one in PRINTING if only in one]:
            test.printing(line)
        subprocess.run(["umount", str(test.disk.place)], check=False)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    if test.failures:
        print(f"FAILED: {len(test.failures)} findings in {test.runs} runs")
        sys.exit(1)
    print(f"passed: {test.runs} runs, {test.refused} on a full disk")


main()
