// Reads the rows of a database by SQLite itself.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <string>
#include <vector>

namespace graspmap_test {

using Rows = std::vector<std::vector<std::string>>;

SQLite::Database open_database(const std::filesystem::path& path);

// Each cell as "TYPE:BYTES", TYPE being SQLite's number of it, or "NULL".
Rows query(SQLite::Database& database, const std::string& text);
Rows query(const std::filesystem::path& path, const std::string& text);

}  // namespace graspmap_test
