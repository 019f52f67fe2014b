#include "tests/libmap/scan/sample_database.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/camera/matrix_codec.h"

namespace graspmap_test {

namespace {

using libmap::MatrixElement;
using libmap::StoredMatrix;

template <typename T>
std::string compressed(int rows, int columns, int channels, MatrixElement element,
                       const std::vector<T>& numbers) {
  return encode_matrix(StoredMatrix{rows, columns, channels, element, bytes_of(numbers)});
}

class Inserter {
 public:
  explicit Inserter(SQLite::Database& database) : database_(database) {}

  // One row; a blob for each name that is in `blobs`, else the text of `values`.
  void row(const std::string& table, const std::vector<std::pair<std::string, std::string>>& values,
           const std::vector<std::pair<std::string, std::string>>& blobs = {}) {
    std::string names;
    std::string marks;
    for (const auto& [name, value] : values) {
      names += (names.empty() ? "" : ", ") + name;
      marks += (marks.empty() ? "" : ", ") + value;
    }
    for (const auto& [name, blob] : blobs) {
      names += (names.empty() ? "" : ", ") + name;
      marks += marks.empty() ? "?" : ", ?";
    }
    SQLite::Statement statement(database_,
                                "INSERT INTO " + table + " (" + names + ") VALUES (" + marks + ")");
    int place = 0;
    for (const auto& [name, blob] : blobs)
      statement.bind(++place, blob.data(), static_cast<int>(blob.size()));
    statement.exec();
  }

 private:
  SQLite::Database& database_;
};

std::string information(double variance) {
  std::vector<double> numbers(36, 0.0);
  for (std::size_t i = 0; i < 6; ++i) numbers[7 * i] = 1 / variance;
  return bytes_of(numbers);
}

void insert_nodes(Inserter& insert, SchemaVersion version) {
  for (int id = 1; id <= sample_nodes; ++id) {
    std::vector<std::pair<std::string, std::string>> values{
        {"id", std::to_string(id)},
        {"map_id", "0"},
        {"weight", std::to_string(id - 1)},
        {"stamp", std::to_string(100 + id) + ".25"},
        {"label", id == 1 ? "'start'" : "NULL"}};
    std::vector<std::pair<std::string, std::string>> blobs{{"pose", pose_bytes(sample_pose(id))}};
    if (version >= SchemaVersion{11, 1})
      blobs.emplace_back("ground_truth_pose", pose_bytes(sample_truth(id)));
    if (version >= SchemaVersion{13, 0})
      blobs.emplace_back("velocity", bytes_of(std::vector<float>{0.5F, 0, 0, 0, 0, 0.25F}));
    if (version >= SchemaVersion{14, 0})
      blobs.emplace_back("gps", bytes_of(std::vector<double>{100.5, 11.5, 48.25, 500, 3, 90}));
    if (version >= SchemaVersion{18, 0})
      blobs.emplace_back("env_sensors", bytes_of(std::vector<double>{1, 21.5, 100}));
    insert.row("Node", values, blobs);
  }
}

void insert_data(Inserter& insert, SchemaVersion version) {
  for (int id = 1; id <= sample_nodes; ++id) {
    std::vector<std::pair<std::string, std::string>> blobs{
        {"image", libmap::encode_png(sample_color(id))},
        {"depth", libmap::encode_rvl(sample_depth(id))},
        {"calibration", sample_calibration(version)}};
    if (version >= SchemaVersion{22, 0})
      blobs.emplace_back("depth_confidence", compressed(24, 32, 1, MatrixElement::uint8,
                                                        std::vector<std::uint8_t>(32 * 24, 100)));
    if (id == 2) {
      blobs.emplace_back("scan", compressed(1, 2, 3, MatrixElement::float32,
                                            std::vector<float>{1, 2, 3, 4, 5, 6}));
      const std::string local = pose_bytes(libmap::Pose::Identity());
      if (version >= SchemaVersion{18, 0})
        blobs.emplace_back("scan_info",
                           bytes_of(std::vector<float>{5, 0.1F, 10, -1, 1, 0.5F, 2}) + local);
      else if (version >= SchemaVersion{16, 1})
        blobs.emplace_back("scan_info", bytes_of(std::vector<float>{2, 10, 5}) + local);
      else if (version >= SchemaVersion{11, 10})
        blobs.emplace_back("scan_info", bytes_of(std::vector<float>{2, 10}) + local);
      if (version >= SchemaVersion{10, 1})
        blobs.emplace_back("user_data", compressed(1, 8, 1, MatrixElement::uint8,
                                                   std::vector<std::uint8_t>(8, 7)));
      if (version >= SchemaVersion{11, 10})
        blobs.emplace_back("ground_cells", compressed(1, 3, 2, MatrixElement::float32,
                                                      std::vector<float>(6, 1.0F)));
    }
    insert.row("Data", {{"id", std::to_string(id)}}, blobs);
  }
}

void insert_link(Inserter& insert, SchemaVersion version, int from, int to, int type,
                 const libmap::Pose& from_from_to) {
  std::vector<std::pair<std::string, std::string>> values{{"from_id", std::to_string(from)},
                                                          {"to_id", std::to_string(to)},
                                                          {"type", std::to_string(type)}};
  std::vector<std::pair<std::string, std::string>> blobs{{"transform", pose_bytes(from_from_to)}};
  if (version >= SchemaVersion{13, 0}) {
    blobs.emplace_back("information_matrix", information(0.01));
  } else {
    values.emplace_back("rot_variance", "0.04");
    values.emplace_back("trans_variance", "0.01");
  }
  insert.row("Link", values, blobs);
}

void insert_links(Inserter& insert, SchemaVersion version) {
  const auto between = [](int from, int to) {
    return libmap::Pose(sample_pose(from).inverse() * sample_pose(to));
  };
  for (int id = 1; id < sample_nodes; ++id) {
    insert_link(insert, version, id, id + 1, 0, between(id, id + 1));
    insert_link(insert, version, id + 1, id, 0, between(id + 1, id));
  }
  insert_link(insert, version, 3, 1, 1, between(3, 1));
  insert_link(insert, version, 1, 3, 1, between(1, 3));
  if (version < SchemaVersion{18, 3}) return;
  insert_link(insert, version, 1, 1, 9, libmap::Pose::Identity());
  insert_link(insert, version, 2, -1, 8, between(1, 2));
}

void insert_words(Inserter& insert, SchemaVersion version) {
  const std::string binary(32, '\x5a');
  const std::string table = version >= SchemaVersion{13, 0} ? "Feature" : "Map_Node_Word";
  for (int word = 1; word <= 2; ++word)
    insert.row("Word", {{"id", std::to_string(word)}, {"descriptor_size", "32"}},
               {{"descriptor", binary}});
  for (int word = 1; word <= 2; ++word) {
    std::vector<std::pair<std::string, std::string>> values{
        {"node_id", "1"},    {"word_id", word == 1 ? "1" : "-5"},
        {"pos_x", "3.5"},    {"pos_y", "4.25"},
        {"size", "31"},      {"dir", "45"},
        {"response", "0.5"}, {"depth_x", word == 1 ? "1.5" : "NULL"},
        {"depth_y", "2"},    {"depth_z", "0.25"}};
    std::vector<std::pair<std::string, std::string>> blobs;
    if (version >= SchemaVersion{12, 0}) values.emplace_back("octave", "2");
    if (version >= SchemaVersion{11, 2}) {
      values.emplace_back("descriptor_size", word == 1 ? "32" : "3");
      blobs.emplace_back("descriptor", word == 1 ? binary : bytes_of(std::vector<float>{1, 2, 3}));
    }
    insert.row(table, values, blobs);
  }
}

void insert_admin(Inserter& insert, SchemaVersion version) {
  std::vector<std::pair<std::string, std::string>> blobs;
  if (version >= SchemaVersion{13, 0}) {
    std::vector<std::int32_t> ids;
    std::string poses;
    for (int id = 1; id <= sample_nodes; ++id) {
      ids.push_back(id);
      poses += pose_bytes(sample_optimized(id));
    }
    blobs.emplace_back("opt_ids", compressed(1, sample_nodes, 1, MatrixElement::int32, ids));
    blobs.emplace_back("opt_poses", encode_matrix(StoredMatrix{1, 12 * sample_nodes, 1,
                                                               MatrixElement::float32, poses}));
  }
  insert.row("Admin", {{"version", "'" + version.text() + "'"}}, blobs);
  const std::string table = version >= SchemaVersion{11, 11} ? "Info" : "Statistics";
  if (version < SchemaVersion{11, 8}) return;
  // The newest row is not the last one.
  insert.row(table, {{"parameters", "'Kp/Max:500;Path/Url:http://x;Empty:'"},
                     {"time_enter", "'2021-01-01'"}});
  insert.row(table, {{"parameters", "'Old/Key:0'"}, {"time_enter", "'2020-01-01'"}});
}

// Return `columns` for versions from `first` on, or before `end`, else an empty text.
std::string from(SchemaVersion version, SchemaVersion first, const std::string& columns) {
  return version >= first ? columns : std::string();
}
std::string before(SchemaVersion version, SchemaVersion end, const std::string& columns) {
  return version < end ? columns : std::string();
}

// Tables of the program's runs, its results, and whole images.
void append_statistics(SchemaVersion version, std::vector<std::string>& statements) {
  const std::string sizes =
      "STM_size INTEGER, last_sign_added INTEGER, process_mem_used INTEGER, database_mem_used "
      "INTEGER, dictionary_size INTEGER" +
      from(version, {11, 8}, ", parameters TEXT") + ", time_enter DATE";
  if (version >= SchemaVersion{11, 11}) {
    statements.push_back("CREATE TABLE Info (" + sizes + ")");
    statements.push_back("CREATE TABLE Statistics (id INTEGER NOT NULL, stamp FLOAT, data BLOB" +
                         from(version, {16, 2}, ", wm_state BLOB") + ")");
  } else {
    statements.push_back("CREATE TABLE Statistics (" + sizes + ")");
  }
  if (version >= SchemaVersion{20, 0})
    statements.emplace_back(
        "CREATE TABLE GlobalDescriptor (node_id INTEGER NOT NULL, type INTEGER NOT NULL, info "
        "BLOB, data BLOB NOT NULL)");
  else if (version >= SchemaVersion{18, 0})
    statements.emplace_back(
        "CREATE TABLE Tag (node_id INTEGER NOT NULL, tag_id INTEGER NOT NULL, stamp FLOAT NOT "
        "NULL, transform BLOB NOT NULL)");
}

}  // namespace

std::string SchemaVersion::text() const {
  return "0." + std::to_string(minor) + "." + std::to_string(patch);
}

std::vector<SchemaVersion> schema_versions() {
  return {{10, 0},  {10, 1},  {10, 7}, {10, 10}, {11, 1}, {11, 2}, {11, 8},
          {11, 10}, {11, 11}, {12, 0}, {13, 0},  {14, 0}, {15, 0}, {16, 0},
          {16, 1},  {17, 0},  {18, 0}, {18, 3},  {20, 0}, {22, 0}, {23, 0}};
}

std::vector<std::string> table_statements(SchemaVersion version) {
  const std::string words =
      "(node_id INTEGER NOT NULL, word_id INTEGER NOT NULL, pos_x FLOAT NOT NULL, pos_y FLOAT NOT "
      "NULL, size INTEGER NOT NULL, dir FLOAT NOT NULL, response FLOAT NOT NULL, " +
      from(version, {12, 0}, "octave INTEGER NOT NULL, ") +
      "depth_x FLOAT, depth_y FLOAT, depth_z FLOAT" +
      from(version, {11, 2}, ", descriptor_size INTEGER, descriptor BLOB") + ")";
  std::vector<std::string> statements{
      "CREATE TABLE Node (id INTEGER NOT NULL, map_id INTEGER NOT NULL, weight INTEGER, stamp "
      "FLOAT, pose BLOB, " +
          from(version, {11, 1}, "ground_truth_pose BLOB, ") +
          from(version, {13, 0}, "velocity BLOB, ") + "label TEXT, " +
          from(version, {14, 0}, "gps BLOB, ") + from(version, {18, 0}, "env_sensors BLOB, ") +
          before(version, {10, 1}, "user_data BLOB, ") + "time_enter DATE, PRIMARY KEY (id))",
      "CREATE TABLE Data (id INTEGER NOT NULL, image BLOB, depth BLOB, " +
          from(version, {22, 0}, "depth_confidence BLOB, ") + "calibration BLOB, " +
          before(version, {11, 10}, "scan_max_pts INTEGER, ") +
          (version < SchemaVersion{11, 10} ? from(version, {10, 7}, "scan_max_range FLOAT, ")
                                           : "") +
          "scan BLOB, " +
          from(version, {11, 10},
               "scan_info BLOB, ground_cells BLOB, obstacle_cells BLOB, cell_size FLOAT, "
               "view_point_x FLOAT, view_point_y FLOAT, view_point_z FLOAT, ") +
          from(version, {16, 0}, "empty_cells BLOB, ") +
          from(version, {10, 1}, "user_data BLOB, ") + "time_enter DATE, PRIMARY KEY (id))",
      "CREATE TABLE Link (from_id INTEGER NOT NULL, to_id INTEGER NOT NULL, type INTEGER NOT "
      "NULL, " +
          from(version, {13, 0}, "information_matrix BLOB NOT NULL, ") +
          before(version, {13, 0}, "rot_variance FLOAT NOT NULL, trans_variance FLOAT NOT NULL, ") +
          "transform BLOB" + from(version, {10, 10}, ", user_data BLOB") + ")",
      "CREATE TABLE Word (id INTEGER NOT NULL, descriptor_size INTEGER NOT NULL, descriptor BLOB "
      "NOT NULL, time_enter DATE, PRIMARY KEY (id))",
      "CREATE TABLE " +
          std::string(version >= SchemaVersion{13, 0} ? "Feature " : "Map_Node_Word ") + words,
      "CREATE TABLE Admin (version TEXT" +
          from(version, {13, 0},
               ", preview_image BLOB, opt_cloud BLOB, opt_ids BLOB, opt_poses BLOB, "
               "opt_polygons_size INTEGER, opt_polygons BLOB, opt_tex_coords BLOB, "
               "opt_tex_materials BLOB") +
          from(version, {16, 0}, ", opt_map BLOB, opt_map_x_min FLOAT, opt_map_y_min FLOAT") +
          from(version, {17, 0}, ", opt_last_localization BLOB, opt_map_resolution FLOAT") +
          from(version, {23, 0}, ", dictionary_index BLOB") + ", time_enter DATE)"};
  append_statistics(version, statements);
  return statements;
}

std::string pose_bytes(const libmap::Pose& pose) {
  std::vector<float> numbers;
  for (int i = 0; i < 12; ++i) numbers.push_back(static_cast<float>(pose.matrix()(i / 4, i % 4)));
  return bytes_of(numbers);
}

void execute(const std::filesystem::path& file, const std::string& statement,
             const std::vector<std::string>& blobs) {
  SQLite::Database database(file.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec("PRAGMA synchronous = OFF");
  SQLite::Statement query(database, statement);
  int place = 0;
  for (const std::string& blob : blobs)
    query.bind(++place, blob.data(), static_cast<int>(blob.size()));
  while (query.executeStep()) {
  }
}

libmap::Pose sample_pose(int node) {
  return libmap::make_pose_from_rpy({0.5 * node, 0.125 * node, 0.25}, {0, 0, 10.0 * node});
}

libmap::Pose sample_truth(int node) {
  return libmap::make_pose_from_rpy({0, 0, 2}, {0, 0, 90}) * sample_pose(node);
}

libmap::Pose sample_optimized(int node) {
  libmap::Pose pose = sample_pose(node);
  pose.translation().z() += 0.125 * node;
  return pose;
}

libmap::ColorImage sample_color(int node) {
  libmap::ColorImage image(32, 24);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 32; ++x)
      image.at(x, y) = {static_cast<std::uint8_t>(8 * x), static_cast<std::uint8_t>(10 * y),
                        static_cast<std::uint8_t>(40 * node)};
  return image;
}

libmap::Image<std::uint16_t> sample_depth(int node) {
  libmap::Image<std::uint16_t> image(32, 24);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 32; ++x)
      if ((x + 3 * y) % 11 != 0)
        image.at(x, y) = static_cast<std::uint16_t>(1000 * node + 7 * x - 3 * y);
  return image;
}

std::string sample_calibration(SchemaVersion version) {
  const std::vector<float> local{0, 0, 1, 0.5F, -1, 0, 0, 0.25F, 0, -1, 0, 0.125F};
  if (version < SchemaVersion{11, 2})
    return bytes_of(std::vector<float>{30, 31, 15.5F, 11.5F}) + bytes_of(local);
  if (version < SchemaVersion{18, 0})
    return bytes_of(std::vector<float>{30, 31, 15.5F, 11.5F, 32, 24}) + bytes_of(local);
  const std::vector<std::int32_t> head{0, version.minor, version.patch, 0, 32, 24, 9, 0, 0, 0, 12};
  return bytes_of(head) + bytes_of(std::vector<double>{30, 0, 15.5, 0, 31, 11.5, 0, 0, 1}) +
         bytes_of(local);
}

void write_sample(const std::filesystem::path& file, SchemaVersion version) {
  SQLite::Database database(file.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec("PRAGMA synchronous = OFF");
  SQLite::Transaction transaction(database);
  for (const std::string& statement : table_statements(version)) database.exec(statement);
  Inserter insert(database);
  insert_nodes(insert, version);
  insert_data(insert, version);
  insert_links(insert, version);
  insert_words(insert, version);
  insert_admin(insert, version);
  transaction.commit();
}

}  // namespace graspmap_test
