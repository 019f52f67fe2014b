#include "libmap/report/map_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/score_color.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

using Field = const std::vector<double>*;

Field field_of(const PointCloud& map, const char* name) {
  const ScalarField* field = map.find_field(name);
  if (field == nullptr)
    throw Error("no such field; a graspability map is required", {.field = name});
  return &field->values;
}

Field optional_field(const PointCloud& map, const char* name) {
  const ScalarField* field = map.find_field(name);
  return field == nullptr ? nullptr : &field->values;
}

std::array<Field, 3> voxel_fields(const PointCloud& map) {
  return {field_of(map, "i"), field_of(map, "j"), field_of(map, "k")};
}

std::uint8_t class_of(double score, bool below_plane) {
  if (below_plane) return below_plane_class;
  const Color color = score_color(score);
  for (std::size_t n = 0; n < score_classes.size(); ++n)
    if (score_classes[n].color == color) return static_cast<std::uint8_t>(n);
  return no_value_class;
}

void add_forces(const PointCloud& map, double load_n, MapView& view) {
  const Field median = optional_field(map, "holding_force_n");
  const Field low = optional_field(map, "holding_force_low_n");
  const Field high = optional_field(map, "holding_force_high_n");
  const Field probability = optional_field(map, "hold_probability");
  if (median == nullptr || low == nullptr || high == nullptr || probability == nullptr) return;
  for (std::size_t n = 0; n < map.size(); ++n)
    view.forces.push_back(
        {force_byte((*median)[n]), force_byte((*low)[n]), force_byte((*high)[n]),
         static_cast<std::uint8_t>(std::lround(255.0 * std::clamp((*probability)[n], 0.0, 1.0)))});
  std::vector<double> forces = *median;
  const auto rank = static_cast<std::ptrdiff_t>(0.995 * static_cast<double>(forces.size() - 1));
  std::nth_element(forces.begin(), forces.begin() + rank, forces.end());
  view.max_force_n = std::max(forces[static_cast<std::size_t>(rank)], 1.0);
  view.load_n = load_n;
}

bool is_set(Field field, std::size_t n) { return field != nullptr && (*field)[n] > 0.0; }

}  // namespace

std::uint8_t force_byte(double force_n) {
  if (!(force_n > 0.0)) return 0;
  return static_cast<std::uint8_t>(
      std::lround(std::clamp(1.0 + (std::log(force_n) + 3.0) / 0.04, 1.0, 255.0)));
}

MapLattice lattice_of(const PointCloud& map) {
  const std::array<Field, 3> voxels = voxel_fields(map);
  MapLattice lattice;
  double widest = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax_element(voxels[axis]->begin(), voxels[axis]->end());
    if (low == high || !(*high - *low > widest)) continue;
    widest = *high - *low;
    const auto at = [&](auto index) {
      return map.positions[static_cast<std::size_t>(index - voxels[axis]->begin())]
                          [static_cast<Eigen::Index>(axis)];
    };
    lattice.voxel_size_m = (at(high) - at(low)) / widest;
  }
  if (map.size() == 1) lattice.voxel_size_m = 0.01;
  if (!(lattice.voxel_size_m > 0.0))
    throw Error("the points are not on a lattice along the terrain's axes",
                {.field = "voxel size", .value = to_text(lattice.voxel_size_m), .bound = "> 0"});
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t n = 0; n < map.size(); ++n) {
      const double origin = map.positions[n][a] - lattice.voxel_size_m * ((*voxels[axis])[n] + 0.5);
      low = std::min(low, origin);
      high = std::max(high, origin);
    }
    if (high - low > 0.2 * lattice.voxel_size_m)
      throw Error("the points are not on a lattice along the terrain's axes",
                  {.field = "distance from the lattice", .value = to_text(high - low) + " m"});
    lattice.origin_in_terrain[a] = 0.5 * (low + high);
  }
  return lattice;
}

MapView make_map_view(const PointCloud& map, const MapViewOptions& options) {
  MapView view;
  view.voxels = map.size();
  view.voxels_per_cell = options.voxels_per_cell;
  if (map.empty()) return view;
  const MapLattice lattice = options.lattice ? *options.lattice : lattice_of(map);
  view.cell_size_m = lattice.voxel_size_m * options.voxels_per_cell;
  const std::array<Field, 3> voxels = voxel_fields(map);
  const auto cell_of = [&](std::size_t axis, std::size_t n) {
    return std::floor((*voxels[axis])[n] / options.voxels_per_cell);
  };
  view.cells.resize(map.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double lowest = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < map.size(); ++n) lowest = std::min(lowest, cell_of(axis, n));
    view.corner_in_terrain[static_cast<Eigen::Index>(axis)] =
        lattice.origin_in_terrain[static_cast<Eigen::Index>(axis)] + view.cell_size_m * lowest;
    for (std::size_t n = 0; n < map.size(); ++n) {
      const double index = cell_of(axis, n) - lowest;
      if (!(index <= std::numeric_limits<std::uint16_t>::max()))
        throw Error("the map is too large for a 3-D view",
                    {.field = "cells along an axis", .value = to_text(index), .bound = "<= 65535"});
      view.cells[n].index[axis] = static_cast<std::uint16_t>(index);
    }
  }
  if (options.load_n) add_forces(map, *options.load_n, view);
  const Field held = optional_field(map, "hold_probability");
  const Field score = held != nullptr ? held : field_of(map, "score");
  const Field convex = optional_field(map, "convex");
  const Field graspable = optional_field(map, "graspable");
  const Field obstacle = optional_field(map, "obstacle");
  view.has_convex = convex != nullptr;
  view.has_graspable = graspable != nullptr;
  view.has_obstacle = obstacle != nullptr;
  for (std::size_t n = 0; n < map.size(); ++n) {
    const bool below = options.zero_plane_m && map.positions[n].z() < *options.zero_plane_m;
    unsigned value = class_of((*score)[n], below);
    if (is_set(convex, n)) value |= convex_flag;
    if (is_set(graspable, n)) value |= graspable_flag;
    if (is_set(obstacle, n)) value |= obstacle_flag;
    view.cells[n].colors_and_flags = static_cast<std::uint8_t>(value);
  }
  return view;
}

}  // namespace libmap
