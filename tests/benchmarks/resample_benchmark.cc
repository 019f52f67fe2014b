// Poisson-disk samples a second, by their number and by the number of triangles.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>

#include "libmap/core/parallel.h"
#include "libmap/mesh/poisson_disk.h"

namespace {

// Rough ground of 3 x 3 m.
libmap::TriangleMesh rough_ground(std::uint32_t cells) {
  libmap::TriangleMesh mesh;
  for (std::uint32_t y = 0; y <= cells; ++y)
    for (std::uint32_t x = 0; x <= cells; ++x) {
      const double u = 3.0 * x / cells;
      const double v = 3.0 * y / cells;
      mesh.vertices.emplace_back(u, v, 0.1 * std::sin(9 * u + 2 * v) * std::cos(8 * v - u));
    }
  for (std::uint32_t y = 0; y < cells; ++y)
    for (std::uint32_t x = 0; x < cells; ++x) {
      const std::uint32_t a = y * (cells + 1) + x;
      mesh.triangles.push_back({a, a + 1, a + cells + 2});
      mesh.triangles.push_back({a, a + cells + 2, a + cells + 1});
    }
  return mesh;
}

// Arguments: samples, cells along a side, threads.
void sample_by_count(benchmark::State& state) {
  const libmap::TriangleMesh mesh = rough_ground(static_cast<std::uint32_t>(state.range(1)));
  const libmap::ThreadLimit limit(static_cast<unsigned>(state.range(2)));
  libmap::PoissonDiskOptions options;
  options.count = static_cast<std::uint64_t>(state.range(0));
  libmap::PoissonDiskResult result;
  while (state.KeepRunning()) result = libmap::sample_poisson_disk(mesh, options);
  state.counters["points"] = static_cast<double>(result.cloud.size());
  state.counters["relative_radius"] = result.relative_radius;
  state.counters["points/s"] = benchmark::Counter(static_cast<double>(result.cloud.size()),
                                                  benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(sample_by_count)
    ->Args({73000, 300, 1})
    ->Args({73000, 300, 2})
    ->Args({73000, 2, 2})
    ->Args({73000, 2300, 2})
    ->Args({1000000, 300, 2})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
