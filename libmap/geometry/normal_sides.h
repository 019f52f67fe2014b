// The side of a surface that is up, as far as its normals agree.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace libmap {

// Smaller shares of normals on one side do not decide which side is up. Rocks seen from all sides
// on their ground have 0.92, eigenvectors without an orientation up to 0.82 (with opposing
// neighbors).
inline constexpr double min_agreeing_share = 0.8;
// Neighbors of an oriented surface rarely face opposite sides: thin parts do.
inline constexpr double max_opposing_share = 0.1;

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
  // Share of the larger side, 0.5 to 1; 0 without votes. 0.5 for a closed surface.
  double share() const { return empty() ? 0.0 : std::max(along, against) / (along + against); }
  bool agree() const { return share() >= min_agreeing_share; }
};

// Share of neighboring points whose normals face opposite sides, among the first 65536 points; 0.5
// for normals with random sides. Neighbors across a crease do not count. Positions may be NaN.
double opposing_share(const std::vector<Eigen::Vector3d>& positions,
                      const std::vector<Eigen::Vector3f>& normals);

// "its normals do not agree on a side (52.0 % of at least 80 %; ...)"
std::string disagreement_text(double share, double opposing);

struct UpOfNormals {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit
  double share = 0.0;     // of the normals on its side (NormalVotes); 0: no normals
  double opposing = 0.0;  // opposing_share
  bool decided = false;   // by the normals; else `direction` is +z
};

// Up by the normals of a surface: the mean of the normals, repeatedly taken among those around it,
// so that walls and rocks do not tilt it. +z if that mean is within 20 degrees of +z, or if the
// normals do not agree. Normals may have any length; zeros and NaN are skipped.
UpOfNormals up_of_normals(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Eigen::Vector3f>& normals);

}  // namespace libmap
