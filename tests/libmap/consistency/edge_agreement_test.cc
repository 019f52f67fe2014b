#include "libmap/consistency/edge_agreement.h"

#include <cmath>
#include <numbers>

#include "libmap/camera/depth_correction.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/rigid_motion.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace edge_agreement_test {

using graspmap_test::box;
using graspmap_test::looking;
using graspmap_test::MemoryScan;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::sphere;
using graspmap_test::Surface;

Camera color_camera() {
  Camera camera;
  camera.width = 256;
  camera.height = 192;
  camera.fx = camera.fy = 210;
  camera.cx = 127.5;
  camera.cy = 95.5;
  return camera;
}

std::vector<Surface> objects() {
  return {plane_z(0),
          sphere({0.3, 0.1, 0.05}, 0.3),
          sphere({-0.4, 0.3, 0.0}, 0.25),
          box({-0.3, -0.5, 0}, {0.1, -0.2, 0.3}),
          box({0.5, -0.6, 0}, {0.7, -0.4, 0.5}),
          sphere({-0.7, -0.5, 0.1}, 0.2)};
}

// Each object has its own brightness, with noise.
ColorImage image(const Camera& camera, const Pose& eye, std::mt19937_64& engine) {
  const std::vector<Surface> all = objects();
  std::normal_distribution<double> noise(0.0, 6.0);
  ColorImage image(camera.width, camera.height);
  const auto rays = ray_table(camera);
  for (std::size_t n = 0; n < rays.size(); ++n) {
    double nearest = std::numeric_limits<double>::infinity();
    double brightness = 20.0;
    for (std::size_t k = 0; k < all.size(); ++k) {
      const double along = all[k](eye.translation(), eye.linear() * rays[n].homogeneous());
      if (along >= nearest) continue;
      nearest = along;
      brightness = 50.0 + 35.0 * static_cast<double>(k * 2 % 5);
    }
    const auto gray = static_cast<std::uint8_t>(std::clamp(brightness + noise(engine), 0.0, 255.0));
    image.pixels[n] = {gray, gray, gray};
  }
  return image;
}

// Depth is taken by a camera with another focal length at another place and stored as it is.
MemoryScan scan_with(const Pose& color_from_depth, double focal_factor, int frames = 16) {
  MemoryScan scan;
  std::mt19937_64 engine = random_engine();
  const Camera camera = color_camera();
  Camera depth_camera = camera;
  depth_camera.fx *= focal_factor;
  depth_camera.fy *= focal_factor;
  const Surface ground = graspmap_test::nearest_of(objects());
  PoseGraph graph;
  for (int n = 0; n < frames; ++n) {
    const double angle = 0.4 * n;
    const Pose eye =
        looking({1.6 * std::cos(angle), 1.6 * std::sin(angle), 0.7 + 0.03 * n}, {0, 0, 0.05}) *
        camera.base_from_camera;
    scan.add(camera,
             graspmap_test::render_depth(ground, depth_camera, eye * color_from_depth,
                                         {0.001, 0.001}, engine),
             image(camera, eye, engine));
    GraphNode node;
    node.id = n + 1;
    graph.nodes.push_back(node);
  }
  scan.set_graph(graph);
  return scan;
}

Pose displace_vertices(const Eigen::Vector3d& shift_m, const Eigen::Vector3d& turn_deg) {
  Pose pose = Pose::Identity();
  pose.linear() = rotation_of(std::numbers::pi / 180.0 * turn_deg).toRotationMatrix();
  pose.translation() = shift_m;
  return pose;
}

TEST(EdgeAgreement, RegisteredDepthAgrees) {
  const EdgeAgreement found = check_edge_agreement(scan_with(Pose::Identity(), 1.0));
  EXPECT_EQ(found.frames, 16U);
  EXPECT_GT(found.edges, 4000U);
  EXPECT_GT(found.stored, 0.3);
  EXPECT_LT(found.displacement_px, 1.0);
  EXPECT_FALSE(found.is_displaced());
  EXPECT_FALSE(found.is_scaled());
  EXPECT_EQ(found.sentence(), "");
  // Errors below half a degree are those of a refinement, not of this check.
  EXPECT_FALSE(check_edge_agreement(scan_with(displace_vertices({0.003, 0, 0}, {0, 0.2, 0}), 1.0))
                   .is_displaced());
}

// The place and direction of the depth camera, by where they put points in the image.
TEST(EdgeAgreement, DisplacedDepthIsFoundAndEstimated) {
  for (const Pose& truth : {displace_vertices({0.025, 0, 0}, {0, 1.5, 0}),
                            displace_vertices({-0.02, 0.015, 0}, {1.0, -0.8, 0.8}),
                            displace_vertices({0, -0.03, 0}, {-3.0, 0.5, 0}),
                            displace_vertices({0.06, 0, 0}, {0, 0, 0})}) {
    const EdgeAgreement found = check_edge_agreement(scan_with(truth, 1.0));
    EXPECT_TRUE(found.is_displaced());
    EXPECT_FALSE(found.is_scaled());
    EXPECT_GT(found.significance, 6.0);
    EXPECT_GT(found.aligned, found.stored + 0.05);
    EXPECT_NEAR(found.focal_factor, 1.0, 0.01);
    EXPECT_NE(found.sentence(), "");
    for (const double z : {1.5, 2.2})
      for (const double x : {-0.4, 0.0, 0.4}) {
        const Eigen::Vector3d point(x, 0.3 * x, z);
        const auto expected = project_point(color_camera(), truth * point);
        const auto actual = project_point(color_camera(), found.color_from_depth * point);
        EXPECT_LT((*expected - *actual).norm(), 2.0) << x << " " << z;
      }
  }
}

TEST(EdgeAgreement, AnotherFocalLengthIsNamed) {
  for (const double factor : {0.9, 1.12}) {
    const EdgeAgreement found =
        check_edge_agreement(scan_with(displace_vertices({0.02, 0, 0}, {0, 0, 0}), factor));
    EXPECT_TRUE(found.is_scaled()) << factor;
    EXPECT_NEAR(found.focal_factor, factor, 0.015);
  }
}

TEST(EdgeAgreement, TheSameForAnyNumberOfThreads) {
  const MemoryScan scan = scan_with(displace_vertices({0.025, 0, 0}, {0, 1.5, 0}), 1.0, 8);
  const auto checked_by = [&](unsigned threads) {
    const ThreadLimit limit(threads);
    return check_edge_agreement(scan);
  };
  const EdgeAgreement one = checked_by(1);
  const EdgeAgreement three = checked_by(3);
  EXPECT_EQ(one.displacement_px, three.displacement_px);
  EXPECT_EQ(one.significance, three.significance);
  EXPECT_EQ(one.color_from_depth.matrix(), three.color_from_depth.matrix());
}

// Images that cannot be compared are not displaced.
TEST(EdgeAgreement, TooLittleIsNoDisplacement) {
  const Pose wrong = displace_vertices({0.05, 0, 0}, {0, 3, 0});
  EXPECT_FALSE(check_edge_agreement(MemoryScan()).is_displaced());
  EXPECT_FALSE(check_edge_agreement(scan_with(wrong, 1.0, 3)).is_displaced());
  MemoryScan scan = scan_with(wrong, 1.0, 8);
  scan.broken[3] = true;
  EXPECT_EQ(check_edge_agreement(scan).frames, 7U);
  for (auto& [node, frame] : scan.frames) frame.color = {};
  EXPECT_EQ(check_edge_agreement(scan).frames, 0U);
  scan = scan_with(wrong, 1.0, 8);
  for (auto& [node, frame] : scan.frames) frame.depth = DepthImage(256, 192, 0.0F);
  EXPECT_FALSE(check_edge_agreement(scan).is_displaced());
  scan = scan_with(wrong, 1.0, 8);
  for (auto& [node, frame] : scan.frames) frame.color = ColorImage(256, 192, {90, 90, 90});
  EXPECT_FALSE(check_edge_agreement(scan).is_displaced());
  // Images of something else.
  std::mt19937_64 engine = random_engine();
  for (auto& [node, frame] : scan.frames)
    for (Color& pixel : frame.color.pixels)
      pixel = {static_cast<std::uint8_t>(engine() % 256), 0, 0};
  EXPECT_FALSE(check_edge_agreement(scan).is_displaced());
}

}  // namespace edge_agreement_test
}  // namespace libmap
