#include "libmap/fusion/view_coverage.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace libmap {

namespace {

constexpr double pixels_per_view = 4800.0;
constexpr double ignored_fraction = 0.05;  // share of a frame's pixels

}  // namespace

void FrameCoverage::add(const DepthImage& depth, const PixelRays& rays,
                        const Pose& grid_from_camera, const DepthSensor& sensor,
                        double cell_size_m) {
  const auto size = static_cast<double>(depth.pixels.size());
  const int step = std::max(1, static_cast<int>(std::sqrt(size / pixels_per_view)));
  for (int y = step / 2; y < depth.height; y += step)
    for (int x = step / 2; x < depth.width; x += step) {
      const std::size_t n = depth.index(x, y);
      const auto z = static_cast<double>(depth.pixels[n]);
      if (!(z >= sensor.min_depth_m && z <= sensor.max_depth_m)) continue;
      const Eigen::Vector3d ray(rays.x[n], rays.y[n], 1.0);
      const Eigen::Vector3i cell =
          (grid_from_camera * (z * ray) / cell_size_m).array().floor().cast<int>();
      const std::uint32_t number = cells.find_or_add(pack({cell, 0}));
      if (number == information.size()) {
        information.push_back(0.0F);
        pixels.push_back(0);
      }
      const auto noise = static_cast<float>(sensor.noise.axial_at(z));
      information[number] += 1.0F / (noise * noise);
      ++pixels[number];
    }
}

bool ViewCoverage::is_improved_by(const FrameCoverage& frame, double views) const {
  double all = 0.0;
  double improved = 0.0;
  for (std::size_t n = 0; n < frame.pixels.size(); ++n) {
    all += frame.pixels[n];
    const std::uint32_t cell = cells_.find(frame.cells.keys()[n]);
    if (cell == VoxelIndex::none ||
        static_cast<double>(frame.information[n]) * views > information_[cell])
      improved += frame.pixels[n];
  }
  return improved > ignored_fraction * all;
}

void ViewCoverage::add(const FrameCoverage& frame) {
  for (std::size_t n = 0; n < frame.pixels.size(); ++n) {
    const std::uint32_t cell = cells_.find_or_add(frame.cells.keys()[n]);
    if (cell == information_.size()) information_.push_back(0.0F);
    information_[cell] += frame.information[n];
  }
}

}  // namespace libmap
