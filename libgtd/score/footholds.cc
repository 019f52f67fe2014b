#include "libgtd/score/footholds.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "libgtd/shape/curvature.h"
#include "libgtd/shape/point_grid.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using libmap::PointCloud;
using libmap::ScalarField;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

void check(const FootholdOptions& options, const FootholdFrame& frame) {
  libmap::check_parameters(options);
  if (!(frame.up.norm() > 0.0) || !frame.up.allFinite())
    throw libmap::Error("has length zero or is not finite", {.field = "up"});
}

// Calls use(index) for the points within `radius_m`, at most the edge of a cell, of `center`.
template <typename Use>
void for_each_near(const PointGrid& grid, const std::vector<Eigen::Vector3d>& positions,
                   const Eigen::Vector3d& center, double radius_m,
                   std::vector<PointGrid::Range>& runs, const Use& use) {
  grid.find_near(grid.cell_of(center), 1, runs);
  for (const PointGrid::Range& run : runs)
    for (std::uint32_t n = run.first; n < run.last; ++n) {
      const std::uint32_t point = grid.order()[n];
      if ((positions[point] - center).squaredNorm() <= radius_m * radius_m) use(point);
    }
}

class FootholdSearch {
 public:
  FootholdSearch(const PointCloud& map, const FootholdOptions& options, const FootholdFrame& frame)
      : map_(map),
        options_(options),
        up_(frame.up.normalized()),
        scores_(values_of(map, is_tested(map) ? "hold_probability" : "score")),
        grid_(map.positions, options.separation_m) {}

  FootholdResult run() {
    FootholdResult result;
    std::vector<Foothold> candidates = find_candidates(result.at_border);
    result.candidates = candidates.size();
    std::sort(candidates.begin(), candidates.end(), [](const Foothold& a, const Foothold& b) {
      if (a.score != b.score) return a.score > b.score;
      if (a.force_n != b.force_n) return a.force_n > b.force_n;
      if (a.mean_score != b.mean_score) return a.mean_score > b.mean_score;
      return a.map_point < b.map_point;
    });
    std::vector<std::uint8_t> suppressed(map_.size(), 0);
    std::vector<PointGrid::Range> runs;
    for (const Foothold& candidate : candidates) {
      if (suppressed[candidate.map_point] != 0) continue;
      if (options_.max_count > 0 &&
          result.footholds.size() == static_cast<std::size_t>(options_.max_count))
        break;
      result.footholds.push_back(candidate);
      for_each_near(grid_, map_.positions, map_.positions[candidate.map_point],
                    options_.separation_m, runs,
                    [&](std::uint32_t point) { suppressed[point] = 1; });
    }
    describe_surface(result.footholds);
    return result;
  }

 private:
  static bool is_tested(const PointCloud& map) {
    return map.find_field("hold_probability") != nullptr;
  }

  // Returns 1 or 0 per point; empty if the map has no such field and the options do not need it.
  std::vector<double> graspable_points() const {
    if (is_tested(map_)) {
      std::vector<double> graspable;
      for (const double probability : scores_) graspable.push_back(probability >= 0.5 ? 1.0 : 0.0);
      return graspable;
    }
    if (map_.find_field("graspable") == nullptr && !options_.graspable_only) return {};
    return values_of(map_, "graspable");
  }

  std::vector<Foothold> find_candidates(std::size_t& at_border) const {
    const std::vector<double> graspable = graspable_points();
    const ScalarField* force = is_tested(map_) ? map_.find_field("holding_force_n") : nullptr;
    // The field is called edge in maps of earlier versions.
    const char* name = map_.find_field("edge") != nullptr ? "edge" : "border";
    const std::vector<double>* border = options_.border ? nullptr : &values_of(map_, name);
    std::vector<Foothold> candidates;
    for (std::size_t n = 0; n < map_.size(); ++n) {
      if (!map_.positions[n].allFinite() || !std::isfinite(scores_[n]) ||
          !(scores_[n] >= options_.min_score))
        continue;
      if (options_.graspable_only && graspable[n] == 0.0) continue;
      if (border != nullptr && (*border)[n] != 0.0) {
        ++at_border;
        continue;
      }
      Foothold& candidate = candidates.emplace_back();
      candidate.map_point = n;
      candidate.score = scores_[n];
      candidate.force_n = force != nullptr ? force->values[n] : 0.0;
      candidate.approach = approach_at(n);
    }
    // Coincident points are adjacent and share their surroundings.
    std::vector<std::size_t> order(candidates.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto is_before = [&](std::size_t a, std::size_t b) {
      return is_position_less(position_of(candidates[a]), position_of(candidates[b]));
    };
    std::sort(order.begin(), order.end(), is_before);
    libmap::parallel_for(candidates.size(), 256, [&](std::size_t begin, std::size_t end) {
      std::vector<PointGrid::Range> runs;
      for (std::size_t n = begin; n < end; ++n) {
        Foothold& candidate = candidates[order[n]];
        const Foothold* last = n == begin ? nullptr : &candidates[order[n - 1]];
        if (last != nullptr && is_same_position(position_of(candidate), position_of(*last))) {
          candidate.mean_score = last->mean_score;
          candidate.graspable_points = last->graspable_points;
        } else {
          look_around(candidate, graspable, runs);
        }
      }
    });
    return candidates;
  }

  const Eigen::Vector3d& position_of(const Foothold& foothold) const {
    return map_.positions[foothold.map_point];
  }

  // Opposite to the axis of the matched mask. Subtracted from zero, so that no component is -0.
  Eigen::Vector3d approach_at(std::size_t point) const {
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    if (!map_.has_normals()) return zero - up_;
    const Eigen::Vector3d axis = map_.normals[point].cast<double>();
    return zero - (axis.allFinite() && axis.norm() > 0.0 ? axis.normalized() : up_);
  }

  void look_around(Foothold& foothold, const std::vector<double>& graspable,
                   std::vector<PointGrid::Range>& runs) const {
    const double radius_m = 0.5 * options_.separation_m;
    const Eigen::Vector3d& center = map_.positions[foothold.map_point];
    double sum = 0.0;
    double weights = 0.0;
    for_each_near(grid_, map_.positions, center, radius_m, runs, [&](std::uint32_t point) {
      if (!std::isfinite(scores_[point])) return;
      const double fraction =
          (map_.positions[point] - center).squaredNorm() / (radius_m * radius_m);
      sum += (1.0 - fraction) * scores_[point];
      weights += 1.0 - fraction;
      if (!graspable.empty() && graspable[point] != 0.0) ++foothold.graspable_points;
    });
    // If the square of the separation underflows, no point has a weight.
    foothold.mean_score = weights > 0.0 ? sum / weights : foothold.score;
  }

  void describe_surface(std::vector<Foothold>& footholds) const {
    std::vector<std::size_t> map_points;
    map_points.reserve(footholds.size());
    for (const Foothold& foothold : footholds) map_points.push_back(foothold.map_point);
    PointCloud surface;  // positions and normals only
    surface.positions = map_.positions;
    surface.normals = map_.normals;
    const CurvatureResult shape = estimate_curvature(
        surface,
        {.method = CurvatureMethod::corrected, .radius_m = options_.surface_radius_m, .up = up_},
        map_points);
    for (std::size_t n = 0; n < footholds.size(); ++n) {
      const Curvature& here = shape.points[n];
      footholds[n].normal = here.normal;
      footholds[n].k1 = here.k1;
      footholds[n].k2 = here.k2;
      const double cosine = here.normal.cast<double>().dot(up_);
      footholds[n].slope_deg =
          here.valid ? std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / M_PI : nan;
    }
  }

  const PointCloud& map_;
  const FootholdOptions& options_;
  Eigen::Vector3d up_;
  const std::vector<double>& scores_;
  PointGrid grid_;
};

}  // namespace

void bind(libmap::ParameterTable& table, FootholdOptions& options) {
  table.add("separation_m", options.separation_m, libmap::positive,
            "minimum distance between footholds, m");
  table.add("min_score", options.min_score, libmap::zero_to_one,
            "minimum score of a foothold, or hold_probability if the map has this field");
  table.add("graspable_only", options.graspable_only,
            "select only graspable voxels (hold_probability >= 0.5, if the map has this field)");
  table.add("border", options.border, "include voxels at the border of the scanned area");
  table.add("surface_radius_m", options.surface_radius_m, libmap::positive,
            "radius within which normal and curvature are estimated, m");
  table.add("max_count", options.max_count, libmap::not_negative,
            "maximum number of footholds; 0: no limit");
}

FootholdResult find_footholds(const PointCloud& map, const FootholdOptions& options,
                              const FootholdFrame& frame) {
  check(options, frame);
  if (map.empty()) throw libmap::no_elements("points of the map");
  return FootholdSearch(map, options, frame).run();
}

PointCloud to_cloud(const FootholdResult& result, const PointCloud& map) {
  std::vector<std::size_t> points;
  for (const Foothold& foothold : result.footholds) points.push_back(foothold.map_point);
  PointCloud cloud = libmap::select_points(map, points);
  std::erase_if(cloud.fields, [](const auto& field) { return field.name == "slope_deg"; });
  cloud.normals.clear();
  for (const Foothold& foothold : result.footholds) cloud.normals.push_back(foothold.normal);
  const auto add = [&](const char* name, const auto& value_of) {
    std::vector<double>& values = cloud.add_field(name, libmap::ScalarType::float32).values;
    for (std::size_t n = 0; n < values.size(); ++n)
      values[n] = static_cast<double>(value_of(result.footholds[n]));
  };
  add("mean_score", [](const Foothold& f) { return f.mean_score; });
  add("graspable_points", [](const Foothold& f) { return f.graspable_points; });
  add("approach_x", [](const Foothold& f) { return f.approach.x(); });
  add("approach_y", [](const Foothold& f) { return f.approach.y(); });
  add("approach_z", [](const Foothold& f) { return f.approach.z(); });
  add("slope_deg", [](const Foothold& f) { return f.slope_deg; });
  add("k1", [](const Foothold& f) { return f.k1; });
  add("k2", [](const Foothold& f) { return f.k2; });
  return cloud;
}

void describe(libmap::ResultTable& table, const FootholdResult& result) {
  table.add("candidates", result.candidates, "number of map points that could become footholds");
  table.add("candidates_at_border", result.at_border,
            "number of further map points, skipped because they are at the border of the scan");
}

}  // namespace libgtd
