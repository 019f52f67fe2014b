#include "libgtd/grasp/trial_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "libgtd/gripper/gripper_io.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace trial_scene_test {

using libgtd::ScenePart;
using libmap::TriangleMesh;

libgtd::Gripper scar_e() {
  return libgtd::read_gripper(graspmap_test::source_folder() / "data/grippers/scar-e.yaml", {});
}

// A rectangle of two triangles at height z.
TriangleMesh floor(double x0, double x1, double z = 0.0) {
  TriangleMesh mesh;
  mesh.vertices = {{x0, -1.0, z}, {x1, -1.0, z}, {x1, 1.0, z}, {x0, 1.0, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

libgtd::GraspOptions quiet_options() {
  libgtd::GraspOptions options;
  options.offset_m = options.tilt_deg = 0.0;
  options.closing.max_unseen = 1.0;
  return options;
}

struct Shown {
  libgtd::Trial trial;
  TriangleMesh scene;
};

Shown show(const TriangleMesh& mesh, const Eigen::Vector3d& location = Eigen::Vector3d::Zero(),
           const libgtd::GraspOptions& options = quiet_options()) {
  const libgtd::Ground ground(mesh);
  Shown shown{libgtd::repeat_trial(ground, scar_e(), location, options, 0, 0), {}};
  shown.scene = libgtd::trial_scene(mesh, scar_e(), shown.trial, options.load_n);
  shown.scene.check();
  return shown;
}

std::vector<std::size_t> vertices_of(const TriangleMesh& scene, ScenePart part) {
  std::vector<std::size_t> found;
  const std::vector<double>& parts = scene.vertex_fields.at(0).values;
  for (std::size_t n = 0; n < parts.size(); ++n) {
    if (parts[n] != static_cast<double>(part)) continue;
    found.push_back(n);
    if (part == ScenePart::ground) continue;
    EXPECT_EQ(scene.vertex_colors[n], libgtd::scene_parts()[static_cast<std::size_t>(part)].color);
  }
  return found;
}

std::size_t spheres(const TriangleMesh& scene, ScenePart part) {
  const std::size_t vertices = vertices_of(scene, part).size();
  EXPECT_EQ(vertices % libgtd::scene_sphere_vertices, 0U);
  return vertices / libgtd::scene_sphere_vertices;
}

void expect_spheres_of_contacts(const Shown& shown) {
  std::size_t links = 0;
  std::set<std::size_t> bearing;
  for (const libgtd::BearingContact& contact : shown.trial.bearing) {
    links += contact.is_link() ? 1 : 0;
    bearing.insert(contact.finger());
  }
  EXPECT_EQ(spheres(shown.scene, ScenePart::link), links);
  EXPECT_EQ(spheres(shown.scene, ScenePart::engaged), shown.trial.bearing.size() - links);
  EXPECT_EQ(spheres(shown.scene, ScenePart::idle), 8 - bearing.size());
}

TEST(TrialScene, OnFlatGroundEveryFingerBears) {
  const Shown shown = show(floor(-1.0, 1.0));
  expect_spheres_of_contacts(shown);
  EXPECT_EQ(spheres(shown.scene, ScenePart::engaged), 8U);
  EXPECT_EQ(spheres(shown.scene, ScenePart::idle), 0U);
  // Each sphere is around its contact.
  const std::vector<std::size_t> engaged = vertices_of(shown.scene, ScenePart::engaged);
  for (std::size_t n = 0; n < engaged.size(); ++n) {
    const std::size_t contact = n / libgtd::scene_sphere_vertices;
    EXPECT_NEAR((shown.scene.vertices[engaged[n]] - shown.trial.bearing[contact].point()).norm(),
                1.5 * 0.035 * 0.081, 1e-9);
  }
}

TEST(TrialScene, AtALedgeSomeFingersAreIdle) {
  const Shown shown = show(floor(0.0, 1.0), {0.01, 0.0, 0.0});
  expect_spheres_of_contacts(shown);
  EXPECT_GE(spheres(shown.scene, ScenePart::idle), 2U);
  EXPECT_GE(spheres(shown.scene, ScenePart::engaged), 2U);
}

// The proximal links rest on the edge of a post wider than the palm.
TEST(TrialScene, OverAPostLinksAreYellow) {
  TriangleMesh mesh = floor(-1.0, 1.0, -0.2);
  const double r = 0.07;
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const double z : {-0.2, 0.0})
    for (int n = 0; n < 16; ++n) {
      const double angle = n * 6.283185307179586 / 16;
      mesh.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    }
  for (std::uint32_t n = 0; n < 16; ++n) {
    const std::uint32_t a = first + n;
    const std::uint32_t b = first + (n + 1) % 16;
    mesh.triangles.push_back({a, b, b + 16});
    mesh.triangles.push_back({a, b + 16, a + 16});
    if (n >= 2) mesh.triangles.push_back({first + 16, first + 15 + n, first + 16 + n});
  }
  const Shown shown = show(mesh);
  expect_spheres_of_contacts(shown);
  EXPECT_GT(spheres(shown.scene, ScenePart::link), 0U);
}

TEST(TrialScene, TheConesAreThoseOfTheSteepestFacet) {
  const Shown shown = show(floor(-1.0, 1.0));
  const std::size_t rod = 6;
  EXPECT_EQ(vertices_of(shown.scene, ScenePart::cone).size(),
            shown.trial.bearing.size() * 16 * rod);
  libgtd::GripContact contact;
  contact.by_spines = true;
  contact.point = contact.outward = Eigen::Vector3d::Zero();
  contact.normal = Eigen::Vector3d::UnitZ();
  contact.drag = Eigen::Vector3d::UnitX();
  const double mu = 0.4;
  const libgtd::BearingContact bearing(contact, {0.2, 1.1, 0.7}, mu, 10.0);
  const Eigen::Vector3d axis(-std::sin(1.1), 0.0, std::cos(1.1));
  EXPECT_EQ(bearing.cone().size(), 8U);
  for (const Eigen::Vector3d& edge : bearing.cone()) {
    EXPECT_NEAR(edge.norm(), 1.0, 1e-12);
    EXPECT_NEAR(std::acos(edge.dot(axis)), std::atan(mu), 1e-9);
  }
  // The force of the best edge is inside it.
  const Eigen::Vector3d force = libgtd::BearingContact(contact, {1.1}, mu, 10.0)
                                    .best_force({-1.0, 0.0, 0.1}, libgtd::SpineSharing::equally);
  EXPECT_LE(std::acos(force.normalized().dot(axis)), std::atan(mu) + 1e-9);
  const libgtd::BearingContact adhesion(contact, libgtd::EngagementOptions{}, 0.39, 2.5);
  EXPECT_EQ(adhesion.cone().size(), 3U);
}

TEST(TrialScene, TheArrowIsAsLongAsTheForce) {
  Shown shown = show(floor(-1.0, 1.0));
  const Eigen::Vector3d palm = shown.trial.gripper.patch_from_gripper.translation();
  const auto length = [&](double force_n) {
    shown.trial.force_n = force_n;
    const TriangleMesh scene = libgtd::trial_scene(floor(-1.0, 1.0), scar_e(), shown.trial, 10.0);
    double most = 0.0;
    for (const std::size_t n : vertices_of(scene, ScenePart::pull))
      most = std::max(most, (scene.vertices[n] - palm).norm());
    return most;
  };
  const double load = 0.071;
  EXPECT_NEAR(length(10.0), load, 1e-9);
  EXPECT_NEAR(length(25.0), 2.5 * load, 1e-9);
  EXPECT_NEAR(length(1000.0), 3.0 * load, 1e-9);
  EXPECT_EQ(length(0.0), 0.0);
}

// Two large triangles are clipped to a square around the location and share their common vertices.
TEST(TrialScene, TheGroundIsCut) {
  TriangleMesh mesh = floor(-1.0, 1.0);
  mesh.vertex_colors = {{0, 0, 0}, {200, 0, 0}, {200, 0, 0}, {0, 0, 0}};
  const Shown shown = show(mesh, {0.3, 0.1, 0.0});
  const std::vector<std::size_t> ground = vertices_of(shown.scene, ScenePart::ground);
  const double half = 1.15 * (0.046 + 0.081);
  std::set<double> xs;
  for (const std::size_t n : ground) {
    const Eigen::Vector3d& vertex = shown.scene.vertices[n];
    EXPECT_LE(std::abs(vertex.x() - 0.3), half + 1e-12);
    EXPECT_LE(std::abs(vertex.y() - 0.1), half + 1e-12);
    EXPECT_NEAR(shown.scene.vertex_colors[n][0], 100.0 * (1.0 + vertex.x()), 0.51);
    xs.insert(vertex.x());
  }
  EXPECT_NEAR(*xs.rbegin() - *xs.begin(), 2.0 * half, 1e-12);
  double area = 0.0;
  for (const libmap::Triangle& triangle : shown.scene.triangles)
    if (std::find(ground.begin(), ground.end(), triangle[0]) != ground.end())
      area += 0.5 * libmap::area_normal(shown.scene, triangle).z();
  EXPECT_NEAR(area, 4.0 * half * half, 1e-9);
  // Corners of the square, and intersections of the diagonal with its border.
  EXPECT_EQ(ground.size(), 6U);
}

TEST(TrialScene, InTheMeshsFrame) {
  TriangleMesh moved = floor(-1.0, 1.0);
  for (Eigen::Vector3d& vertex : moved.vertices) vertex += Eigen::Vector3d(5.0, -3.0, 2.0);
  const Shown shown = show(moved, {5.0, -3.0, 2.0});
  for (const Eigen::Vector3d& vertex : shown.scene.vertices)
    EXPECT_LT((vertex - Eigen::Vector3d(5.0, -3.0, 2.0)).norm(), 0.5);
}

TEST(TrialScene, NoGroundIsALoneSphere) {
  libgtd::GraspOptions options = quiet_options();
  options.closing.start_height_m = 0.01;
  TriangleMesh mesh = floor(-1.0, 1.0);
  mesh = graspmap_test::join_meshes(mesh, floor(-0.1, 0.1, 0.05));
  const Shown shown = show(mesh, {0.0, 0.0, 0.0}, options);
  ASSERT_NE(shown.trial.gripper.approach, libgtd::ApproachOutcome::on_ground);
  EXPECT_EQ(spheres(shown.scene, ScenePart::idle), 1U);
  EXPECT_TRUE(vertices_of(shown.scene, ScenePart::gripper).empty());
}

TEST(TrialScene, TheSameEveryTime) {
  const Shown a = show(floor(0.0, 1.0), {0.01, 0.0, 0.0});
  const Shown b = show(floor(0.0, 1.0), {0.01, 0.0, 0.0});
  EXPECT_EQ(a.scene.vertices, b.scene.vertices);
  EXPECT_EQ(a.scene.triangles, b.scene.triangles);
  EXPECT_EQ(a.scene.vertex_colors, b.scene.vertex_colors);
}

TEST(TrialScene, ItsLegendHasWhatOccurs) {
  const Shown shown = show(floor(-1.0, 1.0));
  std::set<std::string> texts;
  for (const libgtd::ScenePartStyle& part : libgtd::shown_parts(shown.scene))
    texts.insert(part.text);
  EXPECT_TRUE(texts.contains("contact by spines"));
  EXPECT_FALSE(texts.contains("bears nothing"));
  EXPECT_FALSE(texts.contains(""));
  TriangleMesh other = floor(-1.0, 1.0);
  EXPECT_TRUE(libgtd::shown_parts(other).empty());
  other.vertex_fields = shown.scene.vertex_fields;
  other.vertex_fields[0].values = {0.0, 1.0, 99.0, std::nan("")};
  EXPECT_TRUE(libgtd::shown_parts(other).empty());
}

}  // namespace trial_scene_test
