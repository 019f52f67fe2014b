#include "tests/libmap/texture/painted_scan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/mesh/ray_caster.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

using libmap::Camera;
using libmap::Pose;
using libmap::TriangleMesh;

namespace {

constexpr int samples = 3;

libmap::ColorImage photograph(const libmap::RayCaster& caster, const Paint& paint,
                              const Camera& camera, const Pose& pose) {
  libmap::ColorImage image(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int s = 0; s < samples * samples; ++s) {
        const int row = s / samples;
        const Eigen::Vector2d pixel(x + (s % samples + 0.5) / samples - 0.5,
                                    y + (row + 0.5) / samples - 0.5);
        const auto ray = libmap::pixel_to_ray(camera, pixel);
        if (!ray) continue;
        const Eigen::Vector3d direction = pose.linear() * ray->homogeneous();
        const auto hit = caster.cast(pose.translation(), direction);
        if (hit) sum += paint(hit->triangle, pose.translation() + hit->distance * direction);
      }
      for (std::size_t c = 0; c < 3; ++c)
        image.at(x, y)[c] = static_cast<std::uint8_t>(std::lround(
            std::clamp(sum[static_cast<Eigen::Index>(c)] / (samples * samples), 0.0, 255.0)));
    }
  return image;
}

}  // namespace

PaintedScan::PaintedScan(const TriangleMesh& mesh, const Paint& paint, const Camera& camera,
                         const std::vector<Pose>& world_from_camera)
    : camera_(camera) {
  camera_.base_from_camera = Pose::Identity();
  const libmap::RayCaster caster(mesh);
  int node = 0;
  for (const Pose& pose : world_from_camera) {
    poses_.push_back({++node, static_cast<double>(node), pose});
    photos_.push_back(photograph(caster, paint, camera_, pose));
  }
}

libmap::RgbdFrame PaintedScan::read_frame(int node, libmap::FrameParts parts) const {
  libmap::RgbdFrame frame;
  frame.node = node;
  frame.cameras = {camera_};
  if (parts.color) frame.color = photos_[static_cast<std::size_t>(node) - 1];
  return frame;
}

Camera small_camera() {
  Camera camera;
  camera.width = 220;
  camera.height = 180;
  camera.fx = camera.fy = 200;
  camera.cx = 109.5;
  camera.cy = 89.5;
  return camera;
}

Pose looking_at(const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - position).normalized();
  Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ());
  if (right.norm() < 1e-6) right = Eigen::Vector3d::UnitX();
  right.normalize();
  Pose pose = Pose::Identity();
  pose.linear() << right, forward.cross(right), forward;
  pose.translation() = position;
  return pose;
}

std::vector<Pose> circle_of_cameras(int count, double radius_m, double height_m) {
  std::vector<Pose> poses;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / count;
    poses.push_back(looking_at({radius_m * std::cos(angle), radius_m * std::sin(angle), height_m},
                               {0.0, 0.0, 0.0}));
  }
  return poses;
}

TriangleMesh grid_mesh(int cells, double size_m, double z) {
  TriangleMesh mesh;
  const int side = cells + 1;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      mesh.vertices.emplace_back(size_m * (1.0 * x / cells - 0.5), size_m * (1.0 * y / cells - 0.5),
                                 z);
  for (int y = 0; y < cells; ++y)
    for (int x = 0; x < cells; ++x) {
      const auto a = static_cast<std::uint32_t>(y * side + x);
      const auto b = a + static_cast<std::uint32_t>(side);
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
  return mesh;
}

Eigen::Vector3d soft_marks(const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = 2.0 * std::numbers::pi * p;
  return {130.0 + 40.0 * std::sin(q.x() / 0.3) + 30.0 * std::cos(q.y() / 0.15),
          120.0 + 30.0 * std::sin((q.x() + q.y()) / 0.25) + 25.0 * std::cos(q.z() / 0.2),
          110.0 + 45.0 * std::cos(q.x() / 0.2) * std::sin(q.y() / 0.24)};
}

void spoil(PaintedScan& scan, std::vector<Eigen::Vector3d>& gains) {
  for (std::size_t i = 0; i < scan.size(); ++i) {
    gains.emplace_back(uniform(0.75, 1.2), uniform(0.75, 1.2), uniform(0.75, 1.2));
    libmap::ColorImage& photo = scan.photo(i);
    const Eigen::Vector2d middle((photo.width - 1) / 2.0, (photo.height - 1) / 2.0);
    for (int y = 0; y < photo.height; ++y)
      for (int x = 0; x < photo.width; ++x) {
        const double r2 = (Eigen::Vector2d(x, y) - middle).squaredNorm() / middle.squaredNorm();
        for (std::size_t c = 0; c < 3; ++c)
          photo.at(x, y)[c] = static_cast<std::uint8_t>(std::lround(std::min(
              255.0,
              photo.at(x, y)[c] * gains[i][static_cast<Eigen::Index>(c)] * (1.0 - 0.3 * r2))));
      }
  }
}

}  // namespace graspmap_test
