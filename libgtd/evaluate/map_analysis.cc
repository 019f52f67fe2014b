#include "libgtd/evaluate/map_analysis.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/score_color.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr double score_tolerance = 1e-6;  // as in score_color.h
constexpr int largest_gap = 6;            // maximum number of empty columns inside the ground

template <typename Bin>
std::vector<Bin> empty_bins(const ValueBins& bins) {
  std::vector<Bin> result;
  for (std::size_t b = 0; b < bins.count; ++b)
    result.push_back({.low = bins.low(b), .high = bins.high(b)});
  return result;
}

class MapCounter {
 public:
  MapCounter(const VoxelMap& map, const MapSurface& surface, const MapAnalysisOptions& options)
      : map_(map), surface_(surface), options_(options) {}

  MapAnalysis run() {
    make_score_bins();
    make_ground_bins();
    for (std::size_t n = 0; n < map_.size(); ++n) count_voxel(n);
    count_columns();
    return std::move(result_);
  }

 private:
  void make_score_bins() {
    double low = 0.0;
    double high = 1.0;
    for (const float score : map_.scores) {
      if (std::isnan(score)) continue;
      low = std::min(low, static_cast<double>(score));
      high = std::max(high, static_cast<double>(score));
    }
    scores_ = bins_over(low, high, options_.score_bin, "score_bin");
    result_.score_bins = empty_bins<ScoreBin>(scores_);
    double upper = std::numeric_limits<double>::infinity();
    for (const libmap::ScoreClass& one : libmap::score_classes) {
      result_.score_classes.push_back({.low = one.min_score, .high = upper});
      upper = one.min_score;
    }
  }

  void make_ground_bins() {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t n = 0; n < map_.size(); ++n) {
      if (!map_.evaluated(n, options_.border)) continue;
      const double height = map_.center_in_terrain(n).z();
      low = std::min(low, height);
      high = std::max(high, height);
    }
    slopes_ = bins_over(0.0, 90.0, options_.slope_bin_deg, "slope_bin_deg");
    result_.by_slope = empty_bins<GroundBin>(slopes_);
    if (!(low <= high)) return;
    result_.ground.low = low;
    result_.ground.high = high;
    heights_ = bins_over(low, high, options_.height_bin_m, "height_bin_m");
    result_.by_height = empty_bins<GroundBin>(heights_);
  }

  void count_voxel(std::size_t n) {
    const bool scored = !std::isnan(map_.scores[n]);
    const bool above = map_.above_zero_plane(n);
    ++result_.voxels;
    result_.without_score += scored ? 0 : 1;
    result_.below_zero_plane += above ? 0 : 1;
    result_.at_border += map_.border[n] != 0 ? 1 : 0;
    result_.obstacles += map_.obstacle[n] != 0 ? 1 : 0;
    result_.graspable += map_.graspable[n] != 0 ? 1 : 0;
    if (!scored) return;
    const double score = static_cast<double>(map_.scores[n]);
    add_to(result_.score_bins[scores_.bin_of(score + score_tolerance)], n);
    for (ScoreBin& one : result_.score_classes)
      if (score >= one.low - score_tolerance) {
        add_to(one, n);
        break;
      }
    if (!map_.evaluated(n, options_.border)) return;
    add_to(result_.ground, n);
    const double plan_area_m2 = surface_.plan_area_m2(n);
    result_.plan_area_m2 += plan_area_m2;
    result_.graspable_plan_area_m2 += map_.graspable[n] != 0 ? plan_area_m2 : 0.0;
    add_to(result_.by_height[heights_.bin_of(map_.center_in_terrain(n).z())], n);
    const auto slope_deg = static_cast<double>(surface_.slope_deg[n]);
    if (!std::isnan(slope_deg)) add_to(result_.by_slope[slopes_.bin_of(slope_deg)], n);
  }

  void add_to(ScoreBin& bin, std::size_t n) const {
    ++bin.all;
    bin.above_zero_plane += map_.above_zero_plane(n) ? 1 : 0;
    if (!map_.evaluated(n, options_.border)) return;
    ++bin.evaluated;
    bin.graspable += map_.graspable[n];
    bin.area_m2 += static_cast<double>(surface_.area_m2[n]);
  }

  void add_to(GroundBin& bin, std::size_t n) const {
    const auto area_m2 = static_cast<double>(surface_.area_m2[n]);
    ++bin.voxels;
    bin.area_m2 += area_m2;
    bin.score_sum += static_cast<double>(map_.scores[n]);
    if (map_.graspable[n] == 0) return;
    ++bin.graspable_voxels;
    bin.graspable_area_m2 += area_m2;
  }

  // Voxels of a column are adjacent, and columns are adjacent along y.
  void count_columns() {
    std::size_t columns = 0;
    std::size_t gaps = 0;
    for (std::size_t n = 0; n < map_.size();) {
      const Voxel& here = map_.voxels[n];
      bool evaluated = false;
      bool graspable = false;
      std::size_t next = n;
      for (; next < map_.size() && map_.voxels[next].i == here.i && map_.voxels[next].j == here.j;
           ++next) {
        if (!map_.evaluated(next, options_.border)) continue;
        evaluated = true;
        graspable = graspable || map_.graspable[next] != 0;
      }
      ++columns;
      result_.columns += evaluated ? 1 : 0;
      result_.graspable_columns += graspable ? 1 : 0;
      if (next < map_.size() && map_.voxels[next].i == here.i &&
          map_.voxels[next].j - here.j - 1 <= largest_gap)
        gaps += static_cast<std::size_t>(map_.voxels[next].j - here.j - 1);
      n = next;
    }
    if (columns > 0)
      result_.column_coverage = static_cast<double>(columns) / static_cast<double>(columns + gaps);
  }

  const VoxelMap& map_;
  const MapSurface& surface_;
  const MapAnalysisOptions& options_;
  ValueBins scores_;
  ValueBins heights_;
  ValueBins slopes_;
  MapAnalysis result_;
};

constexpr double max_bins = 100'000.0;
constexpr double rounding = 1e-9;  // relative to the bin width

}  // namespace

void bind(libmap::ParameterTable& table, MapAnalysisOptions& options) {
  table.add("score_bin", options.score_bin, libmap::Range{0.0, 1.0, true, false},
            "bin width of the histogram of scores, which are from 0 to 1");
  table.add("height_bin_m", options.height_bin_m, libmap::positive,
            "bin width of the height histogram, m");
  table.add("slope_bin_deg", options.slope_bin_deg, libmap::Range{0.0, 90.0, true, false},
            "bin width of the slope histogram, degrees");
  table.add("border", options.border, "include voxels at the border of the scanned area");
}

std::optional<double> GroundBin::graspable_fraction() const {
  return area_m2 > 0.0 ? std::optional(graspable_area_m2 / area_m2) : std::nullopt;
}

std::optional<double> GroundBin::mean_score() const {
  return voxels > 0 ? std::optional(score_sum / static_cast<double>(voxels)) : std::nullopt;
}

std::size_t nearest_rank(std::size_t count, double fraction) {
  const double rank = std::ceil(fraction * static_cast<double>(count) - 1e-9);
  return static_cast<std::size_t>(std::clamp(rank, 1.0, static_cast<double>(count))) - 1;
}

MapAnalysis analyze_map(const VoxelMap& map, const MapSurface& surface,
                        const MapAnalysisOptions& options) {
  libmap::check_parameters(options);
  if (surface.slope_deg.size() != map.size() || surface.area_m2.size() != map.size())
    throw libmap::Error("not one value per voxel of the map", {.field = "slope_deg"});
  return MapCounter(map, surface, options).run();
}

std::size_t ValueBins::bin_of(double value) const {
  const double bin = std::floor((value - first_edge) / width + rounding);
  return bin > 0.0 ? std::min(static_cast<std::size_t>(bin), count - 1) : 0;
}

ValueBins bins_over(double low, double high, double width, const char* field) {
  if (!(width > 0.0))
    throw libmap::Error("out of range",
                        {.field = field, .value = libmap::to_text(width), .bound = "> 0"});
  const double first = std::floor(low / width + rounding);
  const double count = std::max(1.0, std::ceil(high / width - rounding) - first);
  if (!(count <= max_bins))
    throw libmap::Error(
        "too narrow: there would be " + libmap::to_text(count) + " bins",
        {.field = field,
         .value = libmap::to_text(width),
         .bound = ">= " + libmap::to_text(static_cast<float>((high - low) / max_bins))});
  return {first * width, width, static_cast<std::size_t>(count)};
}

}  // namespace libgtd
