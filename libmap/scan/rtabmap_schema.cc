#include "libmap/scan/rtabmap_schema.h"

namespace libmap {

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
