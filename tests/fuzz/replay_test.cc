// Every fuzz target on its seeds, on cut and changed copies of them, and on the inputs that
// fuzzing found faults with (tests/fuzz/findings/TARGET): none of them may do more than be refused.
#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "libmap/core/file_output.h"
#include "tests/fuzz/fuzz_targets.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace replay_test {

namespace fs = std::filesystem;
using graspmap_fuzz::FuzzTarget;

class Fuzz : public testing::TestWithParam<FuzzTarget> {};

std::vector<std::string> contents_of(const fs::path& folder) {
  std::vector<fs::path> files;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::string> contents;
  for (const fs::path& file : files) contents.push_back(libmap::read_whole_file(file, 1U << 26U));
  return contents;
}

std::vector<std::string> seeds_of(const FuzzTarget& target) {
  const fs::path folder = graspmap_test::scratch_folder() / "seeds";
  graspmap_fuzz::write_seeds(target, folder);
  return contents_of(folder);
}

std::size_t random_below(std::size_t bound) {
  return std::uniform_int_distribution<std::size_t>(0, bound - 1)(graspmap_test::random_engine());
}

TEST_P(Fuzz, SeedsAndWhatIsLeftOfThemWhenCut) {
  const std::vector<std::string> seeds = seeds_of(GetParam());
  ASSERT_FALSE(seeds.empty());
  std::size_t accepted = 0;
  for (const std::string& seed : seeds) {
    accepted += GetParam().run(seed) ? 1 : 0;
    for (int n = 0; n < 5 && !seed.empty(); ++n)
      GetParam().run(std::string_view(seed).substr(0, random_below(seed.size())));
  }
  // Readers of several formats take turns at each other's seeds.
  EXPECT_GE(4 * accepted, seeds.size());
}

TEST_P(Fuzz, SeedsWithChangedBytes) {
  for (std::string seed : seeds_of(GetParam())) {
    for (int n = 0; n < 8 && !seed.empty(); ++n) {
      seed[random_below(seed.size())] = static_cast<char>(random_below(256));
      GetParam().run(seed);
    }
  }
}

TEST_P(Fuzz, NothingAndNoise) {
  GetParam().run({});
  for (const std::size_t size : {1U, 2U, 16U, 300U}) {
    std::string noise(size, '\0');
    for (char& byte : noise) byte = static_cast<char>(random_below(256));
    GetParam().run(noise);
  }
}

// The most addresses that this process ever had, kB.
std::uint64_t peak_kilobytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "VmPeak:") {
      std::uint64_t kilobytes = 0;
      status >> kilobytes;
      return kilobytes;
    }
  ADD_FAILURE() << "no VmPeak";
  return 0;
}

TEST_P(Fuzz, EarlierFindings) {
  const std::uint64_t before = peak_kilobytes();
  for (const std::string& bytes :
       contents_of(graspmap_test::source_folder() / "tests/fuzz/findings" / GetParam().name))
    GetParam().run(bytes);
  // As under the fuzzer; asked for and never touched counts too.
  if (!graspmap_test::memory_can_be_limited) return;
  EXPECT_LT(peak_kilobytes(), before + 600'000);
}

INSTANTIATE_TEST_SUITE_P(Targets, Fuzz, testing::ValuesIn(graspmap_fuzz::fuzz_targets()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace replay_test
