// The other steps of a detection, and the command as a whole, on the clouds in GRASPMAP_DATA.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

#include "libgtd/shape/convexity.h"
#include "libgtd/terrain/interpolation.h"
#include "libgtd/terrain/regression_plane.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "tests/benchmarks/benchmark_table.h"

namespace {

using graspmap_bench::folder_of;
using graspmap_bench::time_iterations;
using libmap::PointCloud;

std::filesystem::path cloud_file(const std::string& name) {
  return *folder_of("GRASPMAP_DATA") / "clouds" / (name + ".pcd");
}

void convexity(benchmark::State& state, libgtd::CurvatureMethod method, const char* label) {
  const PointCloud cloud = libmap::read_cloud(cloud_file("artificial_rocks")).cloud;
  const auto threads = static_cast<unsigned>(state.range(0));
  const libmap::ThreadLimit limit(threads);
  time_iterations(state, [&] {
    const auto curvature = libgtd::estimate_curvature(cloud, {.method = method, .radius_m = 0.09});
    benchmark::DoNotOptimize(libgtd::find_convex(curvature, cloud.positions));
  });
  graspmap_bench::set_author_ms(state, 1720);
  state.SetLabel(std::string(label) + ", " + graspmap_bench::threads_text(threads));
}

// As the command prepares the cloud.
PointCloud terrain_of(const PointCloud& input, bool thesis) {
  PointCloud cloud = input;
  if (thesis) {
    std::vector<Eigen::Vector3f> points;
    for (const Eigen::Vector3d& point : input.positions) points.push_back(point.cast<float>());
    cloud = PointCloud();
    for (const Eigen::Vector3f& point : libgtd::voxel_centroids(points, 0.01))
      cloud.positions.push_back(point.cast<double>());
  }
  const auto method = thesis ? libgtd::PlaneMethod::thesis : libgtd::PlaneMethod::corrected;
  const auto plane = libgtd::fit_regression_plane(cloud, {.method = method});
  return libgtd::transform_to_terrain(cloud, plane, method);
}

void interpolation(benchmark::State& state, bool thesis) {
  const PointCloud terrain =
      terrain_of(libmap::read_cloud(cloud_file("simulated_cloud_pre-scan")).cloud, thesis);
  libgtd::InterpolationOptions options;
  options.method =
      thesis ? libgtd::InterpolationMethod::thesis : libgtd::InterpolationMethod::corrected;
  const auto threads = static_cast<unsigned>(state.range(0));
  const libmap::ThreadLimit limit(threads);
  time_iterations(state, [&] { benchmark::DoNotOptimize(libgtd::interpolate(terrain, options)); });
  graspmap_bench::set_author_ms(state, 240);
  state.SetLabel((thesis ? "thesis, " : "corrected, ") + graspmap_bench::threads_text(threads));
}

// From the start of the process to its end, the map on the disk.
void command(benchmark::State& state, const std::string& method) {
  const auto threads = static_cast<unsigned>(state.range(0));
  const auto output = std::filesystem::temp_directory_path() /
                      ("graspmap_bench_" + std::to_string(getpid()) + ".pcd");
  std::vector<std::string> words = {
      GRASPMAP_PROGRAM, "score",     cloud_file("artificial_rocks"), "-o",
      output,           "--config",  "artificial_rocks_prescan",     "--method",
      method,           "--threads", std::to_string(threads),        "--quiet",
      "--force"};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  int status = 0;
  time_iterations(state, [&] {
    pid_t child = 0;
    if (posix_spawn(&child, GRASPMAP_PROGRAM, nullptr, nullptr, arguments.data(), environ) == 0)
      waitpid(child, &status, 0);
    else
      status = -1;
  });
  std::filesystem::remove(output);
  std::filesystem::remove(output.string() + ".json");
  if (status != 0) state.SkipWithError("the command failed");
  graspmap_bench::set_author_ms(state, 4100);
  state.SetLabel(method + ", with convexity, " + graspmap_bench::threads_text(threads));
}

const bool registered = [] {
  if (!folder_of("GRASPMAP_DATA")) return false;
  const auto add = [](const char* name, int iterations, auto function) {
    benchmark::RegisterBenchmark(name, function)
        ->Arg(1)
        ->Arg(2)
        ->Iterations(iterations)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  };
  using libgtd::CurvatureMethod;
  for (const auto& [method, label] : {std::pair(CurvatureMethod::thesis, "thesis"),
                                      std::pair(CurvatureMethod::corrected, "corrected")})
    add("convexity, artificial_rocks, 0.09 m", 10,
        [method = method, label = label](benchmark::State& state) {
          convexity(state, method, label);
        });
  for (const bool thesis : {true, false})
    add("interpolation, simulated_cloud_pre-scan", 20,
        [thesis](benchmark::State& state) { interpolation(state, thesis); });
  for (const char* method : {"thesis", "corrected"})
    add("graspmap score artificial_rocks.pcd", 10,
        [method](benchmark::State& state) { command(state, method); });
  return true;
}();

}  // namespace
