// Makes the .mcap files of this folder by encoders that share no code with graspmap: the npm packages
// @mcap/core, @foxglove/rosmsg2-serialization and @foxglove/rosmsg-msgs-common, and the programs zstd
// and lz4. Run in a folder where they are installed: node make_bags.mjs OUT.
import { execFileSync } from "node:child_process";
import { createRequire } from "node:module";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { deflateSync } from "node:zlib";

const require = createRequire(join(process.cwd(), "package.json"));
const { McapWriter, TempBuffer } = require("@mcap/core");
const { MessageWriter } = require("@foxglove/rosmsg2-serialization");
const { ros2humble } = require("@foxglove/rosmsg-msgs-common");

function crc32(bytes) {
  let value = 0xffffffff;
  for (const byte of bytes) {
    value ^= byte;
    for (let bit = 0; bit < 8; ++bit) value = (value >>> 1) ^ (value & 1 ? 0xedb88320 : 0);
  }
  return (value ^ 0xffffffff) >>> 0;
}

// A gray PNG of 16 bits.
function png(width, height, values) {
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const bytes = Buffer.alloc(body.length + 8);
    bytes.writeUInt32BE(data.length, 0);
    body.copy(bytes, 4);
    bytes.writeUInt32BE(crc32(body), body.length + 4);
    return bytes;
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head[8] = 16;
  const rows = Buffer.alloc(height * (1 + 2 * width));
  values.forEach((value, n) =>
    rows.writeUInt16BE(value, Math.floor(n / width) * (1 + 2 * width) + 1 + 2 * (n % width)));
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]),
    chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}

function definitions(type) {
  const found = [];
  const visit = (name) => {
    if (found.some((one) => one.name === name)) return;
    const definition = ros2humble[name.replace("/msg", "")] ?? ros2humble[name];
    found.push({ ...definition, name });
    for (const field of definition.definitions)
      if (field.isComplex) visit(field.type);
  };
  visit(type);
  return found;
}

const header = (frame, sec, nanosec = 0) => ({ stamp: { sec, nanosec }, frame_id: frame });
const millimeters = Array.from({ length: 12 }, (_, n) => 1000 + n);
const identity = { x: 0, y: 0, z: 0, w: 1 };

const info = (frame, sec, nanosec) => ({
  header: header(frame, sec, nanosec), height: 3, width: 4, distortion_model: "plumb_bob",
  d: [0.1, 0.02, 0.001, 0.002, 0.3],
  k: [5, 0, 1.5, 0, 6, 1.25, 0, 0, 1], r: [1, 0, 0, 0, 1, 0, 0, 0, 1],
  p: [7, 0, 1.75, 0, 0, 8, 1, 0, 0, 0, 1, 0], binning_x: 0, binning_y: 0,
  roi: { x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false } });
const image = (sec, nanosec) => ({
  header: header("front_optical", sec, nanosec), height: 3, width: 4, encoding: "16UC1",
  is_bigendian: 0, step: 8, data: new Uint8Array(Uint16Array.from(millimeters).buffer) });
const field = (name, offset, datatype) => ({ name, offset, datatype, count: 1 });
const transform = (frame, x, rotation) => ({
  header: header("base_link", 1), child_frame_id: frame,
  transform: { translation: { x, y: -0.5, z: 1 }, rotation } });

const messages = [
  ["/tf_static", "tf2_msgs/msg/TFMessage", 1, 0, {
    transforms: [transform("front_optical", 0.25, { x: 0, y: 0, z: Math.SQRT1_2, w: Math.SQRT1_2 }),
                 transform("rear_optical", -0.25, identity)] }],
  ["/front/camera_info", "sensor_msgs/msg/CameraInfo", 5, 0, info("front_optical", 5, 0)],
  ["/front/image_raw", "sensor_msgs/msg/Image", 5, 0, image(5, 0)],
  ["/rear/camera_info", "sensor_msgs/msg/CameraInfo", 5, 0, info("rear_optical", 5, 0)],
  ["/rear/image_raw/compressedDepth", "sensor_msgs/msg/CompressedImage", 5, 0, {
    header: header("rear_optical", 5), format: "16UC1; compressedDepth png",
    data: Buffer.concat([Buffer.alloc(12), png(4, 3, millimeters)]) }],
  ["/front/image_raw", "sensor_msgs/msg/Image", 5, 250000000, image(5, 250000000)],
  ["/cloud", "sensor_msgs/msg/PointCloud2", 6, 0, {
    header: header("map", 6, 500000000), height: 1, width: 2,
    fields: [field("x", 0, 7), field("y", 4, 7), field("z", 8, 7), field("score", 12, 7)],
    is_bigendian: false, point_step: 16, row_step: 32, is_dense: true,
    data: new Uint8Array(Float32Array.from([1, 2, 3, 0.5, -1, -2, -3, 0.25]).buffer) }],
];
const latched = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n";

async function write(file, compression) {
  const buffer = new TempBuffer();
  const program = { zstd: ["zstd", "-c"], lz4: ["lz4", "-c"] }[compression];
  const writer = new McapWriter({
    writable: buffer, chunkSize: 1500,
    compressChunk: program && ((bytes) => ({
      compression, compressedData: execFileSync(program[0], program.slice(1), { input: bytes }) })) });
  await writer.start({ profile: "ros2", library: "make_bags.mjs" });
  const channels = {};
  for (const [topic, type, sec, nanosec, message] of messages) {
    if (!(topic in channels)) {
      const schemaId = await writer.registerSchema(
        { name: type, encoding: "ros2msg", data: new Uint8Array() });
      channels[topic] = await writer.registerChannel({
        schemaId, topic, messageEncoding: "cdr",
        metadata: new Map([["offered_qos_profiles", topic === "/tf_static" ? latched : ""]]) });
    }
    const time = BigInt(sec) * 1000000000n + BigInt(nanosec);
    await writer.addMessage({
      channelId: channels[topic], sequence: 0, logTime: time, publishTime: time,
      data: new MessageWriter(definitions(type)).writeMessage(message) });
  }
  await writer.end();
  writeFileSync(file, buffer.get());
}

for (const compression of ["none", "lz4", "zstd"])
  await write(join(process.argv[2], `${compression}.mcap`), compression);
