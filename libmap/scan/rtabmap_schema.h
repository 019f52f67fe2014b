// The tables of an RTAB-Map database of schema 0.23.
#pragma once

#include <string>

namespace libmap {

// The oldest version with these tables: every RTAB-Map 0.23 opens the file, and later ones do.
inline constexpr const char* rtabmap_schema_version = "0.23.0";

// CREATE statements of the tables, and of the indices and triggers upon them. The triggers put the
// present time into the rows that are inserted.
std::string rtabmap_table_statements();
std::string rtabmap_index_statements();
std::string rtabmap_trigger_statements();

}  // namespace libmap
