// What happens while a scan is recorded: things that move, sunlight, a look away. All are off by
// default; frames count from 1, as nodes do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/depth_camera.h"

namespace libmap {

struct ScanEvents {
  int walker_first_frame = 0;   // from which on a person walks across the site; 0: nobody
  int walker_frames = 12;       // that it takes
  int stone_moved_frame = 0;    // from which on a loose stone lies elsewhere; 0: no stone
  int sun_first_frame = 0;      // from which on the sun shines; 0: never
  double sun_far_m = 1.5;       // largest depth that is measured then
  int ceiling_first_frame = 0;  // from which on the camera looks up at a plain ceiling; 0: never
  int ceiling_frames = 10;

  bool looks_up(std::size_t frame) const;  // counts from 0
  // The body's pose, turned up where it looks up.
  Pose seen_pose(const Pose& world_from_body, std::size_t frame) const;
  // Of the depth camera, whose own is `far_m`.
  double far_at(std::size_t frame, double far_m) const;
};
void bind(ParameterTable& table, ScanEvents& events);

// Something that is not part of the site: where it is in each frame, if anywhere.
struct ExtraBody {
  std::shared_ptr<const VisibleSurface> surface;
  std::function<std::optional<Pose>(std::size_t frame)> world_from_body;
};
// A person of 1.7 m who walks along y through the middle of the mesh; a stone of 30 x 24 x 20 cm,
// moved by 40 cm near the middle; a ceiling 2.5 m above the ground.
std::vector<ExtraBody> extra_bodies(const TriangleMesh& mesh, const ScanEvents& events,
                                    std::uint64_t seed);

// Of two views of one camera what is nearer.
void take_nearer(SurfaceView& view, const SurfaceView& other);

}  // namespace libmap
