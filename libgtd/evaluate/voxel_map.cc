#include "libgtd/evaluate/voxel_map.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using libmap::PointCloud;
using libmap::ScalarField;

// Maximum offset of a point, in voxel edges. Positions in files are rounded to single precision.
constexpr double max_offset = 0.25;
constexpr std::size_t voxels_per_chunk = 1 << 16;

const std::vector<double>* optional_values(const PointCloud& map, const char* name) {
  const ScalarField* field = map.find_field(name);
  return field == nullptr ? nullptr : &field->values;
}

// Voxels of the points `kept`, from the fields i, j and k.
std::vector<Voxel> voxels_of_fields(const PointCloud& map, const std::vector<std::uint32_t>& kept) {
  const VoxelFields fields(map);
  std::vector<Voxel> voxels;
  voxels.reserve(kept.size());
  for (const std::uint32_t n : kept) voxels.push_back(fields.at(n));
  return voxels;
}

Eigen::Vector3d vector_of(const Voxel& voxel) {
  return {static_cast<double>(voxel.i), static_cast<double>(voxel.j), static_cast<double>(voxel.k)};
}

// Least-squares fit of the lattice in the terrain frame to the points of the voxels.
VoxelLattice fitted_lattice(const PointCloud& map, const libmap::Pose& terrain_from_map,
                            const std::vector<std::uint32_t>& kept,
                            const std::vector<Voxel>& voxels) {
  Eigen::Vector3d mean_voxel = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_point = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n < kept.size(); ++n) {
    mean_voxel += vector_of(voxels[n]);
    mean_point += terrain_from_map * map.positions[kept[n]];
  }
  mean_voxel /= static_cast<double>(kept.size());
  mean_point /= static_cast<double>(kept.size());
  double products = 0.0;
  double squares = 0.0;
  for (std::size_t n = 0; n < kept.size(); ++n) {
    const Eigen::Vector3d offset = vector_of(voxels[n]) - mean_voxel;
    products += offset.dot(terrain_from_map * map.positions[kept[n]] - mean_point);
    squares += offset.squaredNorm();
  }
  if (!(products > 0.0))
    throw libmap::Error("does not follow from the fields i, j and k; provide the map's manifest",
                        {.field = "voxel_size_m"});
  const double size_m = products / squares;
  return {mean_point - size_m * (mean_voxel.array() + 0.5).matrix(), size_m};
}

// Throws Error unless squared distances on the lattice are finite.
void require_measurable(const VoxelLattice& lattice) {
  constexpr double min_m = 1e-100;
  constexpr double max_m = 1e100;
  const auto refuse = [](const char* field, double value, const std::string& bound) {
    throw libmap::Error("out of range",
                        {.field = field, .value = libmap::to_text(value), .bound = bound});
  };
  if (!(lattice.voxel_size_m >= min_m && lattice.voxel_size_m <= max_m))
    refuse("voxel_size_m", lattice.voxel_size_m,
           libmap::to_text(min_m) + " to " + libmap::to_text(max_m));
  const double farthest_m = lattice.origin_m.cwiseAbs().maxCoeff();
  if (farthest_m > max_m)
    refuse("lattice_origin_m", farthest_m, "within +-" + libmap::to_text(max_m));
}

void require_on_lattice(const PointCloud& map, const VoxelMap& result,
                        const std::vector<std::uint32_t>& kept, const std::vector<Voxel>& voxels) {
  const double bound_m = max_offset * result.lattice.voxel_size_m;
  for (std::size_t n = 0; n < kept.size(); ++n) {
    const Eigen::Vector3d center = result.lattice.center_of(voxels[n]);
    const Eigen::Vector3d point = result.terrain_from_map * map.positions[kept[n]];
    if (!((point - center).cwiseAbs().array() <= bound_m).all())
      throw libmap::Error(
          "too large for the lattice of the map; the manifest may belong to another map",
          {.field = "distance of point " + std::to_string(kept[n]) + " from a voxel center",
           .value =
               libmap::to_text(static_cast<float>((point - center).cwiseAbs().maxCoeff())) + " m",
           .bound = "<= " + libmap::to_text(static_cast<float>(bound_m)) + " m"});
  }
}

void sort_by_voxel(std::vector<Voxel>& voxels, std::vector<std::uint32_t>& kept) {
  if (!std::is_sorted(voxels.begin(), voxels.end())) {
    std::vector<std::uint32_t> order(voxels.size());
    std::iota(order.begin(), order.end(), 0U);
    std::sort(order.begin(), order.end(),
              [&](std::uint32_t a, std::uint32_t b) { return voxels[a] < voxels[b]; });
    std::vector<Voxel> sorted_voxels(order.size());
    std::vector<std::uint32_t> sorted_points(order.size());
    for (std::size_t n = 0; n < order.size(); ++n) {
      sorted_voxels[n] = voxels[order[n]];
      sorted_points[n] = kept[order[n]];
    }
    voxels = std::move(sorted_voxels);
    kept = std::move(sorted_points);
  }
  const auto twice = std::adjacent_find(voxels.begin(), voxels.end());
  if (twice != voxels.end())
    throw libmap::Error("two points of the map are in the same voxel",
                        {.field = "i, j, k",
                         .value = std::to_string(twice->i) + ", " + std::to_string(twice->j) +
                                  ", " + std::to_string(twice->k)});
}

void fill_values(const PointCloud& map, VoxelMap& result) {
  const std::vector<double>& score = values_of(map, "score");
  const std::vector<double>& graspable = values_of(map, "graspable");
  const std::vector<double>* border = optional_values(map, "border");
  if (border == nullptr) border = optional_values(map, "edge");  // name in earlier versions
  const std::vector<double>* obstacle = optional_values(map, "obstacle");
  const std::size_t count = result.voxels.size();
  result.scores.resize(count);
  result.graspable.resize(count);
  result.border.resize(count);
  result.obstacle.resize(count);
  libmap::parallel_each(count, voxels_per_chunk, [&](std::size_t n) {
    const std::uint32_t point = result.map_points[n];
    const bool scored = std::isfinite(score[point]);
    const bool blocked = obstacle != nullptr && (*obstacle)[point] > 0.0;
    result.scores[n] =
        scored ? static_cast<float>(score[point]) : std::numeric_limits<float>::quiet_NaN();
    result.graspable[n] = scored && !blocked && graspable[point] > 0.0 ? 1 : 0;
    result.border[n] = border != nullptr && (*border)[point] > 0.0 ? 1 : 0;
    result.obstacle[n] = blocked ? 1 : 0;
  });
}

}  // namespace

MapInfo map_info(const libmap::Manifest& manifest) {
  MapInfo info;
  info.zero_plane_m =
      libmap::number_of(manifest.find_parameter("zero_plane_m")).value_or(info.zero_plane_m);
  const std::optional<double> size_m = libmap::number_of(manifest.find_parameter("voxel_size_m"));
  const libmap::ManifestValue* value = manifest.find_result("lattice_origin_m");
  const auto* origin = value == nullptr ? nullptr : std::get_if<std::vector<double>>(value);
  if (size_m && *size_m > 0.0 && origin != nullptr && origin->size() == 3) {
    info.lattice = VoxelLattice{{(*origin)[0], (*origin)[1], (*origin)[2]}, *size_m};
    if (!info.lattice->origin_m.allFinite() || !std::isfinite(*size_m))
      throw libmap::Error("is not finite in the map's manifest",
                          {.field = "lattice_origin_m or voxel_size_m"});
  }
  if (const libmap::Pose* pose = manifest.find_transform("terrain_from_input");
      pose != nullptr && manifest.frame == "input")
    info.terrain_from_map = *pose;
  return info;
}

VoxelMap voxel_map_of(const PointCloud& map, const MapInfo& info) {
  map.check();
  if (map.size() > std::numeric_limits<std::uint32_t>::max())
    throw libmap::Error(
        "too many",
        {.field = "number of points", .value = std::to_string(map.size()), .bound = "< 2^32"});
  values_of(map, "score");
  values_of(map, "graspable");
  VoxelMap result;
  result.terrain_from_map = info.terrain_from_map;
  result.zero_plane_m = info.zero_plane_m;
  std::vector<std::uint32_t> kept;
  kept.reserve(map.size());
  for (std::uint32_t n = 0; n < map.size(); ++n)
    if (map.positions[n].allFinite()) kept.push_back(n);
  if (kept.empty()) throw libmap::no_elements("points of the map");
  std::vector<Voxel> voxels;
  if (!info.lattice || map.find_field("i") != nullptr) voxels = voxels_of_fields(map, kept);
  result.lattice =
      info.lattice ? *info.lattice : fitted_lattice(map, result.terrain_from_map, kept, voxels);
  require_measurable(result.lattice);
  if (voxels.empty())
    for (const std::uint32_t n : kept) {
      const Eigen::Vector3d cell =
          result.lattice.cell_of(result.terrain_from_map * map.positions[n]);
      if (!(cell.cwiseAbs().array() <= max_voxel_index).all())
        throw libmap::Error("too far from the origin for this voxel size",
                            {.field = "point " + std::to_string(n)});
      voxels.push_back(result.lattice.voxel_of(result.terrain_from_map * map.positions[n]));
    }
  require_on_lattice(map, result, kept, voxels);
  sort_by_voxel(voxels, kept);
  result.voxels = std::move(voxels);
  result.map_points = std::move(kept);
  fill_values(map, result);
  return result;
}

}  // namespace libgtd
