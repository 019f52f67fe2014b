// What `render` shows of a file, as the user asks for it.
#pragma once

#include "libmap/core/parameters.h"
#include "libmap/view/scene_view.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

// How a map lies in the picture. terrain: as in its terrain frame. input: turned about z and moved
// level, so that x and y are those of the cloud that was scored; heights stay the terrain's.
// automatic: terrain for one file, input for several.
enum class MapHeading { automatic, terrain, input };

// One file as a scene, with listed places on it.
struct SceneFileOptions {
  std::string points;  // CSV of marked places; empty: none
  std::string label = "auto";
  std::string verdict;
  std::string zero_plane = "auto";
  PointFrame points_frame = PointFrame::automatic;
  std::string box;  // of the plan that is shown
  std::uint64_t max_points = 1'000'000;
  libmap::SceneLayer layer;  // its shape is the file's
  MapHeading heading = MapHeading::automatic;
};

// All but `points`, which is an option of its own.
void bind(libmap::ParameterTable& table, SceneFileOptions& options);

struct SceneFile {
  libmap::Scene scene;
  int columns_per_point = 0;  // of a tile store: side of the squares that became one point; else 0
};

// A cloud, a mesh, a graspability map or a tile store. Throws Error naming the file.
SceneFile read_scene(const std::string& file, const SceneFileOptions& options, Run& run);

// The file that stands for it in a manifest: of a tile store its index.
std::filesystem::path scene_input(const std::string& file);

}  // namespace graspmap_tools
