// graspmap merge: the tiles of a map into one map.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/score/graspability_map.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "tools/command_line.h"

namespace {

using graspmap_tools::Run;

struct MergeOptions {
  std::vector<std::string> tiles;
  std::string output;
};

libmap::Manifest manifest_of(const std::string& tile) {
  const auto manifest = libmap::read_manifest_of(tile);
  if (!manifest)
    throw libmap::Error("no manifest beside it: it is not a tile that `graspmap score` wrote",
                        {.file = tile});
  return *manifest;
}

// The first parameter of `one` that `other` does not have with the same value.
std::optional<std::string> differing_parameter(const libmap::Manifest& one,
                                               const libmap::Manifest& other) {
  for (const auto& [key, value] : one.parameters) {
    if (key == "tile") continue;
    const libmap::ManifestValue* found = other.find_parameter(key);
    if (found == nullptr || *found != value) return key;
  }
  return std::nullopt;
}

// What all shares of one map have in common.
void require_same_map(const libmap::Manifest& first, const libmap::Manifest& other,
                      const std::string& first_name, const std::string& name) {
  std::optional<std::string> key = differing_parameter(first, other);
  if (!key) key = differing_parameter(other, first);  // one that only the other has
  if (key) throw libmap::Error("differs from that of " + first_name, {.file = name, .field = *key});
  // The terrain and the gripper file.
  const auto same = [](const libmap::ManifestInput& a, const libmap::ManifestInput& b) {
    return a.sha256 == b.sha256;
  };
  if (first.inputs.empty() || !std::equal(first.inputs.begin(), first.inputs.end(),
                                          other.inputs.begin(), other.inputs.end(), same))
    throw libmap::Error("was scored from other inputs than " + first_name, {.file = name});
}

// The shares K/N of the parts are 1 to N, each once.
void require_all_shares(const std::vector<libmap::Manifest>& manifests,
                        const std::vector<std::string>& names) {
  std::vector<std::string> shares;
  std::string count;
  for (std::size_t n = 0; n < manifests.size(); ++n) {
    const libmap::ManifestValue* value = manifests[n].find_parameter("tile");
    const std::string share = value != nullptr && std::holds_alternative<std::string>(*value)
                                  ? std::get<std::string>(*value)
                                  : std::string();
    const std::string of = share.substr(std::min(share.find('/') + 1, share.size()));
    if (share.empty() || (n > 0 && of != count))
      throw libmap::Error("is not a share of the same tiles",
                          {.file = names[n], .field = "tile", .value = share});
    count = of;
    for (const std::string& seen : shares)
      if (seen == share)
        throw libmap::Error("two files hold this share",
                            {.file = names[n], .field = "tile", .value = share});
    shares.push_back(share);
  }
  if (std::to_string(shares.size()) != count)
    throw libmap::Error(fmt::format("{} of {} shares are given", shares.size(), count),
                        {.field = "tile"});
}

void copy_common_facts(const libmap::Manifest& part, libmap::Manifest& whole) {
  for (const auto& parameter : part.parameters)
    if (parameter.first != "tile") whole.parameters.push_back(parameter);
  whole.frame = part.frame;
  whole.transforms = part.transforms;
  for (const char* name : {"lattice_origin_m", "plane_rmse_m", "up_source", "input_points",
                           "occupied_voxels", "mask_side_voxels", "mask_layers"})
    if (const libmap::ManifestValue* value = part.find_result(name))
      whole.results.emplace_back(name, *value);
}

// Points whose flag is set.
std::int64_t count_of(const libmap::PointCloud& map, const char* flag) {
  const libmap::ScalarField* field = map.find_field(flag);
  return field == nullptr ? 0 : std::count(field->values.begin(), field->values.end(), 1.0);
}

void merge(const MergeOptions& options, Run& run) {
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, options.tiles);
  std::vector<libmap::Manifest> manifests;
  for (const std::string& tile : options.tiles) {
    manifests.push_back(manifest_of(tile));
    require_same_map(manifests.front(), manifests.back(), options.tiles.front(), tile);
  }
  require_all_shares(manifests, options.tiles);
  std::vector<libmap::PointCloud> parts;
  for (const std::string& tile : options.tiles) parts.push_back(libmap::read_cloud(tile).cloud);
  const libmap::PointCloud whole = libgtd::merge_map_clouds(parts);
  copy_common_facts(manifests.front(), run.manifest());
  // The terrain and the gripper that the parts were made from, then the parts.
  run.manifest().inputs = manifests.front().inputs;
  for (const std::string& tile : options.tiles) run.add_input(tile);
  run.manifest().results.emplace_back("scored_voxels", static_cast<std::int64_t>(whole.size()));
  run.manifest().results.emplace_back("edge_voxels", count_of(whole, "edge"));
  run.manifest().results.emplace_back("graspable_voxels", count_of(whole, "graspable"));
  run.say(fmt::format("{} scored voxels from {} files", whole.size(), parts.size()));
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, whole); });
}

}  // namespace

int main(int argc, char** argv) {
  MergeOptions options;
  graspmap_tools::Command command("merge", "The shares of a map's tiles into one map.");
  command.inputs("TILE", options.tiles, "maps that `graspmap score --tile K/N` wrote, all N");
  command.output(options.output, "the whole map, the same bytes as without --tile");
  return command.run(argc, argv, [&](Run& run) { merge(options, run); });
}
