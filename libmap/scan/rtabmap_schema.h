// The tables of an RTAB-Map database of schema 0.23.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace libmap {

class SqliteFile;

class RtabmapColumns {
 public:
  // Reads the schema. Throws Error if the file holds none.
  explicit RtabmapColumns(const SqliteFile& file);

  bool has_table(const std::string& table) const { return columns_.contains(table); }
  // Whether the table is there and has the column.
  bool has(const std::string& table, const std::string& column) const;
  // `column` where the table has it, else "NULL", for a query's list.
  std::string or_null(const std::string& table, const std::string& column) const;

  // The first RTAB-Map version whose schema has the newest of the columns that are there, e.g.
  // "0.18.0"; "before 0.10.0" where images stand in tables of their own.
  std::string recognized_version() const;
  // Tables, and columns "TABLE.COLUMN" of known tables, that no version up to 0.23 has.
  std::vector<std::string> unknown() const;

 private:
  std::map<std::string, std::set<std::string>> columns_;  // by table
};

// The oldest version with these tables: every RTAB-Map 0.23 opens the file, and later ones do.
inline constexpr const char* rtabmap_schema_version = "0.23.0";

// CREATE statements of the tables, and of the indices and triggers upon them. The triggers put the
// present time into the rows that are inserted.
std::string rtabmap_table_statements();
std::string rtabmap_index_statements();
std::string rtabmap_trigger_statements();

}  // namespace libmap
