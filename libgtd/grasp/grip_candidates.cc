#include "libgtd/grasp/grip_candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libgtd/grasp/finger_closing.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

constexpr float no_ground = -std::numeric_limits<float>::infinity();

}  // namespace

GripCandidates::GripCandidates(const libmap::TriangleMesh& mesh, const Gripper& gripper,
                               const CandidateOptions& options)
    : start_height_m_(options.start_height_m) {
  const FingerGeometry finger = finger_geometry(gripper);
  init_grid(mesh, options.cell_m);
  for (const libmap::Triangle& triangle : mesh.triangles)
    add_triangle(
        {mesh.vertices[triangle[0]], mesh.vertices[triangle[1]], mesh.vertices[triangle[2]]});
  const double radius = finger.tip(finger.opening_rad, finger.curl_rad).x();
  const auto reach = static_cast<std::int64_t>(radius / cell_m_);
  for (std::int64_t i = -reach; i <= reach; ++i)
    for (std::int64_t j = -reach; j <= reach; ++j)
      if (cell_m_ * std::hypot(i, j) <= radius) reach_.push_back({i, j});
  max_blocked_cells_ =
      static_cast<std::size_t>(options.max_blocked_fraction * static_cast<double>(reach_.size()));
}

void GripCandidates::init_grid(const libmap::TriangleMesh& mesh, double cell_m) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    low = low.cwiseMin(vertex.head<2>());
    high = high.cwiseMax(vertex.head<2>());
  }
  if (mesh.vertices.empty()) low = high = Eigen::Vector2d::Zero();
  const Eigen::Vector2d sides = high - low;
  constexpr double max_cells = 1e8;
  cell_m_ = std::max(
      {cell_m, std::sqrt(sides.x() * sides.y() / max_cells), sides.maxCoeff() / max_cells});
  low_ = low;
  for (std::size_t side = 0; side < 2; ++side) {
    const double count = sides[static_cast<Eigen::Index>(side)] / cell_m_;
    cells_[side] = std::isfinite(count) ? static_cast<std::int64_t>(count) + 1 : 1;
  }
  cell_tops_.assign(static_cast<std::size_t>(cells_[0] * cells_[1]), no_ground);
}

std::int64_t GripCandidates::cell(double coordinate, std::size_t side) const {
  const double number = (coordinate - low_[static_cast<Eigen::Index>(side)]) / cell_m_;
  if (!(number > 0.0)) return 0;  // also if the difference is not finite
  return static_cast<std::int64_t>(std::min(number, static_cast<double>(cells_[side] - 1)));
}

// Raises the columns of the corners and those whose center is on the triangle.
void GripCandidates::add_triangle(const std::array<Eigen::Vector3d, 3>& corners) {
  const auto raise_to = [&](std::int64_t i, std::int64_t j, double z) {
    float& top = cell_tops_[static_cast<std::size_t>(i * cells_[1] + j)];
    top = std::max(top, static_cast<float>(z));
  };
  for (const Eigen::Vector3d& corner : corners)
    raise_to(cell(corner.x(), 0), cell(corner.y(), 1), corner.z());
  const auto [x_low, x_high] = std::minmax({corners[0].x(), corners[1].x(), corners[2].x()});
  const auto [y_low, y_high] = std::minmax({corners[0].y(), corners[1].y(), corners[2].y()});
  const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  if (normal.z() == 0.0) return;
  const double sign = std::copysign(1.0, normal.z());
  for (std::int64_t i = cell(x_low, 0); i <= cell(x_high, 0); ++i)
    for (std::int64_t j = cell(y_low, 1); j <= cell(y_high, 1); ++j) {
      const Eigen::Vector2d middle = low_ + cell_m_ * Eigen::Vector2d(static_cast<double>(i) + 0.5,
                                                                      static_cast<double>(j) + 0.5);
      bool is_inside = true;
      for (std::size_t n = 0; n < 3 && is_inside; ++n) {
        const Eigen::Vector2d edge = (corners[(n + 1) % 3] - corners[n]).head<2>();
        const Eigen::Vector2d way = middle - corners[n].head<2>();
        is_inside = sign * (edge.x() * way.y() - edge.y() * way.x()) >= 0.0;
      }
      if (is_inside)
        raise_to(i, j,
                 corners[0].z() - normal.head<2>().dot(middle - corners[0].head<2>()) / normal.z());
    }
}

float GripCandidates::top_at(std::int64_t i, std::int64_t j) const {
  if (i < 0 || j < 0 || i >= cells_[0] || j >= cells_[1]) return no_ground;
  return cell_tops_[static_cast<std::size_t>(i * cells_[1] + j)];
}

bool GripCandidates::may_hold(const Eigen::Vector3d& location) const {
  const Eigen::Vector2d column = (location.head<2>() - low_) / cell_m_;
  if (!(column.cwiseAbs().maxCoeff() < 1e15)) return false;
  const auto i = static_cast<std::int64_t>(std::floor(column.x()));
  const auto j = static_cast<std::int64_t>(std::floor(column.y()));
  if (top_at(i, j) > location.z() + start_height_m_) return false;
  std::size_t blocked = 0;
  for (const auto& [di, dj] : reach_)
    if (top_at(i + di, j + dj) > location.z() + start_height_m_) ++blocked;
  return blocked <= max_blocked_cells_;
}

}  // namespace libgtd
