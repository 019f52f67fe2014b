#include "tools/support/analysis_outputs.h"

#include "libgtd/evaluate/map_summary.h"
#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "libmap/view/charts.h"
#include "libmap/view/image_io.h"
#include "tools/support/command_line.h"
#include "tools/support/option_values.h"

namespace graspmap_tools {

void bind(libmap::ParameterTable& table, MapTableOptions& options) {
  table.add("cutoff", options.cutoff,
            "for several maps: minimum score of a graspable voxel; auto: threshold with which each "
            "map was scored");
  table.add("names", options.names,
            "for several maps: names of the maps, separated by |; default: names of the files");
  table.add("pairs", options.pairs, "for several maps of one cloud: compare all pairs of maps");
  table.add("varied", options.varied,
            "for several maps: column of maps.csv with the varied parameter; charts show the "
            "graspable share and, with --expected, Youden's index against this parameter");
  table.add(
      "series", options.series,
      "for several maps: columns of maps.csv, separated by commas; the charts of --varied have one "
      "curve per combination of their values");
}

namespace {

double cutoff_of(const MapTableOptions& options, const libgtd::MapSummaryOptions& own) {
  return parse_number_or("auto", options.cutoff, "not a score", "--cutoff", "auto or a number")
      .value_or(own.graspability_threshold);
}

struct ReadMap {
  libgtd::SummarizedMap summarized;
  libgtd::VoxelMap voxels;  // empty unless pairs are compared
};

ReadMap summarize_one(const std::string& file, const MapTableOptions& options,
                      const libgtd::ExpectedMap* expected, Run& run) {
  ReadMap read;
  libgtd::SummarizedMap& map = read.summarized;
  map.name = file;
  map.manifest = libmap::read_manifest_of(file).value_or(libmap::Manifest{});
  const libmap::PointCloud cloud = libmap::read_cloud(file).cloud;
  libgtd::MapSummaryOptions own = libgtd::summary_options(map.manifest);
  own.graspability_threshold = map.cutoff = cutoff_of(options, own);
  read.voxels = libgtd::voxel_map_of(cloud, libgtd::map_info(map.manifest));
  if (map.manifest.find_parameter("zero_plane_m") == nullptr)
    run.warn(file + ": has no manifest with a zero plane; all points are assumed to be above it");
  map.summary = libgtd::summarize_map(cloud, read.voxels, own);
  if (expected != nullptr)
    map.expected = libgtd::evaluate_expected_map(
        cloud, libgtd::transformed(*expected, map_from_points(file, options.points_frame, run)),
        map.cutoff);
  if (!options.pairs) read.voxels = {};
  return read;
}

libmap::Pose terrain_from_input(const libgtd::SummarizedMap& map) {
  const libmap::Pose* pose = map.manifest.find_transform("terrain_from_input");
  return pose == nullptr ? libmap::Pose::Identity() : *pose;
}

std::vector<libgtd::MapPair> compare_all(const std::vector<libgtd::SummarizedMap>& maps,
                                         const std::vector<libgtd::VoxelMap>& voxels) {
  std::vector<libgtd::MapPair> pairs;
  for (std::size_t first = 0; first < maps.size(); ++first) {
    for (std::size_t second = first + 1; second < maps.size(); ++second) {
      pairs.push_back(in_file(maps[first].name + " and " + maps[second].name, [&] {
        return libgtd::compare_pair(
            voxels[first], voxels[second],
            terrain_from_input(maps[first]) * terrain_from_input(maps[second]).inverse());
      }));
      pairs.back().first = first;
      pairs.back().second = second;
    }
  }
  return pairs;
}

std::string percent(std::optional<double> value) {
  return value ? fmt::format("{:.1f} %", 100.0 * *value) : "unknown";
}

void info(const libgtd::SummarizedMap& map, Run& run) {
  const libgtd::MapSummary& summary = map.summary;
  std::string text =
      fmt::format("{}: {} of the voxels reach {}", map.name,
                  percent(libgtd::Rate{summary.reaching_cutoff, summary.evaluated}.value()),
                  libmap::to_text(map.cutoff));
  if (map.expected) {
    const libgtd::Confusion& counts = map.expected->voxels_by_score;
    text += fmt::format("; sensitivity {}, specificity {}",
                        percent(counts.true_positive_rate().value()),
                        percent(counts.true_negative_rate().value()));
  }
  run.info(text);
}

// Chart of column y against column x; rows without one of these numbers are ignored. Curves are in
// the order in which their names first appear, their points by ascending x.
libmap::Chart chart_of(const libmap::Table& table, const std::string& x, const std::string& y,
                       const std::string& series) {
  libmap::Chart chart;
  chart.x_axis.title = x;
  chart.y_axis.title = y;
  std::vector<std::size_t> columns;
  for (const std::string& name : libmap::split_list(series)) columns.push_back(table.column(name));
  std::vector<std::vector<std::pair<double, double>>> points;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto at = table.optional_number(row, table.column(x));
    const auto value = table.optional_number(row, table.column(y));
    if (!at || !value || !std::isfinite(*at) || !std::isfinite(*value)) continue;
    std::string name;
    for (const std::size_t column : columns)
      name += (name.empty() ? "" : ", ") + table.rows[row][column];
    std::size_t n = 0;
    while (n < chart.curves.size() && chart.curves[n].name != name) ++n;
    if (n == chart.curves.size()) {
      chart.curves.emplace_back().name = name;
      points.emplace_back();
    }
    points[n].emplace_back(*at, *value);
  }
  for (std::size_t n = 0; n < points.size(); ++n) {
    std::stable_sort(points[n].begin(), points[n].end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    libmap::ChartCurve& curve = chart.curves[n];
    curve.markers = true;
    for (const auto& [at, value] : points[n]) {
      curve.x.push_back(at);
      curve.y.push_back(value);
    }
  }
  return chart;
}

void add_chart(Run::Files& files, const std::string& name, const libmap::Chart& chart) {
  if (chart.curves.empty()) return;
  files.emplace_back(name + ".svg", Run::text_writer(libmap::chart_svg(chart)));
  files.emplace_back(name + ".png", Run::text_writer(libmap::to_png(libmap::draw_chart(chart))));
}

void add_charts(Run::Files& files, const libmap::Table& maps, const libmap::Table& histograms,
                const MapTableOptions& options) {
  libmap::Chart scores = chart_of(histograms, "score", "share", "map");
  scores.y_axis.title = "share of the evaluated voxels";
  scores.x_axis.range = {0.0, 1.0};
  add_chart(files, "histograms", scores);
  if (options.varied.empty()) return;
  add_chart(files, "graspable_share",
            chart_of(maps, options.varied, "graspable_share", options.series));
  if (options.expected.empty()) return;
  for (const char* column : {"voxel_youden", "place_youden"}) {
    libmap::Chart chart = chart_of(maps, options.varied, column, options.series);
    chart.y_axis.range = {0.0, 1.0};
    add_chart(files, column, chart);
  }
}

}  // namespace

void tabulate_maps(const std::vector<std::string>& map_files, const std::string& folder,
                   const MapTableOptions& options, Run& run) {
  run.claim_output_folder(folder);
  std::optional<libgtd::ExpectedMap> expected;
  if (!options.expected.empty()) {
    expected = libgtd::parse_expected_map(libmap::read_csv(options.expected));
    run.add_input(options.expected);
  }
  const std::vector<std::string> names =
      split_texts(options.names, map_files.size(), "more names than maps", "--names");
  std::vector<libgtd::SummarizedMap> maps;
  std::vector<libgtd::VoxelMap> voxels;
  for (const std::string& file : map_files) {
    ReadMap read = in_file(
        file, [&] { return summarize_one(file, options, expected ? &*expected : nullptr, run); });
    if (maps.size() < names.size() && !names[maps.size()].empty())
      read.summarized.name = names[maps.size()];
    maps.push_back(std::move(read.summarized));
    voxels.push_back(std::move(read.voxels));
    run.add_input(file);
    info(maps.back(), run);
  }
  const auto table = [](const libmap::Table& content) {
    return Run::text_writer(libmap::to_csv(content));
  };
  const libmap::Table rows = libgtd::summary_table(maps);
  const libmap::Table histograms = libgtd::histogram_table(maps);
  Run::Files files = {{"maps.csv", table(rows)}, {"histograms.csv", table(histograms)}};
  if (options.pairs)
    files.emplace_back("pairs.csv", table(libgtd::pair_table(maps, run.timed("pairs", [&] {
                         return compare_all(maps, voxels);
                       }))));
  if (expected) files.emplace_back("regions.csv", table(libgtd::region_table(maps, *expected)));
  if (options.images) {
    try {
      add_charts(files, rows, histograms, options);
    } catch (const libmap::Error& error) {
      throw libmap::Error(error.reason(), {.file = "maps.csv", .field = error.context().field});
    }
  }
  run.write_output_folder(folder, files);
}

}  // namespace graspmap_tools
