#include "tools/support/plane_report.h"

#include <fmt/format.h>

namespace graspmap_tools {

namespace {

// Third standardized moment of the heights. Rocks and holds on their ground have +0.5 to +3, the
// same upside down as much below 0; rolling ground has about 0.
constexpr double upside_down_skewness = -1.0;

std::string_view name_of(libgtd::UpSource source) {
  if (source == libgtd::UpSource::frame_z) return "frame's z axis";
  if (source == libgtd::UpSource::camera_origin) return "camera's origin";
  return to_text(source);
}

}  // namespace

void report_plane(const libgtd::RegressionPlane& plane, const std::string& terrain, Run& run) {
  if (plane.up_source == libgtd::UpSource::direction) return;
  run.say(fmt::format("up from the {}", name_of(plane.up_source)));
  // Of the other sources, viewpoint and normals saw the outside, and the relief agrees with itself.
  if (plane.up_source == libgtd::UpSource::frame_z && plane.relief_skewness < upside_down_skewness)
    run.warn(
        fmt::format("{}: its relief hangs below the plane: if this is upside down, give --up "
                    "(--up=0,0,-1 for a cloud in a camera's frame)",
                    terrain));
}

}  // namespace graspmap_tools
