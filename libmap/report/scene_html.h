// The 3-D view of a scene as HTML and data for the page's script.
#pragma once

#include <cstddef>
#include <string>

#include "libmap/report/report_content.h"

namespace libmap {

// Canvas, legend and data. Without `with_view` the legend alone.
std::string scene_html(const ReportScene& scene, bool with_view);

// Of the mesh in the page, about.
std::size_t scene_bytes(const TriangleMesh& mesh);

}  // namespace libmap
