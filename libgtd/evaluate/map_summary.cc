#include "libgtd/evaluate/map_summary.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <variant>

#include "libgtd/evaluate/named_cells.h"
#include "libmap/core/text.h"

namespace libgtd {
namespace {

// Values of one row with the names of the columns.
struct Row {
  NamedCells cells;

  void add(std::string name, std::string cell) {
    cells.emplace_back(std::move(name), std::move(cell));
  }
  void add(std::string name, std::size_t count) { add(std::move(name), std::to_string(count)); }
  // Six decimals are enough to distinguish the shares of all map sizes.
  void add(std::string name, std::optional<double> value) {
    add(std::move(name), value ? libmap::to_fixed_text(*value, 6) : std::string());
  }
};

std::string text_of(const libmap::ManifestValue* value) {
  if (value == nullptr) return {};
  return std::visit(
      [](const auto& held) -> std::string {
        using Held = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<Held, std::string>)
          return held;
        else if constexpr (std::is_same_v<Held, bool>)
          return held ? "1" : "0";
        else if constexpr (std::is_same_v<Held, std::vector<double>>)
          return {};
        else
          return libmap::to_text(held);
      },
      *value);
}

std::vector<double> quantiles_of(std::vector<double> values) {
  std::vector<double> result;
  if (values.empty()) return result;
  std::sort(values.begin(), values.end());
  for (const double level : summary_quantiles)
    result.push_back(values[nearest_rank(values.size(), level)]);
  return result;
}

void add_quantiles(const std::string& prefix, const std::vector<double>& values, Row& row) {
  for (std::size_t q = 0; q < summary_quantiles.size(); ++q) {
    const std::string percent = libmap::to_fixed_text(100.0 * summary_quantiles[q], 0);
    std::string name = prefix + (percent.size() < 2 ? "_p0" : "_p");
    name += percent;
    row.add(name, values.empty() ? std::nullopt : std::optional(values[q]));
  }
}

void add_rate(const std::string& name, const Rate& rate, Row& row) {
  const std::optional<Interval> interval = rate.wilson_95();
  row.add(name, rate.value());
  row.add(name + "_low_95", interval ? std::optional(interval->low) : std::nullopt);
  row.add(name + "_high_95", interval ? std::optional(interval->high) : std::nullopt);
}

void add_confusion(const std::string& prefix, const Confusion& counts, Row& row) {
  row.add(prefix + "_positives", counts.positives());
  row.add(prefix + "_negatives", counts.negatives());
  add_rate(prefix + "_sensitivity", counts.true_positive_rate(), row);
  add_rate(prefix + "_specificity", counts.true_negative_rate(), row);
  row.add(prefix + "_youden", youden_index(counts));
}

void add_expected(const ExpectedMapResult& expected, Row& row) {
  add_confusion("voxel", expected.voxels_by_score, row);
  row.add("voxel_auc", expected.auc ? std::optional(expected.auc->trapezoid) : std::nullopt);
  // No rates without the flag of the map.
  add_confusion("flag", expected.voxels_by_flag.value_or(Confusion{}), row);
  add_confusion("place", expected.region_confusion, row);
}

std::optional<double> fraction(std::size_t part, std::size_t whole) {
  return Rate{part, whole}.value();
}

Row row_of(const SummarizedMap& map, bool with_expected) {
  static constexpr std::array<const char*, 7> parameters = {
      "method",        "gripper",    "voxel_size_m", "solid_voxel_threshold", "extra_void_layers",
      "interpolation", "orientation"};
  Row row;
  row.add("map", map.name);
  for (const char* name : parameters) row.add(name, text_of(map.manifest.find_parameter(name)));
  row.add("cutoff", libmap::to_text(map.cutoff));
  const MapSummary& summary = map.summary;
  row.add("voxels", summary.voxels);
  row.add("evaluated", summary.evaluated);
  row.add("reached_share", fraction(summary.reaching_cutoff, summary.evaluated));
  row.add("graspable_share", fraction(summary.graspable, summary.evaluated));
  row.add("few_solid_share", summary.below_solid_threshold
                                 ? fraction(*summary.below_solid_threshold, summary.evaluated)
                                 : std::nullopt);
  add_quantiles("score", summary.scores, row);
  add_quantiles("ssv", summary.solid_voxels, row);
  if (with_expected) add_expected(map.expected.value_or(ExpectedMapResult{}), row);
  return row;
}

std::string yes_no(std::optional<bool> value) {
  if (!value) return {};
  return *value ? "1" : "0";
}

// Surface without slopes and areas, for counts that do not need them.
MapSurface unmeasured(const VoxelMap& map) {
  MapSurface surface;
  surface.slope_deg.assign(map.size(), std::numeric_limits<float>::quiet_NaN());
  surface.area_m2.assign(map.size(), 0.0F);
  return surface;
}

}  // namespace

MapSummary summarize_map(const libmap::PointCloud& map, const VoxelMap& voxels,
                         const MapSummaryOptions& options) {
  MapSummary summary;
  summary.voxels = voxels.size();
  const libmap::ScalarField* ssv = map.find_field("ssv");
  if (ssv != nullptr && options.solid_voxel_threshold) summary.below_solid_threshold = 0;
  std::vector<double> scores;
  std::vector<double> solid_voxels;
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    if (!voxels.evaluated(n, false)) continue;
    ++summary.evaluated;
    const double score = static_cast<double>(voxels.scores[n]);
    summary.reaching_cutoff += reaches_cutoff(score, options.graspability_threshold) ? 1 : 0;
    summary.graspable += voxels.graspable[n] != 0 ? 1 : 0;
    scores.push_back(score);
    if (ssv == nullptr) continue;
    solid_voxels.push_back(ssv->values[voxels.map_points[n]]);
    if (summary.below_solid_threshold && solid_voxels.back() < *options.solid_voxel_threshold)
      ++*summary.below_solid_threshold;
  }
  summary.score_bins = analyze_map(voxels, unmeasured(voxels)).score_bins;
  summary.scores = quantiles_of(std::move(scores));
  summary.solid_voxels = quantiles_of(std::move(solid_voxels));
  return summary;
}

MapSummaryOptions summary_options(const libmap::Manifest& manifest) {
  MapSummaryOptions options;
  options.graspability_threshold =
      libmap::number_of(manifest.find_parameter("graspability_threshold"))
          .value_or(options.graspability_threshold);
  options.solid_voxel_threshold =
      libmap::number_of(manifest.find_parameter("solid_voxel_threshold"));
  return options;
}

libmap::Table summary_table(const std::vector<SummarizedMap>& maps) {
  const bool with_expected = std::any_of(
      maps.begin(), maps.end(), [](const SummarizedMap& map) { return map.expected.has_value(); });
  libmap::Table table;
  for (const SummarizedMap& map : maps) append(row_of(map, with_expected).cells, table);
  return table;
}

libmap::Table region_table(const std::vector<SummarizedMap>& maps, const ExpectedMap& expected) {
  libmap::Table table;
  for (const SummarizedMap& map : maps) {
    if (!map.expected) continue;
    for (std::size_t r = 0; r < expected.regions.size(); ++r) {
      const ExpectedRegion& region = expected.regions[r];
      const RegionResult& result = map.expected->regions[r];
      const std::optional<bool> predicted = result.predicted();
      const bool evaluated = region.graspable && predicted;
      Row row;
      row.add("map", map.name);
      row.add("region", region.name);
      row.add("expected", yes_no(region.graspable));
      row.add("voxels", result.voxels);
      row.add("reached_share", fraction(result.reaching_cutoff, result.voxels));
      row.add("graspable_share", fraction(result.graspable, result.voxels));
      row.add("mean_score", result.mean_score);
      row.add("median_score", result.median_score);
      row.add("predicted", yes_no(predicted));
      row.add("agrees",
              yes_no(evaluated ? std::optional(*predicted == *region.graspable) : std::nullopt));
      row.add("why", region.reason);
      append(row.cells, table);
    }
  }
  return table;
}

libmap::Table histogram_table(const std::vector<SummarizedMap>& maps) {
  libmap::Table table;
  for (const SummarizedMap& map : maps) {
    for (const ScoreBin& bin : map.summary.score_bins) {
      Row row;
      row.add("map", map.name);
      row.add("score", std::optional((bin.low + bin.high) / 2.0));
      row.add("voxels", bin.evaluated);
      row.add("share", fraction(bin.evaluated, map.summary.evaluated));
      append(row.cells, table);
    }
  }
  return table;
}

MapPair compare_pair(const VoxelMap& first, const VoxelMap& second,
                     const libmap::Pose& first_terrain_from_second_terrain) {
  const MapChange change =
      compare_maps(first, unmeasured(first), second, first_terrain_from_second_terrain);
  MapPair pair;
  pair.matching = change.matching;
  pair.common = change.pairs.size();
  pair.evaluated = change.evaluated;
  return pair;
}

libmap::Table pair_table(const std::vector<SummarizedMap>& maps,
                         const std::vector<MapPair>& pairs) {
  libmap::Table table;
  for (const MapPair& pair : pairs) {
    const Confusion& counts = pair.evaluated.graspable;
    const std::optional<Kappa>& kappa = pair.evaluated.kappa;
    const ScoreDifference& difference = pair.evaluated.difference;
    const auto where = [](bool there, double value) {
      return there ? std::optional(value) : std::nullopt;
    };
    Row row;
    row.add("first", maps[pair.first].name);
    row.add("second", maps[pair.second].name);
    row.add("matching", std::string(to_text(pair.matching)));
    row.add("common_voxels", pair.common);
    row.add("evaluated_voxels", counts.size());
    row.add("both", counts.true_positives);
    row.add("first_alone", counts.false_positives);
    row.add("second_alone", counts.false_negatives);
    row.add("neither", counts.true_negatives);
    row.add("accuracy", counts.accuracy().value());
    row.add("kappa", where(kappa.has_value(), kappa ? kappa->value : 0.0));
    row.add("kappa_low_95", where(kappa.has_value(), kappa ? kappa->normal_95.low : 0.0));
    row.add("kappa_high_95", where(kappa.has_value(), kappa ? kappa->normal_95.high : 0.0));
    row.add("score_difference_mean", where(difference.count > 0, difference.mean));
    row.add("score_difference_rms", where(difference.count > 0, difference.rms));
    row.add("score_correlation", difference.correlation);
    append(row.cells, table);
  }
  return table;
}

}  // namespace libgtd
