// The 3-D view of a map as HTML and data for the page's script.
#pragma once

#include <string>

#include "libmap/report/report_content.h"

namespace libmap {

// Legend, picture for where no view can be, canvas, looked-up points and data. Without `with_view`
// the data and the canvas are left out. `still` is the picture as <img>, or empty.
std::string map_html(const ReportMap& map, const std::string& still, bool with_view);

// Colors of the classes and flags, for the page's script.
std::string palette_json();

// Rules of the legend's swatches, a class each.
std::string palette_style();

}  // namespace libmap
