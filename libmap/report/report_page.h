// A report as one HTML file: no other file and no network is asked for.
#pragma once

#include <string>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// What the page brings along.
struct PageAssets {
  std::string style;                   // CSS
  std::vector<std::string> scripts;    // our own, in their order
  std::vector<std::string> libraries;  // scripts that it needs, in their order; none: no 3-D views
  std::string library_notice;          // whose they are, with their license
  std::string version;                 // of this toolkit
};

// Scripts and style are let in by their hashes alone (Content-Security-Policy), so that nothing
// that stands in the run's files can run.
std::string report_page(const ReportContent& content, const PageAssets& assets);

// The page with its pictures changed as little as keeps it below `max_bytes` (fit_picture). If not
// even small pictures do, tables are cut to 100 rows. Throws Error naming the bound if it is still
// too large.
struct FittedPage {
  std::string html;
  int picture_level = 0;
  std::size_t changed_pictures = 0;
};
FittedPage fit_report_page(ReportContent content, const PageAssets& assets, std::size_t max_bytes);

}  // namespace libmap
