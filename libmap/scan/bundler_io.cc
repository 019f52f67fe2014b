#include "libmap/scan/bundler_io.h"

#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

void require_bundler_camera(const BundlerView& view) {
  constexpr double tolerance = 1e-9;  // of the focal length, and in pixels
  const Camera& camera = view.camera;
  const auto refuse = [&](const char* field, double value, const std::string& bound) {
    throw Error("Bundler has no such camera",
                {.file = view.image, .field = field, .value = to_text(value), .bound = bound});
  };
  try {
    camera.check();
  } catch (const Error& error) {
    throw error.in_file(view.image);
  }
  if (camera.is_distorted()) refuse("distortion", camera.distortion[0], "none");
  if (!(std::abs(camera.fx - camera.fy) <= tolerance * camera.fx))
    refuse("fy", camera.fy, "fx = " + to_text(camera.fx));
  if (!(std::abs(camera.cx - (camera.width - 1) / 2.0) <= tolerance))
    refuse("cx", camera.cx, to_text((camera.width - 1) / 2.0));
  if (!(std::abs(camera.cy - (camera.height - 1) / 2.0) <= tolerance))
    refuse("cy", camera.cy, to_text((camera.height - 1) / 2.0));
  if (!view.world_from_camera.matrix().allFinite())
    throw Error("the pose is not finite", {.file = view.image});
}

std::string row_of(const Eigen::Vector3d& numbers) {
  return to_text(numbers.x()) + " " + to_text(numbers.y()) + " " + to_text(numbers.z()) + "\n";
}

}  // namespace

std::string to_bundle_text(const std::vector<BundlerView>& views) {
  std::string text = "# Bundle file v0.3\n" + std::to_string(views.size()) + " 0\n";
  for (const BundlerView& view : views) {
    require_bundler_camera(view);
    // Half a turn about x: from x right, y down, z forward to x right, y up, z backward.
    const Eigen::Vector3d half_turn(1.0, -1.0, -1.0);
    const Pose camera_from_world = view.world_from_camera.inverse();
    const Eigen::Matrix3d rotation = half_turn.asDiagonal() * camera_from_world.linear();
    text += to_text(view.camera.fx) + " 0 0\n";
    for (Eigen::Index row = 0; row < 3; ++row) text += row_of(rotation.row(row).transpose());
    text += row_of(half_turn.cwiseProduct(camera_from_world.translation()));
  }
  return text;
}

std::string to_bundler_list(const std::vector<BundlerView>& views) {
  std::string text;
  for (const BundlerView& view : views) text += view.image + "\n";
  return text;
}

}  // namespace libmap
