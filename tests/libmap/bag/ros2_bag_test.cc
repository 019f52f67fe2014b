// Bags of ROS 2: against bags made by other programs (ros2_bags/make_bags.mjs), against bytes
// packed by hand as CDR says, and back and forth.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "libmap/bag/bag_cloud.h"
#include "libmap/bag/bag_reader.h"
#include "libmap/bag/bag_rig.h"
#include "libmap/bag/bag_storage.h"
#include "libmap/bag/bag_writer.h"
#include "libmap/bag/message_codec.h"
#include "libmap/bag/message_encoding.h"
#include "libmap/bag/transform_tree.h"
#include "tests/support/test_support.h"

namespace ros2_bag_test {

namespace fs = std::filesystem;
namespace rm = libmap::ros_message;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_text;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;
using libmap::BagCompression;
using libmap::BagContent;
using libmap::BagFormat;
using libmap::MessageEncoding;
using testing::ElementsAre;
using testing::HasSubstr;

fs::path sample_bag(const std::string& name) {
  return graspmap_test::source_folder() / "tests/libmap/bag/ros2_bags" / name;
}

// Bytes of CDR (XCDR1), written down as the rule is: a number at a multiple of its size, counted
// from behind the four bytes of the head.
class Packed {
 public:
  explicit Packed(bool big_endian)
      : big_endian_(big_endian), bytes_{'\0', big_endian ? '\0' : '\1', '\0', '\0'} {}

  template <typename T>
  Packed& number(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_ += '\0';
    std::string one(reinterpret_cast<const char*>(&value), sizeof(T));
    bytes_ += big_endian_ ? std::string(one.rbegin(), one.rend()) : one;
    return *this;
  }
  Packed& text(const std::string& text) {
    number(static_cast<std::uint32_t>(text.size() + 1));
    bytes_ += text + '\0';
    return *this;
  }
  Packed& header(std::int32_t sec, std::uint32_t nanosec, const std::string& frame) {
    return number(sec).number(nanosec).text(frame);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  bool big_endian_;
  std::string bytes_;
};

std::string packed_transform(bool big_endian) {
  Packed bytes(big_endian);
  bytes.number(std::uint32_t{1}).header(-1, 250'000'000, "base").text("camera");
  for (const double value : {1.5, -2.0, 0.25, 0.0, 0.0, 0.6, 0.8}) bytes.number(value);
  return bytes.bytes();
}

TEST(Cdr, BothByteOrders) {
  for (const bool big_endian : {false, true}) {
    const auto message =
        rm::decode<rm::TFMessage>(MessageEncoding::cdr, packed_transform(big_endian));
    ASSERT_EQ(message.transforms.size(), 1U);
    const rm::TransformStamped& one = message.transforms[0];
    EXPECT_EQ(one.header.stamp.nanoseconds, -750'000'000);
    EXPECT_EQ(one.header.frame_id, "base");
    EXPECT_EQ(one.child_frame_id, "camera");
    EXPECT_EQ(one.transform.translation.y, -2.0);
    EXPECT_EQ(one.transform.rotation.w, 0.8);
  }
}

TEST(Cdr, WrittenAsPacked) {
  rm::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].header = {.stamp = {7'250'000'000}, .frame_id = "base"};
  message.transforms[0].child_frame_id = "camera";
  message.transforms[0].transform.translation.x = 1.5;
  Packed bytes(false);
  bytes.number(std::uint32_t{1}).header(7, 250'000'000, "base").text("camera");
  for (const double value : {1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}) bytes.number(value);
  EXPECT_EQ(rm::encode(MessageEncoding::cdr, message), bytes.bytes());

  // Bytes before numbers, arrays of bytes, and an empty array of doubles without padding.
  rm::CameraInfo info;
  info.header = {.stamp = {0}, .frame_id = "c"};
  info.height = 3;
  info.distortion_model = "x";
  info.k[0] = 5;
  info.roi.do_rectify = true;
  Packed camera(false);
  camera.header(0, 0, "c").number(3U).number(0U).text("x").number(0U);
  for (int n = 0; n < 9 + 9 + 12; ++n) camera.number(n == 0 ? 5.0 : 0.0);
  for (int n = 0; n < 6; ++n) camera.number(0U);
  camera.number(std::uint8_t{1});
  EXPECT_EQ(rm::encode(MessageEncoding::cdr, info), camera.bytes());
}

// A message truncated anywhere, or with any lengths, is an error and takes no memory.
TEST(Cdr, CutOffAndLyingMessages) {
  const std::string whole = packed_transform(false);
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_TRUE(is_error(
        error_of([&] { rm::decode<rm::TFMessage>(MessageEncoding::cdr, whole.substr(0, length)); }),
        {.field = "message"}))
        << length;
  for (const std::size_t at : {4U, 16U})
    for (const char byte : {'\xff', '\x7f'}) {
      std::string lying = whole;
      lying.replace(at, 4, std::string(4, byte));
      EXPECT_TRUE(
          is_error(error_of([&] { rm::decode<rm::TFMessage>(MessageEncoding::cdr, lying); }),
                   {.field = "message"}))
          << at;
    }
  // Messages of another encapsulation (parameter lists), and of no encoding.
  EXPECT_TRUE(is_error(
      error_of([&] { rm::decode<rm::TFMessage>(MessageEncoding::cdr, "\x7f\x7f\x7f\x7f"); }),
      {.field = "message"}));
  EXPECT_TRUE(is_error(error_of([&] { rm::decode<rm::TFMessage>(MessageEncoding::other, whole); }),
                       {.field = "encoding of the messages"}));
}

TEST(Cdr, CyclicTransforms) {
  Packed bytes(false);
  bytes.number(std::uint32_t{2});
  for (const auto& [parent, child] : {std::pair{"a", "b"}, {"b", "a"}}) {
    bytes.header(0, 0, parent).text(child);
    for (const double value : {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}) bytes.number(value);
  }
  libmap::TransformTree tree;
  libmap::add_transforms(MessageEncoding::cdr, bytes.bytes(), tree);
  EXPECT_EQ(error_of([&] { tree.root_of("a"); }).context().value, "a");
}

TEST(Ros2Bag, OtherProgramsBagsAreReadAlike) {
  for (const char* name : {"none.mcap", "lz4.mcap", "zstd.mcap"}) {
    const fs::path bag = sample_bag(name);
    const libmap::BagListing listing = libmap::list_bag(bag);
    ASSERT_EQ(listing.topics.size(), 6U) << name;
    EXPECT_EQ(listing.messages, 7U);
    EXPECT_EQ(listing.start_s, 1.0);
    EXPECT_EQ(listing.end_s, 6.0);
    EXPECT_EQ(listing.topics[0].name, "/tf_static");
    EXPECT_TRUE(listing.topics[0].latching);
    EXPECT_EQ(listing.topics[2].type, "sensor_msgs/msg/Image");
    EXPECT_FALSE(listing.topics[2].latching);
    EXPECT_EQ(listing.topics[2].messages, 2U);

    const libmap::BagCloudResult cloud = libmap::read_bag_cloud(bag);
    EXPECT_EQ(cloud.frame, "map");
    EXPECT_EQ(cloud.stamp_s, 6.5);
    ASSERT_EQ(cloud.cloud.size(), 2U);
    EXPECT_EQ(cloud.cloud.positions[1], Eigen::Vector3d(-1, -2, -3));
    EXPECT_THAT(cloud.cloud.find_field("score")->values, ElementsAre(0.5, 0.25));

    const libmap::BagRigPlan plan = libmap::plan_bag_rig(bag, {});
    EXPECT_THAT(plan.topics, ElementsAre("/front/image_raw", "/rear/image_raw/compressedDepth"));
    const libmap::Camera& front = plan.rig.cameras[0].camera;
    EXPECT_EQ(front.fy, 6);
    EXPECT_THAT(front.distortion, ElementsAre(0.1, 0.02, 0.001, 0.002, 0.3));
    EXPECT_EQ(front.base_from_camera.translation(), Eigen::Vector3d(0.25, -0.5, 1));
    EXPECT_NEAR(front.base_from_camera.linear()(1, 0), 1.0, 1e-12);
    const fs::path folder = scratch_folder() / name;
    fs::create_directory(folder);
    EXPECT_EQ(libmap::export_bag_rig(bag, plan, folder).images, 3U);
    for (const libmap::RigImage& image : libmap::list_rig_images(folder, plan.rig)) {
      const auto units = libmap::read_rig_units(image, plan.rig.cameras[image.camera]);
      ASSERT_EQ(units.pixels.size(), 12U);
      EXPECT_EQ(units.pixels[11], 1011);
    }
  }
}

libmap::PointCloud small_cloud() {
  libmap::PointCloud cloud;
  for (int n = 0; n < 20; ++n) cloud.positions.emplace_back(0.25 * n, -n, 0.5);
  std::vector<double>& values = cloud.add_field("score", libmap::ScalarType::float32).values;
  for (std::size_t n = 0; n < values.size(); ++n) values[n] = 0.125 * static_cast<double>(n);
  return cloud;
}

BagContent sample_content() {
  BagContent content{.stamp_s = 1600000000.25};
  content.transforms = {{"map", "terrain", libmap::make_pose_from_rpy({1, 2, 3}, {0, 0, 1})}};
  content.clouds = {{"/map", "terrain", small_cloud()}};
  content.targets = {{"/footholds",
                      "/foothold_poses",
                      "terrain",
                      0.08,
                      {{{1, 2, 3}, {0, 0, -1}, {255, 0, 51}, "1: 0.98"}}}};
  libmap::BagGrid grid{"/grid", "/occupancy", "terrain", 0.5, {-1, 2}, 3, 2, {}, {}};
  grid.layers = {{"elevation", {0, 1, 2, 3, 4, std::nanf("")}}};
  grid.occupancy = {0.0F, 0.25F, 1.0F, 0.5F, 0.0F, std::nanf("")};
  content.grids = {grid};
  return content;
}

struct Written {
  BagFormat format;
  BagCompression compression;
};
class Ros2Formats : public testing::TestWithParam<Written> {
 protected:
  static fs::path write(const std::string& name) {
    const bool folder = GetParam().format == BagFormat::sqlite;
    const fs::path path = scratch_folder() / (folder ? name : name + ".mcap");
    if (folder) fs::create_directory(path);
    libmap::write_bag(path, GetParam().format, sample_content(), GetParam().compression);
    return path;
  }
};
INSTANTIATE_TEST_SUITE_P(, Ros2Formats,
                         testing::Values(Written{BagFormat::sqlite, BagCompression::none},
                                         Written{BagFormat::mcap, BagCompression::none},
                                         Written{BagFormat::mcap, BagCompression::lz4},
                                         Written{BagFormat::mcap, BagCompression::zstd}));

TEST_P(Ros2Formats, ContentComesBackAndBytesAreTheSame) {
  const fs::path bag = write("a");
  const libmap::BagListing listing = libmap::list_bag(bag);
  ASSERT_EQ(listing.topics.size(), 6U);
  EXPECT_EQ(listing.start_s, 1600000000.25);
  for (const libmap::BagTopic& topic : listing.topics) EXPECT_TRUE(topic.latching) << topic.name;
  EXPECT_EQ(listing.topics[4].type, "grid_map_msgs/msg/GridMap");
  const libmap::BagCloudResult cloud = libmap::read_bag_cloud(bag);
  EXPECT_EQ(cloud.frame, "terrain");
  EXPECT_EQ(cloud.cloud.positions, small_cloud().positions);
  EXPECT_EQ(cloud.cloud.fields, small_cloud().fields);
  const fs::path again = write("b");
  for (const fs::path& file : libmap::files_of_bag(bag)) {
    const fs::path other = fs::is_directory(again) ? again / file.filename() : again;
    EXPECT_TRUE(read_text(file) == read_text(other)) << file;
  }
}

// A truncated file is an error that names the file. Damaged bytes are an error or can be read.
TEST_P(Ros2Formats, DamagedFiles) {
  const fs::path whole_bag = write("a");
  const fs::path source = libmap::files_of_bag(whole_bag).back();
  const std::string whole = read_text(source);
  const fs::path bag = scratch_folder() / "damaged";
  for (int n = 0; n < 60; ++n) {
    std::string bytes = whole;
    const auto place = [&] {
      return static_cast<std::size_t>(
          graspmap_test::uniform(0, static_cast<double>(whole.size() - 1)));
    };
    const bool is_cut = n % 3 == 0;
    if (is_cut)
      bytes.resize(place());
    else
      for (int flip = 0; flip < 8; ++flip) bytes[place()] ^= static_cast<char>(1 << (flip % 8));
    write_text(bag, bytes);
    try {
      libmap::list_bag(bag);
      libmap::read_bag_cloud(bag);
      EXPECT_FALSE(is_cut) << bytes.size();
    } catch (const libmap::Error& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      EXPECT_TRUE(error.context().file.starts_with(bag.string())) << error.what();
    }
  }
}

// Position of a cell by grid_map's formula: index 0, 0 is the corner of largest x and y.
TEST(GridMap, CellsAreWhereGridMapLooksForThem) {
  libmap::BagGrid grid = sample_content().grids[0];
  const rm::GridMap map = libmap::encode_grid_map(grid, {});
  const rm::OccupancyGrid occupancy = libmap::encode_occupancy_grid(grid, {});
  ASSERT_EQ(map.data.size(), 1U);
  const auto& dim = map.data[0].layout.dim;
  ASSERT_EQ(dim.size(), 2U);
  EXPECT_EQ(dim[0].label, "column_index");
  EXPECT_EQ(dim[1].label, "row_index");
  EXPECT_EQ(dim[0].stride, 6U);
  EXPECT_EQ(dim[1].stride, dim[1].size);
  EXPECT_EQ(map.info.length_x, 1.5);
  EXPECT_THAT(map.basic_layers, ElementsAre("elevation"));
  for (std::size_t i = 0; i < dim[1].size; ++i)
    for (std::size_t j = 0; j < dim[0].size; ++j) {
      const double x = map.info.pose.position.x + map.info.length_x / 2 -
                       (static_cast<double>(i) + 0.5) * map.info.resolution;
      const double y = map.info.pose.position.y + map.info.length_y / 2 -
                       (static_cast<double>(j) + 0.5) * map.info.resolution;
      const auto column = static_cast<std::size_t>((x - grid.corner_m.x()) / grid.cell_m);
      const auto row = static_cast<std::size_t>((y - grid.corner_m.y()) / grid.cell_m);
      const float wanted = grid.layers[0].values[row * grid.columns + column];
      const float found = map.data[0].data[j * dim[1].size + i];
      EXPECT_TRUE(found == wanted || (std::isnan(found) && std::isnan(wanted))) << i << ' ' << j;
      EXPECT_EQ(static_cast<std::size_t>((x - occupancy.info.origin.position.x) / 0.5), column);
    }
  EXPECT_EQ(occupancy.info.width, 3U);
  EXPECT_EQ(occupancy.info.origin.position.y, 2.0);
  EXPECT_THAT(occupancy.data, ElementsAre(0, 25, 100, 50, 0, -1));
}

std::string metadata(const std::string& version, const std::string& path,
                     const std::string& quality, const std::string& more = "") {
  return "rosbag2_bagfile_information:\n  version: " + version +
         "\n  storage_identifier: sqlite3\n  topics_with_message_count:\n    - topic_metadata:\n"
         "        name: /map\n        offered_qos_profiles: " +
         quality + "\n  relative_file_paths:\n    - " + path + "\n" + more;
}

TEST(Ros2Bag, MetadataOfAllVersions) {
  const fs::path file = scratch_folder() / "metadata.yaml";
  const auto names = [&](const std::string& text) {
    write_text(file, text);
    return libmap::read_rosbag2_metadata(file);
  };
  const std::string none = "  compression_format: \"\"\n  compression_mode: \"\"\n";
  EXPECT_THAT(names(metadata("2", "run/run_0.db3", "\"\"")), ElementsAre("run_0.db3"));
  EXPECT_THAT(names(metadata("4", "run_0.db3", "\"- history: 1\\n\"", none)),
              ElementsAre("run_0.db3"));
  EXPECT_THAT(names(metadata("9", "run_0.mcap", "\n          - history: keep_last", none)),
              ElementsAre("run_0.mcap"));
  const auto said = [&](const std::string& text) { return error_of([&] { names(text); }); };
  EXPECT_EQ(said("a: 1\n").context().field, "rosbag2_bagfile_information");
  EXPECT_EQ(said("- 1\n").context().field, "rosbag2_bagfile_information");
  EXPECT_EQ(said("a: [\n").context().file, file.string());
  EXPECT_EQ(
      said(metadata("5", "a.db3.zstd", "\"\"", "  compression_format: zstd\n")).context().field,
      "compression_format");
  EXPECT_THAT(said(metadata("5", "..", "\"\"")).context().field, HasSubstr("relative_file_paths"));
  EXPECT_THAT(said(metadata("5", "[a]", "\"\"")).context().field, HasSubstr("relative_file_paths"));
  fs::remove(file);
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::list_bag(scratch_folder()); }), {.file = "metadata.yaml"}));
}

TEST(Ros2Bag, SplitRecordingsAreOneBag) {
  const fs::path folder = scratch_folder() / "run";
  fs::create_directory(folder);
  fs::copy(sample_bag("none.mcap"), folder / "run_0.mcap");
  fs::copy(sample_bag("zstd.mcap"), folder / "run_1.mcap");
  write_text(folder / "metadata.yaml",
             "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap, run_1.mcap]\n");
  EXPECT_TRUE(libmap::is_bag_path(folder));
  const libmap::BagListing listing = libmap::list_bag(folder);
  EXPECT_EQ(listing.topics.size(), 6U);
  EXPECT_EQ(listing.messages, 14U);
  EXPECT_EQ(libmap::read_bag_cloud(folder).messages, 2U);
  fs::remove(folder / "run_1.mcap");
  EXPECT_EQ(error_of([&] { libmap::list_bag(folder); }).context().file,
            (folder / "run_1.mcap").string());
}

// Databases that are not bags, or bags with wrong content.
TEST(Ros2Bag, ForeignDatabases) {
  const fs::path path = scratch_folder() / "a.db3";
  const auto said = [&](const char* statements) {
    fs::remove(path);
    SQLite::Database(path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec(statements);
    return error_of([&] { libmap::list_bag(path); });
  };
  EXPECT_EQ(said("CREATE TABLE other(id)").context().field, "table topics");
  EXPECT_EQ(said("CREATE TABLE topics(id, name, type); CREATE TABLE messages(id)").context().field,
            "column serialization_format of table topics");
  EXPECT_EQ(said("CREATE TABLE topics(id, name, type, serialization_format);"
                 "CREATE VIEW messages AS SELECT 1 AS topic_id, 2 AS timestamp, 3 AS data")
                .context()
                .field,
            "table messages");
  EXPECT_EQ(said("CREATE TABLE topics(id, name, type, serialization_format);"
                 "CREATE TABLE messages(topic_id, timestamp, data);"
                 "INSERT INTO messages VALUES (7, 0, x'00')")
                .context()
                .value,
            "7");
  write_text(path, "no database");
  EXPECT_EQ(error_of([&] { libmap::list_bag(path); }).context().file, path.string());
}

// A chunk takes memory for its actual size, not for its declared size.
TEST(Mcap, ChunksThatPromiseMore) {
  const std::string text(1000, 'x');
  for (const std::string compression : {"", "lz4", "zstd"}) {
    const std::string bytes = libmap::compress_chunk(compression, text);
    EXPECT_EQ(libmap::decompress_chunk(compression, bytes, 1000), text);
    const auto fields_of = [&](std::string_view chunk, std::uint64_t size) {
      return error_of([&] { libmap::decompress_chunk(compression, chunk, size); }).context();
    };
    for (const std::uint64_t size : {1001UL, 1UL << 29}) {
      EXPECT_EQ(fields_of(bytes, size).field, "decompressed chunk");
      EXPECT_EQ(fields_of(bytes, size).value, "1000 bytes");
      EXPECT_EQ(fields_of(bytes, size).bound, std::to_string(size) + " bytes");
    }
    EXPECT_EQ(fields_of(bytes, ~0UL).field, "size of a chunk");
    EXPECT_EQ(fields_of(bytes, ~0UL).bound, "<= 1 GiB");
    // The libraries notice chunks that are larger than declared, and truncated chunks.
    const std::string field = compression.empty() ? "decompressed chunk" : compression + " chunk";
    EXPECT_EQ(fields_of(bytes, 999).field, field);
    EXPECT_EQ(fields_of(std::string_view(bytes).substr(0, bytes.size() - 1), 1000).field, field);
  }
  EXPECT_EQ(error_of([&] { libmap::decompress_chunk("bz2", text, 1000); }).context().value, "bz2");
}

TEST(Ros2Bag, WhatTheFormatsCannotHold) {
  const auto said = [&](BagFormat format, BagCompression compression, double stamp_s) {
    const fs::path path = scratch_folder() / (format == BagFormat::sqlite ? "" : "a.mcap");
    return error_of([&] { libmap::write_bag(path, format, {.stamp_s = stamp_s}, compression); });
  };
  EXPECT_EQ(said(BagFormat::mcap, BagCompression::bz2, 1.0).context().value, "bz2");
  EXPECT_EQ(said(BagFormat::sqlite, BagCompression::lz4, 1.0).context().bound, "none");
  EXPECT_EQ(said(BagFormat::mcap, BagCompression::none, 2147483648.0).context().field, "stamp");
  EXPECT_TRUE(
      is_error(error_of([] { libmap::write_bag("/dev/full", BagFormat::mcap, sample_content()); }),
               {.file = "/dev/full", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(libmap::bag_format_of("a.MCAP"), BagFormat::mcap);
  EXPECT_EQ(libmap::bag_format_of("folder"), BagFormat::sqlite);
  EXPECT_EQ(error_of([] { libmap::bag_format_of("a.zip"); }).context().value, ".zip");
}

TEST(Ros2Bag, DefinitionsNameAllTypes) {
  const std::string text = rm::definition_of<rm::MarkerArray>();
  EXPECT_TRUE(text.starts_with("visualization_msgs/Marker[] markers\n"));
  for (const char* part :
       {"MSG: visualization_msgs/Marker\nstd_msgs/Header header\nstring ns\nint32 id\nint32 type\n",
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
        "MSG: sensor_msgs/CompressedImage\n", "visualization_msgs/UVCoordinate[] uv_coordinates\n"})
    EXPECT_THAT(text, HasSubstr(part));
  // Each definition is contained once.
  EXPECT_EQ(text.find("MSG: std_msgs/Header"), text.rfind("MSG: std_msgs/Header"));
  EXPECT_THAT(rm::definition_of<rm::CameraInfo>(), HasSubstr("float64[] d\nfloat64[9] k\n"));
}

}  // namespace ros2_bag_test
