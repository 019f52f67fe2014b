"""Reads and writes bags with Debian's python3-rosbag, which shares no code with librosbag.

rosbag_check.py show BAG        prints its messages as JSON
rosbag_check.py copy BAG COPY   copies it, compressed with bz2, with images in the other byte order
"""
import json
import struct
import sys

import rosbag


def first_point(message):
    kinds = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 8: "d"}
    return {f.name: struct.unpack_from("<" + kinds[f.datatype], message.data, f.offset)[0]
            for f in message.fields}


def as_json(message):
    kind = message._type
    if kind == "sensor_msgs/PointCloud2":
        return {"frame": message.header.frame_id, "points": message.width * message.height,
                "step": message.point_step, "first": first_point(message),
                "fields": [[f.name, f.offset, f.datatype, f.count] for f in message.fields]}
    if kind == "geometry_msgs/PoseArray":
        return {"frame": message.header.frame_id,
                "poses": [[p.position.x, p.position.y, p.position.z, p.orientation.x,
                           p.orientation.y, p.orientation.z, p.orientation.w]
                          for p in message.poses]}
    if kind == "visualization_msgs/MarkerArray":
        return {"markers": [[m.ns, m.id, m.type, m.header.frame_id] for m in message.markers]}
    return {}


def show(path):
    topics = {}
    with rosbag.Bag(path) as bag:
        for connection in bag._get_connections():
            topics[connection.topic] = {"type": connection.datatype, "md5sum": connection.md5sum,
                                        "latching": int(connection.header["latching"])}
        for topic, message, stamp in bag.read_messages():
            topics[topic].update(as_json(message), stamp=stamp.to_sec())
    print(json.dumps(topics))


def copy(path, target):
    with rosbag.Bag(path) as bag, rosbag.Bag(target, "w", compression="bz2") as out:
        for topic, message, stamp in bag.read_messages():
            if message._type == "sensor_msgs/Image":
                data = bytearray(message.data)
                assert message.encoding == "16UC1"
                data[0::2], data[1::2] = data[1::2], data[0::2]
                message.data = bytes(data)
                message.is_bigendian = 1
            out.write(topic, message, stamp)


if __name__ == "__main__":
    {"show": show, "copy": copy}[sys.argv[1]](*sys.argv[2:])
