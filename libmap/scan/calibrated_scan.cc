#include "libmap/scan/calibrated_scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr double max_step = 0.03;  // of depth between pixels of one surface
constexpr double max_miss_px = 0.5;
constexpr int search_rounds = 5;

class CalibratedScan : public ScanSource {
 public:
  CalibratedScan(std::unique_ptr<ScanSource> scan, CameraFile calibration)
      : scan_(std::move(scan)), calibration_(std::move(calibration)) {}

  const std::filesystem::path& path() const override { return scan_->path(); }
  const PoseGraph& graph() const override { return scan_->graph(); }
  const std::vector<std::string>& warnings() const override { return scan_->warnings(); }
  SourceNode source_of(int node) const override { return scan_->source_of(node); }
  std::string image_name(int node) const override { return scan_->image_name(node); }
  RgbdFrame read_frame(int node, FrameParts parts) const override;

 private:
  std::unique_ptr<ScanSource> scan_;
  CameraFile calibration_;
};

std::string size_of(const Camera& camera) {
  return std::to_string(camera.width) + " x " + std::to_string(camera.height);
}

// Depth at a place between pixels whose four neighbors are of one surface, else at the nearest.
double depth_between(const DepthImage& depth, const Eigen::Vector2d& at) {
  const int left = std::clamp(static_cast<int>(std::floor(at.x())), 0, depth.width - 2);
  const int top = std::clamp(static_cast<int>(std::floor(at.y())), 0, depth.height - 2);
  const auto z = [&](int i, int j) { return static_cast<double>(depth.at(left + i, top + j)); };
  const double u = std::clamp(at.x() - left, 0.0, 1.0);
  const double v = std::clamp(at.y() - top, 0.0, 1.0);
  const auto [least, most] = std::minmax({z(0, 0), z(1, 0), z(0, 1), z(1, 1)});
  if (!(least > 0.0 && most - least < max_step * most)) return z(u < 0.5 ? 0 : 1, v < 0.5 ? 0 : 1);
  return (1.0 - v) * ((1.0 - u) * z(0, 0) + u * z(1, 0)) + v * ((1.0 - u) * z(0, 1) + u * z(1, 1));
}

// The depth image as the color camera sees it. Each pixel looks for the measurement that falls on
// it, from pixel to pixel by how far it misses.
DepthImage registered_depth(const RgbdFrame& frame, const Pose& color_from_depth) {
  const DepthImage& taken = frame.depth;
  DepthImage seen(taken.width, taken.height);
  if (taken.width < 2 || taken.height < 2) return seen;
  RgbdFrame depth_only;
  depth_only.cameras = frame.cameras;
  depth_only.depth = taken;
  const Camera camera = camera_views(depth_only).front().depth_camera;
  for (int y = 0; y < taken.height; ++y)
    for (int x = 0; x < taken.width; ++x) {
      Eigen::Vector2d source(x, y);
      Eigen::Vector3d point = Eigen::Vector3d::Zero();
      double miss_px = std::numeric_limits<double>::infinity();
      for (int round = 0; round < search_rounds && miss_px > 0.05; ++round) {
        const double z = depth_between(taken, source);
        const auto ray = pixel_to_ray(camera, source);
        if (!(z > 0.0) || !ray) break;
        point = color_from_depth * Eigen::Vector3d(z * ray->homogeneous());
        const auto pixel = project_point(camera, point);
        if (!pixel) break;
        const Eigen::Vector2d miss = Eigen::Vector2d(x, y) - *pixel;
        miss_px = miss.norm();
        source += miss;
        if (!(source.x() > -0.5 && source.y() > -0.5 && source.x() < taken.width - 0.5 &&
              source.y() < taken.height - 0.5))
          break;
      }
      if (miss_px < max_miss_px) seen.at(x, y) = static_cast<float>(point.z());
    }
  return seen;
}

RgbdFrame CalibratedScan::read_frame(int node, FrameParts parts) const {
  RgbdFrame frame = scan_->read_frame(node, parts);
  try {
    apply_calibration(frame, calibration_);
  } catch (const Error& error) {
    throw error.in_field("node " + std::to_string(node)).in_file(scan_->path().string());
  }
  return frame;
}

}  // namespace

void apply_calibration(RgbdFrame& frame, const CameraFile& calibration) {
  if (frame.cameras.empty() && frame.stereo.empty()) return;
  if (frame.cameras.size() != 1 || !frame.stereo.empty())
    throw Error("a calibration is of one camera",
                {.field = "cameras",
                 .value = std::to_string(frame.cameras.size() + 2 * frame.stereo.size()),
                 .bound = "1"});
  Camera& camera = frame.cameras.front();
  const Camera& known = calibration.camera;
  if (camera.width != known.width || camera.height != known.height)
    throw Error("the calibration is of another size",
                {.field = "camera", .value = size_of(camera), .bound = size_of(known)});
  const Pose base_from_camera = camera.base_from_camera;
  // By the stored camera, as it was estimated.
  const Pose color_from_depth = calibration.color_from_depth_at(frame.stamp_s);
  if (!color_from_depth.matrix().isIdentity(0.0))
    frame.depth = registered_depth(frame, color_from_depth);
  camera = known;
  camera.base_from_camera = base_from_camera;
  correct_depth(frame.depth, calibration.depth);
}

std::unique_ptr<ScanSource> with_calibration(std::unique_ptr<ScanSource> scan,
                                             const CameraFile& calibration) {
  return std::make_unique<CalibratedScan>(std::move(scan), calibration);
}

}  // namespace libmap
