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
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_graph.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

std::set<std::string> columns_of(SQLite::Database& database, const std::string& table) {
  std::set<std::string> columns;
  SQLite::Statement statement(database, "PRAGMA table_info(" + table + ")");
  while (statement.executeStep()) columns.insert(statement.getColumn(1).getString());
  return columns;
}

std::string blob_of(SQLite::Column column) {
  const char* bytes = static_cast<const char*>(column.getBlob());
  return bytes == nullptr ? std::string()
                          : std::string(bytes, static_cast<std::size_t>(column.getBytes()));
}

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
StoredPoses stored_poses(SQLite::Database& database) {
  const bool localizes = columns_of(database, "Admin").contains("opt_last_localization");
  SQLite::Statement row(database, std::string("SELECT opt_ids, opt_poses, ") +
                                      (localizes ? "opt_last_localization" : "NULL") +
                                      " FROM Admin");
  if (!row.executeStep()) return {};
  try {
    StoredPoses stored;
    stored.localization = blob_of(row.getColumn(2));
    const std::string ids = blob_of(row.getColumn(0));
    const std::string poses = blob_of(row.getColumn(1));
    require_optimized_poses(ids, poses);
    stored.ids = decode_matrix(ids).values<int>();
    stored.poses = decode_matrix(poses).bytes;
    return stored;
  } catch (const Error&) {
  }
  return {};
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

void require_nodes(SQLite::Database& database, const std::map<int, Pose>& poses,
                   const std::vector<PoseLink>& links, const std::string& source) {
  std::set<int> nodes;
  SQLite::Statement statement(database, "SELECT id FROM Node");
  while (statement.executeStep()) nodes.insert(statement.getColumn(0).getInt());
  for (const PoseLink& link : links) {
    const std::string field =
        "link " + std::to_string(link.from) + " -> " + std::to_string(link.to);
    for (const int id : {link.from, link.to})
      if (nodes.count(id) == 0)
        throw Error("the scan has no such node",
                    {.file = source, .field = field, .value = std::to_string(id)});
    if (!link.from_from_to.matrix().allFinite() || !link.information.allFinite())
      throw Error("is not finite", {.field = field});
  }
  for (const auto& [id, pose] : poses) {
    if (id > 0 && nodes.count(id) == 0)
      throw Error("the scan has no such node",
                  {.file = source, .field = "optimized pose of node", .value = std::to_string(id)});
    if (!pose.matrix().allFinite())
      throw Error("is not finite", {.field = "optimized pose of node " + std::to_string(id)});
  }
}

void require_columns(SQLite::Database& database, const std::string& source) {
  const std::set<std::string> columns = columns_of(database, "Admin");
  if (columns.empty() || columns_of(database, "Node").count("id") == 0)
    throw Error("is no RTAB-Map database", {.file = source});
  if (columns.count("opt_ids") == 0 || columns.count("opt_poses") == 0)
    throw Error("has no place for optimized poses: it was made by RTAB-Map before 0.13",
                {.file = source});
  SQLite::Statement rows(database, "SELECT COUNT(*) FROM Admin");
  rows.executeStep();
  if (rows.getColumn(0).getInt() != 1)
    throw Error("is no RTAB-Map database", {.file = source,
                                            .field = "rows of table Admin",
                                            .value = rows.getColumn(0).getString(),
                                            .bound = "1"});
}

// A grid, cloud or mesh of the earlier poses, which RTAB-Map would show beside the new ones; where
// there is none it makes one anew. So do its own tools that change a graph.
void clear_stored_map(SQLite::Database& database) {
  const std::set<std::string> columns = columns_of(database, "Admin");
  std::string changes;
  for (const char* column :
       {"opt_cloud", "opt_polygons_size", "opt_polygons", "opt_tex_coords", "opt_tex_materials",
        "opt_map", "opt_map_x_min", "opt_map_y_min", "opt_map_resolution"})
    if (columns.contains(column))
      changes += (changes.empty() ? "" : ", ") + std::string(column) + " = NULL";
  if (!changes.empty()) database.exec("UPDATE Admin SET " + changes);
}

void update_poses(SQLite::Database& database, const StoredPoses& stored,
                  const std::map<int, Pose>& map_from_base) {
  const OptimizedPoseBlobs blobs = to_blobs(map_from_base);
  std::string localization;
  const std::optional<int> node = node_of_localization(stored);
  const auto place = node ? map_from_base.find(*node) : map_from_base.end();
  if (place != map_from_base.end()) localization = to_blob(place->second);
  const bool localizes = columns_of(database, "Admin").contains("opt_last_localization");
  SQLite::Statement update(database, std::string("UPDATE Admin SET opt_ids = ?, opt_poses = ?") +
                                         (localizes ? ", opt_last_localization = ?" : ""));
  const auto bind = [&](int index, const std::string& blob) {
    if (!map_from_base.empty() && !blob.empty())
      update.bindNoCopy(index, blob.data(), static_cast<int>(blob.size()));
  };
  bind(1, blobs.ids);
  bind(2, blobs.poses);
  if (localizes) bind(3, localization);
  update.exec();
}

void add_links(SQLite::Database& database, const std::vector<PoseLink>& links,
               const std::string& source) {
  if (links.empty()) return;
  if (columns_of(database, "Link").count("information_matrix") == 0)
    throw Error("has no place for links with information matrices: RTAB-Map before 0.13 made it",
                {.file = source});
  std::set<std::pair<int, int>> known;
  SQLite::Statement rows(database, "SELECT from_id, to_id FROM Link");
  while (rows.executeStep())
    known.insert(std::minmax(rows.getColumn(0).getInt(), rows.getColumn(1).getInt()));
  SQLite::Statement insert(database,
                           "INSERT INTO Link (from_id, to_id, type, information_matrix, transform) "
                           "VALUES (?,?,?,?,?)");
  const auto add = [&](int from, int to, const PoseLink& link, const Pose& from_from_to) {
    const std::string information = to_blob(link.information);
    const std::string transform = to_blob(from_from_to);
    insert.bind(1, from);
    insert.bind(2, to);
    insert.bind(3, static_cast<int>(link.type));
    insert.bindNoCopy(4, information.data(), static_cast<int>(information.size()));
    insert.bindNoCopy(5, transform.data(), static_cast<int>(transform.size()));
    insert.exec();
    insert.reset();
  };
  for (const PoseLink& link : links) {
    if (!known.insert(std::minmax(link.from, link.to)).second) continue;
    add(link.from, link.to, link, link.from_from_to);
    // RTAB-Map keeps the same matrix for both directions.
    add(link.to, link.from, link, link.from_from_to.inverse());
  }
}

}  // namespace

void copy_with_optimized_poses(const fs::path& source, const fs::path& target,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<PoseLink>& links) {
  SqliteFile(source).copy_to(target);
  try {
    SQLite::Database copy(target.string(), SQLite::OPEN_READWRITE);
    copy.exec("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = MEMORY;");
    require_columns(copy, source.string());
    require_nodes(copy, map_from_base, links, source.string());
    const StoredPoses stored = stored_poses(copy);
    const std::vector<PoseLink> stored_links = RtabmapDatabase(target).graph().links;
    SQLite::Transaction transaction(copy);
    update_poses(copy, stored, with_landmarks(stored, stored_links, map_from_base));
    clear_stored_map(copy);
    add_links(copy, links, source.string());
    transaction.commit();
  } catch (const SQLite::Exception& error) {
    throw copy_error(source, target, error);
  }
}

}  // namespace libmap
