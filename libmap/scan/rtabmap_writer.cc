#include "libmap/scan/rtabmap_writer.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/calibration_codec.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_schema.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Nothing becomes NULL. `blob` lives until the statement has run.
void bind_blob(SQLite::Statement& statement, int index, const std::string& blob) {
  if (blob.empty())
    statement.bind(index);
  else
    statement.bindNoCopy(index, blob.data(), static_cast<int>(blob.size()));
}

template <typename T>
std::string to_optional_blob(const std::optional<T>& value) {
  return value ? to_blob(*value) : std::string();
}

void run_once(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
  statement.clearBindings();
}

std::string node_field(int id) { return "node " + std::to_string(id); }

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

void require_finite(const Pose& pose, const std::string& field) {
  if (!pose.matrix().allFinite()) throw Error("is not finite", {.field = field});
}

void check_node(const GraphNode& node) {
  const std::string field = node_field(node.id);
  if (node.id <= 0)
    throw Error("no number of a node",
                {.field = field, .value = std::to_string(node.id), .bound = "> 0"});
  if (!std::isfinite(node.stamp_s)) throw Error("is not finite", {.field = field + ": stamp"});
  if (node.odometry_from_base) require_finite(*node.odometry_from_base, field + ": odometry pose");
  if (node.truth_from_base) require_finite(*node.truth_from_base, field + ": ground-truth pose");
}

void check_frame(const GraphNode& node, const RgbdFrame& frame) {
  const std::string field = node_field(node.id);
  if (frame.node != node.id)
    throw Error("the frame is another node's", {.field = field, .value = node_field(frame.node)});
  if (!frame.depth.empty() && !frame.right.empty())
    throw Error("has both a depth image and a right image: the format contains one of them",
                {.field = field});
  if (!frame.stereo.empty() && !frame.cameras.empty() &&
      frame.cameras.size() != frame.stereo.size())
    throw Error("a stereo frame has no cameras but its left ones",
                {.field = field + ": cameras",
                 .value = std::to_string(frame.cameras.size()),
                 .bound = std::to_string(frame.stereo.size())});
  try {
    for (const Camera& camera : frame.cameras) camera.check();
    for (const StereoCamera& pair : frame.stereo) {
      pair.left.check();
      pair.right.check();
    }
  } catch (const Error& error) {
    ErrorContext context = error.context();
    context.field = field + ": camera " + context.field;
    throw Error(error.reason(), context);
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

bool is_one_way(const PoseLink& link) {
  return link.from == link.to || link.to < 0 || link.from < 0;
}

std::string link_field(const PoseLink& link) {
  return "link " + std::to_string(link.from) + " -> " + std::to_string(link.to);
}

// RTAB-Map's serialization.
std::string join_parameters(const std::map<std::string, std::string>& parameters) {
  std::string text;
  for (const auto& [key, value] : parameters) {
    if (key.empty() || key.find_first_of(":;") != std::string::npos ||
        value.find(';') != std::string::npos)
      throw Error("cannot be stored: ':' ends a key and ';' a value",
                  {.field = "parameter " + key, .value = value});
    if (!text.empty()) text += ';';
    text.append(key).append(":").append(value);
  }
  return text;
}

constexpr const char* stamp_as_date = "COALESCE(DATETIME(?, 'unixepoch'), '1970-01-01 00:00:00')";

}  // namespace

struct RtabmapWriter::Parts {
  fs::path path;
  RtabmapWriterOptions options;
  std::string parameters;
  SQLite::Database database;
  std::optional<SQLite::Statement> node_statement;
  std::optional<SQLite::Statement> data_statement;
  std::optional<SQLite::Statement> link_statement;
  std::set<int> nodes;
  std::set<std::string> labels;
  std::set<std::tuple<int, int, int>> links;  // smaller id, larger id, type
  double latest_stamp_s = 0.0;
  std::map<int, Pose> optimized_map_from_base;

  Parts(const fs::path& file, const RtabmapWriterOptions& given)
      : path(file),
        options(given),
        parameters(join_parameters(given.parameters)),
        database(file.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE) {}

  void begin();
  void write_node(const GraphNode& node);
  void write_data(const RgbdFrame& frame);
  void write_link(int from, int to, const PoseLink& link, const Pose& from_from_to);
  void write_admin();
  void require_ends() const;
  std::string encode_left(const RgbdFrame& frame) const;
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
  link_statement.emplace(database,
                         "INSERT INTO Link (from_id, to_id, type, information_matrix, transform) "
                         "VALUES (?,?,?,?,?)");
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

std::string RtabmapWriter::Parts::encode_left(const RgbdFrame& frame) const {
  if (frame.color.empty()) return {};
  return options.color == ImageFormat::png ? encode_png(frame.color)
                                           : encode_jpeg(frame.color, options.jpeg_quality);
}

std::string RtabmapWriter::Parts::encode_right_or_depth(const RgbdFrame& frame) const {
  if (!frame.right.empty())
    return options.color == ImageFormat::png ? encode_png(frame.right)
                                             : encode_jpeg(frame.right, options.jpeg_quality);
  if (frame.depth.empty()) return {};
  switch (options.depth) {
    case DepthFormat::rvl:
      return encode_rvl(to_millimeters(frame.depth));
    case DepthFormat::png16:
      return encode_png(to_millimeters(frame.depth));
    case DepthFormat::float_png:
      return encode_float_png(frame.depth);
  }
  return {};
}

void RtabmapWriter::Parts::write_data(const RgbdFrame& frame) {
  const std::string image = encode_left(frame);
  const std::string depth = encode_right_or_depth(frame);
  const std::string calibration = encode_cameras(frame);
  SQLite::Statement& statement = *data_statement;
  statement.bind(1, frame.node);
  bind_blob(statement, 2, image);
  bind_blob(statement, 3, depth);
  bind_blob(statement, 4, calibration);
  run_once(statement);
}

void RtabmapWriter::Parts::write_link(int from, int to, const PoseLink& link,
                                      const Pose& from_from_to) {
  const std::string information = to_blob(link.information);
  const std::string transform = to_blob(from_from_to);
  SQLite::Statement& statement = *link_statement;
  statement.bind(1, from);
  statement.bind(2, to);
  statement.bind(3, static_cast<int>(link.type));
  bind_blob(statement, 4, information);
  bind_blob(statement, 5, transform);
  run_once(statement);
}

void RtabmapWriter::Parts::write_admin() {
  SQLite::Statement info(
      database, std::string("INSERT INTO Info VALUES (0, ?, 0, 0, 0, ?, ") + stamp_as_date + ")");
  info.bind(1, nodes.empty() ? 0 : *nodes.rbegin());
  info.bind(2, parameters);
  info.bind(3, latest_stamp_s);
  info.exec();
  SQLite::Statement admin(database,
                          std::string("INSERT INTO Admin (version, opt_ids, opt_poses, "
                                      "opt_last_localization, time_enter) VALUES (?,?,?,?,") +
                              stamp_as_date + ")");
  OptimizedPoseBlobs blobs;
  std::string localization;
  if (!optimized_map_from_base.empty()) {
    blobs = to_blobs(optimized_map_from_base);
    localization = to_blob(optimized_map_from_base.rbegin()->second);
  }
  admin.bind(1, rtabmap_schema_version);
  bind_blob(admin, 2, blobs.ids);
  bind_blob(admin, 3, blobs.poses);
  bind_blob(admin, 4, localization);
  admin.bind(5, latest_stamp_s);
  admin.exec();
}

void RtabmapWriter::Parts::require_ends() const {
  const auto require = [&](int id, const std::string& field) {
    if (id > 0 && nodes.count(id) == 0)
      throw Error("names a node that is not there",
                  {.file = path.string(), .field = field, .value = std::to_string(id)});
  };
  for (const auto& [from, to, type] : links) {
    const std::string field = "link " + std::to_string(from) + " -> " + std::to_string(to);
    require(from, field);
    require(to, field);
  }
  for (const auto& [id, pose] : optimized_map_from_base) require(id, "optimized pose");
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
  const std::string field = node_field(node.id);
  check_node(node);
  check_frame(node, frame);
  if (parts_->nodes.count(node.id) > 0) throw Error("is there already", {.field = field});
  if (!node.label.empty() && parts_->labels.count(node.label) > 0)
    throw Error("is another node's label already",
                {.field = field + ": label", .value = node.label});
  guarded(parts_->path, [&] {
    parts_->write_node(node);
    parts_->write_data(frame);
  });
  parts_->nodes.insert(node.id);
  if (!node.label.empty()) parts_->labels.insert(node.label);
  parts_->latest_stamp_s = std::max(parts_->latest_stamp_s, node.stamp_s);
}

void RtabmapWriter::add_link(const PoseLink& link) {
  const std::string field = link_field(link);
  require_finite(link.from_from_to, field);
  if (!link.information.allFinite())
    throw Error("is not finite", {.field = field + ": information matrix"});
  const auto [low, high] = std::minmax(link.from, link.to);
  if (!parts_->links.emplace(low, high, static_cast<int>(link.type)).second)
    throw Error("is there already", {.field = field + ", " + to_text(link.type)});
  guarded(parts_->path, [&] {
    parts_->write_link(link.from, link.to, link, link.from_from_to);
    if (!is_one_way(link))
      parts_->write_link(link.to, link.from, link, link.from_from_to.inverse());
  });
}

void RtabmapWriter::set_optimized_poses(const std::map<int, Pose>& map_from_base) {
  for (const auto& [id, pose] : map_from_base)
    require_finite(pose, node_field(id) + ": optimized pose");
  parts_->optimized_map_from_base = map_from_base;
}

void RtabmapWriter::finish() {
  parts_->require_ends();
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
