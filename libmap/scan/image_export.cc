#include "libmap/scan/image_export.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/scan/rtabmap_reader.h"

namespace libmap {

std::string image_file_name(int node, std::size_t camera, const std::string& extension) {
  constexpr std::size_t digits = 6;
  const std::string number = std::to_string(node);
  return std::string(digits - std::min(digits, number.size()), '0') + number +
         (camera == 0 ? std::string() : "_" + std::to_string(camera)) + extension;
}

ImageFile image_file_of(const ScanSource& scan, int node, const std::vector<CameraView>& views,
                        std::size_t camera) {
  ImageFile file;
  const auto* database = dynamic_cast<const RtabmapDatabase*>(&scan);
  file.bytes = database != nullptr && views.size() == 1 ? database->read_blobs(node).image
                                                        : encode_png(views[camera].color);
  const ImageFormat format = image_format(file.bytes).value_or(ImageFormat::png);
  file.name = image_file_name(node, camera, file_extension(format));
  return file;
}

std::vector<CameraView> read_views(const ScanSource& scan, int node, FrameParts parts) {
  const RgbdFrame frame = scan.read_frame(node, parts);
  const std::string name = "node " + std::to_string(node);
  if (frame.color.empty())
    throw Error("has no color image", {.file = scan.path().string(), .field = name});
  if (frame.cameras.empty())
    throw Error("has no calibration", {.file = scan.path().string(), .field = name});
  return camera_views(frame);
}

void bind(ParameterTable& table, ViewSelectionOptions& options) {
  table.add("radius_m", options.radius_m, not_negative,
            "with --bundler: distance between camera positions below which only one of several "
            "images with similar viewing directions is kept, m; 0: all images are kept");
  table.add("angle_deg", options.angle_deg, {0.0, 180.0},
            "with --bundler: maximum angle between the optical axes of similar images, degrees");
}

namespace {

bool resemble(const Pose& a, const Pose& b, const ViewSelectionOptions& options) {
  if (!((a.translation() - b.translation()).norm() < options.radius_m)) return false;
  const Eigen::Vector3d axis = a.linear().col(2);
  const Eigen::Vector3d other = b.linear().col(2);
  const double angle = std::atan2(axis.cross(other).norm(), axis.dot(other));
  return angle <= options.angle_deg * std::numbers::pi / 180.0;
}

}  // namespace

std::vector<std::size_t> select_views(const std::vector<Pose>& world_from_camera,
                                      const std::vector<double>& qualities,
                                      const ViewSelectionOptions& options) {
  std::vector<std::size_t> order(world_from_camera.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return qualities[a] > qualities[b]; });
  std::vector<std::size_t> kept;
  for (const std::size_t view : order)
    if (std::none_of(kept.begin(), kept.end(), [&](std::size_t other) {
          return resemble(world_from_camera[view], world_from_camera[other], options);
        }))
      kept.push_back(view);
  std::sort(kept.begin(), kept.end());
  return kept;
}

namespace {

std::string row_of(const Eigen::Vector3d& numbers) {
  return to_text(numbers.x()) + " " + to_text(numbers.y()) + " " + to_text(numbers.z()) + "\n";
}

}  // namespace

std::string to_bundle_text(const std::vector<BundlerView>& views) {
  std::string text = "# Bundle file v0.3\n" + std::to_string(views.size()) + " 0\n";
  for (const BundlerView& view : views) {
    // Half a turn about x, from x right, y down, z forward to x right, y up, z backward.
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
