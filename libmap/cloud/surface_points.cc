#include "libmap/cloud/surface_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "libmap/cloud/surface_normals.h"
#include "libmap/cloud/surface_voxels.h"
#include "libmap/core/parallel.h"

namespace libmap {

namespace {

// Beyond an edge a surface is believed as far as it goes on straight: in voxels along the normal.
constexpr double max_extended_shift = 0.5;
// Part of its neighbor's uncertainty below which a point makes the neighbor an echo.
constexpr float echo_certainty = 0.5F;
// Voxels along the normal within which points of two voxels are the same.
constexpr double max_echo_distance = 0.5;
constexpr double normal_radius_voxels = 2.0;

// Points that share a voxel, weighted by their certainty.
struct MergedPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // these three weighted
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  float weight = 0.0F;
  float expected_error_m = 0.0F;
  std::uint32_t frames = 0;  // 0: not begun
  bool extended = false;
};

Color to_color(const Eigen::Vector3f& color) {
  const auto byte = [](float value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F)));
  };
  return {byte(color.x()), byte(color.y()), byte(color.z())};
}

class PointMaker {
 public:
  PointMaker(const RefinedSurface& surface, const SurfacePointOptions& options)
      : surface_(surface), options_(options) {}

  SurfacePoints run() {
    points_.reserve(surface_.elements.size());
    // What was measured first: it speaks for its voxel before what lies beyond the edges.
    for (const bool extended : {false, true})
      for (std::size_t n = 0; n < surface_.elements.size(); ++n) {
        const SurfaceElement& element = surface_.elements[n];
        if (element.extended == extended && is_confirmed(element, surface_.refined[n]))
          merge(element, surface_.refined[n]);
      }
    drop_echoes();
    return make_cloud();
  }

 private:
  bool is_confirmed(const SurfaceElement& element, const RefinedElement& refined);
  void merge(const SurfaceElement& element, const RefinedElement& refined);
  bool is_echo(std::size_t point, std::size_t other, int axis) const;
  void drop_echoes();
  SurfacePoints make_cloud();

  const RefinedSurface& surface_;
  const SurfacePointOptions& options_;
  VoxelIndex index_;
  std::vector<MergedPoint> points_;
  SurfacePointCounts counts_;
};

bool PointMaker::is_confirmed(const SurfaceElement& element, const RefinedElement& refined) {
  counts_.max_views = std::max(counts_.max_views, std::size_t{refined.frames});
  if (refined.frames < static_cast<std::uint32_t>(options_.min_views)) {
    ++counts_.unconfirmed;
    return false;
  }
  if (static_cast<double>(refined.seen_through) >
      options_.max_seen_through * static_cast<double>(refined.seen)) {
    ++counts_.seen_through;
    return false;
  }
  if (element.extended &&
      std::abs(static_cast<double>(refined.shift_m)) > max_extended_shift * options_.voxel_size_m) {
    ++counts_.bent_away;
    return false;
  }
  return true;
}

void PointMaker::merge(const SurfaceElement& element, const RefinedElement& refined) {
  const Eigen::Vector3f position = element.position + refined.shift_m * element.normal;
  const Eigen::Vector3i cell =
      (position.cast<double>() / options_.voxel_size_m).array().floor().cast<int>();
  std::uint32_t number = index_.find_or_add(pack({cell, 0}));
  if (number < points_.size() && points_[number].normal.dot(element.normal) < 0.0F)
    number = index_.find_or_add(pack({cell, 1}));
  if (number == points_.size()) points_.emplace_back();
  MergedPoint& point = points_[number];
  if (point.frames > 0) {
    ++counts_.merged;
    if (element.extended && !point.extended) return;
  }
  point.extended = element.extended;
  const float error = refined.expected_error_m;
  const float weight = 1.0F / (error * error);
  point.weight += weight;
  point.position += weight * position;
  point.normal += weight * element.normal;
  for (int c = 0; c < 3; ++c)
    point.color[c] += weight * static_cast<float>(refined.color[static_cast<std::size_t>(c)]);
  // Their measurements are partly the same: the mean is as certain as the best of them.
  point.expected_error_m = point.frames == 0 ? error : std::min(error, point.expected_error_m);
  point.frames = std::max(point.frames, refined.frames);
}

// Whether `other`, in a voxel before or behind that of `point`, makes it one point too many: noise,
// a pose error or a surface on the border of two voxels has left two of the same place.
bool PointMaker::is_echo(std::size_t point, std::size_t other, int axis) const {
  const MergedPoint& one = points_[point];
  const MergedPoint& two = points_[other];
  if (two.normal.dot(one.normal) <= 0.0F || (two.extended && !one.extended)) return false;
  if (!two.extended && two.expected_error_m < echo_certainty * one.expected_error_m) return true;
  const float apart = std::abs(two.position[axis] / two.weight - one.position[axis] / one.weight);
  if (static_cast<double>(apart) > max_echo_distance * options_.voxel_size_m) return false;
  return std::tuple(two.extended, two.expected_error_m, other) <
         std::tuple(one.extended, one.expected_error_m, point);
}

void PointMaker::drop_echoes() {
  std::vector<char> is_surplus(points_.size(), 0);
  parallel_for(points_.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      VoxelPlace place = unpack(index_.keys()[n]);
      int axis = 2;
      points_[n].normal.cwiseAbs().maxCoeff(&axis);
      place.cell[axis] -= 1;
      for (int step = 0; step < 2; ++step, place.cell[axis] += 2)
        for (place.side = 0; place.side < 2; ++place.side) {
          const std::uint32_t other = index_.find(pack(place));
          if (other != VoxelIndex::none && is_echo(n, other, axis)) is_surplus[n] = 1;
        }
    }
  });
  std::size_t kept = 0;
  for (std::size_t n = 0; n < points_.size(); ++n) {
    if (is_surplus[n] != 0)
      ++counts_.merged;
    else
      points_[kept++] = points_[n];
  }
  points_.resize(kept);
}

SurfacePoints PointMaker::make_cloud() {
  PointCloud cloud;
  ScalarField views{"views", ScalarType::uint16, {}};
  ScalarField errors{"expected_error", ScalarType::float32, {}};
  cloud.positions.reserve(points_.size());
  cloud.normals.reserve(points_.size());
  views.values.reserve(points_.size());
  errors.values.reserve(points_.size());
  for (const MergedPoint& point : points_) {
    cloud.positions.push_back((point.position / point.weight).cast<double>());
    cloud.normals.push_back(point.normal.normalized());
    if (surface_.has_color) cloud.colors.push_back(to_color(point.color / point.weight));
    views.values.push_back(std::min(65535.0, static_cast<double>(point.frames)));
    errors.values.push_back(static_cast<double>(point.expected_error_m));
    counts_.extended_points += point.extended ? 1 : 0;
  }
  fit_normals(cloud, normal_radius_voxels * options_.voxel_size_m, errors.values);
  cloud.fields = {std::move(views), std::move(errors)};
  return {std::move(cloud), counts_};
}

}  // namespace

SurfacePoints make_surface_points(const RefinedSurface& surface,
                                  const SurfacePointOptions& options) {
  return PointMaker(surface, options).run();
}

}  // namespace libmap
