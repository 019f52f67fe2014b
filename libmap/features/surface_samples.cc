#include "libmap/features/surface_samples.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libmap/core/random_stream.h"

namespace libmap {

namespace {

constexpr int patch_cells = 6;  // larger than the discs that planes are fitted to
constexpr std::uint64_t every_patch = 10;

// The patches differ between frames.
bool is_for_checks(int node, std::size_t camera, int row, int column) {
  const std::uint64_t frame =
      mix_bits(static_cast<std::uint64_t>(node), static_cast<std::uint64_t>(camera));
  const std::uint64_t patch = mix_bits(static_cast<std::uint64_t>(row / patch_cells),
                                       static_cast<std::uint64_t>(column / patch_cells));
  return mix_bits(frame, patch) % every_patch == 0;
}

}  // namespace

std::vector<PlacedElement> surface_samples(const FrameFeatures& frame, int count, SampleUse use) {
  std::size_t cells = 0;
  for (const DepthSurface& surface : frame.surfaces)
    cells += static_cast<std::size_t>(surface.columns()) * static_cast<std::size_t>(surface.rows());
  if (use == SampleUse::checks) cells /= every_patch;
  const int step = std::max(
      1, static_cast<int>(std::floor(std::sqrt(static_cast<double>(cells) / std::max(1, count)))));
  std::vector<PlacedElement> samples;
  for (std::size_t camera = 0; camera < frame.surfaces.size(); ++camera) {
    const DepthSurface& surface = frame.surfaces[camera];
    const Pose& base_from_camera = surface.camera().base_from_camera;
    for (int row = step / 2; row < surface.rows(); row += step)
      for (int column = step / 2; column < surface.columns(); column += step) {
        SurfacePatch element;
        if (is_for_checks(frame.node, camera, row, column) == (use == SampleUse::checks) &&
            surface.at(column, row, element))
          samples.push_back({base_from_camera * element.point,
                             base_from_camera.linear() * element.normal, element.noise_m,
                             element.point.z()});
      }
  }
  return samples;
}

bool element_at(const FrameFeatures& frame, const Eigen::Vector3d& point_in_base,
                    PlacedElement& element) {
  for (const DepthSurface& surface : frame.surfaces) {
    const Pose& base_from_camera = surface.camera().base_from_camera;
    SurfacePatch seen;
    if (!surface.nearest_to(base_from_camera.inverse() * point_in_base, seen)) continue;
    element = {base_from_camera * seen.point, base_from_camera.linear() * seen.normal, seen.noise_m,
               seen.point.z()};
    return true;
  }
  return false;
}

}  // namespace libmap
