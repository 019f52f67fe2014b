#include "libmap/scan/rtabmap_writer.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/camera/calibration_codec.h"
#include "libmap/camera/matrix_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/rtabmap_schema.h"
#include "libmap/scan/scan_source.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Binds an empty blob as NULL. `blob` must outlive the statement's execution.
void bind_blob(SQLite::Statement& statement, int index, const std::string& blob) {
  if (blob.empty())
    statement.bind(index);
  else
    statement.bindNoCopy(index, blob.data(), static_cast<int>(blob.size()));
}

void run_once(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
  statement.clearBindings();
}

constexpr const char* rtabmap_link_insert =
    "INSERT INTO Link (from_id, to_id, type, information_matrix, transform) VALUES (?,?,?,?,?)";

// Inserts both directions with one matrix, as RTAB-Map does; priors, gravity and landmarks once.
void insert_link(SQLite::Statement& insert, const PoseLink& link) {
  const auto run = [&](int from, int to, const Pose& from_from_to) {
    const std::string information = to_blob(link.information);
    const std::string transform = to_blob(from_from_to);
    insert.bind(1, from);
    insert.bind(2, to);
    insert.bind(3, static_cast<int>(link.type));
    bind_blob(insert, 4, information);
    bind_blob(insert, 5, transform);
    run_once(insert);
  };
  run(link.from, link.to, link.from_from_to);
  if (link.from != link.to && link.from > 0 && link.to > 0)
    run(link.to, link.from, link.from_from_to.inverse());
}

template <typename T>
std::string to_optional_blob(const std::optional<T>& value) {
  return value ? to_blob(*value) : std::string();
}

// Converts SQLite's errors to Errors of kind failed, because they concern the output.
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
  // A rectified pair stores the baseline in the right camera's projection.
  if (record.right.p.size() == 12) record.right.p[3] = -camera.right.fx * camera.baseline_m;
  return record;
}

std::string encode_cameras(const RgbdFrame& frame) {
  Calibration calibration;
  for (const StereoCamera& pair : frame.stereo) calibration.stereo.push_back(record_of(pair));
  // In stereo pairs, these are the left cameras.
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
  // An incomplete file is useless, so no journal is needed for rolling back.
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
  // As in RTAB-Map, an unknown odometry pose is all zeros, an unknown true pose NULL.
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
  // Removes bytes of an earlier attempt, which SQLite would read as a database.
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
    // Triggers are added last, because they would set the current time in the rows.
    parts_->database.exec(rtabmap_trigger_statements());
    parts_->node_statement.reset();
    parts_->data_statement.reset();
    parts_->link_statement.reset();
    parts_->database.exec("COMMIT");
  });
  parts_.reset();
}

namespace {

struct StoredPoses {
  std::vector<int> ids{};
  std::string poses{};  // 48 bytes each
  std::string localization{};

  std::string_view pose(std::size_t index) const {
    const std::size_t size = null_pose_blob().size();
    return std::string_view(poses).substr(index * size, size);
  }
};

// Returns the stored poses; empty if they are damaged, because they are replaced anyway.
StoredPoses stored_poses(const RtabmapDatabase& scan) {
  std::string ids;
  std::string poses;
  StoredPoses stored;
  scan.file().each_row("SELECT opt_ids, opt_poses, " +
                           scan.columns().or_null("Admin", "opt_last_localization") + " FROM Admin",
                       {}, [&](const SqliteRow& row) {
                         ids = row.bytes(0);
                         poses = row.bytes(1);
                         stored.localization = row.bytes(2);
                       });
  try {
    require_optimized_poses(ids, poses);
    stored.ids = decode_matrix(ids).values<int>();
    stored.poses = decode_matrix(poses).bytes;
    return stored;
  } catch (const Error&) {
    return {};
  }
}

// Returns the node whose optimized pose equals the last localization.
std::optional<int> node_of_localization(const StoredPoses& stored) {
  // Backwards, because RTAB-Map localizes at the last node.
  for (std::size_t i = stored.ids.size(); i-- > 0;)
    if (stored.pose(i) == stored.localization) return stored.ids[i];
  return std::nullopt;
}

// Landmarks (ids below 0) among the stored poses move with the first node that sees them.
std::map<int, Pose> with_landmarks(const StoredPoses& stored, const std::vector<PoseLink>& links,
                                   std::map<int, Pose> map_from_base) {
  std::map<int, std::size_t> row_of_node;
  for (std::size_t n = 0; n < stored.ids.size(); ++n) row_of_node.emplace(stored.ids[n], n);
  const auto earlier = [&](int id) -> std::optional<Pose> {
    const auto entry = row_of_node.find(id);
    return entry == row_of_node.end() ? std::nullopt : decode_pose(stored.pose(entry->second));
  };
  for (const PoseLink& link : links) {
    if (link.to > 0 || map_from_base.contains(link.to)) continue;
    const auto now = map_from_base.find(link.from);
    if (now == map_from_base.end()) continue;
    const auto before = earlier(link.from);
    const auto landmark = earlier(link.to);
    if (before && landmark)
      map_from_base.emplace(link.to, now->second * before->inverse() * *landmark);
  }
  return map_from_base;
}

void require_columns(const RtabmapDatabase& scan, bool adds_links) {
  const ErrorContext file{.file = scan.path().string()};
  if (!scan.columns().has("Admin", "opt_ids") || !scan.columns().has("Admin", "opt_poses"))
    throw Error("cannot store optimized poses: created by RTAB-Map before 0.13", file);
  if (adds_links && !scan.columns().has("Link", "information_matrix"))
    throw Error("cannot store information matrices of links: created by RTAB-Map before 0.13",
                file);
  std::int64_t rows = 0;
  scan.file().each_row("SELECT COUNT(*) FROM Admin", {},
                       [&](const SqliteRow& row) { rows = row.integer(0); });
  if (rows != 1)
    throw Error("not an RTAB-Map database", {.file = file.file,
                                             .field = "number of rows of table Admin",
                                             .value = std::to_string(rows),
                                             .bound = "1"});
}

// Removes a grid, cloud or mesh of the earlier poses, which RTAB-Map would show with the new poses.
// RTAB-Map's own tools that change a graph remove them too.
void clear_stored_map(SQLite::Database& database, const RtabmapColumns& columns) {
  std::string changes;
  for (const char* column :
       {"opt_cloud", "opt_polygons_size", "opt_polygons", "opt_tex_coords", "opt_tex_materials",
        "opt_map", "opt_map_x_min", "opt_map_y_min", "opt_map_resolution"})
    if (columns.has("Admin", column))
      changes += (changes.empty() ? "" : ", ") + std::string(column) + " = NULL";
  if (!changes.empty()) database.exec("UPDATE Admin SET " + changes);
}

void update_poses(SQLite::Database& database, const StoredPoses& stored, bool localizes,
                  const std::map<int, Pose>& map_from_base) {
  const OptimizedPoseBlobs blobs = to_blobs(map_from_base);
  std::string localization;
  const std::optional<int> node = node_of_localization(stored);
  const auto entry = node ? map_from_base.find(*node) : map_from_base.end();
  if (entry != map_from_base.end()) localization = to_blob(entry->second);
  SQLite::Statement update(database, std::string("UPDATE Admin SET opt_ids = ?, opt_poses = ?") +
                                         (localizes ? ", opt_last_localization = ?" : ""));
  if (!map_from_base.empty()) {
    bind_blob(update, 1, blobs.ids);
    bind_blob(update, 2, blobs.poses);
  }
  if (localizes) bind_blob(update, 3, localization);
  update.exec();
}

void add_links(SQLite::Database& database, const std::vector<PoseLink>& links) {
  if (links.empty()) return;
  std::set<std::pair<int, int>> known;
  SQLite::Statement rows(database, "SELECT from_id, to_id FROM Link");
  while (rows.executeStep())
    known.insert(std::minmax(rows.getColumn(0).getInt(), rows.getColumn(1).getInt()));
  SQLite::Statement insert(database, rtabmap_link_insert);
  for (const PoseLink& link : links)
    if (known.insert(std::minmax(link.from, link.to)).second) insert_link(insert, link);
}

void write_calibration(SQLite::Database& database, const RtabmapDatabase& scan,
                       const CameraFile& calibration) {
  if (!scan.columns().has("Data", "calibration"))
    throw Error("table Data has no column calibration", {.file = scan.path().string()});
  SQLite::Statement update(database, "UPDATE Data SET depth = ?, calibration = ? WHERE id = ?");
  for (const GraphNode& node : scan.graph().nodes) {
    const FrameBlobs blobs = scan.read_blobs(node.id);
    RgbdFrame frame = scan.read_frame(node.id, {.color = false, .depth = true});
    in_file(scan.path(), [&] {
      in_field("node " + std::to_string(node.id), [&] { apply_calibration(frame, calibration); });
    });
    if (frame.cameras.empty()) continue;
    std::string depth = blobs.depth;
    if (!frame.depth.empty() && calibration.changes_depth())
      depth = encode_depth(frame.depth, read_depth_info(blobs.depth).value().format);
    const std::string record = encode_calibration({.cameras = {record_of(frame.cameras.front())}});
    bind_blob(update, 1, depth);
    bind_blob(update, 2, record);
    update.bind(3, node.id);
    run_once(update);
  }
}

}  // namespace

void copy_with_optimized_poses(const fs::path& source, const fs::path& target,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<PoseLink>& links,
                               const std::optional<CameraFile>& calibration) {
  const RtabmapDatabase scan(source);
  require_columns(scan, !links.empty());
  scan.file().copy_to(target);
  const StoredPoses stored = stored_poses(scan);
  try {
    SQLite::Database copy(target.string(), SQLite::OPEN_READWRITE);
    copy.exec("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = MEMORY;");
    SQLite::Transaction transaction(copy);
    update_poses(copy, stored, scan.columns().has("Admin", "opt_last_localization"),
                 with_landmarks(stored, scan.graph().links, map_from_base));
    clear_stored_map(copy, scan.columns());
    add_links(copy, links);
    if (calibration) write_calibration(copy, scan, *calibration);
    transaction.commit();
  } catch (const SQLite::Exception& error) {
    throw copy_error(source, target, error);
  }
}

}  // namespace libmap
