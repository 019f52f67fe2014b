// Balls of 1 cm radius that fall on an exported world, in two physics engines.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace graspmap_test {

constexpr double ball_radius_m = 0.01;

struct FallenBalls {
  std::vector<Eigen::Vector3d> centers;
  std::vector<double> speeds;             // m/s
  std::vector<Eigen::Vector3d> contacts;  // between balls and ground
};

// `count` places within the middle of the mesh, 5 cm above its highest surface.
std::vector<Eigen::Vector3d> places_above(const libmap::TriangleMesh& mesh, std::size_t count,
                                          double margin_m);

// world.xml of the folder, as MuJoCo loads it.
FallenBalls drop_in_mujoco(const std::filesystem::path& folder,
                           const std::vector<Eigen::Vector3d>& places);

// world.urdf of the folder: its collision meshes as Bullet's triangle meshes.
FallenBalls drop_in_bullet(const std::filesystem::path& folder,
                           const std::vector<Eigen::Vector3d>& places);

// Expects that all balls are at rest on the surface, and that all contacts are within 2 mm of it
// plus `bound_m`.
void expect_on_surface(const FallenBalls& balls, const libmap::TriangleMesh& surface,
                       double bound_m);

}  // namespace graspmap_test
