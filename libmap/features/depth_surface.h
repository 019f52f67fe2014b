// A depth image downsampled to a grid of small planes, to be looked up by rays.
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

// The surface through one pixel of the grid, in the camera's optical frame.
struct SurfacePatch {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // towards the camera
  double noise_m = 0.0;                              // standard deviation along the normal
};

class DepthSurface {
 public:
  // 10 bytes: the cells of all frames are what a long scan keeps in memory most of.
  struct Cell {
    std::array<std::uint16_t, 2> depth_bits{};  // of a float, m; 0: none
    std::int16_t normal_x = 0;                  // of 32767
    std::int16_t normal_y = 0;
    std::uint16_t noise = 0;  // of 1e-6 m

    float depth_m() const { return std::bit_cast<float>(depth_bits); }
    void set_depth_m(float depth_m) {
      depth_bits = std::bit_cast<std::array<std::uint16_t, 2>>(depth_m);
    }
  };

  DepthSurface() = default;
  // Every step_px-th pixel of `planes`. Planes of fewer than a quarter of their disc's pixels, as
  // at edges, are left out.
  DepthSurface(const DepthPlanes& planes, const Camera& depth_camera, const DepthNoise& noise,
               double surface_noise_m, int step_px);
  // As another was. Throws Error unless there is a cell for each step_px-th pixel of the camera.
  DepthSurface(const Camera& depth_camera, int step_px, std::vector<Cell> cells);

  const Camera& camera() const { return camera_; }
  // The same measurements seen through another camera of the same size and distortion: depths stay
  // at their pixels, normals turn with the rays.
  void set_camera(const Camera& depth_camera);
  // The same measurements with another noise of depth.
  void set_noise(const DepthNoise& before, const DepthNoise& after);
  // The same with other depths, normals as they turn by them.
  void correct(const DepthCorrection& correction);
  int step_px() const { return step_px_; }
  const std::vector<Cell>& cells() const { return cells_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  // The element at a grid place; false where nothing was measured.
  bool at(int column, int row, SurfacePatch& element) const;
  // The element whose pixel lies nearest to where the camera sees `point_in_camera`.
  bool seen_at(const Eigen::Vector3d& point_in_camera, SurfacePatch& element) const;
  // The surface on the ray of that point: the planes of the four elements around it, weighted
  // bilinearly, where all were measured on one surface; else that of the nearest.
  bool met_at(const Eigen::Vector3d& point_in_camera, SurfacePatch& element) const;

 private:
  Camera camera_{};
  int step_px_ = 1;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Cell> cells_;
  std::vector<Eigen::Vector2f> rays_;  // of a lens that distorts; else empty

  void find_rays();
  Eigen::Vector2d ray_at(int column, int row) const;
  // Where the camera sees a point, in steps of the grid.
  std::optional<Eigen::Vector2d> place_of(const Eigen::Vector3d& point_in_camera) const;
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
};

}  // namespace libmap
