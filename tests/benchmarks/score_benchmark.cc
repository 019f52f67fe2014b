// Voxel matching against the plain triple loop of listing A.6, on the same voxels in one run. Each
// benchmark of ours carries the counter `speedup`: the baseline's time over its own.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <map>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/score/tiling.h"
#include "libmap/core/parallel.h"
#include "libmap/simulate/scene_sampling.h"

namespace {

using libgtd::GripperMask;
using libgtd::VoxelGrid;

struct Workload {
  VoxelGrid grid;
  GripperMask mask;
  std::vector<std::size_t> pivots;
  libgtd::TileBounds box;
};

// The thesis's scenario 1 with SCAR-E: about the pivots of its own scans.
const Workload& workload(int voxel_size_mm) {
  static std::map<int, Workload> workloads;
  const auto [at, is_new] = workloads.try_emplace(voxel_size_mm);
  Workload& made = at->second;
  if (!is_new) return made;
  const double voxel_size_m = voxel_size_mm / 1000.0;
  libmap::SceneSamplingOptions sampling;
  sampling.spacing_m = voxel_size_m;
  const auto cloud = libmap::sample_scene(libmap::thesis_primitive_scene(), sampling).cloud;
  made.grid = libgtd::voxelize(cloud.positions, voxel_size_m);
  made.mask = libgtd::make_gripper_mask(
      libgtd::read_gripper(GRASPMAP_SOURCE_DIR "/data/grippers/scar-e.yaml"),
      {libgtd::Method::thesis, voxel_size_m, voxel_size_mm == 5 ? 5 : 1});
  made.box = {made.grid.min.i, made.grid.max.i + 1, made.grid.min.j, made.grid.max.j + 1};
  made.pivots = libgtd::pivots_in(made.grid, made.mask, made.box);
  return made;
}

double baseline_seconds(int voxel_size_mm) {
  static std::map<int, double> measured;
  const auto [at, is_new] = measured.try_emplace(voxel_size_mm);
  if (!is_new) return at->second;
  const Workload& work = workload(voxel_size_mm);
  const auto start = std::chrono::steady_clock::now();
  benchmark::DoNotOptimize(libgtd::match_voxels_plainly(work.grid, work.mask, work.pivots));
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  return at->second = taken.count();
}

void plain_triple_loop(benchmark::State& state) {
  const Workload& work = workload(static_cast<int>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(libgtd::match_voxels_plainly(work.grid, work.mask, work.pivots));
  state.counters["pivots"] = static_cast<double>(work.pivots.size());
}

void tiled_population_counts(benchmark::State& state) {
  const int voxel_size_mm = static_cast<int>(state.range(0));
  const Workload& work = workload(voxel_size_mm);
  const double baseline_s = baseline_seconds(voxel_size_mm);
  const libmap::ThreadLimit limit(static_cast<unsigned>(state.range(1)));
  const auto tiles = libgtd::make_tiles(work.grid, 1000 / voxel_size_mm);
  double total_s = 0.0;
  for (auto _ : state) {
    const auto start = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(libgtd::score_tiles(work.grid, work.mask, tiles, {}));
    total_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  state.counters["pivots"] = static_cast<double>(work.pivots.size());
  state.counters["speedup"] = baseline_s * static_cast<double>(state.iterations()) / total_s;
}

BENCHMARK(plain_triple_loop)->ArgName("voxel_mm")->Arg(10)->Arg(5)->Unit(benchmark::kMillisecond);
BENCHMARK(tiled_population_counts)
    ->ArgNames({"voxel_mm", "threads"})
    ->Args({10, 1})
    ->Args({10, 2})
    ->Args({5, 1})
    ->Args({5, 2})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
