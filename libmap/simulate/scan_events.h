// Events during a simulated scan: a person, a stone, sunlight, a view of the ceiling. All are
// disabled by default. Options number frames from 1, like nodes; functions number frames from 0.
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
  int walker_first_frame = 0;   // first frame of a person walking across the site; 0: no person
  int walker_frames = 12;       // number of frames with the person
  int stone_moved_frame = 0;    // first frame after a loose stone has moved; 0: no stone
  int sun_first_frame = 0;      // first frame with sunlight; 0: never
  double sun_far_m = 1.5;       // maximum measured depth in sunlight
  int ceiling_first_frame = 0;  // first frame of a view of a plain ceiling; 0: never
  int ceiling_frames = 10;      // number of frames with the ceiling

  bool looks_up(std::size_t frame) const;  // true if the camera looks at the ceiling
  // Returns the camera body's pose, rotated upward in frames in which it looks at the ceiling.
  Pose seen_pose(const Pose& world_from_body, std::size_t frame) const;
  // Returns the maximum measured depth in a frame, for a camera with the maximum `far_m`.
  double far_at(std::size_t frame, double far_m) const;
};
void bind(ParameterTable& table, ScanEvents& events);

// An object that is not part of the site.
struct ExtraBody {
  std::shared_ptr<const VisibleSurface> surface;
  std::function<std::optional<Pose>(std::size_t frame)> world_from_body;  // nullopt: absent
};
// Returns the objects of enabled events: a person of 1.7 m who walks along y through the mesh
// center, a stone of 30 x 24 x 20 cm near the center that moves by 40 cm, a ceiling at 2.5 m.
std::vector<ExtraBody> extra_bodies(const TriangleMesh& mesh, const ScanEvents& events,
                                    std::uint64_t seed);

// Merges another view from the same camera into `view`: each pixel shows the nearer surface.
void merge_nearer(SurfaceView& view, const SurfaceView& other);

}  // namespace libmap
