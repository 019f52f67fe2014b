// Schema of RTAB-Map databases: the columns of a file, and the statements that create schema 0.23.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace libmap {

class SqliteFile;

class RtabmapColumns {
 public:
  // Reads the schema. Throws Error if it cannot be read.
  explicit RtabmapColumns(const SqliteFile& file);

  bool has_table(const std::string& table) const { return columns_.contains(table); }
  // True if the table exists and has the column.
  bool has(const std::string& table, const std::string& column) const;
  // Returns `column` if the table has the column, else "NULL", as a part of an SQL query.
  std::string or_null(const std::string& table, const std::string& column) const;

  // Returns the first RTAB-Map version whose schema has the newest column of the file, e.g.
  // "0.18.0"; "before 0.10.0" if images are in separate tables.
  std::string recognized_version() const;
  // Returns tables, and columns "TABLE.COLUMN" of known tables, that no version up to 0.23 has.
  std::vector<std::string> unknown() const;

 private:
  std::map<std::string, std::set<std::string>> columns_;  // by table
};

// Schema version of written files, which RTAB-Map 0.23 and later can open.
inline constexpr const char* rtabmap_schema_version = "0.23.0";

// CREATE statements of tables, indices and triggers. The triggers set the current time in new rows.
std::string rtabmap_table_statements();
std::string rtabmap_index_statements();
std::string rtabmap_trigger_statements();

}  // namespace libmap
