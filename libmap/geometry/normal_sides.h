// Determines the up direction of a surface from normals, and the consistency of the normals.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace libmap {

// Minimum share of normals on one side that decides the upper side. Rocks on the ground, seen from
// all sides, have 0.92; unoriented eigenvectors have up to 0.82 (with opposing neighbors).
inline constexpr double min_agreeing_fraction = 0.8;
// Maximum share of opposing neighbors of an oriented surface; only thin parts have such neighbors.
inline constexpr double max_opposing_fraction = 0.1;

// Sums of |cosine| between unit normals and an axis, by side. Zero and NaN normals are skipped.
struct NormalVotes {
  double along = 0.0;
  double against = 0.0;

  void add(const Eigen::Vector3f& normal, const Eigen::Vector3d& unit_axis) {
    const Eigen::Vector3d n = normal.cast<double>();
    const double length = n.norm();
    if (!(length > 0.0) || !std::isfinite(length)) return;
    const double cosine = n.dot(unit_axis) / length;
    (cosine > 0.0 ? along : against) += std::abs(cosine);
  }
  NormalVotes& operator+=(const NormalVotes& other) {
    along += other.along;
    against += other.against;
    return *this;
  }
  bool empty() const { return !(along + against > 0.0); }
  // Returns the share of the larger side, 0.5 (e.g. a closed surface) to 1; 0 without votes.
  double fraction() const { return empty() ? 0.0 : std::max(along, against) / (along + against); }
  bool agree() const { return fraction() >= min_agreeing_fraction; }
};

// Returns the share of pairs of neighbors whose normals point to opposite sides, among the first
// 65536 points: 0.5 for random sides, 0 for fewer than 100 pairs. Skips pairs at creases and NaN.
double opposing_fraction(const std::vector<Eigen::Vector3d>& positions,
                         const std::vector<Eigen::Vector3f>& normals);

// Returns the warning "its normals do not agree on an upper side: 52.0 % point to one side (...".
std::string disagreement_text(double fraction, double opposing);

struct UpOfNormals {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit
  double fraction = 0.0;  // NormalVotes::fraction() of the normals; 0: no normals
  double opposing = 0.0;  // opposing_fraction
  bool decided = false;   // true if the normals agree; else `direction` is +z
};

// Returns the up direction of a surface: the mean of the normals, repeatedly restricted to normals
// near the mean, so that walls and rocks do not tilt the result. Returns +z if the mean is within
// 20 degrees of +z or the normals do not agree. Normals can have any length; zeros and NaN are
// skipped.
UpOfNormals up_of_normals(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Eigen::Vector3f>& normals);

}  // namespace libmap
