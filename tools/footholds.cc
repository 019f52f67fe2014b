// graspmap footholds: the best places of a map, for a planner of steps.
#include "libgtd/score/footholds.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "tools/support/command_line.h"
#include "tools/support/foothold_trials.h"
#include "tools/support/map_frame.h"

using namespace graspmap_tools;

namespace {

struct FootholdsCommandOptions {
  std::string map;
  std::string output;
  libgtd::FootholdOptions footholds;
  FootholdTrialsOptions trials;
};

void bind(libmap::ParameterTable& table, FootholdsCommandOptions& options) {
  bind(table, options.footholds);
  bind(table, options.trials);
}

libgtd::FootholdResult search(const FootholdsCommandOptions& options, const libmap::PointCloud& map,
                              const std::optional<libmap::Manifest>& manifest, Run& run) {
  libgtd::FootholdOptions wanted = options.footholds;
  // Some of the best do not hold.
  if (!options.trials.mesh.empty()) wanted.max_count = 0;
  return in_file(options.map, [&] {
    return run.timed("footholds", [&] {
      return libgtd::find_footholds(map, wanted, {.up = up_of_map(manifest)});
    });
  });
}

void find_footholds(const FootholdsCommandOptions& options, Run& run) {
  if (options.trials.mesh.empty())
    refuse_set(options.trials, &graspmap_tools::bind, "is for --mesh");
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.map, options.trials.mesh});
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  const std::optional<libmap::Manifest> manifest = libmap::read_manifest_of(options.map);
  libgtd::FootholdResult result = search(options, map, manifest, run);
  if (manifest) {
    run.manifest().frame = manifest->frame;
    run.manifest().transforms = manifest->transforms;
  } else {
    run.warn(options.map + ": no manifest beside it: the z axis is taken as up");
  }
  run.add_input(options.map);
  run.add_results({{"candidates", result.candidates}, {"candidates_at_border", result.at_border}});
  std::vector<libgtd::LocationResult> trials;
  if (!options.trials.mesh.empty() && !run.options().dry_run)
    trials =
        test_footholds(options.trials, options.footholds.max_count, manifest, map, result, run);
  run.add_results({{"footholds", result.footholds.size()}});
  run.say("{} footholds among {} voxels that may be one", result.footholds.size(),
          result.candidates);
  if (result.candidates == 0)
    run.warn("{}: no voxel may be a foothold{}", options.map,
             result.at_border == 0
                 ? ""
                 : fmt::format("; {} at the border of the scan are left out (--border)",
                               result.at_border));
  libmap::PointCloud cloud = libgtd::to_cloud(result, map);
  add_trial_fields(trials, cloud);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  FootholdsCommandOptions options;
  Command command("footholds");
  command.input("MAP", options.map, "graspability map");
  command.output(options.output,
                 "the footholds, best first, with normals and directions of approach (.csv, .vtp, "
                 ".pcd, .ply)");
  command.option("--mesh", "MESH", options.trials.mesh,
                 "mesh of the terrain: each foothold is tested as by `graspmap grasp`, and those "
                 "that do not hold are left out");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { find_footholds(options, run); });
}
