#include "tests/fuzz/target_support.h"

#include <algorithm>

#include "libmap/core/file_output.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/support/test_support.h"

namespace graspmap_fuzz {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t max_seed_bytes = 1U << 24U;

}  // namespace

std::size_t take_choice(std::string_view& bytes, std::size_t count) {
  if (bytes.empty()) return 0;
  const auto choice = static_cast<unsigned char>(bytes.front());
  bytes.remove_prefix(1);
  return choice % count;
}

std::string with_choice(std::size_t choice, const std::string& bytes) {
  return std::string(1, static_cast<char>(choice)) + bytes;
}

std::string_view take_file(std::string_view& bytes) {
  const std::size_t end = std::min(bytes.find('\f'), bytes.size());
  const std::string_view file = bytes.substr(0, end);
  bytes.remove_prefix(std::min(end + 1, bytes.size()));
  return file;
}

std::string written(const std::string& name, const std::function<void(const fs::path&)>& write) {
  const ScratchFile file("seed/" + name);
  write(file.path());
  return libmap::read_whole_file(file.path(), max_seed_bytes);
}

void add_data(Seeds& seeds, std::size_t choice, const std::string& kind) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(graspmap_test::source_folder() / "data" / kind))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files)
    seeds.push_back(with_choice(choice, libmap::read_whole_file(file, max_seed_bytes)));
}

libmap::Manifest small_manifest() {
  libmap::Manifest manifest;
  manifest.command = "score";
  manifest.parameters = {{"voxel_size_m", 0.01}, {"interpolation", true}};
  manifest.inputs = {{"terrain.pcd", std::string(64, 'a'), 12}};
  manifest.frame = "terrain";
  manifest.transforms = {{"terrain_from_input", libmap::Pose::Identity()}};
  manifest.results = {{"voxels", std::int64_t{7}}};
  return manifest;
}

}  // namespace graspmap_fuzz
