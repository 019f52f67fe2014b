#include "tools/support/report_scene.h"

#include "libgtd/grasp/trial_scene.h"
#include "libmap/core/error.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/report/scene_html.h"

namespace graspmap_tools {

libmap::ReportScene load_report_scene(const std::filesystem::path& path, double& bytes_left) {
  libmap::ReportScene scene;
  scene.mesh = libmap::read_mesh(path).mesh;
  const auto bytes = static_cast<double>(libmap::scene_bytes(scene.mesh));
  if (bytes > bytes_left)
    throw libmap::Error("the report has no room for it: --max-size-mb gives more");
  bytes_left -= bytes;
  for (const libgtd::ScenePartStyle& part : libgtd::shown_parts(scene.mesh))
    scene.legend.emplace_back(part.color, part.text);
  return scene;
}

}  // namespace graspmap_tools
