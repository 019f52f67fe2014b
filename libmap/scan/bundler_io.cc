#include "libmap/scan/bundler_io.h"

#include "libmap/core/text.h"

namespace libmap {

namespace {

std::string row_of(const Eigen::Vector3d& numbers) {
  return to_text(numbers.x()) + " " + to_text(numbers.y()) + " " + to_text(numbers.z()) + "\n";
}

}  // namespace

std::string to_bundle_text(const std::vector<BundlerView>& views) {
  std::string text = "# Bundle file v0.3\n" + std::to_string(views.size()) + " 0\n";
  for (const BundlerView& view : views) {
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
