"""Scan databases and folders, rig folders, images and bags, broken field by field."""
import contextlib
import functools
import shutil
import sqlite3
import struct
import zlib

from corpus import damage_file, damage_text
from good_inputs import png


def rvl(width, height, words):
    return b"DEPTHRVL" + struct.pack("<II", width, height) + words


def zip_bomb(size, tail):
    """Returns compressed zeros of `size` bytes as RTAB-Map stores matrices: three numbers at the end."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    block = packer.compress(bytes(1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)
    checksum = size % 65521 << 16 | 1  # Adler-32 of zeros
    return (b"\x78\xda" + block * (size >> 20) + packer.flush() + struct.pack(">I", checksum)
            + struct.pack("<3i", *tail))


def database(corpus, name, statements, refused=False):
    """Adds a copy of the good database after `statements` (SQL, or SQL and its values)."""
    path = corpus.copy("scan", f"database {name}", "scan.db", ".db", refused)
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA foreign_keys = OFF")
        connection.execute("PRAGMA journal_mode = OFF")
        # Triggers prevent changes of tables and do not affect readers.
        for (trigger,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {trigger}")
        for statement in statements:
            words, values = (statement, ()) if isinstance(statement, str) else statement
            connection.execute(words, values)
    connection.close()


NAN_POSE = struct.pack("<12f", *[float("nan")] * 12)


def database_links(corpus):
    def add(name, *statements):
        database(corpus, name, statements, False)

    link = ("INSERT INTO Link SELECT {0}, {1}, type, information_matrix, transform, user_data FROM Link "
            "WHERE from_id = 1 LIMIT 1")
    add("link to itself", link.format(3, 3))
    add("links in a circle", link.format(5, 1), link.format(1, 5), link.format(2, 4), link.format(4, 2))
    add("link to a node that is not there", link.format(2, 99))
    add("link from node -7", link.format(-7, 1))
    add("link of 2^62", link.format(2 ** 62, 1))
    add("same link a thousand times", *[link.format(1, 2)] * 1000)
    add("link of type 99", "UPDATE Link SET type = 99")
    add("link of type -1", "UPDATE Link SET type = -1")
    add("links without transforms", "UPDATE Link SET transform = NULL")
    add("links of NaN", ("UPDATE Link SET transform = ?", (NAN_POSE,)))
    add("links certain to NaN", ("UPDATE Link SET information_matrix = ?", (struct.pack("<36d", *[float("nan")] * 36),)))
    add("links certain to 1e300", ("UPDATE Link SET information_matrix = ?", (struct.pack("<36d", *[1e300] * 36),)))
    add("links certain to zero", ("UPDATE Link SET information_matrix = zeroblob(288)", ()))
    add("links certain to less than zero",
        ("UPDATE Link SET information_matrix = ?", (struct.pack("<36d", *[-1.0] * 36),)))
    add("link cut", "UPDATE Link SET transform = substr(transform, 1, 17)")
    add("links far away", ("UPDATE Link SET transform = ?", (struct.pack("<12f", 1, 0, 0, 3e38, 0, 1, 0, 0, 0, 0, 1, 0),)))
    add("links of zero turns", "UPDATE Link SET transform = zeroblob(48)")


def database_rows(corpus):
    def add(name, *statements, refused=False):
        database(corpus, name, statements, refused)

    free = ("CREATE TABLE Free AS SELECT * FROM Node", "DROP TABLE Node", "ALTER TABLE Free RENAME TO Node")
    add("node twice", *free, "INSERT INTO Node SELECT * FROM Node WHERE id = 2")
    add("node -1", "UPDATE Node SET id = -1 WHERE id = 1")
    add("node 0", "UPDATE Node SET id = 0 WHERE id = 1")
    add("node 2^62", f"UPDATE Node SET id = {2 ** 62} WHERE id = 1")
    add("node of a word", *free, "UPDATE Node SET id = 'one' WHERE id = 1")
    add("node without data", "DELETE FROM Data WHERE id = 2")
    add("data without nodes", "DELETE FROM Node")
    add("no data", "DELETE FROM Data")
    for name, value in (("NaN", NAN_POSE), ("zero", bytes(48)), ("cut", NAN_POSE[:13]), ("long", NAN_POSE * 1000)):
        add(f"poses {name}", ("UPDATE Node SET pose = ?, ground_truth_pose = ?", (value, value)))
    add("poses as text", "UPDATE Node SET pose = 'here', ground_truth_pose = 'there'")
    add("poses as numbers", "UPDATE Node SET pose = 7, ground_truth_pose = 2.5")
    add("stamps infinite", "UPDATE Node SET stamp = 9e999")
    add("stamps of words", "UPDATE Node SET stamp = 'noon'")
    add("stamps equal", "UPDATE Node SET stamp = 5")
    add("stamps backwards", "UPDATE Node SET stamp = -stamp")
    add("label with a line break", "UPDATE Node SET label = 'a' || char(10) || 'graspmap: error: b' || char(27) || '[2J' || id")
    add("label of 10^6 letters", "UPDATE Node SET label = hex(zeroblob(500000)) || id")
    add("weights", "UPDATE Node SET weight = -9223372036854775808, map_id = 9223372036854775807")
    add("parameters", "UPDATE Info SET parameters = 'a:b;;;:::;c' || char(0) || 'd'")
    add("version of the future", "UPDATE Admin SET version = '99.1.2'")
    add("version of words", "UPDATE Admin SET version = '../../etc'")
    add("version of a long number", "UPDATE Admin SET version = '99999999999999999999.1.1'")
    add("no version", "DELETE FROM Admin")
    for table in ("Node", "Data", "Link", "Admin", "Info"):
        add(f"no table {table}", f"DROP TABLE {table}", refused=table == "Node")
    for table, column in (("Node", "pose"), ("Node", "stamp"), ("Link", "information_matrix"),
                          ("Data", "calibration"), ("Data", "depth")):
        add(f"no column {table}.{column}", f"ALTER TABLE {table} RENAME COLUMN {column} TO other")
    add("a view as table", "ALTER TABLE Data RENAME TO Stored", "CREATE VIEW Data AS SELECT * FROM Stored, Node, Link")
    add("a view that never ends", "ALTER TABLE Data RENAME TO Stored",
        "CREATE VIEW Data AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
        "SELECT n.i AS id, image, depth, calibration FROM n, Stored")
    add("nodes by a view that never ends", "ALTER TABLE Node RENAME TO Stored",
        "CREATE VIEW Node AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
        "SELECT n.i AS id, 0 AS map_id, 0 AS weight, 1.0 AS stamp, s.pose, s.ground_truth_pose, NULL AS velocity, "
        "NULL AS label, NULL AS gps, NULL AS env_sensors FROM n, Stored s")


def database_blobs(corpus):
    def blob(name, column, value, table="Data"):
        only = "WHERE id = 2" if "bomb" in name and table == "Data" else ""
        database(corpus, f"{column} {name}", [(f"UPDATE {table} SET {column} = ? {only}", (value,))])

    run = b"\x70" * 40  # runs of 7 zeros, 7 values, ...
    for name, value in (("RVL run past the end", rvl(80, 60, b"\xff" * 4 + run)),
                        ("RVL zero run of 2^31", rvl(80, 60, b"\xff\xff\xff\xff\x10\x00\x00\x70" + run)),
                        ("RVL of 65535 x 65535", rvl(65535, 65535, run)),
                        ("RVL of 2^31 x 2^31", rvl(2 ** 31, 2 ** 31, run)),
                        ("RVL of 0 x 0", rvl(0, 0, run)), ("RVL of its header", rvl(80, 60, b"")),
                        ("RVL half a header", b"DEPTHRVL\x50"), ("empty", b""), ("text", "deep"), ("number", 3.5),
                        ("PNG of 65535 x 65535", inflated_png(65535)),
                        ("PNG of other size", png(7, 5, [bytes(14)] * 5, 16)),
                        ("PNG bomb", png_bomb()), ("zlib bomb", zip_bomb(1 << 29, (60, 80, 2)))):
        blob(name, "depth", value)
    for name, value in (("empty", b""), ("text", "color"), ("JPEG of its header", b"\xff\xd8\xff\xe0"),
                        ("PNG of 65535 x 65535", inflated_png(65535)), ("PNG bomb", png_bomb()),
                        ("of another size", png(13, 11, [bytes(39)] * 11, 8, 2)), ("noise", corpus.random("image").randbytes(3000))):
        blob(name, "image", value)
    with sqlite3.connect(corpus.good / "scan.db") as connection:
        good = connection.execute("SELECT calibration FROM Data").fetchone()[0]
        jpeg = connection.execute("SELECT image FROM Data").fetchone()[0]
    connection.close()
    size = jpeg.index(b"\xff\xc0") + 5
    blob("JPEG of 65535 x 65535", "image", jpeg[:size] + b"\xff" * 4 + jpeg[size + 4:])
    blob("JPEG cut", "image", jpeg[:len(jpeg) // 2])

    def calibration(name, at, kind, value):
        blob(name, "calibration", good[:at] + struct.pack(kind, value) + good[at + struct.calcsize(kind):])

    matrix = 44
    for name, value in (("zero", 0.0), ("NaN", float("nan")), ("infinite", float("inf")), ("negative", -80.0),
                        ("1e-300", 1e-300)):
        calibration(f"focal length {name}", matrix, "<d", value)
    blob("of zeros", "calibration", good[:44] + bytes(len(good) - 44))
    for n, what in enumerate(("version", "minor version", "patch", "type", "width", "height", "K", "D", "R", "P", "transform")):
        for number in (-1, 2 ** 31 - 1):
            calibration(f"{what} {number}", 4 * n, "<i", number)
    blob("empty", "calibration", b"")
    blob("cut", "calibration", good[:100])
    blob("twice", "calibration", good * 2)
    blob("text", "calibration", "80 60")
    bomb = zip_bomb(1 << 30, (1 << 15, 1 << 13, 5))
    for column in ("scan", "user_data", "ground_cells"):
        blob("zlib bomb of 1 GB", column, bomb)
        blob("cut matrix", column, zlib.compress(bytes(100))[:9] + struct.pack("<3i", 5, 5, 5))
        blob("matrix of -1 rows", column, zlib.compress(bytes(100)) + struct.pack("<3i", -1, 5, 5))
        blob("matrix of 2^31-1 rows", column, zlib.compress(bytes(100)) + struct.pack("<3i", 2 ** 31 - 1, 2 ** 31 - 1, 5))
    for column in ("opt_cloud", "opt_map", "opt_polygons", "preview_image"):
        blob("zlib bomb of 1 GB", column, bomb, "Admin")
    for name, ids, poses in (("of more poses than ids", 2, 5), ("of 10^6", 10 ** 6, 10 ** 6), ("of no ids", 0, 5)):
        pack = lambda data, count, kind: zlib.compress(data) + struct.pack("<3i", 1, count, kind)
        database(corpus, f"optimized poses {name}", [("UPDATE Admin SET opt_ids = ?, opt_poses = ?", (
            pack(struct.pack(f"<{ids}i", *range(-2, ids - 2)), ids, 4), pack(bytes(48 * poses), 12 * poses, 5)))])


def database_file(corpus):
    damage_file(corpus, "scan", "scan.db", "database", leave_out=("twice",))
    good = (corpus.good / "scan.db").read_bytes()
    for name, at, value in (("page size 0", 16, b"\0\0"), ("page size 3", 16, b"\0\3"), ("page size 65536", 16, b"\0\1"),
                            ("reserved space 255", 20, b"\xff"), ("pages 2^32-1", 28, b"\xff" * 4),
                            ("free list in a circle", 32, b"\0\0\0\1\0\0\0\7"), ("schema format 99", 44, b"\0\0\0c"),
                            ("UTF-16 by its header alone", 56, b"\0\0\0\2"), ("text encoding 9", 56, b"\0\0\0\t"),
                            ("write version 9", 18, b"\x09\x09"), ("root page of another kind", 100, b"\x02"),
                            ("first page of cells beyond it", 103, b"\xff\xff")):
        corpus.add("scan", f"database {name}", ".db", good[:at] + value + good[at + len(value):])
    corpus.add("scan", "database without its last page", ".db", good[:-4096])
    corpus.add("scan", "database with WAL of noise", ".db", good[:18] + b"\2\2" + good[20:])
    corpus.cases[-1].path.with_name("broken.db-wal").write_bytes(corpus.random("wal").randbytes(9000))
    corpus.add("scan", "database with journal left over", ".db", good)
    corpus.cases[-1].path.with_name("broken.db-journal").write_bytes(
        b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7" + corpus.random("journal").randbytes(6000))
    corpus.add("scan", "database of nothing", ".db", b"SQLite format 3\0" + bytes(84))
    path = corpus.path("scan", "database of other tables", ".db", True)
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE Other (a)")
    connection.close()


def inflated_png(side):
    """Returns an image whose header declares side x side pixels of 16 bits."""
    return png(side, side, [bytes(64)] * 3, 16)


@functools.cache
def png_bomb():
    """Returns an image of 8000 x 8000 pixels of 16 bits in 130 kB."""
    return png(8000, 8000, [bytes(16000)] * 8000, 16)


def images(corpus):
    for kind in ("picture", "board"):
        source = "picture.png" if kind == "picture" else "pictures/board_0.png"
        damage_file(corpus, kind, source, "PNG", leave_out=("twice",))
        good = (corpus.good / source).read_bytes()
        for name, size in (("65535 x 65535", (65535, 65535)), ("2^31-1 x 1", (2 ** 31 - 1, 1)), ("0 x 0", (0, 0)),
                           ("2^32-1 x 2^32-1", (2 ** 32 - 1, 2 ** 32 - 1))):
            chunk = b"IHDR" + struct.pack(">II", *size) + good[24:29]
            corpus.add(kind, f"PNG of {name}", ".png", good[:12] + chunk + struct.pack(">I", zlib.crc32(chunk)) + good[33:], kind == "picture")
        corpus.add(kind, "PNG bomb", ".png", png_bomb())
        corpus.add(kind, "JPEG named PNG", ".png", b"\xff\xd8\xff\xe0\0\x10JFIF", kind == "picture")
        corpus.add(kind, "PNG of one pixel", ".png", png(1, 1, [b"\0"]))


def in_folder(corpus, kind, source, name, file, content, extension="", refused=False):
    path = corpus.copy(kind, name, source, extension, refused) / file
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def frame_folders(corpus):
    folder = corpus.good / "frames"
    for file in ("nodes.csv", "scan.yaml", "links.g2o", "calibration/camera_1.yaml", "depth/000002.png", "color/000001.jpg"):
        add = lambda name, content: in_folder(corpus, "scan", "frames", f"folder {file.replace('/', ' ')} {name}", file, content)
        good = (folder / file).read_bytes()
        draw = corpus.random("frames", file)
        add("missing", None)
        add("empty", b"")
        add("cut", good[:draw.randrange(len(good) // 4, len(good))])
        add("noise", draw.randbytes(500))
        if file.endswith(".png"):
            add("of 65535 x 65535", inflated_png(65535))
            add("a bomb", png_bomb())
    nodes = (folder / "nodes.csv").read_text()
    for name, old, new in (("path out of the folder", "color/000001.jpg", "../../../../../etc/passwd"),
                           ("device", "color/000001.jpg", "/dev/zero"), ("same node twice", "\n2,", "\n1,"),
                           ("node -1", "\n2,", "\n-1,"), ("node of a word", "\n2,", "\ntwo,"),
                           ("stamp NaN", ",1.7e+09,", ",nan,"), ("node 2^63", "\n2,", f"\n{2 ** 63},")):
        in_folder(corpus, "scan", "frames", f"folder {name}", "nodes.csv", nodes.replace(old, new))
    links = (folder / "links.g2o").read_text()
    for name, text in (("edge to itself", "EDGE_SE3:QUAT 1 1 0 0 0 0 0 0 1 "), ("edge to node 99", "EDGE_SE3:QUAT 1 99 0 0 0 0 0 0 1 "),
                       ("edge of NaN", "EDGE_SE3:QUAT 1 3 nan 0 0 0 0 0 1 ")):
        in_folder(corpus, "scan", "frames", f"folder {name}", "links.g2o", links + text + "1 " * 21 + "\n")


def rigs(corpus):
    folder = corpus.good / "rig"
    for file in ("rig.yaml", "images.csv", "front.png"):
        good = (folder / file).read_bytes()
        draw = corpus.random("rig", file)
        for name, content in (("missing", None), ("empty", b""), ("cut", good[:draw.randrange(len(good) // 4, len(good))]),
                              ("noise", draw.randbytes(500))):
            in_folder(corpus, "rig-folder", "rig", f"{file} {name}", file, content)
    for name, content in (("65535 x 65535", inflated_png(65535)), ("bomb", png_bomb()),
                          ("8 bits", png(48, 32, [bytes(48)] * 32)), ("of another size", png(5, 7, [bytes(10)] * 7, 16))):
        in_folder(corpus, "rig-folder", "rig", f"image {name}", "front.png", content)
    table = (folder / "images.csv").read_text()
    for name, text in (("of an unknown camera", "camera,stamp_s,file\nside,0,front.png\n"), ("without columns", "a,b\n1,2\n"),
                       ("stamp NaN", "camera,stamp_s,file\nfront,nan,front.png\n"), ("device", "camera,stamp_s,file\nfront,0,/dev/zero\n"),
                       ("out of the folder", "camera,stamp_s,file\nfront,0,../../../../../etc/passwd\n"),
                       ("a folder", "camera,stamp_s,file\nfront,0,.\n"), ("10^5 times", table + "front,0.000137,front.png\n" * 100_000)):
        in_folder(corpus, "rig-folder", "rig", f"images {name}", "images.csv", text)


def bags(corpus):
    damage_file(corpus, "bag", "rig.bag", "BAG")
    damage_file(corpus, "bag", "map.bag", "BAG of a map")
    good = (corpus.good / "rig.bag").read_bytes()
    add = lambda name, content, refused=False: corpus.add("bag", f"BAG {name}", ".bag", content, refused)
    add("version 1.1", good.replace(b"#ROSBAG V2.0", b"#ROSBAG V1.1"), True)
    at = good.index(b"\n") + 1
    add("header of 2^32-1", good[:at] + b"\xff" * 4 + good[at + 4:], True)
    for field, size in ((b"index_pos=", 8), (b"chunk_count=", 4), (b"conn_count=", 4), (b"size=", 4), (b"chunk_pos=", 8)):
        at = good.index(field) + len(field)
        for name, value in (("all ones", b"\xff" * size), ("zero", bytes(size)), ("2^31-1", struct.pack("<Q", 2 ** 31 - 1)[:size])):
            add(f"{field.decode()[:-1]} {name}", good[:at] + value + good[at + size:])
    add("compression unknown", good.replace(b"compression=none", b"compression=zzzz"))
    add("compression bz2 by its header alone", good.replace(b"compression=none", b"compression=bz2!"))
    add("images of 65535 rows", good.replace(struct.pack("<II", 32, 48), struct.pack("<II", 65535, 65535)))
    add("images of 0 rows", good.replace(struct.pack("<II", 32, 48), struct.pack("<II", 0, 0)))
    add("other encoding", good.replace(b"16UC1", b"64XC9").replace(b"mono16", b"mono99"))


def ros2_bags(corpus):
    damage_file(corpus, "bag", "rig.mcap", "MCAP")
    damage_file(corpus, "bag", "rig_bag/bag_0.db3", "BAG of ROS 2")
    good = corpus.good / "rig_bag/bag_0.db3"

    def changed(name, statement, *values, refused=False):
        path = corpus.path("bag", f"BAG of ROS 2 {name}", ".db3", refused)
        shutil.copyfile(good, path)
        with contextlib.closing(sqlite3.connect(path)) as database:
            database.execute(statement, values)
            database.commit()

    def transforms(*frames):
        """Returns the CDR of a tf2_msgs/msg/TFMessage: identity transforms of (parent, child)."""
        data = bytearray(struct.pack("<I", len(frames)))
        for pair in frames:
            data += bytes(-len(data) % 4 + 8)
            for frame in pair:
                data += bytes(-len(data) % 4) + struct.pack("<I", len(frame) + 1) + frame.encode() + b"\0"
            data += bytes(-len(data) % 8) + struct.pack("<7d", 0, 0, 0, 0, 0, 0, 1)
        return b"\0\1\0\0" + bytes(data)

    static = "UPDATE messages SET data = ? WHERE topic_id = 1"
    optical = "front_depth_optical_frame"
    changed("TF in a circle", static, transforms(("a", optical), (optical, "a")))
    changed("TF that moves", static, transforms(("base_link", optical), ("map", optical)))
    changed("2^32-1 transforms", static, b"\0\1\0\0\xff\xff\xff\xff")
    for name, head in (("of parameter lists", b"\0\3\0\0"), ("of no encoding", b"\xff\xff\xff\xff")):
        changed(f"messages {name}", "UPDATE messages SET data = ? || substr(data, 5)", head)
    changed("messages of 2^32-1", "UPDATE messages SET data = x'00010000' || zeroblob(8) || x'ffffffff'")
    changed("messages cut", "UPDATE messages SET data = substr(data, 1, length(data) / 2)")
    changed("messages NULL", "UPDATE messages SET data = ''")
    changed("stamps of 2^63-1", "UPDATE messages SET timestamp = 9223372036854775807")
    changed("other encoding", "UPDATE topics SET serialization_format = 'json'")
    changed("without messages", "DROP TABLE messages", refused=True)
    changed("messages of nothing", "UPDATE messages SET topic_id = 99", refused=True)
    changed("10^5 topics", "WITH RECURSIVE n(i) AS (SELECT 100 UNION ALL SELECT i + 1 FROM n LIMIT 100000) "
            "INSERT INTO topics SELECT i, '/t' || i, 'a/msg/B', 'cdr', '' FROM n")


def make(corpus):
    database_links(corpus)
    database_rows(corpus)
    database_blobs(corpus)
    database_file(corpus)
    images(corpus)
    frame_folders(corpus)
    rigs(corpus)
    bags(corpus)
    ros2_bags(corpus)
