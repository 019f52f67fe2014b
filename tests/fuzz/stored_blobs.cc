#include "tests/fuzz/stored_blobs.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include "libmap/camera/image_codec.h"
#include "libmap/camera/matrix_codec.h"
#include "libmap/core/file_output.h"
#include "tests/libmap/scan/sample_database.h"

namespace graspmap_fuzz {

namespace {

std::vector<std::string> texts(SQLite::Database& database, const std::string& query) {
  std::vector<std::string> list;
  SQLite::Statement statement(database, query);
  while (statement.executeStep()) list.push_back(statement.getColumn(0).getString());
  return list;
}

// What RTAB-Map keeps of its last map.
void store_map(const std::filesystem::path& path) {
  using libmap::MatrixElement;
  const auto matrix = [](int rows, int columns, int channels, MatrixElement element,
                         const std::string& bytes) {
    return libmap::encode_matrix({rows, columns, channels, element, bytes});
  };
  // Two triangles of one material.
  const std::vector<std::int32_t> polygons = {2, 0, 1, 2, 0, 2, 3};
  const std::string image = libmap::encode_png(graspmap_test::sample_color(1));
  const std::vector<std::pair<std::string, std::string>> blobs = {
      {"opt_map", matrix(2, 3, 1, MatrixElement::int8, std::string(6, '\x64'))},
      {"opt_cloud", matrix(1, 4, 3, MatrixElement::float32, std::string(48, '\0'))},
      {"opt_polygons", matrix(1, 7, 1, MatrixElement::int32, graspmap_test::bytes_of(polygons))},
      {"opt_tex_materials", image},
      {"preview_image", image},
      {"opt_last_localization", graspmap_test::pose_bytes(libmap::Pose::Identity())}};
  SQLite::Database database(path.string(), SQLite::OPEN_READWRITE);
  database.exec("UPDATE Admin SET opt_polygons_size = 3, opt_map_resolution = 0.05");
  for (const auto& [column, bytes] : blobs) {
    SQLite::Statement update(database, "UPDATE Admin SET " + column + " = ?");
    update.bind(1, bytes.data(), static_cast<int>(bytes.size()));
    update.exec();
  }
}

}  // namespace

StoredBlobs::StoredBlobs() {
  std::filesystem::remove(file_.path());
  graspmap_test::write_sample(file_.path());
  store_map(file_.path());
  sample_ = libmap::read_whole_file(file_.path(), 1U << 26U);
  SQLite::Database database(file_.path().string(), SQLite::OPEN_READONLY);
  for (const std::string& table :
       texts(database, "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name"))
    for (const std::string& column :
         texts(database, "SELECT name FROM pragma_table_info('" + table + "')")) {
      SQLite::Statement rows(database, "SELECT rowid, " + column + " FROM " + table +
                                           " WHERE typeof(" + column + ") = 'blob'");
      while (rows.executeStep())
        places_.push_back(
            {table, column, rows.getColumn(0).getInt64(), rows.getColumn(1).getString()});
    }
}

const std::filesystem::path& StoredBlobs::database_with(std::size_t place,
                                                        std::string_view bytes) const {
  file_.write(sample_);
  SQLite::Database database(file_.path().string(), SQLite::OPEN_READWRITE);
  database.exec("PRAGMA journal_mode = OFF");
  database.exec("PRAGMA synchronous = OFF");
  const Place& at = places_[place];
  SQLite::Statement update(database,
                           "UPDATE " + at.table + " SET " + at.column + " = ? WHERE rowid = ?");
  update.bind(1, bytes.data(), static_cast<int>(bytes.size()));
  update.bind(2, at.row);
  update.exec();
  return file_.path();
}

}  // namespace graspmap_fuzz
