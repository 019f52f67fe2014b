#include "libmap/consistency/pose_consistency.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/fusion/fusion_frames.h"
#include "libmap/fusion/view_pairs.h"
#include "libmap/scan/pose_import.h"

namespace libmap {

namespace {

constexpr std::size_t max_pairs = 24;
constexpr std::size_t max_gap = 60;  // frames
constexpr double min_turn_rad = 8.0 * std::numbers::pi / 180.0;
constexpr double min_shift_m = 0.1;
constexpr double max_difference = 0.05;
constexpr std::size_t min_measurements = 500;
// Shares of contradicted measurements.
constexpr double doubtful_fraction = 0.2;       // minimum for trying conventions
constexpr double contradictory_fraction = 0.5;  // minimum for a warning without a convention
constexpr double max_fitting_fraction = 0.5;    // maximum for a convention that fits
constexpr double min_gain = 3.0;                // minimum ratio of differences, given to best

// Converts poses from another convention; depth is multiplied by `depth_factor`.
struct Convention {
  std::string text;
  std::function<Pose(const Pose& given, const Pose& base_from_camera)> world_from_base;
  double depth_factor = 1.0;
};

// All permutations and reflections of the axes, with the text of the new coordinates.
std::vector<std::pair<std::string, Eigen::Matrix3d>> axis_changes() {
  std::vector<std::pair<std::string, Eigen::Matrix3d>> rotations;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
      std::string text;
      for (int row = 0; row < 3; ++row) {
        const bool is_negative = (signs >> row & 1) != 0;
        const int column = order[static_cast<std::size_t>(row)];
        rotation(row, column) = is_negative ? -1.0 : 1.0;
        text += std::string(row == 0 ? "" : " ") + (is_negative ? "-" : "") + "xyz"[column];
      }
      if (!rotation.isIdentity()) rotations.emplace_back(text, rotation);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return rotations;
}

std::vector<Convention> conventions() {
  const auto as_camera = [](const Pose& pose, const Pose& base_from_camera) {
    return Pose(pose * base_from_camera.inverse());
  };
  const auto first_w = [](const Pose& pose) {
    return with_quaternion_order(pose, QuaternionOrder::wxyz);
  };
  const Pose y_up(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  std::vector<Convention> all = {
      {"with the quaternion as w x y z: --poses-quaternion wxyz",
       [=](const Pose& pose, const Pose&) { return first_w(pose); }},
      {"with the quaternion as w x y z, of the optical frame: --poses-quaternion wxyz --poses-of "
       "camera",
       [=](const Pose& pose, const Pose& camera) { return as_camera(first_w(pose), camera); }},
      {"as poses of the camera's optical frame: --poses-of camera", as_camera},
      {"as poses of the base: --poses-of base",
       [](const Pose& pose, const Pose& camera) { return Pose(pose * camera); }},
      {"as poses of a camera with y up and z backward",
       [=](const Pose& pose, const Pose& camera) { return as_camera(pose * y_up, camera); }},
      {"inverted", [](const Pose& pose, const Pose&) { return pose.inverse(); }},
      {"inverted, as poses of the camera's optical frame",
       [=](const Pose& pose, const Pose& camera) { return as_camera(pose.inverse(), camera); }}};
  for (const auto& [text, rotation] : axis_changes())
    all.push_back({"with positions x y z changed to " + text + ", the axes of the rotations",
                   [rotation = rotation](const Pose& pose, const Pose&) {
                     Pose moved = pose;
                     moved.translation() = rotation * pose.translation();
                     return moved;
                   }});
  for (const double factor : {0.2, 5.0, 0.001, 1000.0})
    all.push_back({"with depth times " + to_text(factor) +
                       " (depth_unit_m of scan.yaml), or positions times " + to_text(1.0 / factor) +
                       ": --poses-scale " + to_text(1.0 / factor),
                   [](const Pose& pose, const Pose&) { return pose; }, factor});
  return all;
}

// Two frames with their given poses.
struct ViewedPair {
  RefinementView first;
  RefinementView second;
  Pose world_from_first;
  Pose world_from_second;
};

DepthAgreement agreement_of(const std::vector<ViewedPair>& pairs, const Convention& convention) {
  std::vector<double> differences;
  std::size_t contradicted = 0;
  for (const ViewedPair& pair : pairs) {
    const Pose base_from_first = pair.first.camera_from_grid.inverse();
    const Pose base_from_second = pair.second.camera_from_grid.inverse();
    Pose second_from_first =
        (convention.world_from_base(pair.world_from_second, base_from_second) * base_from_second)
            .inverse() *
        convention.world_from_base(pair.world_from_first, base_from_first) * base_from_first;
    second_from_first.translation() /= convention.depth_factor;
    for (const bool back : {false, true}) {
      const auto compared =
          back ? compare_views(pair.second, pair.first, second_from_first.inverse(), 0.0F)
               : compare_views(pair.first, pair.second, second_from_first, 0.0F);
      for (const float difference : compared.depth) {
        if (!std::isfinite(difference)) continue;
        differences.push_back(std::abs(static_cast<double>(difference)));
        contradicted += differences.back() > max_difference ? 1 : 0;
      }
    }
  }
  DepthAgreement agreement{differences.size(), 1.0, 1.0};
  if (differences.empty()) return agreement;
  agreement.contradicted =
      static_cast<double>(contradicted) / static_cast<double>(differences.size());
  agreement.difference = median(std::move(differences));
  return agreement;
}

// Returns the next frame that has moved enough to reveal a wrong convention, or nullopt.
std::optional<std::size_t> partner_of(std::size_t first, const Trajectory& poses) {
  for (std::size_t n = first + 1; n < std::min(first + max_gap, poses.size()); ++n) {
    const Pose motion = poses[first].world_from_base.inverse() * poses[n].world_from_base;
    if (!motion.matrix().allFinite()) continue;
    if (Eigen::AngleAxisd(motion.linear()).angle() > min_turn_rad ||
        motion.translation().norm() > min_shift_m)
      return n;
  }
  return std::nullopt;
}

std::vector<ViewedPair> read_pairs(const ScanSource& scan, const Trajectory& poses) {
  FusionFrames images(scan, {});
  const auto numbers = near_pairs_of(poses);
  std::vector<std::optional<ViewedPair>> read(numbers.size());
  parallel_each(numbers.size(), [&](std::size_t n) {
    const auto view = [&](std::size_t number) {
      FusionFrame frame;
      frame.node = poses[number].node;
      return images.views_of(frame, 0, false).front();
    };
    try {
      const auto [first, second] = numbers[n];
      read[n] = {view(first), view(second), poses[first].world_from_base,
                 poses[second].world_from_base};
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::bad_input) throw;
    }
  });
  std::vector<ViewedPair> pairs;
  for (std::optional<ViewedPair>& pair : read)
    if (pair) pairs.push_back(std::move(*pair));
  return pairs;
}

}  // namespace

std::string PoseConsistency::warning() const {
  const auto percent = [](double fraction) { return to_fixed_text(100.0 * fraction, 0) + " %"; };
  const std::string found = given.measurements == 0
                                ? std::to_string(pairs) + " pairs of frames have no depth in common"
                                : percent(given.contradicted) + " of the depth that " +
                                      std::to_string(pairs) +
                                      " pairs of frames have in common is contradictory";
  if (!convention.empty())
    return "the poses fit " + to_fixed_text(given.difference / best.difference, 0) +
           " times better " + convention + "; " + found + ", but only " +
           percent(best.contradicted) + " with this convention";
  if (given.measurements < min_measurements || given.contradicted < contradictory_fraction)
    return {};
  return found + ": poses, depth unit or calibration are wrong, and no usual convention fits";
}

std::vector<std::pair<std::size_t, std::size_t>> near_pairs_of(const Trajectory& poses) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  const std::size_t anchors = std::min(max_pairs, poses.size());
  for (std::size_t n = 0; n < anchors; ++n) {
    const std::size_t first = n * poses.size() / anchors;
    if (const auto second = partner_of(first, poses)) pairs.emplace_back(first, *second);
  }
  return pairs;
}

PoseConsistency check_pose_consistency(const ScanSource& scan, const Trajectory& world_from_base) {
  const std::vector<ViewedPair> pairs = read_pairs(scan, world_from_base);
  PoseConsistency found;
  found.pairs = pairs.size();
  found.given = agreement_of(pairs, {"", [](const Pose& pose, const Pose&) { return pose; }});
  if (pairs.empty() || found.given.contradicted < doubtful_fraction) return found;
  const std::vector<Convention> all = conventions();
  std::vector<DepthAgreement> agreements(all.size());
  parallel_each(all.size(), [&](std::size_t n) { agreements[n] = agreement_of(pairs, all[n]); });
  const auto best = std::min_element(
      agreements.begin(), agreements.end(), [](const DepthAgreement& a, const DepthAgreement& b) {
        if ((a.measurements < min_measurements) != (b.measurements < min_measurements))
          return a.measurements >= min_measurements;
        return a.difference < b.difference;
      });
  if (best->measurements >= min_measurements &&
      2 * best->measurements >= found.given.measurements &&
      best->contradicted < max_fitting_fraction && best->difference > 0.0 &&
      min_gain * best->difference < found.given.difference) {
    found.best = *best;
    found.convention = all[static_cast<std::size_t>(best - agreements.begin())].text;
  }
  return found;
}

}  // namespace libmap
