#include "libmap/scan/rtabmap_schema.h"

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

std::string rtabmap_table_statements() {
  return R"sql(
CREATE TABLE Node (
  id INTEGER NOT NULL, map_id INTEGER NOT NULL, weight INTEGER, stamp FLOAT,
  pose BLOB, ground_truth_pose BLOB, velocity BLOB, label TEXT, gps BLOB, env_sensors BLOB,
  time_enter DATE, PRIMARY KEY (id));
CREATE TABLE Data (
  id INTEGER NOT NULL,
  image BLOB, depth BLOB, depth_confidence BLOB, calibration BLOB,
  scan BLOB, scan_info BLOB,
  ground_cells BLOB, obstacle_cells BLOB, empty_cells BLOB,
  cell_size FLOAT, view_point_x FLOAT, view_point_y FLOAT, view_point_z FLOAT,
  user_data BLOB, time_enter DATE, PRIMARY KEY (id));
CREATE TABLE Link (
  from_id INTEGER NOT NULL, to_id INTEGER NOT NULL, type INTEGER NOT NULL,
  information_matrix BLOB NOT NULL, transform BLOB, user_data BLOB,
  FOREIGN KEY (from_id) REFERENCES Node(id), FOREIGN KEY (to_id) REFERENCES Node(id));
CREATE TABLE Word (
  id INTEGER NOT NULL, descriptor_size INTEGER NOT NULL, descriptor BLOB NOT NULL,
  time_enter DATE, PRIMARY KEY (id));
CREATE TABLE Feature (
  node_id INTEGER NOT NULL, word_id INTEGER NOT NULL,
  pos_x FLOAT NOT NULL, pos_y FLOAT NOT NULL, size INTEGER NOT NULL,
  dir FLOAT NOT NULL, response FLOAT NOT NULL, octave INTEGER NOT NULL,
  depth_x FLOAT, depth_y FLOAT, depth_z FLOAT, descriptor_size INTEGER, descriptor BLOB,
  FOREIGN KEY (node_id) REFERENCES Node(id));
CREATE TABLE GlobalDescriptor (
  node_id INTEGER NOT NULL, type INTEGER NOT NULL, info BLOB, data BLOB NOT NULL,
  FOREIGN KEY (node_id) REFERENCES Node(id));
CREATE TABLE Info (
  STM_size INTEGER, last_sign_added INTEGER, process_mem_used INTEGER, database_mem_used INTEGER,
  dictionary_size INTEGER, parameters TEXT, time_enter DATE);
CREATE TABLE Statistics (
  id INTEGER NOT NULL, stamp FLOAT, data BLOB, wm_state BLOB,
  FOREIGN KEY (id) REFERENCES Node(id));
CREATE TABLE Admin (
  version TEXT, preview_image BLOB,
  opt_cloud BLOB, opt_ids BLOB, opt_poses BLOB, opt_last_localization BLOB,
  opt_polygons_size INTEGER, opt_polygons BLOB, opt_tex_coords BLOB, opt_tex_materials BLOB,
  opt_map BLOB, opt_map_x_min FLOAT, opt_map_y_min FLOAT, opt_map_resolution FLOAT,
  dictionary_index BLOB, time_enter DATE);
)sql";
}

std::string rtabmap_index_statements() {
  return R"sql(
CREATE UNIQUE INDEX IDX_Node_id ON Node (id);
CREATE UNIQUE INDEX IDX_node_label ON Node (label);
CREATE INDEX IDX_Link_from_id ON Link (from_id);
CREATE INDEX IDX_Feature_node_id ON Feature (node_id);
CREATE INDEX IDX_GlobalDescriptor_node_id ON GlobalDescriptor (node_id);
CREATE UNIQUE INDEX IDX_Statistics_id ON Statistics (id);
)sql";
}

std::string rtabmap_trigger_statements() {
  return R"sql(
CREATE TRIGGER insert_Feature BEFORE INSERT ON Feature
WHEN NOT EXISTS (SELECT Node.id FROM Node WHERE Node.id = NEW.node_id)
BEGIN
  SELECT RAISE(ABORT, 'Foreign key constraint failed in Feature table');
END;
CREATE TRIGGER insert_Node_timeEnter AFTER INSERT ON Node
BEGIN UPDATE Node SET time_enter = DATETIME('NOW') WHERE rowid = new.rowid; END;
CREATE TRIGGER insert_Data_timeEnter AFTER INSERT ON Data
BEGIN UPDATE Node SET time_enter = DATETIME('NOW') WHERE rowid = new.rowid; END;
CREATE TRIGGER insert_Word_timeEnter AFTER INSERT ON Word
BEGIN UPDATE Word SET time_enter = DATETIME('NOW') WHERE rowid = new.rowid; END;
CREATE TRIGGER insert_Info_timeEnter AFTER INSERT ON Info
BEGIN UPDATE Info SET time_enter = DATETIME('NOW') WHERE rowid = new.rowid; END;
)sql";
}

}  // namespace libmap
