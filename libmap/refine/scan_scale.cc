#include "libmap/refine/scan_scale.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr double picked_px = 0.5;  // standard deviation of a picked pixel
constexpr double guessed_depth_m = 2.0;

std::optional<KnownLength::End> parse_end(std::string_view text) {
  const std::size_t first = text.find(':');
  const std::size_t second = text.rfind(':');
  if (first == second) return std::nullopt;
  const std::optional<int> node = parse_int(text.substr(0, first));
  const std::optional<double> x = parse_double(text.substr(first + 1, second - first - 1));
  const std::optional<double> y = parse_double(text.substr(second + 1));
  if (!node || !x || !y || !(std::abs(*x) < 1e6) || !(std::abs(*y) < 1e6)) return std::nullopt;
  return KnownLength::End{*node, {*x, *y}};
}

struct MeasuredEnd {
  Eigen::Vector3d in_map = Eigen::Vector3d::Zero();
  double variance = 0.0;  // per axis, in m2
};

[[noreturn]] void refuse(const KnownLength::End& length_end, const std::string& reason,
                         const std::string& bound) {
  throw Error(reason, {.field = "known length",
                       .value = std::to_string(length_end.node) + ":" +
                                to_text(length_end.pixel.x()) + ":" + to_text(length_end.pixel.y()),
                       .bound = bound});
}

MeasuredEnd measured_end(const KnownLength::End& length_end,
                         const std::vector<FrameFeatures>& frames,
                         const SensorCalibration& calibration,
                         const std::map<int, Pose>& map_from_base) {
  const auto found = std::find_if(frames.begin(), frames.end(), [&](const FrameFeatures& frame) {
    return frame.node == length_end.node;
  });
  const auto pose = map_from_base.find(length_end.node);
  if (found == frames.end() || found->cameras.empty() || pose == map_from_base.end())
    refuse(length_end, "the node has no usable images or no pose", "a node with images and a pose");
  FrameFeatures frame;
  frame.node = found->node;
  frame.cameras = found->cameras;
  frame.surfaces = found->surfaces;
  const Camera& camera = frame.cameras.front();
  const auto ray = pixel_to_ray(camera, length_end.pixel);
  if (!ray || length_end.pixel.x() < 0.0 || length_end.pixel.y() < 0.0 ||
      length_end.pixel.x() > camera.width - 1.0 || length_end.pixel.y() > camera.height - 1.0)
    refuse(length_end, "the pixel is outside the image",
           "0:0 to " + std::to_string(camera.width - 1) + ":" + std::to_string(camera.height - 1));
  SurfacePatch element;
  if (frame.surfaces.empty() ||
      !frame.surfaces.front().nearest_to(guessed_depth_m * ray->homogeneous(), element))
    refuse(length_end, "no depth was measured at this pixel", "a pixel on a surface");
  // Intersects the ray with the plane of the nearest element.
  const double depth = element.normal.dot(element.point) / element.normal.dot(ray->homogeneous());
  if (!(depth > 0.0))
    refuse(length_end, "no depth was measured at this pixel", "a pixel on a surface");
  frame.features.push_back({ray->cast<float>(), static_cast<float>(depth), 0.0F, 0.0F, 0});
  calibrate(frame, calibration);
  const double picked_m = picked_px * depth / std::min(camera.fx, camera.fy);
  return {pose->second * frame.point_in_base(0),
          element.noise_m * element.noise_m + picked_m * picked_m};
}

}  // namespace

KnownLength parse_known_length(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  const std::size_t dash = text.find('-', text.find(':', text.find(':') + 1) + 2);
  if (equals != std::string::npos && dash != std::string::npos && dash < equals) {
    const auto from = parse_end(std::string_view(text).substr(0, dash));
    const auto to = parse_end(std::string_view(text).substr(dash + 1, equals - dash - 1));
    const auto length = parse_double(std::string_view(text).substr(equals + 1));
    if (from && to && length && *length > 0.0 && *length < 1e6) return {*from, *to, *length};
  }
  throw Error("not a known length", {.field = "known length",
                                     .value = text,
                                     .bound = "NODE:X:Y-NODE:X:Y=METERS with METERS > 0"});
}

void check_known_lengths(const std::vector<FrameFeatures>& frames,
                         const std::vector<KnownLength>& lengths) {
  for (const KnownLength& known : lengths)
    for (const KnownLength::End& length_end : {known.from, known.to})
      measured_end(length_end, frames, {}, {{length_end.node, Pose::Identity()}});
}

ScaleEstimate scale_by_lengths(const std::vector<FrameFeatures>& frames,
                               const SensorCalibration& calibration,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<KnownLength>& lengths) {
  double weights = 0.0;
  double sum = 0.0;
  std::vector<std::array<double, 2>> ratios;
  for (const KnownLength& known : lengths) {
    const MeasuredEnd from = measured_end(known.from, frames, calibration, map_from_base);
    const MeasuredEnd to = measured_end(known.to, frames, calibration, map_from_base);
    const double distance = (to.in_map - from.in_map).norm();
    const double deviation = std::sqrt(from.variance + to.variance);
    if (!(distance > 3.0 * deviation))
      refuse(known.to, "the distance to the other end is within three times the depth noise",
             "more than " + to_fixed_text(3e3 * deviation, 1) + " mm from the other end");
    const double ratio = known.length_m / distance;
    const double weight = std::pow(distance / (ratio * deviation), 2);
    ratios.push_back({ratio, weight});
    weights += weight;
    sum += weight * ratio;
  }
  ScaleEstimate scale;
  if (ratios.empty()) return scale;
  scale.factor = sum / weights;
  scale.deviation = 1.0 / std::sqrt(weights);
  scale.lengths = ratios.size();
  for (const auto& [ratio, weight] : ratios)
    scale.chi_square += weight * (ratio - scale.factor) * (ratio - scale.factor);
  if (ratios.size() > 1) scale.chi_square /= static_cast<double>(ratios.size() - 1);
  return scale;
}

std::optional<ScaleEstimate> scale_by_odometry(const std::vector<GraphLinkResult>& links,
                                               const std::map<int, Pose>& map_from_base) {
  double mixed = 0.0;
  double squares = 0.0;
  ScaleEstimate scale;
  for (const GraphLinkResult& kept : links) {
    const PoseLink& link = kept.link;
    const auto from = map_from_base.find(link.from);
    const auto to = map_from_base.find(link.to);
    if (kept.rejected || link.type != LinkType::neighbor || from == map_from_base.end() ||
        to == map_from_base.end())
      continue;
    const Eigen::Vector3d refined = (from->second.inverse() * to->second).translation();
    const Eigen::Matrix3d information = kept.weight * link.information.topLeftCorner<3, 3>();
    mixed += refined.dot(information * link.from_from_to.translation());
    squares += refined.dot(information * refined);
    ++scale.lengths;
  }
  if (!(mixed > 0.0 && squares > 0.0)) return std::nullopt;
  scale.factor = mixed / squares;
  scale.deviation = 1.0 / std::sqrt(squares);
  return scale;
}

void apply_scale(double factor, int fixed_node, std::size_t cameras,
                 std::map<int, Pose>& map_from_base, SensorCalibration& calibration) {
  const auto fixed = map_from_base.find(fixed_node);
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  if (fixed != map_from_base.end()) center = fixed->second.translation();
  for (auto& [node, pose] : map_from_base)
    pose.translation() = center + factor * (pose.translation() - center);
  calibration.depth.resize(std::max(calibration.depth.size(), cameras));
  for (DepthCorrection& depth : calibration.depth) depth.scale *= factor;
}

}  // namespace libmap
