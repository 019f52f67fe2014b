// CSV files as a report shows them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// At most `max_rows` of the file's rows, however large it is, and the columns that are asked for
// (none: all). Throws Error: no table, a column that is not there.
ReportTable read_report_table(const std::filesystem::path& path,
                              const std::vector<OutlineColumn>& columns, std::size_t open_rows,
                              std::size_t max_rows);

}  // namespace libmap
