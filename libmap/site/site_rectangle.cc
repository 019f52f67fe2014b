#include "libmap/site/site_rectangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/image.h"
#include "libmap/core/parallel.h"

namespace libmap {

namespace {

using Eigen::Vector2d;
using Mask = Image<std::uint8_t>;

constexpr double max_cells = 1e6;
constexpr double max_per_side = 20000.0;
constexpr double min_on_site = 20.0;  // cells along the shorter side of the site

// Summed-area table: sums of a mask over rectangles in constant time (Crow 1984).
class AreaTable {
 public:
  explicit AreaTable(const Mask& mask) : sums_(mask.width + 1, mask.height + 1) {
    for (int y = 0; y < mask.height; ++y) {
      std::uint32_t row = 0;
      for (int x = 0; x < mask.width; ++x) {
        row += mask.at(x, y);
        sums_.at(x + 1, y + 1) = sums_.at(x + 1, y) + row;
      }
    }
  }
  int width() const { return sums_.width - 1; }
  int height() const { return sums_.height - 1; }

  // Sum over columns x to x + width - 1 and rows y to y + height - 1, which must be in the mask.
  std::uint32_t sum(int x, int y, int width, int height) const {
    return sums_.at(x + width, y + height) - sums_.at(x, y + height) - sums_.at(x + width, y) +
           sums_.at(x, y);
  }
  bool is_full(int x, int y, int width, int height) const {
    return sum(x, y, width, height) ==
           static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height);
  }

 private:
  Image<std::uint32_t> sums_;
};

// Mask of the data in the x-y plane.
struct Ground {
  Vector2d corner = Vector2d::Zero();
  double cell = 0.0;
  Mask mask;

  bool at(const Vector2d& position) const {
    const Vector2d index = (position - corner) / cell;
    const double x = std::floor(index.x());
    const double y = std::floor(index.y());
    return x >= 0.0 && y >= 0.0 && x < mask.width && y < mask.height &&
           mask.at(static_cast<int>(x), static_cast<int>(y)) != 0;
  }
};

Ground make_ground(const std::vector<Vector2d>& points, const SiteRectangleOptions& options) {
  Ground ground;
  Vector2d low = points.front();
  Vector2d high = low;
  for (const Vector2d& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double area = (high - low).x() * (high - low).y();
  ground.cell = std::max(
      {options.cell_m, std::sqrt(area / max_cells), (high - low).maxCoeff() / max_per_side});
  // A closing by `reach` cells in each direction fills gaps of 2 * reach cells.
  const int reach = static_cast<int>(std::ceil(options.max_gap_m / ground.cell / 2.0));
  const int rim = reach + 2;
  ground.corner = low - Vector2d::Constant((rim + 0.5) * ground.cell);
  const auto cells = [&](double length) {
    return static_cast<int>(std::floor(length / ground.cell)) + 1 + 2 * rim;
  };
  ground.mask = Mask(cells((high - low).x()), cells((high - low).y()));
  for (const Vector2d& point : points) {
    const Vector2d index = (point - ground.corner) / ground.cell;
    ground.mask.at(std::min(static_cast<int>(index.x()), ground.mask.width - 1),
                   std::min(static_cast<int>(index.y()), ground.mask.height - 1)) = 1;
  }
  cv::Mat cells_of_mask(ground.mask.height, ground.mask.width, CV_8UC1, ground.mask.pixels.data());
  const cv::Size square(2 * reach + 1, 2 * reach + 1);
  cv::morphologyEx(cells_of_mask, cells_of_mask, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_RECT, square));
  return ground;
}

struct Fit {
  int growth = 0;  // clearance in cells; negative: the rectangle is too large
  Vector2d center = Vector2d::Zero();
};

// Mask of the data along axes rotated by a yaw.
class TurnedGround {
 public:
  TurnedGround(const Ground& ground, double yaw_deg, double cell)
      : turn_(yaw_deg * std::numbers::pi / 180.0), cell_(cell), table_(Mask()) {
    const Vector2d size(ground.mask.width * ground.cell, ground.mask.height * ground.cell);
    middle_ = ground.corner + size / 2.0;
    const Eigen::Matrix2d rotation = turn_.toRotationMatrix();
    const Vector2d extent = rotation.cwiseAbs() * size;
    Mask mask(static_cast<int>(std::ceil(extent.x() / cell)) + 1,
              static_cast<int>(std::ceil(extent.y() / cell)) + 1);
    half_ = Vector2d(mask.width, mask.height) / 2.0;
    for (int y = 0; y < mask.height; ++y)
      for (int x = 0; x < mask.width; ++x)
        mask.at(x, y) = ground.at(place(x + 0.5, y + 0.5)) ? 1 : 0;
    table_ = AreaTable(mask);
  }

  // Best-centered position of a rectangle of `size` cells, with negative growth if it does not fit;
  // nullopt if not even the smallest one fits.
  std::optional<Fit> best(const Eigen::Vector2i& size) const {
    int least = -(size.minCoeff() - 1) / 2;
    if (!fits(size, least)) return std::nullopt;
    int most = std::max(table_.width() - size.x(), table_.height() - size.y()) / 2 + 1;
    while (most - least > 1) {
      const int middle = least + (most - least) / 2;
      (fits(size, middle) ? least : most) = middle;
    }
    return Fit{least, middle_position(size, least)};
  }

 private:
  Vector2d place(double x, double y) const {
    return middle_ + turn_ * (cell_ * (Vector2d(x, y) - half_));
  }
  template <typename Visit>
  void visit_positions(const Eigen::Vector2i& size, int growth, const Visit& visit) const {
    const Eigen::Vector2i grown = size.array() + 2 * growth;
    for (int y = 0; y + grown.y() <= table_.height(); ++y)
      for (int x = 0; x + grown.x() <= table_.width(); ++x)
        if (table_.is_full(x, y, grown.x(), grown.y()) &&
            !visit(Vector2d(x + grown.x() / 2.0, y + grown.y() / 2.0)))
          return;
  }
  bool fits(const Eigen::Vector2i& size, int growth) const {
    bool found = false;
    visit_positions(size, growth, [&](const Vector2d&) { return !(found = true); });
    return found;
  }
  // Among all positions that fit, the one nearest to their mean.
  Vector2d middle_position(const Eigen::Vector2i& size, int growth) const {
    std::vector<Vector2d> positions;
    Vector2d mean = Vector2d::Zero();
    visit_positions(size, growth, [&](const Vector2d& at) {
      positions.push_back(at);
      mean += at;
      return true;
    });
    mean /= static_cast<double>(positions.size());
    const Vector2d nearest = *std::min_element(
        positions.begin(), positions.end(), [&](const Vector2d& a, const Vector2d& b) {
          return (a - mean).squaredNorm() < (b - mean).squaredNorm();
        });
    return place(nearest.x(), nearest.y());
  }

  Eigen::Rotation2Dd turn_;
  double cell_;
  Vector2d middle_ = Vector2d::Zero();
  Vector2d half_ = Vector2d::Zero();
  AreaTable table_;
};

struct Direction {
  double yaw_deg = 0.0;
  std::optional<Fit> fit;
};

int growth_of(const Direction& direction) {
  return direction.fit ? direction.fit->growth : -1000000;
}

std::vector<Direction> try_directions(const Ground& ground, const Vector2d& size_m, double cell,
                                      std::vector<double> yaws_deg) {
  const Eigen::Vector2i size(std::max(1, static_cast<int>(std::lround(size_m.x() / cell))),
                             std::max(1, static_cast<int>(std::lround(size_m.y() / cell))));
  std::vector<Direction> directions(yaws_deg.size());
  parallel_each(yaws_deg.size(), [&](std::size_t n) {
    directions[n] = {yaws_deg[n], TurnedGround(ground, yaws_deg[n], cell).best(size)};
  });
  return directions;
}

// Chooses the best direction: 0 if it is among the best, otherwise the middle of the interval of
// best directions that contains the smallest rotation.
const Direction& choose(const std::vector<Direction>& directions) {
  int most = growth_of(directions.front());
  for (const Direction& direction : directions) most = std::max(most, growth_of(direction));
  const auto is_best = [&](std::size_t n) { return growth_of(directions[n]) == most; };
  std::size_t least_turned = 0;
  while (!is_best(least_turned)) ++least_turned;
  for (std::size_t n = least_turned + 1; n < directions.size(); ++n)
    if (is_best(n) && std::abs(directions[n].yaw_deg) < std::abs(directions[least_turned].yaw_deg))
      least_turned = n;
  if (directions[least_turned].yaw_deg == 0.0) return directions[least_turned];
  std::size_t first = least_turned;
  std::size_t last = least_turned;
  while (first > 0 && is_best(first - 1)) --first;
  while (last + 1 < directions.size() && is_best(last + 1)) ++last;
  return directions[(first + last) / 2];
}

std::vector<double> steps(double from, double to, double step) {
  std::vector<double> values;
  const auto count = static_cast<int>(std::lround((to - from) / step));
  for (int n = 0; n <= count; ++n) values.push_back(from + step * n);
  return values;
}

std::string size_text(const Vector2d& size) {
  const auto text = [](double length) {
    return to_fixed_text(std::floor(std::max(length, 0.0) * 100.0 + 1e-6) / 100.0, 2);
  };
  return text(size.x()) + " x " + text(size.y()) + " m";
}

void require_ranges(const Vector2d& size_m, const SiteRectangleOptions& options) {
  check_parameters(options);
  if (!size_m.allFinite() || (size_m.array() <= 0.0).any())
    throw Error("not a size", {.field = "size",
                               .value = to_text(size_m.x()) + " x " + to_text(size_m.y()) + " m",
                               .bound = "> 0 and finite"});
}

// Suggests a larger --max-gap if the site fits with it; empty for more than a quarter of the site.
std::string gap_remedy(const std::vector<Vector2d>& points, const Vector2d& size_m,
                       SiteRectangleOptions options) {
  options.max_gap_m = std::max(2.0 * options.max_gap_m, options.cell_m);
  if (options.max_gap_m > 0.25 * size_m.minCoeff()) return "";
  try {
    find_site_rectangle(points, size_m, options);
  } catch (const Error&) {
    return "";
  }
  return "; --max-gap " + to_text(options.max_gap_m) + " closes more holes";
}

}  // namespace

void bind(ParameterTable& table, SiteRectangleOptions& options) {
  table.add("site_cell_m", options.cell_m, positive,
            "cell size of the grid in which the site is searched, m; larger for large areas");
  table.add("max_gap_m", options.max_gap_m, not_negative,
            "maximum size of ignored holes in the measured area: side of a square that fits in, m");
  table.add("margin_m", options.margin_m, not_negative,
            "minimum distance of the site from holes, the data's border and the border band, m");
}

SiteRectangle find_site_rectangle(const std::vector<Vector2d>& points, const Vector2d& size_m,
                                  const SiteRectangleOptions& options) {
  require_ranges(size_m, options);
  if (points.empty()) throw no_elements("points");
  const Ground ground = make_ground(points, options);
  if (ground.cell > std::max(options.cell_m, size_m.minCoeff() / min_on_site))
    throw Error("the data extend too far for a site of this size; remove stray points",
                {.field = "size of the data",
                 .value = to_fixed_text(ground.cell * ground.mask.width, 0) + " x " +
                          to_fixed_text(ground.cell * ground.mask.height, 0) + " m"});
  const double quarter = size_m.x() == size_m.y() ? 45.0 : 90.0;
  const double coarse_cell =
      std::max(ground.cell, std::min(4.0 * ground.cell, size_m.minCoeff() / 8.0));
  const Direction coarse =
      choose(try_directions(ground, size_m, coarse_cell, steps(-quarter, quarter, 1.0)));
  // Yaw 0 is tried as well as the neighborhood of the best yaw.
  std::vector<double> fine = steps(coarse.yaw_deg - 1.5, coarse.yaw_deg + 1.5, 0.125);
  if (coarse.yaw_deg != 0.0) fine.insert(fine.begin(), 0.0);
  const Direction best = choose(try_directions(ground, size_m, ground.cell, fine));
  SiteRectangle result;
  result.yaw_deg = best.yaw_deg;
  result.clearance_m = growth_of(best) * ground.cell;
  if (!best.fit || result.clearance_m < options.margin_m - 1.001 * ground.cell)
    throw Error("no rectangle of this size fits into the data",
                {.field = "size",
                 .value = size_text(size_m),
                 .bound = "at most " +
                          (best.fit ? size_text(size_m.array() +
                                                2.0 * (result.clearance_m - options.margin_m))
                                    : std::string("0")) +
                          ", the largest that fits" + gap_remedy(points, size_m, options)});
  result.center = best.fit->center;
  return result;
}

}  // namespace libmap
