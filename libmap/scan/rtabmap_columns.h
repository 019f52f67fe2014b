// Which tables and columns an RTAB-Map database has: schemas are told apart by them alone, whatever
// version the file names.
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

}  // namespace libmap
