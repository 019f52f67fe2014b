#include "libgtd/score/map_shares.h"

#include <algorithm>
#include <optional>
#include <set>

#include "libgtd/score/graspability_map.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

using libmap::Manifest;

// Returns the first parameter of `one` that `other` lacks or has with another value.
std::optional<std::string> differing_parameter(const Manifest& one, const Manifest& other) {
  for (const auto& [key, value] : one.parameters) {
    if (key == "tile") continue;
    const libmap::ManifestValue* found = other.find_parameter(key);
    if (found == nullptr || *found != value) return key;
  }
  return std::nullopt;
}

void require_same_map(const Manifest& first, const Manifest& other, const std::string& first_name,
                      const std::string& name) {
  // Other versions may score the same points differently.
  if (other.version != first.version)
    throw libmap::Error(
        "not the version of graspmap that scored " + first_name,
        {.file = name, .field = "version", .value = other.version, .bound = first.version});
  std::optional<std::string> key = differing_parameter(first, other);
  if (!key) key = differing_parameter(other, first);  // parameters that only the other has
  if (key)
    throw libmap::Error("differs from the value in " + first_name, {.file = name, .field = *key});
  // Inputs are the terrain and the gripper file.
  const auto same = [](const libmap::ManifestInput& a, const libmap::ManifestInput& b) {
    return a.sha256 == b.sha256;
  };
  if (first.inputs.empty() || !std::equal(first.inputs.begin(), first.inputs.end(),
                                          other.inputs.begin(), other.inputs.end(), same))
    throw libmap::Error("inputs differ from the inputs of " + first_name, {.file = name});
}

// Returns "K/N", or an empty text if the manifest is not that of a share.
std::string share_text(const Manifest& manifest) {
  const auto* share = std::get_if<std::string>(manifest.find_parameter("tile"));
  return share == nullptr ? std::string() : *share;
}

// Throws Error unless each of the shares 1/N to N/N is given once.
void require_all_shares(const std::vector<Manifest>& manifests,
                        const std::vector<std::string>& files) {
  std::set<std::string> shares;
  std::string count;
  for (std::size_t n = 0; n < manifests.size(); ++n) {
    const std::string share = share_text(manifests[n]);
    const std::string of = share.substr(std::min(share.find('/') + 1, share.size()));
    if (n > 0 && of != count)
      throw libmap::Error("not a share of the tiles of the first file",
                          {.file = files[n], .field = "tile", .value = share});
    count = of;
    if (!shares.insert(share).second)
      throw libmap::Error("two files contain the same share",
                          {.file = files[n], .field = "tile", .value = share});
  }
  if (std::to_string(shares.size()) != count)
    throw libmap::Error(std::to_string(shares.size()) + " of " + count + " shares are given",
                        {.field = "tile"});
}

}  // namespace

bool is_map_share(const Manifest& manifest) {
  const std::string share = share_text(manifest);
  return !share.empty() && !share.ends_with("/1");
}

void require_shares_of_one_map(const std::vector<Manifest>& manifests,
                               const std::vector<std::string>& files) {
  for (std::size_t n = 0; n < manifests.size(); ++n) {
    if (!is_map_share(manifests[n]))
      throw libmap::Error("is not a share of a map; only shares can be merged", {.file = files[n]});
    require_same_map(manifests.front(), manifests[n], files.front(), files[n]);
  }
  require_all_shares(manifests, files);
}

void copy_common_entries(const Manifest& part, Manifest& whole) {
  for (const auto& parameter : part.parameters)
    if (parameter.first != "tile") whole.parameters.push_back(parameter);
  whole.frame = part.frame;
  whole.transforms = part.transforms;
  whole.georeference = part.georeference;
  for (const char* name : {"lattice_origin_m", "plane_rmse_m", "up_source", "input_points",
                           "occupied_voxels", "mask_side_voxels", "mask_layers", "normal_radius_m"})
    if (const libmap::ManifestValue* value = part.find_result(name))
      whole.results.emplace_back(name, *value);
}

std::size_t add_obstacles_of(const Manifest& part, libmap::PointCloud& whole) {
  const auto number = [](const libmap::ManifestValue* value) {
    return libmap::number_of(value).value_or(0.0);
  };
  const auto parameter = [&](const char* name) { return number(part.find_parameter(name)); };
  return add_obstacles(whole, parameter("voxel_size_m"),
                       {.slope_deg = parameter("obstacle_slope_deg"),
                        .height_m = parameter("obstacle_height_m"),
                        .normal_radius_m = number(part.find_result("normal_radius_m"))});
}

std::int64_t count_set(const libmap::PointCloud& map, const char* flag) {
  const libmap::ScalarField* field = map.find_field(flag);
  return field == nullptr ? 0 : std::count(field->values.begin(), field->values.end(), 1.0);
}

}  // namespace libgtd
