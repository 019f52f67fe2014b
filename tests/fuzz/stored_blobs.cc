#include "tests/fuzz/stored_blobs.h"

#include <SQLiteCpp/SQLiteCpp.h>

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

}  // namespace

StoredBlobs::StoredBlobs() {
  std::filesystem::remove(file_.path());
  graspmap_test::write_sample(file_.path());
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
