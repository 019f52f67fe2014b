#include "tools/support/analysis_outputs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/core/score_color.h"
#include "libmap/view/scene_view.h"

namespace graspmap_tools {

namespace {

using libgtd::ChangeClass;
using libmap::Color;

constexpr Color line_color{90, 90, 90};
constexpr Color bar_color{34, 139, 34};
constexpr Color start_color{0, 70, 160};
constexpr Color reachable_color{34, 139, 34};
constexpr Color unreachable_color{230, 120, 0};
constexpr Color obstacle_color{110, 60, 30};
constexpr Color gained_color{0, 114, 178};
constexpr Color lost_color{213, 94, 0};
constexpr Color only_one_color{190, 175, 205};
constexpr std::size_t max_labels = 8;

double percent(double part, double whole) { return whole > 0.0 ? 100.0 * part / whole : 0.0; }

Color ground_color(float slope_deg) {
  const double slope = std::isnan(slope_deg) ? 0.0 : static_cast<double>(slope_deg);
  const auto gray = static_cast<std::uint8_t>(std::lround(228.0 - 110.0 * slope / 90.0));
  return {gray, gray, gray};
}

// Voxel centers in the terrain frame, colored as ground, obstacle or below the zero plane.
libmap::PointCloud cloud_of(const libgtd::VoxelMap& map, const libgtd::MapSurface& surface) {
  libmap::PointCloud cloud;
  cloud.positions.reserve(map.size());
  cloud.colors.reserve(map.size());
  for (std::size_t n = 0; n < map.size(); ++n) {
    cloud.positions.push_back(map.center_in_terrain(n));
    cloud.colors.push_back(!map.above_zero_plane(n) ? libmap::below_plane_color
                           : map.obstacle[n] != 0   ? obstacle_color
                                                    : ground_color(surface.slope_deg[n]));
  }
  return cloud;
}

// Coloring by the cloud's colors. The legend shows the `known` colors that the cloud contains, and
// the grays of other ground, which is named `rest`.
libmap::Coloring own_colors(const libmap::PointCloud& cloud, const std::string& title,
                            const std::vector<libmap::LegendEntry>& known,
                            const std::string& rest) {
  libmap::Coloring coloring;
  coloring.mode = libmap::ColorMode::own;
  coloring.own_legend.title = title;
  std::vector<libmap::LegendEntry>& entries = coloring.own_legend.entries;
  for (const libmap::LegendEntry& entry : known)
    if (std::find(cloud.colors.begin(), cloud.colors.end(), entry.color) != cloud.colors.end())
      entries.push_back(entry);
  entries.push_back({ground_color(0.0F), rest + ", level"});
  entries.push_back({ground_color(90.0F), rest + ", upright"});
  return coloring;
}

libmap::ColorImage draw(libmap::PointCloud cloud, libmap::Coloring coloring,
                        const std::string& title, std::vector<libmap::Marker> markers = {}) {
  libmap::Scene scene;
  libmap::SceneLayer& layer = scene.layers.emplace_back();
  layer.shape = std::move(cloud);
  layer.coloring = std::move(coloring);
  scene.markers = std::move(markers);
  libmap::SceneViewOptions view;
  view.title = title;
  return libmap::render_scene(std::move(scene), view);
}

Color change_color(ChangeClass change, const Color& ground) {
  switch (change) {
    case ChangeClass::both:
      return reachable_color;
    case ChangeClass::gained:
      return gained_color;
    case ChangeClass::lost:
      return lost_color;
    case ChangeClass::only_map:
    case ChangeClass::only_other:
      return only_one_color;
    case ChangeClass::neither:
      break;
  }
  return ground;
}

}  // namespace

libmap::Chart histogram_chart(const libgtd::MapAnalysis& analysis, const std::string& title) {
  libmap::Chart chart;
  chart.title = title;
  chart.x_axis = {.title = "score", .range = {}};
  chart.y_axis = {.title = "share of evaluated voxels [%]", .range = {}};
  chart.legend = libmap::LegendCorner::top_left;
  const std::vector<libgtd::ScoreBin>& bins = analysis.score_bins;
  const double evaluated = static_cast<double>(analysis.ground.voxels);
  const double all = static_cast<double>(analysis.voxels - analysis.without_score);
  libmap::ChartCurve line;
  line.name = "all voxels";
  line.color = line_color;
  line.dashed = true;
  for (std::size_t b = 0; b < bins.size(); ++b) {
    const Color color = libmap::score_color((bins[b].low + bins[b].high) / 2.0);
    if (chart.histograms.empty() || chart.histograms.back().color != color) {
      libmap::ChartHistogram& next = chart.histograms.emplace_back();
      next.first_edge = bins[b].low;
      next.bin_width = bins[b].high - bins[b].low;
      next.color = color;
      for (const libmap::ScoreClass& one : libmap::score_classes)
        if (one.color == color) next.name = one.text;
    }
    chart.histograms.back().heights.push_back(
        percent(static_cast<double>(bins[b].evaluated), evaluated));
    for (const double edge : {bins[b].low, bins[b].high}) {
      line.x.push_back(edge);
      line.y.push_back(percent(static_cast<double>(bins[b].all), all));
    }
  }
  chart.curves.push_back(std::move(line));
  return chart;
}

libmap::Chart ground_chart(const std::vector<libgtd::GroundBin>& bins,
                           const std::string& axis_title, const std::string& title) {
  libmap::Chart chart;
  chart.title = title;
  chart.x_axis = {.title = axis_title, .range = {}};
  chart.y_axis = {.title = "share of surface area [%]", .range = {}};
  double whole_m2 = 0.0;
  for (const libgtd::GroundBin& bin : bins) whole_m2 += bin.area_m2;
  libmap::ChartHistogram bars;
  bars.name = "graspable, of the bin's ground";
  bars.color = bar_color;
  libmap::ChartCurve line;
  line.name = "in the bin, of all ground";
  line.color = line_color;
  for (const libgtd::GroundBin& bin : bins) {
    bars.heights.push_back(percent(bin.graspable_area_m2, bin.area_m2));
    for (const double edge : {bin.low, bin.high}) {
      line.x.push_back(edge);
      line.y.push_back(percent(bin.area_m2, whole_m2));
    }
  }
  double highest = 0.0;
  for (const std::vector<double>* values : {&bars.heights, &line.y})
    for (const double value : *values) highest = std::max(highest, value);
  if (highest > 0.0) chart.y_axis.range = std::pair(0.0, 1.25 * highest);
  if (!bins.empty()) {
    bars.first_edge = bins.front().low;
    bars.bin_width = bins.front().high - bins.front().low;
    chart.histograms.push_back(std::move(bars));
    chart.curves.push_back(std::move(line));
  }
  return chart;
}

libmap::ColorImage draw_regions(const MapImage& image, const libgtd::MapRegionResult& regions,
                                const libgtd::RegionReach& reach) {
  libmap::PointCloud cloud = cloud_of(image.map, image.surface);
  std::vector<libmap::Marker> markers;
  for (std::size_t r = 0; r < regions.regions.size(); ++r) {
    const bool reachable = reach.access[r].reachable;
    const Color color = reach.start_region == r && reachable ? start_color
                        : reachable                          ? reachable_color
                                                             : unreachable_color;
    for (const std::uint32_t voxel : regions.regions[r].voxels) cloud.colors[voxel] = color;
    if (r < max_labels)
      markers.push_back({.position = image.map.center_in_terrain(regions.regions[r].best_voxel),
                         .label = std::to_string(r + 1)});
  }
  libmap::Coloring coloring = own_colors(cloud, "graspable regions",
                                         {{start_color, "start"},
                                          {reachable_color, "reachable"},
                                          {unreachable_color, "not reachable"},
                                          {obstacle_color, "obstacle"},
                                          {libmap::below_plane_color, "below zero plane"}},
                                         "other ground");
  return draw(std::move(cloud), std::move(coloring), image.title, std::move(markers));
}

libmap::ColorImage draw_change(const MapImage& image, const libgtd::MapChange& change,
                               const libgtd::VoxelMap& other,
                               const libmap::Pose& map_terrain_from_other_terrain) {
  libmap::PointCloud cloud = cloud_of(image.map, image.surface);
  const auto paint = [&](std::size_t n, ChangeClass one) {
    cloud.colors[n] = change_color(one, cloud.colors[n]);
  };
  for (const libgtd::VoxelPair& pair : change.pairs)
    paint(pair.map, libgtd::class_of(image.map, other, pair));
  // Between different lattices, many voxels have no partner by chance.
  if (change.matching == libgtd::VoxelMatching::lattice) {
    for (const std::uint32_t n : change.only_map) paint(n, ChangeClass::only_map);
    for (const std::uint32_t n : change.only_other) {
      cloud.positions.push_back(map_terrain_from_other_terrain * other.center_in_terrain(n));
      cloud.colors.push_back(only_one_color);
    }
  }
  libmap::Coloring coloring = own_colors(cloud, "graspable",
                                         {{reachable_color, "in both maps"},
                                          {gained_color, "in OTHER only"},
                                          {lost_color, "in MAP only"},
                                          {only_one_color, "ground of one map"},
                                          {libmap::below_plane_color, "below zero plane"}},
                                         "neither");
  return draw(std::move(cloud), std::move(coloring), image.title);
}

libmap::ColorImage draw_score_change(const MapImage& image, const libgtd::MapChange& change,
                                     const libgtd::VoxelMap& other) {
  constexpr const char* name = "score, OTHER - MAP";
  libmap::PointCloud cloud;
  libmap::ScalarField field{name, libmap::ScalarType::float32, {}};
  for (const libgtd::VoxelPair& pair : change.pairs) {
    cloud.positions.push_back(image.map.center_in_terrain(pair.map));
    field.values.push_back(static_cast<double>(other.scores[pair.other]) -
                           static_cast<double>(image.map.scores[pair.map]));
  }
  cloud.fields.push_back(std::move(field));
  libmap::Coloring coloring;
  coloring.mode = libmap::ColorMode::field;
  coloring.field = name;
  coloring.scale = libmap::ColorScale::diverging;
  coloring.range_min = -0.5;
  coloring.range_max = 0.5;
  return draw(std::move(cloud), std::move(coloring), image.title);
}

}  // namespace graspmap_tools
