"""Poses, tables, YAML, tile stores and report folders, broken field by field."""
import hashlib
import json
import shutil

from corpus import damage_file, damage_text, damaged_bytes
from damage_scans import in_folder

YAML = {"gripper": "gripper.yaml", "scenario": "scenario.yaml", "rig": "rig.yaml", "camera": "camera.yaml",
        "site": "site.yaml", "scene": "scene.yaml"}


def yaml(corpus):
    aliases = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 10))
    merged = "m0: &m0 {x: 1}\n" + "".join(f"m{n}: &m{n}\n  <<: [*m{n - 1}, *m{n - 1}]\n" for n in range(1, 25))
    for kind, source in YAML.items():
        text = (corpus.good / source).read_text()
        damage_file(corpus, kind, source, "YAML", leave_out=("0xff", "zeros", "one byte"))
        damage_text(corpus, kind, source, "YAML")
        add = lambda name, content, refused=False: corpus.add(kind, f"YAML {name}", ".yaml", content, refused)
        strict = kind != "camera"  # OpenCV's files contain more fields than are read
        add("aliases that multiply", aliases + text, strict)
        add("merges that multiply", merged + text, strict)
        add("alias of itself", "a: &a [*a]\n" + text, strict)
        add("alias of nothing", text + "b: *nothing\n", True)
        add("nested 10^5 deep", "a: " + "[" * 100_000, True)
        add("mappings nested 10^5 deep", "{a: " * 100_000, True)
        add("blocks nested 2000 deep", "".join(" " * n + "a:\n" for n in range(2000)), True)
        add("keys nested 10^5 deep", "? " * 100_000, True)
        add("a list", "- 1\n- 2\n", True)
        add("a word", "word\n", True)
        add("two documents", text + "---\n" + text)
        add("tag of a program", "!!python/object/apply:os.system [id]\n" + text)
        add("10^6 keys", "".join(f"k{n}: 1\n" for n in range(300_000)), True)
        for name, number in (("NaN", ".nan"), ("infinity", ".inf"), ("1e999", "1e999"), ("-1", "-1"), ("0", "0"),
                             ("1e300", "1e300"), ("10^18", "1000000000000000000"), ("words", "many"), ("null", "~")):
            for place, key in enumerate(numeric_keys(text)):
                if place in corpus.random(kind, name).sample(range(40), 12):
                    add(f"{key} {name}", with_value(text, key, number))


def urdf(corpus):
    """Adds a gripper file with a broken URDF."""
    mapping = (corpus.good / "hubrobo-urdf.yaml").read_text().replace("hubrobo.urdf", "broken.urdf")
    good = (corpus.good / "hubrobo.urdf").read_text()

    def add(name, content, refused=True):
        path = corpus.path("urdf", f"URDF {name}", ".yaml", refused)
        path.write_text(mapping)
        path.with_name("broken.urdf").write_bytes(content if isinstance(content, bytes) else content.encode())

    for name, content, refused in damaged_bytes(good.encode(), corpus.random("urdf", "URDF")):
        add(name, content, refused)
    add("nested 12,000 deep", "<robot name='r'>" + "<a>" * 12_000)
    add("10^5 links", "<robot name='r'>" + "".join(f"<link name='l{n}'/>" for n in range(10 ** 5)) + "</robot>")
    add("of entities that multiply", "<!DOCTYPE r [<!ENTITY a 'aaaa'>" + "".join(
        f"<!ENTITY a{n} '{'&a%d;' % (n - 1) * 9}'>" for n in range(1, 12)) + "]>" + good, False)
    for name, old, new in (("circle", '<parent link="palm"/> <child link="finger_2"/>', '<parent link="finger_2_tip"/> <child link="finger_2"/>'),
                           ("NaN", 'xyz="0 0 -0.015"', 'xyz="nan 0 -0.015"'), ("1e999", 'xyz="0 0 -0.015"', 'xyz="1e999 0 -0.015"'),
                           ("1e300", 'xyz="0 0 -0.015"', 'xyz="1e300 0 -0.015"'), ("millimeters", 'xyz="0 0 -0.015"', 'xyz="0 0 -15"'),
                           ("degrees", 'upper="1.3089969"', 'upper="75"'), ("no limit", 'upper="1.3089969"', ""),
                           ("axis of nothing", 'xyz="0 -1 0"', 'xyz="0 0 0"'), ("wrong axis", 'xyz="0 -1 0"', 'xyz="1 0 0"')):
        add(name, good.replace(old, new, 1))


def numeric_keys(text):
    """Returns the unique keys that precede a number or a list of numbers."""
    keys = []
    for word in text.replace("{", " ").replace(",", " ").split():
        if word.endswith(":") and word[:-1] not in keys and word[:-1] not in (
                "name", "shape", "shapes", "rocks", "cameras", "sections", "items"):
            keys.append(word[:-1])
    return keys


def with_value(text, key, value):
    at = text.index(key + ":") + len(key) + 1
    end = at
    depth = 0
    while end < len(text) and (depth > 0 or text[end] not in ",}\n#"):
        depth += {"[": 1, "{": 1, "]": -1, "}": -1}.get(text[end], 0)
        end += 1
    return text[:at] + " " + value + text[end:]


def poses(corpus):
    for extension in ("tum", "kitti", "g2o", "toro"):
        damage_file(corpus, "poses", f"poses.{extension}", extension.upper(), leave_out=("twice",))
        damage_text(corpus, "poses", f"poses.{extension}", extension.upper())
    add = lambda name, extension, text, refused=False: corpus.add("poses", name, extension, text, refused)
    add("TUM NaN", ".tum", "1 nan nan nan 0 0 0 1\n" * 3)
    add("TUM turn of zero", ".tum", "1 0 0 0 0 0 0 0\n2 0 0 0 0 0 0 0\n")
    add("TUM infinite stamps", ".tum", "inf 0 0 0 0 0 0 1\n-inf 0 0 0 0 0 0 1\n")
    add("TUM same stamp", ".tum", "1 0 0 0 0 0 0 1\n" * 9)
    add("TUM 1e308", ".tum", "1 1e308 -1e308 1e308 0 0 0 1\n2 -1e308 1e308 0 0 0 0 1\n")
    add("TUM three columns", ".tum", "1 2 3\n", True)
    add("TUM 10^6 columns", ".tum", "1 " * 1_000_000 + "\n", True)
    add("TUM comments alone", ".tum", "# nothing\n" * 100, True)
    add("KITTI of zeros", ".kitti", ("0 " * 12 + "\n") * 5)
    add("KITTI mirror", ".kitti", "1 0 0 0 0 1 0 0 0 0 -1 0\n" * 5)
    add("KITTI eleven numbers", ".kitti", "1 " * 11 + "\n", True)
    vertex = "VERTEX_SE3:QUAT {0} 0 0 0 0 0 0 1\n"
    edge = "EDGE_SE3:QUAT {0} {1} 1 0 0 0 0 0 1 " + "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"
    graph = "".join(vertex.format(n) for n in range(1, 6)) + "".join(edge.format(n, n + 1) for n in range(1, 5))
    add("G2O edge to itself", ".g2o", graph + edge.format(2, 2))
    add("G2O edges in a circle", ".g2o", graph + edge.format(5, 1) + edge.format(3, 1))
    add("G2O edge to a missing vertex", ".g2o", graph + edge.format(2, 77))
    add("G2O vertex twice", ".g2o", graph + vertex.format(3))
    add("G2O vertex -4", ".g2o", graph + vertex.format(-4))
    add("G2O vertex 10^30", ".g2o", graph + vertex.format(10 ** 30), True)
    add("G2O vertex 1.5", ".g2o", graph + vertex.format(1.5), True)
    add("G2O unknown record", ".g2o", graph + "VERTEX_OF_TIME 1 2 3\n")
    add("TORO vertex twice", ".toro", "VERTEX3 1 0 0 0 0 0 0\n" * 2)
    for file in ("cameras.txt", "images.txt", "points3D.txt"):
        good = (corpus.good / "poses.colmap/sparse" / file).read_bytes()
        draw = corpus.random("colmap", file)
        for name, content in (("missing", None), ("empty", b""), ("noise", draw.randbytes(400)),
                              ("cut", good[:draw.randrange(len(good) // 3, len(good))])):
            in_folder(corpus, "poses", "poses.colmap", f"COLMAP {file} {name}", f"sparse/{file}", content, ".colmap")
    images = (corpus.good / "poses.colmap/sparse/images.txt").read_text()
    in_folder(corpus, "poses", "poses.colmap", "COLMAP of camera 99", "sparse/images.txt", images.replace(" 1 0000", " 99 0000"), ".colmap")
    in_folder(corpus, "poses", "poses.colmap", "COLMAP picture elsewhere", "sparse/images.txt",
              images.replace(" 000001.jpg", " ../../../etc/passwd"), ".colmap")


def tables(corpus):
    for kind, source in (("points", "points.csv"), ("lookup", "lookup.csv"), ("expected", "expected.csv"),
                         ("polygon", "polygon.csv")):
        damage_file(corpus, kind, source, "CSV")
        damage_text(corpus, kind, source, "CSV")
        text = (corpus.good / source).read_text()
        header, first, rest = text.split("\n", 2)
        add = lambda name, content, refused=False: corpus.add(kind, f"CSV {name}", ".csv", content, refused)
        add("10^6 columns", header + ",c" * 1_000_000 + "\n" + first + "\n", False)
        add("10^5 different columns", header + "".join(f",c{n}" for n in range(100_000)) + "\n" + first + "\n", True)
        add("header alone", header + "\n")
        add("no header", first + "\n" + rest, True)
        add("row too short", text + "1\n", True)
        add("row too long", text + "1," * 50 + "\n", True)
        add("quote without an end", text + '"open,1,2,3\n', True)
        add("column twice", header + "," + header + "\n" + first + "," + first + "\n")
        add("NaN", header + "\n" + ",".join(["nan"] * (header.count(",") + 1)) + "\n")
        add("infinity", header + "\n" + ",".join(["inf"] * (header.count(",") + 1)) + "\n")
        add("1e308", header + "\n" + ",".join(["1e308"] * (header.count(",") + 1)) + "\n")
        add("words", header + "\n" + ",".join(["word"] * (header.count(",") + 1)) + "\n", kind != "lookup")
        add("formula", header + "\n" + ",".join(["=cmd()"] * (header.count(",") + 1)) + "\n", kind != "lookup")
        add("commas in numbers", text.replace(".", ","), True)
        add("semicolons", text.replace(",", ";"), True)
        add("5000 rows", header + "\n" + (first + "\n") * 5000)
    damage_file(corpus, "cloud", "cloud.csv", "CSV")
    damage_text(corpus, "cloud", "cloud.csv", "CSV")
    corpus.add("cloud", "CSV 10^6 columns", ".csv", "x,y,z" + ",c" * 1_000_000 + "\n")
    corpus.add("cloud", "CSV 10^5 different columns", ".csv",
               "x,y,z" + "".join(f",c{n}" for n in range(100_000)) + "\n1,2,3" + ",0" * 100_000 + "\n")
    damage_file(corpus, "transform", "transform.txt", "matrix")
    damage_text(corpus, "transform", "transform.txt", "matrix")
    for name, text in (("of zeros", "0 0 0 0\n" * 4), ("NaN", "nan nan nan nan\n" * 4), ("mirror", "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n"),
                       ("of three rows", "1 0 0 0\n" * 3), ("1e300", "1 0 0 1e300\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")):
        corpus.add("transform", f"matrix {name}", ".txt", text, name != "1e300")


def tile_files(corpus):
    text = (corpus.good / "map.tiles/index.json").read_text()
    names = [tile["file"] for tile in json.loads(text)["tiles"]]
    draw = corpus.random("tiles")
    for name, content in (("missing", None), ("empty", b""), ("cut", text[:draw.randrange(100, len(text) - 5)]),
                          ("noise", draw.randbytes(400)), ("an array", "[]"), ("nested 10^5 deep", "[" * 100_000),
                          ("NUL bytes", text.replace(" ", "\0"))):
        in_folder(corpus, "tiles", "map.tiles", f"index {name}", "index.json", content, ".tiles", True)
    tile = (corpus.good / "map.tiles" / names[0]).read_bytes()
    for name, content in (("missing", None), ("empty", b""), ("cut", tile[:-40]), ("noise", draw.randbytes(400)),
                          ("bit flipped", tile[:-9] + bytes([tile[-9] ^ 4]) + tile[-8:])):
        in_folder(corpus, "tiles", "map.tiles", f"tile {name}", names[0], content, ".tiles")
    path = corpus.copy("tiles", "tiles swapped", "map.tiles", ".tiles")
    (path / names[0]).rename(path / "other")
    (path / names[1]).rename(path / names[0])
    (path / "other").rename(path / names[1])
    path = corpus.copy("tiles", "folder of tiles is a file", "map.tiles", ".tiles", True)
    shutil.rmtree(path / "tiles")
    (path / "tiles").write_text("")


def tile_indexes(corpus):
    index = json.loads((corpus.good / "map.tiles/index.json").read_text())

    def with_index(name, change, refused=True):
        other = json.loads(json.dumps(index))
        change(other)
        path = corpus.copy("tiles", name, "map.tiles", ".tiles", refused)
        (path / "index.json").write_text(json.dumps(other))
        return path, other

    def first(**values):
        return lambda other: other["tiles"][0].update(values)

    with_index("tile in another folder", first(file="../../../../../../etc/passwd"))
    with_index("tile of an absolute path", first(file="/dev/zero"))
    with_index("tile that is a folder", first(file="tiles"))
    with_index("tile of 10^18 bytes", first(bytes=10 ** 18))
    with_index("tile of -1 bytes", first(bytes=-1))
    with_index("tile of 10^9 voxels", first(voxels=10 ** 9))
    with_index("tile of -1 voxels", first(voxels=-1))
    with_index("tile number 10^12", first(i=10 ** 12))
    with_index("tile number of a word", first(i="one"))
    with_index("tile twice", lambda other: other["tiles"].append(other["tiles"][0]))
    with_index("tiles backwards", lambda other: other["tiles"].reverse())
    with_index("no tiles", lambda other: other.update(tiles=[]), False)
    with_index("tiles no list", lambda other: other.update(tiles=7))
    with_index("voxels of 0 m", lambda other: other["lattice"].update(voxel_size_m=0))
    with_index("voxels of -1 m", lambda other: other["lattice"].update(voxel_size_m=-1))
    with_index("voxels of 1e-300 m", lambda other: other["lattice"].update(voxel_size_m=1e-300), False)
    with_index("origin of two numbers", lambda other: other["lattice"].update(origin_m=[0, 0]))
    with_index("tiles 0 voxels wide", lambda other: other.update(tile_voxels=0))
    with_index("tiles 10^12 voxels wide", lambda other: other.update(tile_voxels=10 ** 12))
    with_index("box upside down", lambda other: other.update(min=other["max"], max=other["min"]), False)
    with_index("box of 2^31", lambda other: other.update(max=[2 ** 31 - 1] * 3), False)
    with_index("version 9", lambda other: other.update(version=9))
    with_index("another format", lambda other: other.update(format="other"))
    with_index("no map", lambda other: other.pop("map"))
    # Correct hashes of a broken tile.
    file = index["tiles"][0]["file"]
    tile = (corpus.good / "map.tiles" / file).read_bytes()
    forged = tile.replace(b"POINTS ", b"POINTS 9", 1).replace(b"WIDTH ", b"WIDTH 9", 1)
    for name, content in (("forged header", forged), ("forged fields", tile.replace(b" i j k", b" i j q", 1)),
                          ("forged voxels", tile[:-12] + b"\x7f" * 12)):
        path, other = with_index(name, lambda other: None, False)
        other["tiles"][0].update(bytes=len(content), sha256=hashlib.sha256(content).hexdigest())
        (path / file).write_bytes(content)
        (path / "index.json").write_text(json.dumps(other))


def runs(corpus):
    for file, contents in {
            "map.pcd": (("noise", b"\x81" * 900), ("empty", b"")),
            "map.pcd.json": (("nested 10^5 deep", "[" * 100_000), ("cut", '{"made_by": "gr'), ("numbers", "7")),
            "lookup.csv": (("10^5 columns", ",".join(f"c{n}" for n in range(100_000)) + "\n"), ("noise", b"\x81\0\n" * 900)),
            "picture.png": (("noise", b"\x89PNG" + b"\x81" * 900), ("empty", b"")),
            "script.svg": (("script", "<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>"),
                           ("entities", '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "b">]><svg>&a;</svg>'))}.items():
        for name, content in contents:
            in_folder(corpus, "run-folder", "run", f"{file} {name}", file, content)
    path = corpus.copy("run-folder", "that contains itself", "run")
    (path / "again").symlink_to(".")
    path = corpus.copy("run-folder", "50 folders deep", "run")
    for n in range(50):
        path = path / f"f{n}"
    path.mkdir(parents=True)
    (path / "lookup.csv").write_text("a\n1\n")
    path = corpus.copy("run-folder", "with names of markup", "run")
    (path / "<script>alert(1)<!-- .csv").write_text("<b>a</b>\n<img src=x>\n")
    (path / "line\nbreak.csv").write_text("a\n1\n")


def make(corpus):
    yaml(corpus)
    urdf(corpus)
    poses(corpus)
    tables(corpus)
    tile_files(corpus)
    tile_indexes(corpus)
    runs(corpus)
