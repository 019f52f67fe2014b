// Downsamples a depth image to a grid of small planes, and looks up planes at projected points.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "libmap/camera/depth_correction.h"
#include "libmap/core/camera.h"
#include "libmap/fusion/depth_planes.h"

namespace libmap {

// Plane at one position of the grid, in the camera's optical frame (m).
struct SurfacePatch {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, towards the camera
  double noise_m = 0.0;                              // standard deviation along the normal
};

class DepthSurface {
 public:
  // A SurfacePatch in 10 bytes, because cells need most of the memory of a long scan.
  struct Cell {
    std::array<std::uint16_t, 2> depth_bits{};  // depth as float, m; 0: no measurement
    std::int16_t normal_x = 0;                  // unit normal, in units of 1/32767
    std::int16_t normal_y = 0;
    std::uint16_t noise = 0;  // in units of 1e-6 m

    float depth_m() const { return std::bit_cast<float>(depth_bits); }
    void set_depth_m(float depth_m) {
      depth_bits = std::bit_cast<std::array<std::uint16_t, 2>>(depth_m);
    }
  };

  DepthSurface() = default;
  // Takes every step_px-th pixel of `planes`. Drops planes (e.g. at edges) whose `support` is
  // less than a quarter of the image's largest. surface_noise_m: as in FeatureOptions.
  DepthSurface(const DepthPlanes& planes, const Camera& depth_camera, const DepthNoise& noise,
               double surface_noise_m, int step_px);
  // Restores a stored surface. Throws Error if the number of cells differs from columns() * rows().
  DepthSurface(const Camera& depth_camera, int step_px, std::vector<Cell> cells);

  const Camera& camera() const { return camera_; }
  // Sets a camera of equal image size and distortion. Keeps all depths, and recomputes normals.
  void set_camera(const Camera& depth_camera);
  // Rescales the noise from the depth noise model `before` to `after`.
  void set_noise(const DepthNoise& before, const DepthNoise& after);
  // Applies the correction to the depths and recomputes the normals. Drops planes with depths <= 0.
  void correct(const DepthCorrection& correction);
  int step_px() const { return step_px_; }
  const std::vector<Cell>& cells() const { return cells_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  // Looks up a position, which must be inside the grid. at, nearest_to and interpolated_at set
  // `element` (optical frame), or return false if there is no measurement.
  bool at(int column, int row, SurfacePatch& element) const;
  // Looks up the grid position nearest to the projection of `point_in_camera` (optical frame).
  bool nearest_to(const Eigen::Vector3d& point_in_camera, SurfacePatch& element) const;
  // Looks up the surface on the point's ray: the bilinear mean of the four neighboring planes if
  // their depths on the ray differ by less than 3 %, otherwise the nearest plane.
  bool interpolated_at(const Eigen::Vector3d& point_in_camera, SurfacePatch& element) const;

 private:
  Camera camera_{};
  int step_px_ = 1;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Cell> cells_;
  std::vector<Eigen::Vector2f> rays_;  // one per cell with lens distortion, otherwise empty

  void find_rays();
  Eigen::Vector2d ray_at(int column, int row) const;
  // Projection of a point, in steps of the grid; nullopt if it is not in the image.
  std::optional<Eigen::Vector2d> grid_position(const Eigen::Vector3d& point_in_camera) const;
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
};

}  // namespace libmap
