// A picture of one trial: the ground around it, the closed gripper, its contacts and forces as one
// colored mesh.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/gripper/gripper.h"
#include "libmap/core/triangle_mesh.h"

namespace libgtd {

// What a vertex of the picture is of: the values of its field `scene_part`. idle: a finger that
// bears nothing. cone: the forces of a contact's steepest facet. pull: the limiting direction.
enum class ScenePart { ground, gripper, engaged, link, idle, cone, pull, load };

struct ScenePartStyle {
  ScenePart part;
  libmap::Color color;
  std::string text;  // for a legend; empty: not in one
};

// One for each part, in their order. The ground has this color unless the mesh has its own.
const std::vector<ScenePartStyle>& scene_parts();

// In the mesh's frame, with vertex colors and the vertex field `scene_part`. A sphere for each
// contact that bears, and one at the tip of each finger that bears nothing; at the location if the
// gripper does not come to the ground. The pull begins where it acts, in the palm's middle; its
// length is in proportion to the force, up to three times that of `load_n`, which a disc across it
// marks.
libmap::TriangleMesh trial_scene(const libmap::TriangleMesh& mesh, const Gripper& gripper,
                                 const Trial& trial, double load_n);

// The parts of a scene with a text, those that occur in it; none of a mesh that is no scene.
std::vector<ScenePartStyle> shown_parts(const libmap::TriangleMesh& scene);

// Vertices of a sphere of a scene.
constexpr std::size_t scene_sphere_vertices = 84;  // seven rings of twelve

}  // namespace libgtd
