// What stands nearest to the camera in each small square of a photograph. Inner part of
// libmap/texture.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/texture/texture_photos.h"

namespace libmap {

class OccluderCells {
 public:
  // Squares of so many pixels; 0: nothing is ever found.
  explicit OccluderCells(int side_px) : side_px_(side_px) {}

  // Forgets the photograph before.
  void begin(const PhotoProjector& projector);
  // A point of a surface by its pixel and z, m, in the camera's frame; none if z is not positive or
  // the pixel is outside.
  void add(float x, float y, float z);
  // Whether something in the square of the pixel or in the eight around it is more than `gap_m`
  // above the plane: normal . (point - camera) = height_m in the world's axes, the normal toward
  // the camera. The pixel must be inside the photograph.
  bool has_any_above(float x, float y, const Eigen::Vector3d& normal, double height_m,
                     double gap_m) const;

 private:
  int cell_of(float x) const { return static_cast<int>((x + 0.5F) / static_cast<float>(side_px_)); }
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  int side_px_;
  float width_px_ = 0.0F;
  float height_px_ = 0.0F;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<float> z_;               // the least of the points in each square
  std::vector<Eigen::Vector3d> rays_;  // through its middle, z = 1, world's axes; zero: none
};

}  // namespace libmap
