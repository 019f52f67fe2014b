#include "libmap/scan/rtabmap_writer.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/calibration_codec.h"
#include "libmap/scan/rtabmap_rows.h"
#include "libmap/scan/rtabmap_schema.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

template <typename T>
std::string to_optional_blob(const std::optional<T>& value) {
  return value ? to_blob(*value) : std::string();
}

// SQLite's own errors as ours: the disk, not the input, went wrong.
template <typename Action>
auto guarded(const fs::path& path, const Action& action) {
  try {
    return action();
  } catch (const SQLite::Exception& error) {
    throw Error(std::string("cannot be written: ") + error.what(), {.file = path.string()},
                ErrorKind::failed);
  }
}

StereoCalibrationRecord record_of(const StereoCamera& camera) {
  StereoCalibrationRecord record;
  record.left = record_of(camera.left);
  record.right = record_of(camera.right);
  record.version = record.left.version;
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = camera.right_from_left.linear();
  const Eigen::Vector3d translation = camera.right_from_left.translation();
  record.r.assign(rotation.data(), rotation.data() + 9);
  record.t.assign(translation.data(), translation.data() + 3);
  // A rectified pair: the baseline stands in the right camera's projection.
  if (record.right.p.size() == 12) record.right.p[3] = -camera.right.fx * camera.baseline_m;
  return record;
}

std::string encode_cameras(const RgbdFrame& frame) {
  Calibration calibration;
  for (const StereoCamera& pair : frame.stereo) calibration.stereo.push_back(record_of(pair));
  // Of stereo pairs they are the left ones.
  if (calibration.stereo.empty())
    for (const Camera& camera : frame.cameras) calibration.cameras.push_back(record_of(camera));
  return calibration.empty() ? std::string() : encode_calibration(calibration);
}

constexpr const char* stamp_as_date = "COALESCE(DATETIME(?, 'unixepoch'), '1970-01-01 00:00:00')";

}  // namespace

std::string encode_depth(const DepthImage& depth, DepthFormat format) {
  if (depth.empty()) return {};
  switch (format) {
    case DepthFormat::rvl:
      return encode_rvl(to_millimeters(depth));
    case DepthFormat::png16:
      return encode_png(to_millimeters(depth));
    case DepthFormat::float_png:
      return encode_float_png(depth);
  }
  return {};
}

struct RtabmapWriter::Parts {
  fs::path path;
  RtabmapWriterOptions options;
  SQLite::Database database;
  std::optional<SQLite::Statement> node_statement;
  std::optional<SQLite::Statement> data_statement;
  std::optional<SQLite::Statement> link_statement;
  int last_node = 0;
  double latest_stamp_s = 0.0;

  Parts(const fs::path& file, const RtabmapWriterOptions& given)
      : path(file),
        options(given),
        database(file.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE) {}

  void begin();
  void write_node(const GraphNode& node);
  void write_data(const RgbdFrame& frame);
  void write_admin();
  std::string encode(const auto& image) const;
  std::string encode_right_or_depth(const RgbdFrame& frame) const;
};

void RtabmapWriter::Parts::begin() {
  // The file is of use as a whole only: nothing to roll back to, no journal to leave.
  database.exec(
      "PRAGMA page_size = 4096; PRAGMA encoding = 'UTF-8'; PRAGMA locking_mode = EXCLUSIVE; "
      "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA temp_store = MEMORY; "
      "BEGIN EXCLUSIVE;");
  database.exec(rtabmap_table_statements());
  database.exec(rtabmap_index_statements());
  node_statement.emplace(database,
                         std::string("INSERT INTO Node (id, map_id, weight, stamp, pose, "
                                     "ground_truth_pose, velocity, label, gps, time_enter) "
                                     "VALUES (?,?,?,?,?,?,?,?,?,") +
                             stamp_as_date + ")");
  data_statement.emplace(database,
                         "INSERT INTO Data (id, image, depth, calibration, cell_size, "
                         "view_point_x, view_point_y, view_point_z) VALUES (?,?,?,?,0,0,0,0)");
  link_statement.emplace(database, rtabmap_link_insert);
}

void RtabmapWriter::Parts::write_node(const GraphNode& node) {
  // An unknown odometry pose is all zero, an unknown true one NULL, as RTAB-Map writes them.
  const std::string pose =
      node.odometry_from_base ? to_blob(*node.odometry_from_base) : null_pose_blob();
  const std::string truth = to_optional_blob(node.truth_from_base);
  const std::string velocity = to_optional_blob(node.velocity);
  const std::string gps = to_optional_blob(node.gps);
  SQLite::Statement& statement = *node_statement;
  statement.bind(1, node.id);
  statement.bind(2, node.session);
  statement.bind(3, node.weight);
  statement.bind(4, node.stamp_s);
  bind_blob(statement, 5, pose);
  bind_blob(statement, 6, truth);
  bind_blob(statement, 7, velocity);
  if (!node.label.empty()) statement.bind(8, node.label);
  bind_blob(statement, 9, gps);
  statement.bind(10, node.stamp_s);
  run_once(statement);
}

std::string RtabmapWriter::Parts::encode(const auto& image) const {
  if (image.empty()) return {};
  return options.color == ImageFormat::png ? encode_png(image) : encode_jpeg(image);
}

std::string RtabmapWriter::Parts::encode_right_or_depth(const RgbdFrame& frame) const {
  if (!frame.right.empty()) return encode(frame.right);
  return encode_depth(frame.depth, options.depth);
}

void RtabmapWriter::Parts::write_data(const RgbdFrame& frame) {
  const std::string image = encode(frame.color);
  const std::string depth = encode_right_or_depth(frame);
  const std::string calibration = encode_cameras(frame);
  SQLite::Statement& statement = *data_statement;
  statement.bind(1, frame.node);
  bind_blob(statement, 2, image);
  bind_blob(statement, 3, depth);
  bind_blob(statement, 4, calibration);
  run_once(statement);
}

void RtabmapWriter::Parts::write_admin() {
  SQLite::Statement info(
      database, std::string("INSERT INTO Info VALUES (0, ?, 0, 0, 0, '', ") + stamp_as_date + ")");
  info.bind(1, last_node);
  info.bind(2, latest_stamp_s);
  info.exec();
  SQLite::Statement admin(
      database,
      std::string("INSERT INTO Admin (version, time_enter) VALUES (?,") + stamp_as_date + ")");
  admin.bind(1, rtabmap_schema_version);
  admin.bind(2, latest_stamp_s);
  admin.exec();
}

RtabmapWriter::RtabmapWriter(const fs::path& path, const RtabmapWriterOptions& options) {
  // Bytes of an earlier attempt must not be taken for a database.
  write_text(path, {});
  guarded(path, [&] {
    parts_ = std::make_unique<Parts>(path, options);
    parts_->begin();
  });
}

RtabmapWriter::~RtabmapWriter() = default;

void RtabmapWriter::add_node(const GraphNode& node, const RgbdFrame& frame) {
  guarded(parts_->path, [&] {
    parts_->write_node(node);
    parts_->write_data(frame);
  });
  parts_->last_node = std::max(parts_->last_node, node.id);
  parts_->latest_stamp_s = std::max(parts_->latest_stamp_s, node.stamp_s);
}

void RtabmapWriter::add_link(const PoseLink& link) {
  guarded(parts_->path, [&] { insert_link(*parts_->link_statement, link); });
}

void RtabmapWriter::finish() {
  guarded(parts_->path, [&] {
    parts_->write_admin();
    // Last: they would put the present time into the rows.
    parts_->database.exec(rtabmap_trigger_statements());
    parts_->node_statement.reset();
    parts_->data_statement.reset();
    parts_->link_statement.reset();
    parts_->database.exec("COMMIT");
  });
  parts_.reset();
}

}  // namespace libmap
