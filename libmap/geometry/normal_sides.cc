#include "libmap/geometry/normal_sides.h"

#include <algorithm>
#include <numbers>
#include <optional>

#include "libmap/core/text.h"
#include "libmap/geometry/spatial_index.h"

namespace libmap {

namespace {

constexpr std::size_t max_indexed = 65536;
constexpr std::size_t max_sampled = 4000;
constexpr std::size_t min_pairs = 100;  // fewer pairs are not significant
constexpr std::size_t neighbors = 4;    // the point itself is one
constexpr float min_cosine = 0.7F;      // smaller: the neighbors are across a crease

bool is_direction(const Eigen::Vector3f& normal) {
  return normal.allFinite() && !normal.isZero(0.0F);
}

// Mean normal; nullopt if the normals cancel.
std::optional<Eigen::Vector3d> mean_direction(const std::vector<Eigen::Vector3f>& normals) {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  // The narrowing cones exclude walls and rocks; the ground remains.
  for (const double within_deg : {180.0, 60.0, 45.0, 30.0, 30.0}) {
    const double min_dot = std::cos(within_deg * std::numbers::pi / 180.0);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    std::size_t count = 0;
    for (const Eigen::Vector3f& each : normals) {
      const Eigen::Vector3d normal = each.cast<double>();
      const double length = normal.norm();
      if (!(length > 0.0) || !std::isfinite(length)) continue;
      if (within_deg < 180.0 && normal.dot(direction) < min_dot * length) continue;
      sum += normal / length;
      ++count;
    }
    if (count == 0 || sum.norm() < 0.2 * static_cast<double>(count)) return std::nullopt;
    direction = sum.normalized();
  }
  return direction;
}

}  // namespace

double opposing_fraction(const std::vector<Eigen::Vector3d>& positions,
                         const std::vector<Eigen::Vector3f>& normals) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3f> directions;
  const std::size_t count = std::min({positions.size(), normals.size(), max_indexed});
  for (std::size_t n = 0; n < count; ++n) {
    if (!positions[n].allFinite() || !is_direction(normals[n])) continue;
    points.push_back(positions[n]);
    directions.push_back(normals[n].stableNormalized());
  }
  if (points.empty()) return 0.0;
  const PointTree tree(points);
  std::size_t pairs = 0, opposing = 0;
  for (std::size_t n = 0; n < points.size(); n += points.size() / max_sampled + 1)
    for (const NeighborPoint& other : tree.nearest(points[n], neighbors)) {
      const float cosine = directions[n].dot(directions[other.index]);
      if (other.index == n || std::abs(cosine) < min_cosine) continue;
      ++pairs;
      opposing += cosine < 0.0F ? 1U : 0U;
    }
  return pairs < min_pairs ? 0.0 : static_cast<double>(opposing) / static_cast<double>(pairs);
}

std::string disagreement_text(double fraction, double opposing) {
  const auto percent = [](double value) { return to_fixed_text(100.0 * value, 1) + " %"; };
  return "its normals do not agree on an upper side: " + percent(fraction) +
         " point to one side (minimum " + percent(min_agreeing_fraction) + "), and " +
         percent(opposing) + " of neighbors to opposite sides (maximum " +
         percent(max_opposing_fraction) + ")";
}

UpOfNormals up_of_normals(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Eigen::Vector3f>& normals) {
  UpOfNormals up;
  const std::optional<Eigen::Vector3d> mean = mean_direction(normals);
  NormalVotes votes;
  for (const Eigen::Vector3f& normal : normals) votes.add(normal, mean.value_or(up.direction));
  up.fraction = votes.fraction();
  up.opposing = opposing_fraction(positions, normals);
  up.decided = mean && votes.agree() && up.opposing <= max_opposing_fraction;
  constexpr double cosine_of_20_deg = 0.9396926207859084;
  if (up.decided && mean->z() < cosine_of_20_deg) up.direction = *mean;
  return up;
}

}  // namespace libmap
