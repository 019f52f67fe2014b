#include "libmap/simulate/terrain_tiles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/scenes/solid_noise.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

namespace {

using std::numbers::pi;
constexpr double rock_cell_m = 1.0;       // cells in which rocks are drawn
constexpr double bucket_m = 0.25;         // buckets for searching rocks
constexpr double power_index = 2.65;      // of rock heights (Michikami et al. 2019)
constexpr double cobble_fraction = 0.25;  // share of cobbles among the rocks
constexpr double roughness_length_m = 0.16;
constexpr double rounding_m = 1e-6;    // tolerance at the borders of buckets
constexpr double largest_reach = 2.4;  // maximum reach of a rock, in rock heights
// Keys of the random streams.
constexpr std::uint64_t relief_stream = 11;
constexpr std::uint64_t roughness_stream = 12;
constexpr std::uint64_t rocks_stream = 13;

// Truncated power law: the share of rocks higher than h is proportional to h^-power_index.
double draw_height(const RockyTerrainOptions& options, RandomStream& draw) {
  const double low = std::pow(options.min_rock_m, -power_index);
  const double high = std::pow(options.max_rock_m, -power_index);
  return std::pow(low - draw.uniform() * (low - high), -1.0 / power_index);
}

std::int64_t cell_below(double position_m, double cell_m) {
  return static_cast<std::int64_t>(std::floor(position_m / cell_m));
}

}  // namespace

void bind(ParameterTable& table, RockyTerrainOptions& options) {
  table.add("seed", options.seed, not_negative, "random seed of the terrain");
  table.add("relief_m", options.relief_m, Range{0.0, 100.0}, "maximum height of the relief, m");
  table.add("relief_length_m", options.relief_length_m, Range{0.1, 10'000.0},
            "longest wavelength of the ground's relief, m");
  table.add("roughness_m", options.roughness_m, Range{0.0, 1.0},
            "maximum height of the small-scale surface roughness, m");
  table.add("rocks_per_m2", options.rocks_per_m2, Range{0.0, 100.0}, "number of rocks per m2");
  table.add("min_rock_m", options.min_rock_m, Range{0.01, 5.0}, "minimum height of rocks, m");
  table.add("max_rock_m", options.max_rock_m, Range{0.01, 5.0}, "maximum height of rocks, m");
}

void RockyTerrainOptions::check() const {
  if (max_rock_m < min_rock_m)
    throw Error("less than the minimum height",
                {.field = "max_rock_m",
                 .value = to_text(max_rock_m),
                 .bound = ">= min_rock_m = " + to_text(min_rock_m)});
}

RockyTerrain::RockyTerrain(const RockyTerrainOptions& options,
                           const Eigen::AlignedBox2d& rectangle_m)
    : options_(options), rectangle_m_(rectangle_m) {
  const double margin = largest_reach * options_.max_rock_m;
  const auto first_i = cell_below(rectangle_m.min().x() - margin, rock_cell_m);
  const auto last_i = cell_below(rectangle_m.max().x() + margin, rock_cell_m);
  const auto first_j = cell_below(rectangle_m.min().y() - margin, rock_cell_m);
  const auto last_j = cell_below(rectangle_m.max().y() + margin, rock_cell_m);
  for (std::int64_t i = first_i; i <= last_i; ++i)
    for (std::int64_t j = first_j; j <= last_j; ++j) add_rocks_of_cell(i, j);
  sort_into_buckets();
}

double RockyTerrain::ground(double x_m, double y_m) const {
  const Eigen::Vector3d position(x_m / options_.relief_length_m, y_m / options_.relief_length_m,
                                 0.5);
  return options_.relief_m * fractal_noise(position, mix_bits(options_.seed, relief_stream), 4);
}

// A block with inward sloping walls, shoulders and a nearly flat top.
RockyTerrain::Rock RockyTerrain::draw_block(double height_m, std::uint64_t seed) const {
  const SiteRock form = draw_rock(RockShape::block, height_m, seed);
  RandomStream draw(seed, 2);
  Rock rock;
  const double yaw = form.yaw_deg * radians_per_degree;
  // Adds the plane through the point at `distance` along `heading` and height `level`.
  const auto add = [&](double heading, double slope, double distance, double level) {
    const double steepness = std::tan(slope);
    rock.facets.push_back({steepness * std::cos(heading + yaw), steepness * std::sin(heading + yaw),
                           level + steepness * distance});
  };
  const auto half_width = [&](double heading) {
    return 0.5 * std::hypot(form.width_m * std::cos(heading), form.depth_m * std::sin(heading));
  };
  for (int n = 0; n < form.sides; ++n) {
    const double heading = 2.0 * pi * (n + draw.uniform(-0.2, 0.2)) / form.sides;
    add(heading, radians_per_degree * draw.uniform(66.0, 82.0),
        half_width(heading) * draw.uniform(0.86, 1.0), 0.0);
  }
  const int shoulders = 2 + static_cast<int>(draw.uniform(0.0, 3.0));
  for (int n = 0; n < shoulders; ++n) {
    const double heading = draw.uniform(0.0, 2.0 * pi);
    add(heading, radians_per_degree * draw.uniform(30.0, 65.0),
        half_width(heading) * draw.uniform(0.5, 0.8), height_m);
  }
  add(draw.uniform(0.0, 2.0 * pi), radians_per_degree * draw.uniform(0.5, 6.0), 0.0, height_m);
  rock.reach_m = 1.3 * std::max(form.width_m, form.depth_m);
  return rock;
}

// The upper part of an ellipsoid.
RockyTerrain::Rock RockyTerrain::draw_cobble(double height_m, std::uint64_t seed) const {
  const SiteRock form = draw_rock(RockShape::cobble, height_m, seed);
  Rock rock;
  rock.height_m = height_m;
  // The outline on the ground is at sqrt(3)/2 of the half-axes.
  const double root3 = std::sqrt(3.0);
  rock.unit_from_plan = Eigen::Vector2d(root3 / form.width_m, root3 / form.depth_m).asDiagonal() *
                        Eigen::Rotation2Dd(-form.yaw_deg * radians_per_degree).toRotationMatrix();
  rock.reach_m = std::max(form.width_m, form.depth_m) / root3;
  return rock;
}

void RockyTerrain::add_rocks_of_cell(std::int64_t i, std::int64_t j) {
  const std::uint64_t cell = mix_bits(static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j));
  RandomStream draw(mix_bits(options_.seed, rocks_stream), cell);
  const int count = static_cast<int>(
      std::floor(options_.rocks_per_m2 * rock_cell_m * rock_cell_m + draw.uniform()));
  for (int n = 0; n < count; ++n) {
    const double x = (static_cast<double>(i) + draw.uniform()) * rock_cell_m;
    const double y = (static_cast<double>(j) + draw.uniform()) * rock_cell_m;
    const double height_m = draw_height(options_, draw);
    const bool is_cobble = draw.uniform() < cobble_fraction;
    const std::uint64_t seed = mix_bits(mix_bits(options_.seed, cell), static_cast<unsigned>(n));
    Rock rock = is_cobble ? draw_cobble(height_m, seed) : draw_block(height_m, seed);
    rock.center = {x, y};
    if (rectangle_m_.squaredExteriorDistance(rock.center) > rock.reach_m * rock.reach_m) continue;
    rock.foot_m = ground(x, y);
    rocks_.push_back(std::move(rock));
  }
}

void RockyTerrain::sort_into_buckets() {
  const Eigen::Vector2d size = rectangle_m_.sizes();
  columns_ = static_cast<std::size_t>(size.x() / bucket_m) + 1;
  const std::size_t rows = static_cast<std::size_t>(size.y() / bucket_m) + 1;
  buckets_.resize(columns_ * rows);
  const auto bucket_at = [&](double offset_m, std::size_t count) {
    const double bucket = std::floor(offset_m / bucket_m);
    return static_cast<std::size_t>(std::clamp(bucket, 0.0, static_cast<double>(count - 1)));
  };
  for (std::size_t r = 0; r < rocks_.size(); ++r) {
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(rocks_[r].reach_m + rounding_m);
    const Eigen::Vector2d low = rocks_[r].center - reach - rectangle_m_.min();
    const Eigen::Vector2d high = rocks_[r].center + reach - rectangle_m_.min();
    for (std::size_t row = bucket_at(low.y(), rows); row <= bucket_at(high.y(), rows); ++row)
      for (std::size_t column = bucket_at(low.x(), columns_);
           column <= bucket_at(high.x(), columns_); ++column)
        buckets_[row * columns_ + column].push_back(static_cast<std::uint32_t>(r));
  }
}

double RockyTerrain::height_over_foot(const Rock& rock, const Eigen::Vector2d& position) {
  const Eigen::Vector2d offset = position - rock.center;
  if (offset.squaredNorm() > rock.reach_m * rock.reach_m) return -HUGE_VAL;
  if (rock.facets.empty()) {
    const double squared = (rock.unit_from_plan * offset).squaredNorm();
    // The ground intersects the ellipsoid at half the height of its upper half.
    return squared >= 1.0 ? -HUGE_VAL : rock.height_m * (2.0 * std::sqrt(1.0 - squared) - 1.0);
  }
  double height = HUGE_VAL;
  for (const Facet& facet : rock.facets)
    height = std::min(height, facet.c - facet.a * offset.x() - facet.b * offset.y());
  return height;
}

double RockyTerrain::height(double x_m, double y_m) const {
  const Eigen::Vector2d position(x_m, y_m);
  const Eigen::Vector2d bucket = (position - rectangle_m_.min()) / bucket_m;
  const auto column = std::min(static_cast<std::size_t>(std::max(bucket.x(), 0.0)), columns_ - 1);
  const auto row =
      std::min(static_cast<std::size_t>(std::max(bucket.y(), 0.0)), buckets_.size() / columns_ - 1);
  double height = ground(x_m, y_m);
  for (const std::uint32_t r : buckets_[row * columns_ + column])
    height = std::max(height, rocks_[r].foot_m + height_over_foot(rocks_[r], position));
  const Eigen::Vector3d fine(x_m / roughness_length_m, y_m / roughness_length_m, 0.5);
  return height +
         options_.roughness_m * fractal_noise(fine, mix_bits(options_.seed, roughness_stream), 3);
}

namespace {

constexpr std::uint64_t points_stream = 21;
constexpr double flat_jitter = 0.5;  // jitter of a cell's only point, relative to the cell's side

std::int64_t cells_in(double length_m, double spacing_m) {
  return std::max<std::int64_t>(1, std::llround(length_m / spacing_m));
}

// A range of cells along one axis: first .. last - 1.
struct CellRange {
  std::int64_t first = 0;
  std::int64_t last = 0;
  std::size_t count() const { return static_cast<std::size_t>(last - first); }
};
CellRange cells_of_tile(std::int64_t tile, double size_m, const TerrainTilesOptions& options) {
  const std::int64_t side = cells_in(options.tile_m, options.spacing_m);
  const std::int64_t end = cells_in(size_m, options.spacing_m);
  return {std::min(tile * side, end), std::min((tile + 1) * side, end)};
}

// Draws the points of one cell of the plan.
class CellSampler {
 public:
  CellSampler(const RockyTerrain& terrain, const TerrainTilesOptions& options)
      : terrain_(terrain),
        spacing_m_(options.spacing_m),
        seed_(mix_bits(options.terrain.seed, points_stream)) {}

  double corner_height(std::int64_t a, std::int64_t b) const {
    return terrain_.height(static_cast<double>(a) * spacing_m_,
                           static_cast<double>(b) * spacing_m_);
  }

  // `corners`: heights at (a, b), (a + 1, b), (a, b + 1), (a + 1, b + 1).
  void sample(std::int64_t a, std::int64_t b, const double (&corners)[4], PointCloud& cloud) const {
    RandomStream draw(seed_,
                      mix_bits(static_cast<std::uint64_t>(a), static_cast<std::uint64_t>(b)));
    const double rise_x =
        std::max(std::abs(corners[1] - corners[0]), std::abs(corners[3] - corners[2]));
    const double rise_y =
        std::max(std::abs(corners[2] - corners[0]), std::abs(corners[3] - corners[1]));
    const int count =
        std::max(1, static_cast<int>(std::floor(area_ratio(corners) + draw.uniform())));
    for (int n = 0; n < count; ++n) {
      // Stratified along the slope; near the center if the cell has one point.
      double along = (n + draw.uniform()) / count;
      double across = draw.uniform();
      if (count == 1) {
        along = 0.5 + flat_jitter * (along - 0.5);
        across = 0.5 + flat_jitter * (across - 0.5);
      }
      const double u = rise_x >= rise_y ? along : across;
      const double v = rise_x >= rise_y ? across : along;
      add_point((static_cast<double>(a) + u) * spacing_m_,
                (static_cast<double>(b) + v) * spacing_m_, cloud);
    }
  }

 private:
  // Ratio of surface area to plan area, from the two triangles of the corners.
  double area_ratio(const double (&corners)[4]) const {
    const auto triangle = [&](double rise_x, double rise_y) {
      return 0.5 * Eigen::Vector3d(rise_x / spacing_m_, rise_y / spacing_m_, 1.0).norm();
    };
    return triangle(corners[1] - corners[0], corners[2] - corners[0]) +
           triangle(corners[3] - corners[2], corners[3] - corners[1]);
  }

  void add_point(double x, double y, PointCloud& cloud) const {
    const double step = 0.25 * spacing_m_;
    const double z = terrain_.height(x, y);
    const double rise_x = terrain_.height(x + step, y) - z;
    const double rise_y = terrain_.height(x, y + step) - z;
    cloud.positions.emplace_back(x, y, z);
    cloud.normals.push_back(Eigen::Vector3d(-rise_x, -rise_y, step).normalized().cast<float>());
  }

  const RockyTerrain& terrain_;
  double spacing_m_;
  std::uint64_t seed_;
};

}  // namespace

void bind(ParameterTable& table, TerrainTilesOptions& options) {
  table.add("spacing_m", options.spacing_m, Range{1e-4, 10.0}, "mean point spacing, m");
  table.add_former_key("piece_m", "tile_size_m");
  table.add("tile_size_m", options.tile_m, Range{1e-3, 1000.0},
            "side of a tile, m; each tile is one file of the output");
  bind(table, options.terrain);
}

void TerrainTilesOptions::check() const {
  TerrainTilesOptions copy = *this;
  ParameterTable table;
  bind(table, copy);
  table.add("size_x_m", copy.size_x_m, Range{1e-3, 1e5}, "");
  table.add("size_y_m", copy.size_y_m, Range{1e-3, 1e5}, "");
  table.check();
  terrain.check();
  const double cells = tile_m / spacing_m;
  if (cells < 1.0 || cells * cells > 1e8)
    throw Error(
        "too few or too many points per tile",
        {.field = "tile_size_m", .value = to_text(tile_m), .bound = "1 to 10,000 times spacing_m"});
  if (std::ceil(size_x_m / tile_m) * std::ceil(size_y_m / tile_m) > 1e6)
    throw Error("too many tiles", {.field = "tile_size_m",
                                   .value = to_text(tile_m),
                                   .bound = "large enough for at most 1,000,000 tiles"});
}

std::vector<XyTile> terrain_tiles(const TerrainTilesOptions& options) {
  options.check();
  std::vector<XyTile> tiles;
  for (std::int64_t i = 0; cells_of_tile(i, options.size_x_m, options).count() > 0; ++i)
    for (std::int64_t j = 0; cells_of_tile(j, options.size_y_m, options).count() > 0; ++j)
      tiles.push_back({i, j});
  return tiles;
}

PointCloud sample_tile(const TerrainTilesOptions& options, const XyTile& tile) {
  options.check();
  const double spacing = options.spacing_m;
  const CellRange x = cells_of_tile(tile.i, options.size_x_m, options);
  const CellRange y = cells_of_tile(tile.j, options.size_y_m, options);
  const auto corner_at = [&](std::int64_t a, std::int64_t b) {
    return Eigen::Vector2d(static_cast<double>(a) * spacing, static_cast<double>(b) * spacing);
  };
  // One additional cell, because slopes are forward differences.
  const RockyTerrain terrain(options.terrain,
                             {corner_at(x.first, y.first), corner_at(x.last + 1, y.last + 1)});
  const CellSampler sampler(terrain, options);
  PointCloud cloud;
  cloud.positions.reserve(x.count() * y.count() * 5 / 4);
  cloud.normals.reserve(x.count() * y.count() * 5 / 4);
  std::vector<double> low(y.count() + 1);
  std::vector<double> high(y.count() + 1);
  const auto fill = [&](std::int64_t a, std::vector<double>& heights) {
    for (std::size_t n = 0; n < heights.size(); ++n)
      heights[n] = sampler.corner_height(a, y.first + static_cast<std::int64_t>(n));
  };
  fill(x.first, low);
  for (std::int64_t a = x.first; a < x.last; ++a) {
    fill(a + 1, high);
    for (std::size_t n = 0; n < y.count(); ++n)
      sampler.sample(a, y.first + static_cast<std::int64_t>(n),
                     {low[n], high[n], low[n + 1], high[n + 1]}, cloud);
    std::swap(low, high);
  }
  return cloud;
}

}  // namespace libmap
