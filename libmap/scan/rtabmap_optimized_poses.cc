#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/image/matrix_codec.h"
#include "libmap/scan/calibrated_scan.h"
#include "libmap/scan/calibration_codec.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_graph.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/rtabmap_rows.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace fs = std::filesystem;

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

// Empty where they are broken: they are replaced all the same.
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

// The node at whose optimized pose the last localisation stands.
std::optional<int> node_of_localization(const StoredPoses& stored) {
  // From the back: RTAB-Map localises at the last node.
  for (std::size_t i = stored.ids.size(); i-- > 0;)
    if (stored.pose(i) == stored.localization) return stored.ids[i];
  return std::nullopt;
}

// Landmarks (ids below 0) among the stored poses move with the first node that sees them.
std::map<int, Pose> with_landmarks(const StoredPoses& stored, const std::vector<PoseLink>& links,
                                   std::map<int, Pose> map_from_base) {
  std::map<int, std::size_t> places;
  for (std::size_t n = 0; n < stored.ids.size(); ++n) places.emplace(stored.ids[n], n);
  const auto earlier = [&](int id) -> std::optional<Pose> {
    const auto place = places.find(id);
    return place == places.end() ? std::nullopt : decode_pose(stored.pose(place->second));
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
    throw Error("has no place for optimized poses: it was made by RTAB-Map before 0.13", file);
  if (adds_links && !scan.columns().has("Link", "information_matrix"))
    throw Error("has no place for links with information matrices: RTAB-Map before 0.13 made it",
                file);
  std::int64_t rows = 0;
  scan.file().each_row("SELECT COUNT(*) FROM Admin", {},
                       [&](const SqliteRow& row) { rows = row.integer(0); });
  if (rows != 1)
    throw Error("is no RTAB-Map database", {.file = file.file,
                                            .field = "rows of table Admin",
                                            .value = std::to_string(rows),
                                            .bound = "1"});
}

// A grid, cloud or mesh of the earlier poses, which RTAB-Map would show beside the new ones; where
// there is none it makes one anew. So do its own tools that change a graph.
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
  const auto place = node ? map_from_base.find(*node) : map_from_base.end();
  if (place != map_from_base.end()) localization = to_blob(place->second);
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
    throw Error("has no place for calibrations", {.file = scan.path().string()});
  SQLite::Statement update(database, "UPDATE Data SET depth = ?, calibration = ? WHERE id = ?");
  for (const GraphNode& node : scan.graph().nodes) {
    const FrameBlobs blobs = scan.read_blobs(node.id);
    RgbdFrame frame = scan.read_frame(node.id, {.color = false, .depth = true});
    try {
      apply_calibration(frame, calibration);
    } catch (const Error& error) {
      throw error.in_field("node " + std::to_string(node.id)).in_file(scan.path().string());
    }
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
