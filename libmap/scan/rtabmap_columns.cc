#include "libmap/scan/rtabmap_columns.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace {

struct Mark {
  std::string_view version;
  std::string_view table;
  std::string_view column;  // empty: the table itself
};

// The newest first.
constexpr std::array<Mark, 15> marks{{
    {"0.23.0", "Admin", "dictionary_index"},
    {"0.22.0", "Data", "depth_confidence"},
    {"0.20.0", "GlobalDescriptor", ""},
    {"0.18.0", "Node", "env_sensors"},
    {"0.17.0", "Admin", "opt_last_localization"},
    {"0.16.0", "Data", "empty_cells"},
    {"0.14.0", "Node", "gps"},
    {"0.13.0", "Feature", ""},
    {"0.12.0", "Map_Node_Word", "octave"},
    {"0.11.10", "Data", "scan_info"},
    {"0.11.1", "Node", "ground_truth_pose"},
    {"0.10.10", "Link", "user_data"},
    {"0.10.7", "Data", "scan_max_range"},
    {"0.10.1", "Data", "user_data"},
    {"0.10.0", "Data", ""},
}};

const std::map<std::string, std::set<std::string>>& known_columns() {
  static const std::map<std::string, std::set<std::string>> known{
      {"Node",
       {"id", "map_id", "weight", "stamp", "pose", "ground_truth_pose", "velocity", "label", "gps",
        "env_sensors", "time_enter", "user_data"}},
      {"Data",
       {"id", "image", "depth", "depth_confidence", "calibration", "scan", "scan_info",
        "scan_max_pts", "scan_max_range", "ground_cells", "obstacle_cells", "empty_cells",
        "cell_size", "view_point_x", "view_point_y", "view_point_z", "user_data", "time_enter"}},
      {"Image", {"id", "data", "time_enter"}},
      {"Depth",
       {"id", "data", "constant", "fx", "fy", "cx", "cy", "local_transform", "data2d",
        "data2d_max_pts", "time_enter"}},
      {"Link",
       {"from_id", "to_id", "type", "information_matrix", "rot_variance", "trans_variance",
        "variance", "transform", "user_data"}},
      {"Word", {"id", "descriptor_size", "descriptor", "time_enter"}},
      {"Feature",
       {"node_id", "word_id", "pos_x", "pos_y", "size", "dir", "response", "octave", "depth_x",
        "depth_y", "depth_z", "descriptor_size", "descriptor"}},
      {"Map_Node_Word",
       {"node_id", "word_id", "pos_x", "pos_y", "size", "dir", "response", "octave", "depth_x",
        "depth_y", "depth_z", "descriptor_size", "descriptor"}},
      {"GlobalDescriptor", {"node_id", "type", "info", "data"}},
      {"Tag", {"node_id", "tag_id", "stamp", "transform"}},
      {"Info",
       {"STM_size", "last_sign_added", "process_mem_used", "database_mem_used", "dictionary_size",
        "parameters", "time_enter"}},
      {"Statistics",
       {"id", "stamp", "data", "wm_state", "STM_size", "last_sign_added", "process_mem_used",
        "database_mem_used", "dictionary_size", "parameters", "time_enter"}},
      {"Admin",
       {"version", "preview_image", "opt_cloud", "opt_ids", "opt_poses", "opt_last_localization",
        "opt_polygons_size", "opt_polygons", "opt_tex_coords", "opt_tex_materials", "opt_map",
        "opt_map_x_min", "opt_map_y_min", "opt_map_resolution", "dictionary_index", "time_enter"}}};
  return known;
}

}  // namespace

RtabmapColumns::RtabmapColumns(const SqliteFile& file) {
  for (const std::string& table : file.tables()) columns_.emplace(table, file.columns(table));
}

bool RtabmapColumns::has(const std::string& table, const std::string& column) const {
  const auto found = columns_.find(table);
  return found != columns_.end() && found->second.contains(column);
}

std::string RtabmapColumns::or_null(const std::string& table, const std::string& column) const {
  return has(table, column) ? column : "NULL";
}

std::string RtabmapColumns::recognized_version() const {
  const auto found = std::find_if(marks.begin(), marks.end(), [&](const Mark& mark) {
    const std::string table(mark.table);
    return mark.column.empty() ? has_table(table) : has(table, std::string(mark.column));
  });
  return found == marks.end() ? "before 0.10.0" : std::string(found->version);
}

std::vector<std::string> RtabmapColumns::unknown() const {
  std::vector<std::string> names;
  for (const auto& [table, columns] : columns_) {
    const auto known = known_columns().find(table);
    if (known == known_columns().end()) {
      names.push_back(table);
      continue;
    }
    for (const std::string& column : columns)
      if (!known->second.contains(column))
        names.push_back(std::string(table).append(".").append(column));
  }
  return names;
}

}  // namespace libmap
