// Surfaces of revolution by their profile: the half-plane curve that is turned about the axis a.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace libmap {

// One piece of a profile in coordinates (rho, a): distance from the axis, and along it. Pieces run
// from the top (large a) down, so that the outside lies on their left.
struct ProfileSegment {
  bool is_arc = false;
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  // of a line
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  double center_a = 0.0;  // of an arc, whose center lies on the axis
  double radius = 0.0;
  double angle_start = 0.0;  // from the +a direction, radians
  double angle_end = 0.0;

  // A straight segment; an arc about (center_a, 0).
  static ProfileSegment line(Eigen::Vector2d start, Eigen::Vector2d end);
  static ProfileSegment arc(double center_a, double radius, double angle_start, double angle_end);

  double length() const;  // of the segment, in meters
  double area() const;    // turned once about the axis
  // The part of area() between two places, t0 <= t1.
  double area_between(double t0, double t1) const;
  Eigen::Vector2d point(double t) const;  // t from 0 to 1 along the length
  // Outward unit normal at a point of the segment.
  Eigen::Vector2d normal_at(const Eigen::Vector2d& point) const;
  double curvature_along() const;  // of the profile itself
  // Of the surface in the direction round the axis (Meusnier).
  double curvature_around(const Eigen::Vector2d& point) const;
  // t such that the part of the area between t0 and t1 that lies before it is `share`.
  double t_of_area_share(double t0, double t1, double share) const;
  // Distance in the half-plane, without sign.
  double distance(const Eigen::Vector2d& point) const;
  // Whether a point of the half-plane is on the inner side of the line, or in the arc's sector
  // beyond its circle.
  bool is_beyond(const Eigen::Vector2d& point) const;
};

using Profile = std::vector<ProfileSegment>;

// Signed distance to the convex solid that a closed profile encloses.
double profile_signed_distance(const Profile& profile, const Eigen::Vector2d& point);

}  // namespace libmap
