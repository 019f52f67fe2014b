// Simple polygons of the x-y plane, convex or not, and cropping of clouds.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Cross product: twice the signed area of the triangle (0, a, b), > 0 if counter-clockwise.
inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

class XyPolygon {
 public:
  // Takes corners in either orientation. Drops a last corner equal to the first. Throws Error if
  // there are fewer than three corners, a corner is not finite or occurs twice in succession, edges
  // cross or touch, or there is no area.
  explicit XyPolygon(std::vector<Eigen::Vector2d> corners);

  const std::vector<Eigen::Vector2d>& corners() const { return corners_; }  // counter-clockwise
  double area_m2() const { return area_m2_; }
  Eigen::Vector2d min() const { return min_; }
  Eigen::Vector2d max() const { return max_; }

  // True for points inside or within 1e-9 m of the border.
  bool contains(const Eigen::Vector2d& point) const;

  // Returns edges that may intersect the box, as the indices of their first corners, ascending.
  std::vector<std::uint32_t> edges_near(const Eigen::Vector2d& box_min,
                                        const Eigen::Vector2d& box_max) const;

 private:
  std::size_t strip_of(double y) const;
  void make_strips();
  void require_simple() const;

  std::vector<Eigen::Vector2d> corners_;
  Eigen::Vector2d min_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d max_ = Eigen::Vector2d::Zero();
  double area_m2_ = 0.0;
  std::vector<std::vector<std::uint32_t>> strips_;  // edges by interval of y
};

// The rectangle from min to max.
XyPolygon make_rectangle(const Eigen::Vector2d& min, const Eigen::Vector2d& max);

// Polygon extruded between two heights. Without a polygon, contains all points between the heights.
struct ExtrudedPolygon {
  std::optional<XyPolygon> polygon{};
  double min_z = -std::numeric_limits<double>::infinity();
  double max_z = std::numeric_limits<double>::infinity();

  bool contains(const Eigen::Vector3d& point) const {
    return point.z() >= min_z && point.z() <= max_z &&
           (!polygon || polygon->contains(point.head<2>()));
  }
};

// Returns the points inside and on the border, with normals, colors and fields.
PointCloud clip_cloud(const PointCloud& cloud, const ExtrudedPolygon& prism);

}  // namespace libmap
