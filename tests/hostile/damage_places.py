"""Paths that are not files or not readable, for every kind of input."""
import os

EXTENSIONS = {
    "cloud": ".pcd", "map": ".pcd", "mesh": ".ply", "scan": ".db", "poses": ".tum", "tiles": ".tiles",
    "bag": ".bag", "points": ".csv", "lookup": ".csv", "gripper": ".yaml", "dem": ".tif", "scenario": ".yaml", "picture": ".png",
    "transform": ".txt", "rig-folder": "", "run-folder": "",
}


def make(corpus):
    """Adds the paths without root privileges. Root runs "not readable" as nobody."""
    for kind, extension in EXTENSIONS.items():
        folder = kind in ("tiles", "rig-folder", "run-folder")
        path = lambda name, refused=True: corpus.path(kind, name, extension, refused)
        path("no such file")
        path("a folder").mkdir()
        path("a device").symlink_to("/dev/zero")
        path("a full device").symlink_to("/dev/full")
        path("nothing").symlink_to("/dev/null")
        os.mkfifo(path("a pipe"))
        place = path("a link to itself")
        place.symlink_to(place.name)
        place = path("links in a circle")
        place.symlink_to("other")
        place.with_name("other").symlink_to(place.name)
        path("a link to nothing").symlink_to("nowhere")
        place = path("beneath a file")
        place.write_text("text")
        corpus.cases[-1].path = place / place.name
        corpus.path(kind, "a name too long", extension, True)
        corpus.cases[-1].path = corpus.cases[-1].path.with_name("broken" + "x" * 300 + extension)
        place = path("not readable")
        place.mkdir() if folder else place.write_text("text\n")
        place.chmod(0)
        # procfs file of size 0; reading fails.
        path("a file of the kernel").symlink_to("/proc/self/mem")
    corpus.add("cloud", "size of a sparse file", ".pcd", b"# .PCD v0.7\nVERSION 0.7\n", True)
    os.truncate(corpus.cases[-1].path, 1 << 40)
    for kind, extension in (("scan", ".db"), ("mesh", ".stl"), ("mesh", ".glb"), ("mesh", ".obj"), ("cloud", ".ply"),
                            ("cloud", ".csv"), ("bag", ".bag"), ("poses", ".g2o"), ("gripper", ".yaml"), ("dem", ".tif"),
                            ("picture", ".png"), ("points", ".csv")):
        corpus.add(kind, f"{extension[1:]} of a tebibyte of zeros", extension, b"", True)
        os.truncate(corpus.cases[-1].path, 1 << 40)
