// Determines the up direction of a surface from normals, and the consistency of the normals.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace libmap {

// Minimum of NormalVotes::fraction() of a surface whose normals have correct signs. Measured: 0.92
// for rocks scanned from all sides. Random signs yield up to 0.82 but exceed max_opposing_fraction.
inline constexpr double min_agreeing_fraction = 0.8;
// Maximum of opposing_fraction() for correct signs; only thin parts have opposing neighbors then.
inline constexpr double max_opposing_fraction = 0.1;

// Sums of |cosine| of the angles between normals and an axis. Zero and NaN normals are skipped.
struct NormalVotes {
  double along = 0.0;    // sum over normals with cosine > 0
  double against = 0.0;  // sum over the other normals

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
  // Returns the share of the larger sum, 0.5 (e.g. a closed surface) to 1; 0 without votes.
  double fraction() const { return empty() ? 0.0 : std::max(along, against) / (along + against); }
  bool agree() const { return fraction() >= min_agreeing_fraction; }
};

// Returns the share of pairs of neighboring points, among the first 65536 points, whose normals
// point to opposite sides: 0.5 for random signs; 0 if there are fewer than 100 pairs. Skips NaN,
// and pairs of normals that are neither parallel nor antiparallel within 45 degrees (creases).
double opposing_fraction(const std::vector<Eigen::Vector3d>& positions,
                         const std::vector<Eigen::Vector3f>& normals);

// Returns the warning "its normals do not agree on an upper side: 52.0 % point to one side (...".
std::string disagreement_text(double fraction, double opposing);

struct UpOfNormals {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit vector upwards
  double fraction = 0.0;  // NormalVotes::fraction() of the normals; 0: no normals
  double opposing = 0.0;  // opposing_fraction() of the normals
  bool decided = false;   // true if `fraction` and `opposing` are within the bounds above
};

// Returns the up direction of a surface: the mean of the normals, repeatedly restricted to normals
// near the mean, so that walls and rocks do not tilt the result. `direction` is +z if the mean is
// within 20 degrees of +z or `decided` is false. Normals can have any length; skips zeros and NaN.
UpOfNormals up_of_normals(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Eigen::Vector3f>& normals);

}  // namespace libmap
