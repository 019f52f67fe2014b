// graspmap footholds: the best places of a map, for a planner of steps.
#include "libgtd/score/footholds.h"
#include "libmap/cloud/cloud_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"

using namespace graspmap_tools;

namespace {

struct FootholdsCommandOptions {
  std::string map;
  std::string output;
  libgtd::FootholdOptions footholds;
};

void find_footholds(const FootholdsCommandOptions& options, Run& run) {
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.map});
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  const std::optional<libmap::Manifest> manifest = libmap::read_manifest_of(options.map);
  const libgtd::FootholdResult result = in_file(options.map, [&] {
    return run.timed("footholds", [&] {
      return libgtd::find_footholds(map, options.footholds, {.up = up_of_map(manifest)});
    });
  });
  if (manifest) {
    run.manifest().frame = manifest->frame;
    run.manifest().transforms = manifest->transforms;
  } else {
    run.warn(options.map + ": no manifest beside it: the z axis is taken as up");
  }
  run.add_input(options.map);
  run.add_results({{"candidates", result.candidates},
                   {"footholds", result.footholds.size()},
                   {"candidates_at_border", result.at_border}});
  run.say("{} footholds among {} voxels that may be one", result.footholds.size(),
          result.candidates);
  if (result.footholds.empty())
    run.warn("{}: no voxel may be a foothold{}", options.map,
             result.at_border == 0 ? ""
                                   : fmt::format("; {} at the scan's edges are left out (--edges)",
                                                 result.at_border));
  const libmap::PointCloud cloud = libgtd::to_cloud(result, map);
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
  bind(command.parameters(), options.footholds);
  return command.run(argc, argv, [&](Run& run) { find_footholds(options, run); });
}
