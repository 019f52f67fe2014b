// Writes a report as one HTML file, which needs no other file and no network.
#pragma once

#include <string>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// Style and scripts embedded in the page.
struct PageAssets {
  std::string style;                   // CSS
  std::vector<std::string> scripts;    // scripts of this toolkit, in order of execution
  std::vector<std::string> libraries;  // third-party scripts, in order; empty: no 3-D views
  std::string library_notice;          // authors and licenses of `libraries`
  std::string version;                 // version of this toolkit
};

// Returns the page. Its Content-Security-Policy allows only the hashes of these scripts and this
// style, so that content of the run's files is never executed.
std::string report_page(const ReportContent& content, const PageAssets& assets);

// Returns the page with the lowest level of image reduction (fit_image) at which it has at most
// `max_bytes`. If the highest level is not sufficient, tables are cut to 100 rows. Throws Error
// naming the bound if the page is still too large.
struct FittedPage {
  std::string html;
  int image_level = 0;             // level of fit_image; 0: images are unchanged
  std::size_t changed_images = 0;  // number of reduced images
};
FittedPage fit_report_page(ReportContent content, const PageAssets& assets, std::size_t max_bytes);

}  // namespace libmap
