"""Clouds, maps and meshes, broken field by field."""
import json
import random
import struct

from corpus import damage_file, damage_text


def replaced(data, *pairs):
    for old, new in pairs:
        old, new = (word.encode() if isinstance(word, str) else word for word in (old, new))
        if old not in data:
            raise SystemExit(f"the good input contains no {old!r}")
        data = data.replace(old, new, 1)
    return data


def pcd(corpus):
    for source, label in (("terrain.pcd", "PCD"), ("ascii.pcd", "ASCII PCD"),
                          ("compressed.pcd", "compressed PCD")):
        damage_file(corpus, "cloud", source, label)
    damage_text(corpus, "cloud", "ascii.pcd", "ASCII PCD")
    good = {name: (corpus.good / f"{name}.pcd").read_bytes() for name in ("terrain", "ascii", "compressed")}
    count = next(line for line in good["terrain"].split(b"\n") if line.startswith(b"WIDTH"))[6:].decode()

    def add(name, source, *pairs, refused=True):
        corpus.add("cloud", f"PCD {name}", ".pcd", replaced(good[source], *pairs), refused)

    for source in good:
        for name, number in (("10^9", "1000000000"), ("2^64", "18446744073709551616"), ("minus one", "-1")):
            add(f"{source} promises {name} points", source, (f"WIDTH {count}", f"WIDTH {number}"),
                (f"POINTS {count}", f"POINTS {number}"))
    add("10^5 x 10^5", "terrain", (f"WIDTH {count}", "WIDTH 100000"), ("HEIGHT 1", "HEIGHT 100000"))
    add("points are not width x height", "terrain", ("HEIGHT 1", "HEIGHT 7"))
    add("no x", "terrain", ("FIELDS x ", "FIELDS u "))
    add("x twice", "terrain", ("FIELDS x y", "FIELDS x x"))
    add("fields fewer than sizes", "terrain", ("FIELDS x y z", "FIELDS x y"))
    add("size 3", "terrain", ("SIZE 4", "SIZE 3"))
    add("size 10^9", "terrain", ("SIZE 4", "SIZE 1000000000"))
    add("count 10^9", "terrain", ("COUNT 1", "COUNT 1000000000"))
    add("count -1", "terrain", ("COUNT 1", "COUNT -1"))
    add("type Q", "terrain", ("TYPE F", "TYPE Q"))
    add("no data line", "terrain", ("DATA binary", "DATUM binary"))
    add("data of another kind", "terrain", ("DATA binary", "DATA hologram"))
    add("text said to be binary", "ascii", ("DATA ascii", "DATA binary"), refused=False)
    add("binary said to be text", "terrain", ("DATA binary", "DATA ascii"))
    add("binary said to be compressed", "terrain", ("DATA binary", "DATA binary_compressed"))
    at = good["compressed"].index(b"compressed\n") + len("compressed\n")
    packed, unpacked = struct.unpack_from("<II", good["compressed"], at)
    for name, sizes in (("packed size 2^32-1", (2 ** 32 - 1, unpacked)),
                        ("unpacked size 2^32-1", (packed, 2 ** 32 - 1)),
                        ("sizes 0", (0, 0)), ("sizes swapped", (unpacked, packed))):
        corpus.add("cloud", f"compressed PCD {name}", ".pcd",
                   good["compressed"][:at] + struct.pack("<II", *sizes) + good["compressed"][at + 8:], True)
    begin = good["terrain"].index(b"binary\n") + len("binary\n")
    step = (len(good["terrain"]) - begin) // int(count)
    values = bytearray(good["terrain"][begin:])
    for name, value in (("NaN", "nan"), ("infinite", "inf"), ("1e38", "1e38"), ("denormal", "1e-42")):
        for n in range(int(count)):
            struct.pack_into("<3f", values, n * step, *[float(value)] * 3)
        corpus.add("cloud", f"PCD all {name}", ".pcd", good["terrain"][:begin] + bytes(values))
    for n in range(0, int(count), 7):
        struct.pack_into("<3f", values, n * step, n * 0.01, 1e30 * (-1) ** n, 0.0)
    corpus.add("cloud", "PCD some far away", ".pcd", good["terrain"][:begin] + bytes(values))
    swapped = good["terrain"][begin:]
    swapped = b"".join(swapped[i:i + 4][::-1] for i in range(0, len(swapped), 4))
    corpus.add("cloud", "PCD other byte order", ".pcd", good["terrain"][:begin] + swapped)
    corpus.add("cloud", "PCD a million header lines", ".pcd", b"# line\n" * 1_000_000 + good["terrain"])
    corpus.add("cloud", "PCD 10^5 fields", ".pcd", "VERSION 0.7\nFIELDS x y z " + "f " * 100_000 + "\nSIZE 4\n", True)


def ply(corpus):
    damage_file(corpus, "cloud", "cloud.ply", "PLY")
    damage_file(corpus, "mesh", "mesh.ply", "PLY")
    good = (corpus.good / "mesh.ply").read_bytes()
    lines = good[:good.index(b"end_header")].decode().splitlines()
    vertices = next(line for line in lines if line.startswith("element vertex"))
    faces = next(line for line in lines if line.startswith("element face"))

    def add(name, *pairs, refused=True):
        corpus.add("mesh", f"PLY {name}", ".ply", replaced(good, *pairs), refused)

    for what, line in (("vertices", vertices), ("faces", faces)):
        for name, number in (("10^9", 10 ** 9), ("2^64", 2 ** 64), ("minus one", -1), ("nan", "nan")):
            add(f"{name} {what}", (line, line.rsplit(" ", 1)[0] + f" {number}"))
    add("big-endian by its header alone", ("binary_little_endian", "binary_big_endian"))
    add("text by its header alone", ("binary_little_endian", "ascii"))
    add("format of the future", ("little_endian 1.0", "little_endian 9.0"))
    add("property of an unknown type", ("property float x", "property quaternion x"))
    add("x twice", ("property float y", "property float x"))
    add("no z", ("property float z", "property float w"))
    add("no end of its header", ("end_header", "end_hearder"))
    add("list without a type", ("property list uchar int", "property list uchar"))
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    corners = "0 0 0\n1 0 0\n0 1 0\n"
    face = header + "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + corners
    for name, text in (("of a missing vertex", "3 0 1 3"), ("of a negative vertex", "3 0 1 -1"),
                       ("of vertex 10^9", "3 0 1 1000000000"), ("of two corners", "2 0 1"),
                       ("of 200 corners", "200 0 1 2"), ("of no corner", "0"), ("of one vertex thrice", "3 1 1 1")):
        corpus.add("mesh", f"PLY face {name}", ".ply", face + text + "\n")
    corpus.add("cloud", "PLY without faces", ".ply",
               header + "element face 0\nproperty list uchar int vertex_indices\nend_header\n" + corners)
    corpus.add("cloud", "PLY 10^5 properties", ".ply", header + "property float q\n" * 100_000 + "end_header\n" + corners, True)
    corpus.add("cloud", "PLY without points", ".ply", header.replace("vertex 3", "vertex 0") + "end_header\n")
    corpus.add("cloud", "PLY NaN", ".ply", header + "end_header\n" + "nan nan nan\n" * 3)
    corpus.add("cloud", "PLY list of 2^32 in a vertex", ".ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
               b"property float x\nproperty float y\nproperty float z\nproperty list uint float w\nend_header\n"
               + struct.pack("<fffI", 0, 0, 0, 2 ** 32 - 1), True)


def vtp(corpus):
    for kind in ("cloud", "mesh"):
        corpus.add(kind, "VTP, which is written only", ".vtp", "<VTKFile>\n", True)


def obj_stl_off(corpus):
    for name in ("mesh.obj", "mesh.stl", "mesh.off"):
        damage_file(corpus, "mesh", name, name[-3:].upper())
    for name in ("mesh.obj", "mesh.off"):
        damage_text(corpus, "mesh", name, name[-3:].upper())
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    for name, text in (("face 0", "f 0 1 2"), ("face -5", "f -5 -2 -1"), ("face 10^9", "f 1 2 1000000000"),
                       ("face 2^64", "f 1 2 18446744073709551616"), ("face of words", "f a b c"),
                       ("face of two", "f 1 2"), ("normal that is not there", "f 1//9 2//9 3//9"),
                       ("texture that is not there", "f 1/9 2/9 3/9"),
                       ("face of 90 corners", "f" + " 1 2 3" * 30)):
        corpus.add("mesh", f"OBJ {name}", ".obj", corners + text + "\n")
    corpus.add("mesh", "OBJ without vertices", ".obj", "f 1 2 3\n", True)
    corpus.add("mesh", "OBJ NaN and infinity", ".obj", "v nan 0 0\nv inf 0 0\nv 0 -inf 0\nf 1 2 3\n")
    corpus.add("mesh", "OBJ 1e308", ".obj", "v 1e308 0 0\nv -1e308 0 0\nv 0 1e308 0\nf 1 2 3\n")
    corpus.add("mesh", "OBJ material of another folder", ".obj", "mtllib ../../../../etc/passwd\n" + corners + "f 1 2 3\n")
    corpus.add("mesh", "OBJ material that is a device", ".obj", "mtllib /dev/zero\n" + corners + "f 1 2 3\n")
    corpus.add("mesh", "OBJ material that is itself", ".obj", "mtllib broken.obj\nusemtl a\n" + corners + "f 1 2 3\n")
    corpus.add("mesh", "OBJ picture that is a device", ".obj", "mtllib broken.mtl\nusemtl a\n" + corners
               + "vt 0 0\nf 1/1 2/1 3/1\n")
    corpus.cases[-1].path.with_suffix(".mtl").write_text("newmtl a\nmap_Kd /dev/zero\n")
    corpus.add("mesh", "OBJ picture of 65535 x 65535", ".obj", "mtllib broken.mtl\nusemtl a\n" + corners
               + "vt 0 0\nf 1/1 2/1 3/1\n")
    corpus.cases[-1].path.with_suffix(".mtl").write_text("newmtl a\nmap_Kd broken.png\n")
    corpus.cases[-1].path.with_suffix(".png").write_bytes(
        replaced((corpus.good / "picture.png").read_bytes(), (struct.pack(">II", 40, 30), struct.pack(">II", 65535, 65535))))
    good = (corpus.good / "mesh.stl").read_bytes()
    for name, count in (("10^9", 10 ** 9), ("2^32-1", 2 ** 32 - 1), ("no", 0)):
        corpus.add("mesh", f"STL of {name} triangles", ".stl", good[:80] + struct.pack("<I", count) + good[84:])
    corpus.add("mesh", "STL NaN", ".stl", good[:84] + (struct.pack("<12f", *[float("nan")] * 12) + b"\0\0") * ((len(good) - 84) // 50))
    corpus.add("mesh", "STL text without an end", ".stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", True)
    corpus.add("mesh", "STL text of words", ".stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex a b c\n" * 5, True)
    for name, counts in (("10^9 vertices", "1000000000 1 0"), ("10^9 faces", "3 1000000000 0"),
                         ("-1 vertices", "-1 1 0"), ("2^64 vertices", "18446744073709551616 1 0")):
        corpus.add("mesh", f"OFF of {name}", ".off", f"OFF\n{counts}\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", True)
    for name, face in (("10^9", "3 0 1 1000000000"), ("-1", "3 0 1 -1"), ("corners 10^9", "1000000000 0 1 2")):
        corpus.add("mesh", f"OFF face {name}", ".off", f"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n{face}\n", True)


def glb_of(document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return (struct.pack("<4sII", b"glTF", 2, 20 + len(text) + 8 + len(binary)) + struct.pack("<I4s", len(text), b"JSON")
            + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def glb(corpus):
    damage_file(corpus, "mesh", "mesh.glb", "GLB")
    good = (corpus.good / "mesh.glb").read_bytes()
    length, = struct.unpack_from("<I", good, 12)
    document, binary = json.loads(good[20:20 + length]), good[28 + length:]

    def raw(name, at, number):
        corpus.add("mesh", f"GLB {name}", ".glb", good[:at] + struct.pack("<I", number) + good[at + 4:])

    for name, number in (("2^32-1", 2 ** 32 - 1), ("0", 0), ("12", 12)):
        raw(f"length {name}", 8, number)
        raw(f"length of the text {name}", 12, number)
        raw(f"length of the numbers {name}", 20 + length, number)
    raw("version 1", 4, 1)
    raw("version 9", 4, 9)

    def changed(name, change, refused=False):
        other = json.loads(json.dumps(document))
        change(other)
        corpus.add("mesh", f"GLB {name}", ".glb", glb_of(other, binary), refused)

    def set_in(part, key, value):
        def change(other):
            for one in other[part]:
                one[key] = value
        return change

    changed("same as before", lambda other: None)
    for name, number in (("10^9", 10 ** 9), ("-1", -1), ("0", 0), ("a word", "many")):
        changed(f"accessor count {name}", set_in("accessors", "count", number))
        changed(f"view length {name}", set_in("bufferViews", "byteLength", number))
    changed("accessor offset 10^9", set_in("accessors", "byteOffset", 10 ** 9), True)
    changed("accessor type 7", set_in("accessors", "componentType", 7))
    changed("accessor of matrices", set_in("accessors", "type", "MAT4"))
    changed("view of buffer 7", set_in("bufferViews", "buffer", 7), True)
    changed("view stride 1", set_in("bufferViews", "byteStride", 1))
    changed("accessor of view -1", set_in("accessors", "bufferView", -1))
    changed("accessor of view 99", set_in("accessors", "bufferView", 99), True)
    changed("buffer of 10^12 bytes", set_in("buffers", "byteLength", 10 ** 12))
    changed("buffer that is a device", set_in("buffers", "uri", "/dev/zero"))
    changed("buffer of another folder", set_in("buffers", "uri", "../../../../../etc/passwd"))
    changed("node that is its own child", set_in("nodes", "children", [0]))
    changed("node 10^9", lambda other: other["scenes"][0].update(nodes=[10 ** 9]))
    changed("no meshes", lambda other: other.pop("meshes"))
    changed("positions from accessor 99",
            lambda other: other["meshes"][0]["primitives"][0]["attributes"].update(POSITION=99))
    changed("node scaled by 1e300", set_in("nodes", "scale", [1e300] * 3))
    noise = random.Random(corpus.seed).randbytes(len(binary))
    corpus.add("mesh", "GLB numbers of noise", ".glb", glb_of(document, noise))
    corpus.add("mesh", "GLB text nested 10^5 deep", ".glb",
               struct.pack("<4sIII4s", b"glTF", 2, 20 + 100_000, 100_000, b"JSON") + b"[" * 100_000, True)


def maps(corpus):
    """Adds damage of a map's cloud or of its manifest."""
    def broken_manifest(name, change):
        path = corpus.copy("map", f"manifest {name}", "map.pcd", ".pcd")
        text = (corpus.good / "map.pcd.json").read_text()
        path.with_name(path.name + ".json").write_text(change(text))

    def of_object(change):
        def on_text(text):
            manifest = json.loads(text)
            change(manifest)
            return json.dumps(manifest)
        return on_text

    broken_manifest("empty", lambda text: "")
    broken_manifest("cut", lambda text: text[:len(text) // 2])
    broken_manifest("an array", lambda text: "[1, 2]")
    broken_manifest("nested 10^5 deep", lambda text: "[" * 100_000)
    broken_manifest("numbers as words", lambda text: text.replace("0.02", '"wide"'))
    broken_manifest("1e999", lambda text: text.replace("0.02", "1e999"))
    broken_manifest("voxels of 0 m", of_object(lambda m: m["parameters"].update(voxel_size_m=0)))
    broken_manifest("voxels of 1e-12 m", of_object(lambda m: m["parameters"].update(voxel_size_m=1e-12)))
    broken_manifest("voxels of -1 m", of_object(lambda m: m["parameters"].update(voxel_size_m=-1)))
    broken_manifest("transform of three numbers", of_object(lambda m: m["transforms"].update(terrain_from_input=[1, 2, 3])))
    broken_manifest("transform of zeros", of_object(lambda m: m["transforms"].update(terrain_from_input=[0] * 12)))
    broken_manifest("no parameters", of_object(lambda m: m.pop("parameters")))
    broken_manifest("no results", of_object(lambda m: m.pop("results")))
    broken_manifest("other maker", of_object(lambda m: m.update(made_by="someone")))
    damage_file(corpus, "map", "map.pcd", "PCD")
    good = (corpus.good / "map.pcd").read_bytes()
    corpus.add("map", "without a manifest", ".pcd", good)
    corpus.add("map", "without scores", ".pcd", replaced(good, (" score ", " scare ")))
    corpus.add("map", "without lattice", ".pcd", replaced(good, (" i j k", " a b c")))
    damage_file(corpus, "footholds", "footholds.csv", "CSV")


def tiff(tags, data=b""):
    """Returns a little-endian TIFF of one directory. tags: {number: (type, count, value)}. Data start at byte 8."""
    at = 8 + len(data)
    entries = b"".join(struct.pack("<HHII", tag, *what) for tag, what in sorted(tags.items()))
    return b"II*\0" + struct.pack("<I", at) + data + struct.pack("<H", len(tags)) + entries + bytes(4)


def dem(corpus):
    damage_file(corpus, "dem", "dem.tif", "TIFF")
    scale = struct.pack("<3d6d", 0.02, 0.02, 0, 0, 0, 0, 500000, 5400000, 0)
    values = struct.pack("<16f", *range(16))
    # 4 x 4 pixels of float32 in one strip, after the transform.
    good = {256: (3, 1, 4), 257: (3, 1, 4), 258: (3, 1, 32), 259: (3, 1, 1), 262: (3, 1, 1), 273: (4, 1, 8 + len(scale)),
            277: (3, 1, 1), 278: (3, 1, 4), 279: (4, 1, 64), 339: (3, 1, 3), 33550: (12, 3, 8), 33922: (12, 6, 32)}

    def add(name, refused=True, **changes):
        tags = {**good, **{int(tag[1:]): what for tag, what in changes.items()}}
        corpus.add("dem", f"TIFF {name}", ".tif", tiff({t: w for t, w in tags.items() if w}, scale + values), refused)

    add("that is sound", False)
    add("10^9 x 10^9", t256=(4, 1, 10 ** 9), t257=(4, 1, 10 ** 9))
    add("60000 x 60000 in one strip", t256=(4, 1, 60000), t257=(4, 1, 60000), t278=(4, 1, 60000), t259=(3, 1, 8))
    add("60000 x 60000 in rows that are not there", t256=(4, 1, 60000), t257=(4, 1, 60000), t278=(4, 1, 1))
    add("4 x 0", t257=(3, 1, 0))
    add("of 7 bits", False, t258=(3, 1, 7))
    add("of 8 bits", t258=(3, 1, 8), t339=None, t279=(4, 1, 16))
    add("of an unknown compression", t259=(3, 1, 60000))
    add("of JPEG that is none", t259=(3, 1, 7))
    add("of deflate that is none", t259=(3, 1, 8))
    add("with a strip at 2^32-1", t273=(4, 1, 2 ** 32 - 1))
    add("with a strip of 2^32-1 bytes", False, t279=(4, 1, 2 ** 32 - 1))
    add("of 60000 bands", t277=(3, 1, 60000))
    add("without a transform", t33550=None, t33922=None)
    add("with a transform at 2^32-1", t33550=(12, 3, 2 ** 32 - 1))
    add("that is its own directory", False, t330=(4, 1, 8 + len(scale) + 64))
    for name, number in (("NaN", float("nan")), ("infinite", float("inf")), ("1e300", 1e300), ("0", 0.0), ("-1", -1.0)):
        other = struct.pack("<9d", number, *struct.unpack("<9d", scale)[1:])
        corpus.add("dem", f"TIFF pixels {name} wide", ".tif", tiff(good, other + values), name != "-1")
    for name, number in (("NaN", float("nan")), ("1e38", 1e38), ("-1e38", -1e38)):
        corpus.add("dem", f"TIFF all {name}", ".tif", tiff(good, scale + struct.pack("<16f", *[number] * 16)), True)
    corpus.add("dem", "VRT of another file", ".tif", "<VRTDataset rasterXSize=\"1\" rasterYSize=\"1\"><VRTRasterBand><SimpleSource>"
               "<SourceFilename>/etc/passwd</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>", True)
    corpus.add("dem", "address", ".tif", "/vsicurl/http://localhost/dem.tif", True)


def make(corpus):
    pcd(corpus)
    dem(corpus)
    ply(corpus)
    vtp(corpus)
    obj_stl_off(corpus)
    glb(corpus)
    maps(corpus)
