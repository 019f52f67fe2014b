// Voxel matching against the plain triple loop of listing A.6, on the same voxels in one run. The
// counter `speedup` is the loop's least time over ours; `peak_percent` the bytes of mask that were
// counted in a second of a processor over the most that the innermost loop of those instructions
// counts on this machine.
#include <chrono>
#include <cmath>
#include <map>
#include <string>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/score/matching_loops.h"
#include "libgtd/score/tiling.h"
#include "libmap/core/parallel.h"
#include "libmap/scenes/scene_sampling.h"
#include "tests/benchmarks/benchmark_table.h"
#include "tests/libgtd/plain_matching.h"
#include "tests/support/reference_data.h"
#include "tests/support/thesis_scene.h"

namespace {

using graspmap_bench::folder_of;
using graspmap_bench::time_iterations;
using graspmap_bench::Times;
using libgtd::GripperMask;
using libgtd::Method;
using libgtd::VoxelGrid;
using libmap::InstructionSet;

struct Set {
  std::string name;
  std::string reference;  // NAME.f32.gz in the folder `gtd` of GRASPMAP_REFERENCE
  std::string gripper = "scar-e";
  double voxel_size_m = 0.01;
  int extra_void_layers = 1;
  double author_ms = 0.0;
};

const std::vector<Set> sets = {
    {"simulated scenario 1, 10 mm", "", "scar-e", 0.01, 1},
    {"artificial_rocks, 10 mm", "artificial_rocks.thesis.transformed", "scar-e", 0.01, 1, 2340},
    {"primitive_shapes, 5 mm", "primitive_shapes.thesis.interpolated", "scar-e", 0.005, 5, 34300},
    {"leaning_holds_hubrobo, 1 mm", "leaning_holds_hubrobo.thesis.interpolated", "hubrobo", 0.001,
     3, 8900}};

struct Workload {
  VoxelGrid grid;
  GripperMask mask;
  std::vector<std::size_t> pivots;
  std::optional<double> baseline_s;
};

VoxelGrid grid_of(const Set& set) {
  if (!set.reference.empty())
    return libgtd::voxelize_thesis(
        graspmap_test::read_points_f32_gz(*folder_of("GRASPMAP_REFERENCE") / "gtd" /
                                          (set.reference + ".f32.gz")),
        set.voxel_size_m);
  libmap::SceneSamplingOptions sampling;
  sampling.spacing_m = set.voxel_size_m;
  return libgtd::voxelize(
      libmap::sample_scene(graspmap_test::thesis_primitive_scene(), sampling).cloud.positions,
      set.voxel_size_m);
}

Workload& workload(const Set& set) {
  static std::map<std::string, Workload> workloads;
  const auto [at, is_new] = workloads.try_emplace(set.name);
  Workload& made = at->second;
  if (!is_new) return made;
  made.grid = grid_of(set);
  made.mask = libgtd::make_gripper_mask(
      libgtd::read_gripper(std::string(GRASPMAP_SOURCE_DIR "/data/grippers/") + set.gripper +
                           ".yaml"),
      {Method::thesis, set.voxel_size_m, set.extra_void_layers});
  const libgtd::TileBounds box = {made.grid.min.i, made.grid.max.i + 1, made.grid.min.j,
                                  made.grid.max.j + 1};
  made.pivots = libgtd::pivots_in(made.grid, made.mask, box);
  return made;
}

// Bytes of mask a second, one thread: the loop alone on aligned bits in the first cache.
double peak_bytes_per_s(libmap::InstructionSet instructions) {
  static std::map<libmap::InstructionSet, double> measured;
  const auto [at, is_new] = measured.try_emplace(instructions);
  if (!is_new) return at->second;
  constexpr std::size_t chunk_count = 64, pivot_count = 4096;
  std::vector<libgtd::MaskChunk> window(chunk_count), chunks(chunk_count);
  std::vector<std::uint32_t> offsets, origins(pivot_count, 0), counts(pivot_count);
  for (std::uint32_t c = 0; c < chunk_count; ++c) {
    offsets.push_back(c * libgtd::MaskChunk::columns);
    for (std::size_t n = 0; n < libgtd::MaskChunk::columns; ++n)
      window[c].bits[n] = chunks[c].bits[n] = static_cast<std::uint16_t>(40503U * (n + c));
  }
  Times times;
  for (int round = 0; round < 30; ++round)
    graspmap_bench::time_once(
        [&] {
          libgtd::matching_loops_of(instructions)
              .count(window.front().bits, origins.data(), pivot_count, chunks.data(),
                     offsets.data(), chunk_count, counts.data());
          benchmark::DoNotOptimize(counts.data());
        },
        times);
  return at->second = static_cast<double>(chunk_count * pivot_count) * sizeof(libgtd::MaskChunk) /
                      times.min();
}

void triple_loop(benchmark::State& state, const Set& set) {
  Workload& work = workload(set);
  const Times times = time_iterations(state, [&] {
    benchmark::DoNotOptimize(
        graspmap_test::match_voxels_plainly(work.grid, work.mask, work.pivots));
  });
  work.baseline_s = times.min();
  state.counters["pivots"] = static_cast<double>(work.pivots.size());
  state.SetLabel("triple loop, 1 thread");
}

void matching(benchmark::State& state, const Set& set, libmap::InstructionSet instructions,
              const char* name_of_them) {
  if (!libmap::has_instruction_set(instructions)) {
    state.SkipWithError("this processor has no such instructions");
    return;
  }
  Workload& work = workload(set);
  const auto threads = static_cast<unsigned>(state.range(0));
  const libmap::ThreadLimit limit(threads);
  const auto tiles =
      libgtd::make_tiles(work.grid, static_cast<int>(std::lround(1.0 / set.voxel_size_m)));
  libgtd::ScoringOptions options;
  options.instructions = instructions;
  const Times times = time_iterations(state, [&] {
    benchmark::DoNotOptimize(libgtd::score_tiles(work.grid, work.mask, tiles, options));
  });
  const double bytes = static_cast<double>(work.pivots.size()) *
                       static_cast<double>(libgtd::solid_chunks(work.mask)) *
                       sizeof(libgtd::MaskChunk);
  state.counters["pivots"] = static_cast<double>(work.pivots.size());
  if (work.baseline_s) state.counters["speedup"] = *work.baseline_s / times.min();
  state.counters["peak_percent"] =
      100.0 * bytes / times.processor_s / peak_bytes_per_s(instructions);
  graspmap_bench::set_author_ms(state, set.author_ms);
  state.SetLabel(std::string(name_of_them) + ", " + graspmap_bench::threads_text(threads));
}

const bool registered = [] {
  const bool has_reference = folder_of("GRASPMAP_REFERENCE").has_value();
  for (const Set& set : sets) {
    if (!set.reference.empty() && !has_reference) continue;
    const std::string name = "voxel matching, " + set.name;
    benchmark::RegisterBenchmark(name.c_str(),
                                 [&set](benchmark::State& state) { triple_loop(state, set); })
        ->Iterations(1)
        ->Unit(benchmark::kMillisecond);
    for (const auto& [instructions, name_of_them] :
         {std::pair(libmap::InstructionSet::portable, "portable"),
          std::pair(libmap::InstructionSet::avx2, "AVX2"),
          std::pair(libmap::InstructionSet::avx512, "AVX-512")})
      benchmark::RegisterBenchmark(
          name.c_str(),
          [&set, instructions = instructions, name_of_them = name_of_them](
              benchmark::State& state) { matching(state, set, instructions, name_of_them); })
          ->Arg(1)
          ->Arg(2)
          ->Iterations(30)
          ->UseRealTime()
          ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
