// Makes a colored mesh that shows one trial of the virtual field test: ground, closed gripper,
// contacts and forces. For images of `graspmap grasp --scenes`.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/gripper/gripper.h"
#include "libmap/core/triangle_mesh.h"

namespace libgtd {

// Part of the scene, stored in the vertex field `scene_part`. engaged, link: contact of spines or
// of a link that bears a force. idle: finger that bears no force. cone: forces that a contact can
// bear on its steepest facet. pull: largest pull in the weakest direction. load: arrow of the load.
enum class ScenePart { ground, gripper, engaged, link, idle, cone, pull, load };

struct ScenePartStyle {
  ScenePart part;
  libmap::Color color;
  std::string text;  // label in the legend of an image; empty: not in the legend
};

// Returns one style per part, in order of ScenePart. Ground with vertex colors keeps them.
const std::vector<ScenePartStyle>& scene_parts();

// Returns the scene in the frame of the mesh, with vertex colors and the vertex field `scene_part`.
// There is a sphere at each contact that bears a force and at the tip of each finger that bears no
// force, or one sphere at the location if the gripper does not reach the ground. Both arrows start
// at the middle of the palm and have lengths proportional to the forces; the arrow of the pull is
// at most three times as long as that of `load_n`.
libmap::TriangleMesh trial_scene(const libmap::TriangleMesh& mesh, const Gripper& gripper,
                                 const Trial& trial, double load_n);

// Returns the labeled parts that occur in a scene; empty if the mesh is not a scene.
std::vector<ScenePartStyle> shown_parts(const libmap::TriangleMesh& scene);

// Number of vertices of a sphere in a scene.
constexpr std::size_t scene_sphere_vertices = 84;  // seven rings of twelve

}  // namespace libgtd
