#include "libmap/simulate/terrain_pieces.h"

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr std::uint64_t points_stream = 21;
constexpr double flat_jitter = 0.5;  // of a square's side, where it holds one point

std::int64_t cells_in(double length_m, double spacing_m) {
  return std::max<std::int64_t>(1, std::llround(length_m / spacing_m));
}

// A run of cells along one axis: first .. last - 1.
struct CellRange {
  std::int64_t first = 0;
  std::int64_t last = 0;
  std::size_t count() const { return static_cast<std::size_t>(last - first); }
};
CellRange cells_of_piece(std::int64_t place, double size_m, const TerrainPiecesOptions& options) {
  const std::int64_t side = cells_in(options.piece_m, options.spacing_m);
  const std::int64_t end = cells_in(size_m, options.spacing_m);
  return {std::min(place * side, end), std::min((place + 1) * side, end)};
}

// Draws the points of one square of the plan.
class CellSampler {
 public:
  CellSampler(const RockyTerrain& terrain, const TerrainPiecesOptions& options)
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
      // Evenly up a slope; in the middle of a square that is all but flat.
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
  // Surface over plan, by the two triangles of the corners.
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

void bind(ParameterTable& table, TerrainPiecesOptions& options) {
  table.add("spacing_m", options.spacing_m, Range{1e-4, 10.0}, "between points, about, m");
  table.add("piece_m", options.piece_m, Range{1e-3, 1000.0}, "side of a piece, m");
  bind(table, options.terrain);
}

void TerrainPiecesOptions::check() const {
  TerrainPiecesOptions copy = *this;
  ParameterTable table;
  bind(table, copy);
  table.add("size_x_m", copy.size_x_m, Range{1e-3, 1e5}, "");
  table.add("size_y_m", copy.size_y_m, Range{1e-3, 1e5}, "");
  table.check();
  terrain.check();
  const double cells = piece_m / spacing_m;
  if (cells < 1.0 || cells * cells > 1e8)
    throw Error(
        "a piece has too few or too many points",
        {.field = "piece_m", .value = to_text(piece_m), .bound = "1 to 10,000 times spacing_m"});
  if (std::ceil(size_x_m / piece_m) * std::ceil(size_y_m / piece_m) > 1e6)
    throw Error("too many pieces", {.field = "piece_m",
                                    .value = to_text(piece_m),
                                    .bound = "large enough for at most 1,000,000 pieces"});
}

std::vector<XyTile> terrain_pieces(const TerrainPiecesOptions& options) {
  options.check();
  std::vector<XyTile> pieces;
  for (std::int64_t i = 0; cells_of_piece(i, options.size_x_m, options).count() > 0; ++i)
    for (std::int64_t j = 0; cells_of_piece(j, options.size_y_m, options).count() > 0; ++j)
      pieces.push_back({i, j});
  return pieces;
}

PointCloud sample_piece(const TerrainPiecesOptions& options, const XyTile& piece) {
  options.check();
  const double spacing = options.spacing_m;
  const CellRange x = cells_of_piece(piece.i, options.size_x_m, options);
  const CellRange y = cells_of_piece(piece.j, options.size_y_m, options);
  const auto place = [&](std::int64_t a, std::int64_t b) {
    return Eigen::Vector2d(static_cast<double>(a) * spacing, static_cast<double>(b) * spacing);
  };
  // One cell more: slopes are taken forward.
  const RockyTerrain terrain(options.terrain,
                             {place(x.first, y.first), place(x.last + 1, y.last + 1)});
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
