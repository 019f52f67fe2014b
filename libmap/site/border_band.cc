#include "libmap/site/border_band.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/image.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/robust.h"

namespace libmap {

namespace {

using Eigen::Vector2d;

constexpr double unseen = -1.0;
constexpr double max_band_cells = 4e6;
constexpr double min_contrast = 40.0;  // of 255, between white and the median
constexpr std::size_t max_lines = 10;  // white lines in one direction
constexpr double max_size_error = 0.05;

// Image from above of the white level.
struct TopView {
  Vector2d corner = Vector2d::Zero();
  double cell = 0.0;
  Image<double> levels;  // mean over points of min(red, green, blue); `unseen` without points

  // Bilinear interpolation between the seen cells around a position.
  double at(const Vector2d& position) const {
    const Vector2d index = (position - corner) / cell - Vector2d::Constant(0.5);
    const Vector2d low(std::floor(index.x()), std::floor(index.y()));
    if (!(low.x() >= 0.0 && low.y() >= 0.0 && low.x() < levels.width - 1 &&
          low.y() < levels.height - 1))
      return unseen;
    const Vector2d fraction = index - low;
    double sum = 0.0;
    double weights = 0.0;
    for (int n = 0; n < 4; ++n) {
      const double level =
          levels.at(static_cast<int>(low.x()) + n % 2, static_cast<int>(low.y()) + n / 2);
      const double weight = (n % 2 == 0 ? 1.0 - fraction.x() : fraction.x()) *
                            (n / 2 == 0 ? 1.0 - fraction.y() : fraction.y());
      if (level == unseen) continue;
      sum += weight * level;
      weights += weight;
    }
    return weights > 0.25 ? sum / weights : unseen;
  }
};

TopView make_top_view(const PointCloud& cloud, const BorderBandOptions& options) {
  if (!cloud.has_colors())
    throw Error("the map has none, but a white border requires them", {.field = "colors"});
  std::vector<std::size_t> used;
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d& point = cloud.positions[n];
    if (point.z() < options.min_z_m || point.z() > options.max_z_m) continue;
    used.push_back(n);
    low = low.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  if (used.empty())
    throw Error("no point is at the heights at which the border band is searched",
                {.field = "heights of the points",
                 .bound = to_text(options.min_z_m) + " to " + to_text(options.max_z_m) + " m"});
  TopView view;
  const Vector2d size = high - low;
  view.corner = low;
  view.cell = std::max(
      {options.cell_m, std::sqrt(size.x() * size.y() / max_band_cells), size.maxCoeff() / 20000.0});
  view.levels = Image<double>(static_cast<int>(size.x() / view.cell) + 1,
                              static_cast<int>(size.y() / view.cell) + 1, 0.0);
  Image<int> counts(view.levels.width, view.levels.height);
  for (const std::size_t n : used) {
    const Vector2d index = (cloud.positions[n].head<2>() - low) / view.cell;
    const std::size_t cell = counts.index(std::min(static_cast<int>(index.x()), counts.width - 1),
                                          std::min(static_cast<int>(index.y()), counts.height - 1));
    view.levels.pixels[cell] += *std::min_element(cloud.colors[n].begin(), cloud.colors[n].end());
    ++counts.pixels[cell];
  }
  for (std::size_t n = 0; n < counts.pixels.size(); ++n)
    view.levels.pixels[n] =
        counts.pixels[n] == 0 ? unseen : view.levels.pixels[n] / counts.pixels[n];
  return view;
}

double white_level_of(const TopView& view, const BorderBandOptions& options) {
  if (options.white_level > 0.0) return options.white_level;
  std::vector<double> seen;
  for (const double level : view.levels.pixels)
    if (level != unseen) seen.push_back(level);
  std::sort(seen.begin(), seen.end());
  const double usual = seen[seen.size() / 2];
  const double brightest = seen[seen.size() - 1 - seen.size() / 200];
  if (brightest - usual < min_contrast)
    throw Error("too little contrast for a white border band; set white_level",
                {.field = "99.5 % quantile of the brightness",
                 .value = to_fixed_text(brightest, 0),
                 .bound = ">= " + to_fixed_text(usual + min_contrast, 0) + " of 255, " +
                          to_fixed_text(min_contrast, 0) + " above the median"});
  return (usual + brightest) / 2.0;
}

// White line parallel to an axis of the rotated frame.
struct Line {
  double across = 0.0;      // coordinate on the perpendicular axis
  std::vector<int> sums{};  // cumulative number of bins along the line with white
};

// Histogram of white cells along an axis of the rotated frame.
struct Axis {
  double first = 0.0;  // start of the first bin
  double bin = 0.0;
  std::vector<double> counts{};

  std::size_t bin_of(double value) const {
    return static_cast<std::size_t>(
        std::clamp((value - first) / bin, 0.0, static_cast<double>(counts.size()) - 1.0));
  }
};

Axis make_axis(const std::vector<Vector2d>& locations, Eigen::Index axis, double bin) {
  double low = locations.front()[axis];
  double high = low;
  for (const Vector2d& position : locations) {
    low = std::min(low, position[axis]);
    high = std::max(high, position[axis]);
  }
  Axis result{low, bin, std::vector<double>(static_cast<std::size_t>((high - low) / bin) + 1)};
  for (const Vector2d& position : locations) result.counts[result.bin_of(position[axis])] += 1.0;
  return result;
}

// Centers of the max_lines largest local maxima, in ascending order.
std::vector<double> peaks_of(const Axis& axis) {
  std::vector<std::size_t> peaks;
  const auto& counts = axis.counts;
  for (std::size_t n = 0; n < counts.size(); ++n) {
    const bool rises = n == 0 || counts[n] > counts[n - 1];
    const bool falls = n + 1 == counts.size() || counts[n] >= counts[n + 1];
    if (rises && falls) peaks.push_back(n);
  }
  std::stable_sort(peaks.begin(), peaks.end(),
                   [&](std::size_t a, std::size_t b) { return counts[a] > counts[b]; });
  peaks.resize(std::min(peaks.size(), max_lines));
  std::sort(peaks.begin(), peaks.end());
  std::vector<double> locations;
  locations.reserve(peaks.size());
  for (const std::size_t n : peaks)
    locations.push_back(axis.first + (static_cast<double>(n) + 0.5) * axis.bin);
  return locations;
}

std::vector<Line> lines_along(const std::vector<Vector2d>& locations, const Axis& across,
                              const Axis& along, Eigen::Index axis) {
  std::vector<Line> lines;
  for (const double at : peaks_of(across)) {
    std::vector<int> white(along.counts.size());
    for (const Vector2d& position : locations)
      if (std::abs(position[axis] - at) <= 1.5 * across.bin)
        white[along.bin_of(position[1 - axis])] = 1;
    Line line{at, std::vector<int>(white.size() + 1)};
    for (std::size_t n = 0; n < white.size(); ++n) line.sums[n + 1] = line.sums[n] + white[n];
    lines.push_back(std::move(line));
  }
  return lines;
}

double seen_fraction(const Line& line, const Axis& along, double from, double to) {
  const std::size_t first = along.bin_of(from);
  const std::size_t last = along.bin_of(to);
  return static_cast<double>(line.sums[last + 1] - line.sums[first]) /
         static_cast<double>(last + 1 - first);
}

struct Frame {
  double score = 0.0;
  double yaw_deg = 0.0;
  Vector2d min = Vector2d::Zero();  // in the rotated frame
  Vector2d max = Vector2d::Zero();
};

// Finds the rectangle with the longest white sides in the frame rotated by `yaw_deg`.
Frame best_frame(const std::vector<Vector2d>& white, double yaw_deg, double bin,
                 const BorderBandOptions& options) {
  const Eigen::Rotation2Dd turn(-yaw_deg * std::numbers::pi / 180.0);
  std::vector<Vector2d> locations;
  locations.reserve(white.size());
  for (const Vector2d& position : white) locations.push_back(turn * position);
  const Axis x = make_axis(locations, 0, bin);
  const Axis y = make_axis(locations, 1, bin);
  const std::vector<Line> upright = lines_along(locations, x, y, 0);
  const std::vector<Line> level = lines_along(locations, y, x, 1);
  Frame best;
  best.yaw_deg = yaw_deg;
  for (std::size_t left = 0; left < upright.size(); ++left)
    for (std::size_t right = left + 1; right < upright.size(); ++right)
      for (std::size_t low = 0; low < level.size(); ++low)
        for (std::size_t high = low + 1; high < level.size(); ++high) {
          const Vector2d min(upright[left].across, level[low].across);
          const Vector2d max(upright[right].across, level[high].across);
          if ((max - min).minCoeff() < options.min_side_m) continue;
          const std::array<double, 4> seen = {seen_fraction(level[low], x, min.x(), max.x()),
                                              seen_fraction(level[high], x, min.x(), max.x()),
                                              seen_fraction(upright[left], y, min.y(), max.y()),
                                              seen_fraction(upright[right], y, min.y(), max.y())};
          const double least = *std::min_element(seen.begin(), seen.end());
          if (least < options.min_seen) continue;
          const double length =
              (max - min).x() * (seen[0] + seen[1]) + (max - min).y() * (seen[2] + seen[3]);
          if (length * least > best.score) best = {length * least, yaw_deg, min, max};
        }
  return best;
}

Frame find_frame(const TopView& view, double white_level, const BorderBandOptions& options) {
  std::vector<Vector2d> white;
  for (int y = 0; y < view.levels.height; ++y)
    for (int x = 0; x < view.levels.width; ++x)
      if (view.levels.at(x, y) >= white_level)
        white.push_back(view.corner + view.cell * Vector2d(x + 0.5, y + 0.5));
  if (white.empty())
    throw Error("no part of the ground is white enough for a border band; reduce white_level",
                {.field = "white_level", .value = to_text(white_level)});
  const double bin = 2.0 * view.cell;
  std::vector<Frame> frames(180);
  parallel_each(frames.size(), 4, [&](std::size_t n) {
    frames[n] = best_frame(white, 0.5 * static_cast<double>(n) - 45.0, bin, options);
  });
  Frame best = *std::max_element(frames.begin(), frames.end(),
                                 [](const Frame& a, const Frame& b) { return a.score < b.score; });
  if (!(best.score > 0.0))
    throw Error("no white band with four visible sides was found on the ground",
                {.field = "white share of each side",
                 .bound = ">= " + to_text(100.0 * options.min_seen) + " %"});
  return best;
}

// Side of the area between two corners, counter-clockwise: the inside is on the left.
struct Side {
  Vector2d from = Vector2d::Zero();
  Vector2d to = Vector2d::Zero();
  double seen = 0.0;

  Vector2d along() const { return (to - from).normalized(); }
  Vector2d inward() const { return {-along().y(), along().x()}; }
};

// Distance of the inner end of the white from the side, inwards, at a position along the side.
std::optional<double> inner_edge(const TopView& view, const Side& side, double along,
                                 double white_level, double max_width) {
  const double step = view.cell;
  const auto count = static_cast<int>(max_width / step);
  const auto level = [&](int n) {
    return view.at(side.from + along * side.along() + n * step * side.inward());
  };
  // Starts at the white cell nearest to the side in either direction.
  int start = 0;
  while (start <= count && level(start) < white_level && level(-start) < white_level) ++start;
  if (start > count) return std::nullopt;
  int n = level(-start) >= white_level ? -start : start;
  const int first = n;
  // One dark cell in between is noise.
  while (level(n + 1) >= white_level || level(n + 2) >= white_level) {
    ++n;
    if (n - first > 2 * count) return std::nullopt;
  }
  const double white = level(n);
  const double dark = level(n + 1);
  if (dark == unseen || white < white_level) return std::nullopt;
  return step * (n + (white - white_level) / (white - dark));
}

// Fits across = result[0] + result[1] * along by Theil (1950) and Sen (1968), then by least squares
// with Tukey's weights.
Vector2d fit_line(const std::vector<Vector2d>& edges) {
  std::vector<double> slopes;
  for (std::size_t a = 0; a < edges.size(); ++a)
    for (std::size_t b = a + 1; b < edges.size(); ++b)
      slopes.push_back((edges[b].y() - edges[a].y()) / (edges[b].x() - edges[a].x()));
  Vector2d line(0.0, median(slopes));
  std::vector<double> offsets;
  offsets.reserve(edges.size());
  for (const Vector2d& edge : edges) offsets.push_back(edge.y() - line[1] * edge.x());
  line[0] = median(offsets);
  for (int round = 0; round < 20; ++round) {
    std::vector<double> deviations;
    deviations.reserve(edges.size());
    for (const Vector2d& edge : edges)
      deviations.push_back(std::abs(edge.y() - line[0] - line[1] * edge.x()));
    const double limit = std::max(tukey_width_of(median(deviations)), 1e-6);
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Vector2d right = Vector2d::Zero();
    for (std::size_t n = 0; n < edges.size(); ++n) {
      const double weight = tukey_weight(deviations[n] / limit);
      const Vector2d row(1.0, edges[n].x());
      normal += weight * row * row.transpose();
      right += weight * edges[n].y() * row;
    }
    if (!(std::abs(normal.determinant()) > 1e-12)) return line;
    line = normal.inverse() * right;
  }
  return line;
}

void move_to_inner_edge(Side& side, const TopView& view, double white_level,
                        const BorderBandOptions& options) {
  const double length = (side.to - side.from).norm();
  const double step = std::max(2.0 * view.cell, length / 400.0);
  // The bands of the neighboring sides are excluded.
  const double rim = std::min(options.max_width_m, length / 4.0);
  std::vector<Vector2d> edges;
  int slices = 0;
  for (double along = rim; along <= length - rim; along += step, ++slices)
    if (const auto edge = inner_edge(view, side, along, white_level, options.max_width_m))
      edges.emplace_back(along, *edge);
  side.seen = static_cast<double>(edges.size()) / std::max(slices, 1);
  if (edges.size() < 5 || side.seen < options.min_seen)
    throw Error("the inner edge of the white band is not visible along enough of a side",
                {.field = "visible share of the side",
                 .value = to_fixed_text(100.0 * side.seen, 0) + " %",
                 .bound = ">= " + to_text(100.0 * options.min_seen) + " %"});
  const Vector2d line = fit_line(edges);
  const Vector2d inward = side.inward();
  const Vector2d from = side.from;
  side.from = from + line[0] * inward;
  side.to = from + length * side.along() + (line[0] + line[1] * length) * inward;
}

Vector2d crossing_of(const Side& a, const Side& b) {
  Eigen::Matrix2d directions;
  directions << a.along(), -b.along();
  const Vector2d at = directions.inverse() * (b.from - a.from);
  return a.from + at[0] * a.along();
}

std::array<Vector2d, 4> corners_of(const std::array<Side, 4>& sides) {
  std::array<Vector2d, 4> corners;
  for (std::size_t n = 0; n < 4; ++n) corners[n] = crossing_of(sides[(n + 3) % 4], sides[n]);
  return corners;
}

}  // namespace

void bind(ParameterTable& table, BorderBandOptions& options) {
  table.add(
      "white_level", options.white_level, {0.0, 255.0},
      "with --border: brightness (minimum of red, green and blue, 0 to 255) from which a color is "
      "white; 0: determined from the colors");
  table.add("max_band_width_m", options.max_width_m, positive,
            "with --border: maximum width of the band, m");
  table.add("min_band_side_m", options.min_side_m, positive,
            "with --border: minimum side of the area inside the band, m");
  table.add("min_band_seen", options.min_seen, {0.0, 1.0, true, false},
            "with --border: minimum share of each side's length along which the band is visible");
  table.add("band_cell_m", options.cell_m, positive,
            "with --border: cell size of the top view in which the band is detected, m");
  table.add("min_band_z_m", options.min_z_m, any_number,
            "with --border: minimum z of the white band above the ground, m");
  table.add("max_band_z_m", options.max_z_m, any_number,
            "with --border: maximum z of the white band above the ground, m");
}

BorderBand find_border_band(const PointCloud& level_cloud, double margin_m,
                            const BorderBandOptions& options) {
  const TopView view = make_top_view(level_cloud, options);
  BorderBand band;
  band.white_level = white_level_of(view, options);
  const Frame frame = find_frame(view, band.white_level, options);
  const Eigen::Rotation2Dd turn(frame.yaw_deg * std::numbers::pi / 180.0);
  std::array<Vector2d, 4> corners = {frame.min, Vector2d(frame.max.x(), frame.min.y()), frame.max,
                                     Vector2d(frame.min.x(), frame.max.y())};
  for (Vector2d& corner : corners) corner = turn * corner;
  std::array<Side, 4> sides;
  // The second round uses the directions of the sides that the first round found.
  for (int round = 0; round < 2; ++round) {
    for (std::size_t n = 0; n < 4; ++n) {
      sides[n] = {corners[n], corners[(n + 1) % 4], 0.0};
      move_to_inner_edge(sides[n], view, band.white_level, options);
    }
    corners = corners_of(sides);
  }
  band.seen = 1.0;
  for (std::size_t n = 0; n < 4; ++n) {
    Side& side = sides[n];
    band.sides_m[n] = (corners[(n + 1) % 4] - corners[n]).norm();
    const Vector2d inward = side.inward();
    side.from += margin_m * inward;
    side.to += margin_m * inward;
    band.seen = std::min(band.seen, side.seen);
  }
  corners = corners_of(sides);
  for (std::size_t n = 0; n < 4; ++n) {
    const double side_m = (corners[(n + 1) % 4] - corners[n]).dot(sides[n].along());
    if (!corners[n].allFinite() || side_m < options.min_side_m)
      throw Error("the area inside the white band is too small",
                  {.field = "side",
                   .value = to_text(static_cast<float>(side_m)) + " m",
                   .bound = ">= " + to_text(options.min_side_m) + " m"});
  }
  band.corners.assign(corners.begin(), corners.end());
  return band;
}

BorderScale scale_by_border(const BorderBand& band, const Vector2d& inner_size_m) {
  Eigen::Vector4d measured;
  std::copy(band.sides_m.begin(), band.sides_m.end(), measured.begin());
  Eigen::Vector4d size;
  size << inner_size_m, inner_size_m;
  if (const Eigen::Vector4d turned = size.reverse(); turned.dot(measured) > size.dot(measured))
    size = turned;
  if ((measured.cwiseQuotient(size).array() - 1.0).abs().maxCoeff() > max_size_error) {
    std::string sides;
    for (const double side : measured)
      sides += (sides.empty() ? "" : ", ") + to_fixed_text(side, 3);
    throw Error("does not match the size of the area inside the white band",
                {.field = "border_size",
                 .value = to_text(inner_size_m.x()) + "x" + to_text(inner_size_m.y()),
                 .bound = "within " + to_text(100.0 * max_size_error) +
                          " % of the sides found: " + sides + " m"});
  }
  const double ratio = size.dot(measured) / size.squaredNorm();
  const double variance = (measured - ratio * size).squaredNorm() / 3.0;  // per side, m^2
  return {1.0 / ratio, std::sqrt(2.0 * variance / size.squaredNorm()) / (ratio * ratio)};
}

}  // namespace libmap
