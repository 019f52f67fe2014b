#include "libgtd/evaluate/analysis_tables.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libgtd/evaluate/named_cells.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

using libgtd::json_of;
using libmap::Table;

std::string text(std::size_t value) { return std::to_string(value); }

// Areas are sums of single-precision numbers; more digits are not significant.
std::string text(double value) {
  return std::isfinite(value) ? libmap::to_text(static_cast<float>(value)) : std::string();
}

std::string text(std::optional<double> value) { return value ? text(*value) : std::string(); }

void add_position(const Eigen::Vector3d& position, std::vector<std::string>& row) {
  // Rounds to micrometers. Single precision would round UTM coordinates to decimeters.
  constexpr double steps_per_m = 1e6;
  for (const double coordinate : position)
    row.push_back(std::isfinite(coordinate)
                      ? libmap::to_text(std::round(coordinate * steps_per_m) / steps_per_m)
                      : std::string());
}

Json json_of(const ScoreDifference& difference) {
  Json json;
  json["voxels"] = difference.count;
  if (difference.count == 0) return json;
  json["mean"] = difference.mean;
  json["mean_absolute"] = difference.mean_absolute;
  json["rms"] = difference.rms;
  json["percentile_5"] = difference.low_5;
  json["median"] = difference.median;
  json["percentile_95"] = difference.high_95;
  json["min"] = difference.min;
  json["max"] = difference.max;
  json["correlation"] = json_of(difference.correlation);
  return json;
}

Json json_of(const ChangeSummary& summary) {
  const Confusion& counts = summary.graspable;
  Json json;
  json["voxels"] = counts.size();
  json["graspable"] = {{"both", counts.true_positives},
                       {"lost", summary.lost()},
                       {"gained", summary.gained()},
                       {"neither", counts.true_negatives}};
  json["area_m2"] = {{"both", summary.both_area_m2},
                     {"lost", summary.lost_area_m2},
                     {"gained", summary.gained_area_m2}};
  json["accuracy"] = json_of(counts.accuracy());
  json["sensitivity"] = json_of(counts.true_positive_rate());
  json["specificity"] = json_of(counts.true_negative_rate());
  json["positive_predictive_value"] = json_of(counts.positive_predictive_value());
  if (const std::optional<Kappa>& kappa = summary.kappa)
    json["kappa"] = {{"value", kappa->value},
                     {"standard_error", kappa->standard_error},
                     {"normal_95", {kappa->normal_95.low, kappa->normal_95.high}}};
  else
    json["kappa"] = nullptr;
  json["score_difference"] = json_of(summary.difference);
  return json;
}

Json json_of(const MapAnalysis& analysis) {
  const GroundBin& ground = analysis.ground;
  Json json;
  json["voxels"] = {{"all", analysis.voxels},
                    {"without_score", analysis.without_score},
                    {"below_zero_plane", analysis.below_zero_plane},
                    {"at_border", analysis.at_border},
                    {"obstacles", analysis.obstacles},
                    {"graspable", analysis.graspable},
                    {"evaluated", ground.voxels},
                    {"evaluated_graspable", ground.graspable_voxels}};
  json["evaluated"] = {{"surface_area_m2", ground.area_m2},
                       {"graspable_surface_area_m2", ground.graspable_area_m2},
                       {"graspable_share", json_of(ground.graspable_fraction())},
                       {"plan_area_m2", analysis.plan_area_m2},
                       {"graspable_plan_area_m2", analysis.graspable_plan_area_m2},
                       {"columns", analysis.columns},
                       {"graspable_columns", analysis.graspable_columns},
                       {"mean_score", json_of(ground.mean_score())},
                       {"min_height_m", ground.low},
                       {"max_height_m", ground.high},
                       {"column_coverage", analysis.column_coverage}};
  Json score_classes = Json::array();
  for (std::size_t n = 0; n < analysis.score_classes.size(); ++n) {
    const ScoreBin& bin = analysis.score_classes[n];
    Json entry;
    entry["score_from"] = std::isfinite(bin.low) ? Json(bin.low) : Json(nullptr);
    entry["all"] = bin.all;
    entry["evaluated"] = bin.evaluated;
    entry["area_m2"] = bin.area_m2;
    score_classes.push_back(std::move(entry));
  }
  json["classes"] = std::move(score_classes);
  return json;
}

Json json_of(const MapRegionResult& regions, const RegionReachOptions& options,
             const RegionReach& reach) {
  Json json;
  json["count"] = regions.regions.size();
  json["voxels"] = regions.voxels;
  json["skipped_small_regions"] = {{"regions", regions.skipped_regions},
                                   {"voxels", regions.skipped_voxels}};
  if (!regions.regions.empty()) {
    const MapRegion& largest = regions.regions.front();
    json["largest"] = {{"voxels", largest.voxels.size()},
                       {"area_m2", largest.area_m2},
                       {"best_score", largest.best_score}};
  }
  json["stride_m"] = options.stride_m;
  json["links"] = reach.links.size();
  json["groups"] = reach.groups;
  json["start_region"] = reach.start_region ? Json(*reach.start_region + 1) : Json(nullptr);
  json["start_distance_m"] = reach.start_distance_m;
  json["reachable_regions"] = reach.reachable_regions;
  json["reachable_area_m2"] = reach.reachable_area_m2;
  json["joining_stride_m"] = json_of(reach.joining_stride_m);
  return json;
}

void add_change_row(const char* of, const ChangeSummary& summary, bool bounds, Table& table) {
  const Confusion& counts = summary.graspable;
  const ScoreDifference& difference = summary.difference;
  const bool scored = difference.count > 0;
  const auto value = [&](double number) { return scored ? text(number) : std::string(); };
  const std::optional<Kappa>& kappa = summary.kappa;
  append({{"of", of},
          {"from", bounds ? text(summary.low) : ""},
          {"to", bounds ? text(summary.high) : ""},
          {"voxels", text(counts.size())},
          {"both", text(counts.true_positives)},
          {"lost", text(summary.lost())},
          {"gained", text(summary.gained())},
          {"neither", text(counts.true_negatives)},
          {"accuracy", text(counts.accuracy().value())},
          {"sensitivity", text(counts.true_positive_rate().value())},
          {"specificity", text(counts.true_negative_rate().value())},
          {"positive_predictive_value", text(counts.positive_predictive_value().value())},
          {"kappa", kappa ? text(kappa->value) : ""},
          {"kappa_error", kappa ? text(kappa->standard_error) : ""},
          {"both_area_m2", text(summary.both_area_m2)},
          {"lost_area_m2", text(summary.lost_area_m2)},
          {"gained_area_m2", text(summary.gained_area_m2)},
          {"difference_mean", value(difference.mean)},
          {"difference_mean_absolute", value(difference.mean_absolute)},
          {"difference_rms", value(difference.rms)},
          {"difference_p05", value(difference.low_5)},
          {"difference_median", value(difference.median)},
          {"difference_p95", value(difference.high_95)},
          {"correlation", text(difference.correlation)}},
         table);
}

}  // namespace

Table histogram_table(const MapAnalysis& analysis) {
  Table table;
  table.columns = {"bins",      "score_from", "score_to", "all", "above_zero_plane",
                   "evaluated", "graspable",  "area_m2"};
  const auto add = [&](const char* bins, const ScoreBin& bin) {
    table.rows.push_back({bins, text(bin.low), text(bin.high), text(bin.all),
                          text(bin.above_zero_plane), text(bin.evaluated), text(bin.graspable),
                          text(bin.area_m2)});
  };
  for (const ScoreBin& bin : analysis.score_classes) add("class", bin);
  for (const ScoreBin& bin : analysis.score_bins) add("width", bin);
  return table;
}

Table ground_table(const std::vector<GroundBin>& bins, const std::string& unit) {
  Table table;
  table.columns = {"from_" + unit,     "to_" + unit,        "voxels",          "area_m2",
                   "graspable_voxels", "graspable_area_m2", "graspable_share", "mean_score"};
  for (const GroundBin& bin : bins)
    table.rows.push_back({text(bin.low), text(bin.high), text(bin.voxels), text(bin.area_m2),
                          text(bin.graspable_voxels), text(bin.graspable_area_m2),
                          text(bin.graspable_fraction()), text(bin.mean_score())});
  return table;
}

Table regions_table(const VoxelMap& map, const MapRegionResult& regions, const RegionReach& reach) {
  const libmap::Pose map_from_terrain = map.terrain_from_map.inverse();
  Table table;
  table.columns = {
      "region",   "voxels",     "area_m2",      "plan_area_m2",   "x",        "y",
      "z",        "height_m",   "min_height_m", "max_height_m",   "size_x_m", "size_y_m",
      "size_z_m", "mean_score", "best_score",   "best_x",         "best_y",   "best_z",
      "group",    "reachable",  "steps",        "stride_needed_m"};
  for (std::size_t r = 0; r < regions.regions.size(); ++r) {
    const MapRegion& region = regions.regions[r];
    const RegionAccess& access = reach.access[r];
    // The box of the voxels, not only of their centers.
    const Eigen::Vector3d size = (region.max - region.min).array() + map.lattice.voxel_size_m;
    std::vector<std::string> row = {text(r + 1), text(region.voxels.size()), text(region.area_m2),
                                    text(region.plan_area_m2)};
    add_position(map_from_terrain * region.centroid, row);
    row.insert(row.end(), {text(region.centroid.z()), text(region.min.z()), text(region.max.z())});
    add_position(size, row);
    row.insert(row.end(), {text(region.mean_score), text(region.best_score)});
    add_position(map_from_terrain * map.center_in_terrain(region.best_voxel), row);
    row.insert(row.end(),
               {text(std::size_t{access.group} + 1), access.reachable ? "1" : "0",
                access.steps ? text(*access.steps) : std::string(), text(access.stride_needed_m)});
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table region_links_table(const VoxelMap& map, const RegionReach& reach) {
  const libmap::Pose map_from_terrain = map.terrain_from_map.inverse();
  struct Row {
    RegionLink link;
    bool within_stride = false;
    bool in_tree = false;
  };
  const auto ends = [](const Row& row) { return std::pair(row.link.a, row.link.b); };
  std::vector<Row> rows;
  for (const RegionLink& link : reach.links) rows.push_back({link, true, false});
  for (const RegionLink& link : reach.tree) rows.push_back({link, false, true});
  std::stable_sort(rows.begin(), rows.end(),
                   [&](const Row& a, const Row& b) { return ends(a) < ends(b); });
  Table table;
  table.columns = {"a",   "b",   "distance_m", "within_stride", "in_tree", "a_x",
                   "a_y", "a_z", "b_x",        "b_y",           "b_z"};
  for (std::size_t n = 0; n < rows.size(); ++n) {
    Row row = rows[n];
    if (n + 1 < rows.size() && ends(rows[n + 1]) == ends(row)) {
      row.in_tree = true;
      ++n;
    }
    const RegionLink& link = row.link;
    std::vector<std::string> cells = {text(std::size_t{link.a} + 1), text(std::size_t{link.b} + 1),
                                      text(link.distance_m), row.within_stride ? "1" : "0",
                                      row.in_tree ? "1" : "0"};
    add_position(map_from_terrain * map.center_in_terrain(link.voxel_a), cells);
    add_position(map_from_terrain * map.center_in_terrain(link.voxel_b), cells);
    table.rows.push_back(std::move(cells));
  }
  return table;
}

Table change_table(const MapChange& change) {
  Table table;
  add_change_row("common", change.common, false, table);
  add_change_row("evaluated", change.evaluated, false, table);
  for (const ChangeSummary& bin : change.by_height) add_change_row("height_m", bin, true, table);
  for (const ChangeSummary& bin : change.by_slope) add_change_row("slope_deg", bin, true, table);
  return table;
}

std::string analysis_json(const MapAnalysis& analysis, const MapSurface& surface,
                          const MapRegionResult& regions, const RegionReachOptions& reach_options,
                          const RegionReach& reach, const MapChange* change) {
  Json json = json_of(analysis);
  json["surface_radius_m"] = surface.radius_m;
  json["regions"] = json_of(regions, reach_options, reach);
  if (change != nullptr) {
    Json part;
    part["matching"] = std::string(to_text(change->matching));
    part["only_in_map"] = {{"voxels", change->only_map.size()},
                           {"graspable", change->only_map_graspable}};
    part["only_in_other"] = {{"voxels", change->only_other.size()},
                             {"graspable", change->only_other_graspable}};
    part["common"] = json_of(change->common);
    part["evaluated"] = json_of(change->evaluated);
    json["change"] = std::move(part);
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

libmap::PointCloud regions_cloud(const libmap::PointCloud& cloud, const VoxelMap& map,
                                 const MapSurface& surface, const MapRegionResult& regions,
                                 const RegionReach& reach) {
  libmap::PointCloud result;
  result.positions = cloud.positions;
  result.colors = cloud.colors;
  result.viewpoint = cloud.viewpoint;
  for (const char* name : {"score", "graspable"}) result.fields.push_back(*cloud.find_field(name));
  std::vector<double> region(cloud.size(), 0.0);
  std::vector<double> reachable(cloud.size(), 0.0);
  std::vector<double> slope(cloud.size(), std::nan(""));
  std::vector<double> area(cloud.size(), 0.0);
  for (std::size_t n = 0; n < map.size(); ++n) {
    const std::uint32_t point = map.map_points[n];
    slope[point] = static_cast<double>(surface.slope_deg[n]);
    area[point] = static_cast<double>(surface.area_m2[n]);
    const std::int32_t here = regions.region_of_voxel[n];
    if (here < 0) continue;
    region[point] = here + 1.0;
    reachable[point] = reach.access[static_cast<std::size_t>(here)].reachable ? 1.0 : 0.0;
  }
  const auto add = [&](const char* name, libmap::ScalarType type, std::vector<double>& values) {
    result.fields.push_back({name, type, std::move(values)});
  };
  add("region", libmap::ScalarType::uint32, region);
  add("reachable", libmap::ScalarType::uint8, reachable);
  add("slope_deg", libmap::ScalarType::float32, slope);
  add("area_m2", libmap::ScalarType::float32, area);
  return result;
}

}  // namespace libgtd
