#include "tests/libmap/scan/database_rows.h"

namespace graspmap_test {
namespace {

std::string cell_of(const SQLite::Column& column) {
  if (column.isNull()) return "NULL";
  const auto* bytes = static_cast<const char*>(column.getBlob());
  const auto size = static_cast<std::size_t>(column.getBytes());
  return std::to_string(column.getType()) + ":" +
         (bytes == nullptr ? std::string() : std::string(bytes, size));
}

}  // namespace

SQLite::Database open_database(const std::filesystem::path& path) {
  return SQLite::Database(path.string(), SQLite::OPEN_READONLY);
}

Rows query(SQLite::Database& database, const std::string& text) {
  SQLite::Statement statement(database, text);
  Rows rows;
  while (statement.executeStep()) {
    rows.emplace_back();
    for (int i = 0; i < statement.getColumnCount(); ++i)
      rows.back().push_back(cell_of(statement.getColumn(i)));
  }
  return rows;
}

Rows query(const std::filesystem::path& path, const std::string& text) {
  SQLite::Database database = open_database(path);
  return query(database, text);
}

}  // namespace graspmap_test
