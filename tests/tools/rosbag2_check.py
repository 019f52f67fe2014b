"""Reads and writes bags of ROS 2 without ROS and graspmap, with Python's SQLite and its own CDR (XCDR1).

  copy IN OUT   writes a folder of .db3 files as big-endian CDR, with metadata of version 9, in two files
  show IN       prints the messages of a folder that graspmap wrote, as JSON
"""
import json
import pathlib
import sqlite3
import struct
import sys

# Fields of the published message definitions: [] is a sequence, [N] an array.
TYPES = {
    "Time": "i:sec I:nanosec",
    "Header": "Time:stamp s:frame_id",
    "Point": "d:x d:y d:z",
    "Quaternion": "d:x d:y d:z d:w",
    "Pose": "Point:position Quaternion:orientation",
    "Transform": "Point:translation Quaternion:rotation",
    "TransformStamped": "Header:header s:child_frame_id Transform:transform",
    "tf2_msgs/msg/TFMessage": "TransformStamped[]:transforms",
    "geometry_msgs/msg/PoseArray": "Header:header Pose[]:poses",
    "sensor_msgs/msg/Image": "Header:header I:height I:width s:encoding B:is_bigendian I:step B[]:data",
    "Region": "I:x_offset I:y_offset I:height I:width ?:do_rectify",
    "sensor_msgs/msg/CameraInfo": "Header:header I:height I:width s:distortion_model d[]:d d[9]:k d[9]:r "
                                  "d[12]:p I:binning_x I:binning_y Region:roi",
    "PointField": "s:name I:offset B:datatype I:count",
    "sensor_msgs/msg/PointCloud2": "Header:header I:height I:width PointField[]:fields ?:is_bigendian "
                                   "I:point_step I:row_step B[]:data ?:is_dense",
    "Color": "f:r f:g f:b f:a",
    "Compressed": "Header:header s:format B[]:data",
    "UV": "f:u f:v",
    "MeshFile": "s:filename B[]:data",
    "Marker": "Header:header s:ns i:id i:type i:action Pose:pose Point:scale Color:color Time:lifetime "
              "?:frame_locked Point[]:points Color[]:colors s:texture_resource Compressed:texture UV[]:uv "
              "s:text s:mesh_resource MeshFile:mesh_file ?:mesh_use_embedded_materials",
    "visualization_msgs/msg/MarkerArray": "Marker[]:markers",
    "MapMetaData": "Time:map_load_time f:resolution I:width I:height Pose:origin",
    "nav_msgs/msg/OccupancyGrid": "Header:header MapMetaData:info b[]:data",
    "Dimension": "s:label I:size I:stride",
    "Layout": "Dimension[]:dim I:data_offset",
    "Array": "Layout:layout f[]:data",
    "GridMapInfo": "d:resolution d:length_x d:length_y Pose:pose",
    "grid_map_msgs/msg/GridMap": "Header:header GridMapInfo:info s[]:layers s[]:basic_layers Array[]:data "
                                 "H:outer_start_index H:inner_start_index",
}


def fields_of(name):
    return [field.split(":") for field in TYPES[name].split()]


class Unpacker:
    def __init__(self, data):
        assert data[:4] == b"\0\1\0\0", data[:4]
        self.data, self.at = data[4:], 0

    def number(self, code, count=1):
        size = struct.calcsize(code)
        if count:
            self.at += -self.at % size
        values = struct.unpack_from(f"<{count}{code}", self.data, self.at)
        self.at += size * count
        return values

    def value(self, kind):
        if kind.endswith("]"):
            kind, count = kind[:-1].split("[")
            count = int(count) if count else self.number("I")[0]
            return list(self.number(kind, count)) if len(kind) == 1 and kind != "s" else [
                self.value(kind) for _ in range(count)]
        if kind == "s":
            text = bytes(self.number("B", self.number("I")[0]))
            assert text.endswith(b"\0"), text
            return text[:-1].decode()
        if len(kind) == 1:
            return self.number(kind)[0]
        return {name: self.value(part) for part, name in fields_of(kind)}


class BigEndianPacker:
    def __init__(self):
        self.data = bytearray()

    def number(self, code, *values):
        if values:
            self.data += b"\0" * (-len(self.data) % struct.calcsize(code))
        self.data += struct.pack(f">{len(values)}{code}", *values)

    def value(self, kind, value):
        if kind.endswith("]"):
            kind, count = kind[:-1].split("[")
            if not count:
                self.number("I", len(value))
            if len(kind) == 1 and kind != "s":
                self.number(kind, *value)
            else:
                for one in value:
                    self.value(kind, one)
        elif kind == "s":
            self.number("I", len(value) + 1)
            self.data += value.encode() + b"\0"
        elif len(kind) == 1:
            self.number(kind, value)
        else:
            for part, name in fields_of(kind):
                self.value(part, value[name])


def decode(name, data):
    unpacker = Unpacker(data)
    value = unpacker.value(name)
    assert len(unpacker.data) == unpacker.at, (name, len(unpacker.data), unpacker.at)
    return value


def rows(folder):
    with sqlite3.connect(f"file:{folder}/bag_0.db3?mode=ro", uri=True) as database:
        assert database.execute("SELECT * FROM schema").fetchall() == [(3, "humble")]
        yield from database.execute(
            "SELECT name, type, serialization_format, offered_qos_profiles, timestamp, data FROM messages "
            "JOIN topics ON topics.id = topic_id ORDER BY timestamp, messages.id")


def show(folder):
    topics = {}
    for name, kind, encoding, quality, stamp, data in rows(folder):
        assert encoding == "cdr"
        topics[name] = {"type": kind, "latched": "durability: 1\n" in quality, "stamp": stamp,
                        "message": decode(kind, data)}
    print(json.dumps(topics))


def copy(source, target):
    folder = pathlib.Path(target)
    folder.mkdir()
    messages = list(rows(source))
    middle = len(messages) // 2
    for n, part in enumerate((messages[:middle], messages[middle:])):
        with sqlite3.connect(folder / f"run_{n}.db3") as database:
            # Format of rosbag2 since Iron: more columns, and no index.
            database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT "
                             "NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL, "
                             "type_description_hash TEXT NOT NULL)")
            database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
                             "timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
            ids = {}
            for name, kind, _, _, stamp, data in part:
                if name not in ids:
                    ids[name] = len(ids) + 10
                    database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '', 'RIHS01_0')",
                                     (ids[name], name, kind))
                packer = BigEndianPacker()
                packer.value(kind, decode(kind, data))
                database.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                                 (ids[name], stamp, b"\0\0\0\0" + bytes(packer.data)))
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: sqlite3\n"
        "  relative_file_paths:\n    - run_0.db3\n    - run_1.db3\n  compression_format: ''\n"
        "  compression_mode: ''\n  custom_data: ~\n  ros_distro: jazzy\n")


if __name__ == "__main__":
    {"show": show, "copy": copy}[sys.argv[1]](*sys.argv[2:])
