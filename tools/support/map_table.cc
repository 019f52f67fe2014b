// graspmap summarize: several maps in one table, a row each, and how they do where their
// graspability is expected.
#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/evaluate/map_summary.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "tools/command_line.h"
#include "tools/map_frame.h"
#include "tools/text_list.h"

namespace {

using graspmap_tools::Run;

struct SummarizeOptions {
  std::vector<std::string> maps;
  std::string folder;
  std::string expected;
  graspmap_tools::PointFrame points_frame = graspmap_tools::PointFrame::input;
  std::string cutoff = "auto";
  std::string names;  // with '|' between
  bool pairs = false;
};

void bind(libmap::ParameterTable& table, SummarizeOptions& options) {
  table.add("cutoff", options.cutoff,
            "score from which a voxel counts as graspable; auto: each map's own threshold");
  table.add(
      "names", options.names,
      "of the maps in the tables, in their order, with | between; the others' are their files");
  table.add("pairs", options.pairs, "compare each map with each: they are of one cloud");
  table.add("points_frame", options.points_frame, graspmap_tools::point_frame_names(),
            "frame of the expected regions: of the cloud that was scored, the terrain's, or the "
            "map's before it was cropped");
}

double cutoff_of(const SummarizeOptions& options, const libgtd::MapSummaryOptions& own) {
  if (options.cutoff == "auto") return own.graspability_threshold;
  const auto value = libmap::parse_double(options.cutoff);
  if (value && std::isfinite(*value)) return *value;
  throw libmap::Error("not a score",
                      {.field = "--cutoff", .value = options.cutoff, .bound = "auto or a number"});
}

struct ReadMap {
  libgtd::SummarizedMap summarized;
  libgtd::VoxelMap voxels;  // empty unless pairs are compared
};

ReadMap summarize_one(const std::string& file, const SummarizeOptions& options,
                      const libgtd::ExpectedMap* expected, Run& run) {
  ReadMap read;
  libgtd::SummarizedMap& map = read.summarized;
  map.name = file;
  map.manifest = libmap::read_manifest_of(file).value_or(libmap::Manifest{});
  const libmap::PointCloud cloud = libmap::read_cloud(file).cloud;
  libgtd::MapSummaryOptions own = libgtd::summary_options(map.manifest);
  own.graspability_threshold = map.cutoff = cutoff_of(options, own);
  read.voxels = libgtd::voxel_map_of(cloud, libgtd::facts_of(map.manifest));
  if (map.manifest.find_parameter("zero_plane_m") == nullptr)
    run.warn(file + ": no manifest tells its zero plane: all its points are taken to lie above");
  map.summary = libgtd::summarize_map(cloud, read.voxels, own);
  if (expected != nullptr)
    map.expected = libgtd::evaluate_expected_map(
        cloud,
        libgtd::transformed(*expected,
                            graspmap_tools::map_from_points(file, options.points_frame, run)),
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
      try {
        pairs.push_back(libgtd::compare_pair(
            voxels[first], voxels[second],
            terrain_from_input(maps[first]) * terrain_from_input(maps[second]).inverse()));
      } catch (const libmap::Error& error) {
        throw error.in_file(maps[first].name + " and " + maps[second].name);
      }
      pairs.back().first = first;
      pairs.back().second = second;
    }
  }
  return pairs;
}

std::string percent(std::optional<double> value) {
  return value ? fmt::format("{:.1f} %", 100.0 * *value) : "unknown";
}

void say(const libgtd::SummarizedMap& map, Run& run) {
  const libgtd::MapSummary& summary = map.summary;
  std::string text = fmt::format("{}: {} of the voxels reach {}", map.name,
                                 percent(libgtd::Rate{summary.reached, summary.judged}.value()),
                                 libmap::to_text(map.cutoff));
  if (map.expected) {
    const libgtd::Confusion& counts = map.expected->voxels_by_score;
    text += fmt::format("; sensitivity {}, specificity {}",
                        percent(counts.true_positive_rate().value()),
                        percent(counts.true_negative_rate().value()));
  }
  run.say(text);
}

void summarize(const SummarizeOptions& options, Run& run) {
  run.claim_output_folder(options.folder);
  std::optional<libgtd::ExpectedMap> expected;
  if (!options.expected.empty()) {
    expected = libgtd::parse_expected_map(libmap::read_csv(options.expected));
    run.add_input(options.expected);
  }
  const std::vector<std::string> names = graspmap_tools::split_texts(options.names);
  if (names.size() > options.maps.size())
    throw libmap::Error("more names than maps",
                        {.field = "--names",
                         .value = std::to_string(names.size()),
                         .bound = "<= " + std::to_string(options.maps.size())});
  std::vector<libgtd::SummarizedMap> maps;
  std::vector<libgtd::VoxelMap> voxels;
  for (const std::string& file : options.maps) {
    try {
      ReadMap read = summarize_one(file, options, expected ? &*expected : nullptr, run);
      if (maps.size() < names.size() && !names[maps.size()].empty())
        read.summarized.name = names[maps.size()];
      maps.push_back(std::move(read.summarized));
      voxels.push_back(std::move(read.voxels));
    } catch (const libmap::Error& error) {
      throw error.in_file(file);
    }
    run.add_input(file);
    say(maps.back(), run);
  }
  const auto table = [](const libmap::Table& content) {
    return [text = libmap::to_csv(content)](const std::filesystem::path& temporary) {
      libmap::write_text(temporary, text);
    };
  };
  std::vector<std::pair<std::string, Run::Writer>> files = {
      {"maps.csv", table(libgtd::summary_table(maps))},
      {"histograms.csv", table(libgtd::histogram_table(maps))}};
  if (options.pairs)
    files.emplace_back("pairs.csv", table(libgtd::pair_table(maps, run.timed("pairs", [&] {
                         return compare_all(maps, voxels);
                       }))));
  if (expected) files.emplace_back("regions.csv", table(libgtd::region_table(maps, *expected)));
  run.write_output_folder(options.folder, files);
}

}  // namespace

int main(int argc, char** argv) {
  SummarizeOptions options;
  graspmap_tools::Command command(
      "summarize", "Several maps in one table, also against places of expected graspability.");
  command.inputs("MAP", options.maps, "graspability maps");
  command.output(options.folder,
                 "folder of maps.csv, histograms.csv and, if asked for, pairs.csv and regions.csv");
  command.option("--expected", "EXPECTED.csv", options.expected,
                 "regions of expected graspability, e.g. data/expected/primitive_shapes.csv");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { summarize(options, run); });
}
