#include "libmap/texture/occluder_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {
constexpr std::size_t cells_per_chunk = 4096;
}  // namespace

void OccluderCells::begin(const PhotoProjector& projector) {
  if (side_px_ == 0) return;
  const Camera& camera = projector.camera();
  width_px_ = static_cast<float>(camera.width);
  height_px_ = static_cast<float>(camera.height);
  columns_ = (camera.width - 1) / side_px_ + 1;
  rows_ = (camera.height - 1) / side_px_ + 1;
  const auto count = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  z_.assign(count, std::numeric_limits<float>::infinity());
  rays_.resize(count);
  parallel_for(count, cells_per_chunk, [&](std::size_t begin, std::size_t end) {
    const auto columns = static_cast<std::size_t>(columns_);
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d cell(static_cast<double>(i % columns),
                                 static_cast<double>(i / columns));
      const auto ray = pixel_to_ray(camera, (side_px_ * cell).array() + (side_px_ - 1) / 2.0);
      rays_[i] = ray ? projector.to_world(ray->homogeneous()) : Eigen::Vector3d::Zero();
    }
  });
}

void OccluderCells::add(float x, float y, float z) {
  if (side_px_ == 0 || !(z > 0.0F) || !(x > -0.5F) || !(y > -0.5F)) return;
  if (!(x < width_px_ - 0.5F) || !(y < height_px_ - 0.5F)) return;
  float& nearest = z_[index(cell_of(x), cell_of(y))];
  nearest = std::min(nearest, z);
}

bool OccluderCells::has_any_above(float x, float y, const Eigen::Vector3d& normal, double height_m,
                                  double gap_m) const {
  if (side_px_ == 0) return false;
  const int middle_column = cell_of(x);
  const int middle_row = cell_of(y);
  for (int row = std::max(0, middle_row - 1); row <= std::min(rows_ - 1, middle_row + 1); ++row)
    for (int column = std::max(0, middle_column - 1);
         column <= std::min(columns_ - 1, middle_column + 1); ++column) {
      const std::size_t i = index(column, row);
      if (!std::isfinite(z_[i])) continue;
      // Both are negative below the camera.
      if (normal.dot(rays_[i]) * static_cast<double>(z_[i]) - height_m > gap_m) return true;
    }
  return false;
}

}  // namespace libmap
