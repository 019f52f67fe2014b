// graspmap compare: how far a cloud lies from a true surface, and how much of it the cloud covers.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/pose.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/surface_distance.h"
#include "tools/command_line.h"

namespace {

using graspmap_tools::Run;
using Json = nlohmann::ordered_json;

struct CompareOptions {
  std::string cloud;
  std::string mesh;
  std::string output;
  std::string transform;
  std::string box;
  double within_m = 0.01;
  double samples_per_m2 = 20000.0;
  std::uint64_t seed = 1;
  bool json = false;
};

void bind(libmap::ParameterTable& table, CompareOptions& options) {
  table.add("within_m", options.within_m, libmap::positive,
            "the surface is covered where a point of the cloud is this near");
  table.add("samples_per_m2", options.samples_per_m2, libmap::positive,
            "points of the surface at which its coverage is asked");
  table.add("seed", options.seed, {}, "of those points");
}

// Six finite numbers with commas between them.
std::vector<double> parse_six(const std::string& text, const char* field, const char* bound) {
  std::vector<double> numbers;
  std::string_view rest = text;
  while (true) {
    const std::size_t comma = rest.find(',');
    const auto number = libmap::parse_double(rest.substr(0, comma));
    if (!number || !std::isfinite(*number)) break;
    numbers.push_back(*number);
    if (comma == std::string_view::npos) {
      if (numbers.size() == 6) return numbers;
      break;
    }
    rest = rest.substr(comma + 1);
  }
  throw libmap::Error("not six numbers",
                      {.file = {}, .field = field, .value = text, .bound = bound});
}

libmap::Pose mesh_from_cloud(const std::string& text) {
  if (text.empty()) return libmap::Pose::Identity();
  const std::vector<double> n =
      parse_six(text, "--transform", "X,Y,Z,ROLL,PITCH,YAW in metres and degrees");
  return libmap::make_pose_from_rpy({n[0], n[1], n[2]}, {n[3], n[4], n[5]});
}

std::optional<libmap::Bounds3d> parse_box(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const char* bound = "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX in metres";
  const std::vector<double> n = parse_six(text, "--box", bound);
  const libmap::Bounds3d box{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
  if ((box.min.array() > box.max.array()).any())
    throw libmap::Error("the box is inside out",
                        {.file = {}, .field = "--box", .value = text, .bound = bound});
  return box;
}

bool is_inside(const std::optional<libmap::Bounds3d>& box, const Eigen::Vector3d& point) {
  return !box ||
         ((point.array() >= box->min.array()).all() && (point.array() <= box->max.array()).all());
}

libmap::PointCloud part_in_box(const libmap::PointCloud& cloud,
                               const std::optional<libmap::Bounds3d>& box,
                               const std::string& file) {
  std::vector<std::size_t> inside;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (is_inside(box, cloud.positions[n])) inside.push_back(n);
  if (inside.empty())
    throw libmap::Error(cloud.empty() ? "the cloud has no points" : "no point lies in the box",
                        {.file = file});
  return libmap::select_points(cloud, inside);
}

// Distances to a mesh take the longer the farther a point is from it; a cloud that lies so far off
// was carried there by a wrong transform.
void require_nearness(const libmap::TriangleMesh& mesh, const libmap::PointCloud& cloud,
                      const CompareOptions& options) {
  constexpr double most_sizes = 100;
  const libmap::Bounds3d surface = libmap::bounds_of(mesh.vertices);
  const libmap::Bounds3d points = libmap::bounds_of(cloud.positions);
  const double size = (surface.max - surface.min).norm();
  const double apart = ((points.max + points.min) / 2 - (surface.max + surface.min) / 2).norm();
  if (!(apart <= most_sizes * size))
    throw libmap::Error("the cloud lies too far from the mesh to be compared",
                        {.file = options.cloud,
                         .field = "distance of the centres",
                         .value = libmap::to_text(static_cast<float>(apart)) + " m",
                         .bound = "<= " + libmap::to_text(static_cast<float>(most_sizes * size)) +
                                  " m, 100 times the mesh"});
}

struct Comparison {
  libmap::DistanceStatistics distances;
  std::size_t samples = 0;  // of the surface in the box
  double completeness = 0.0;
};

// Of the surface in the box, by all of the cloud: points just outside cover its border.
double completeness_of(const libmap::TriangleMesh& mesh, const libmap::PointCloud& cloud,
                       const std::optional<libmap::Bounds3d>& box, const CompareOptions& options,
                       std::size_t& samples) {
  std::vector<Eigen::Vector3d> inside;
  for (const libmap::SurfacePoint& sample :
       libmap::sample_surface(mesh, options.samples_per_m2, options.seed))
    if (is_inside(box, sample.position)) inside.push_back(sample.position);
  samples = inside.size();
  return libmap::share_of(libmap::covered(inside, cloud.positions, options.within_m));
}

void print(const Comparison& comparison, const CompareOptions& options) {
  const libmap::DistanceStatistics& distances = comparison.distances;
  if (options.json) {
    const Json json = {{"cloud", options.cloud},
                       {"mesh", options.mesh},
                       {"points", distances.count},
                       {"rmse_m", distances.rmse_m},
                       {"mean_m", distances.mean_m},
                       {"median_m", distances.median_m},
                       {"p95_m", distances.p95_m},
                       {"max_m", distances.max_m},
                       {"surface_samples", comparison.samples},
                       {"within_m", options.within_m},
                       {"completeness", comparison.completeness}};
    std::cout << json.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
    return;
  }
  std::cout << fmt::format(
      "points: {}\nrmse: {:.2f} mm\nmean: {:.2f} mm\nmedian: {:.2f} mm\n95th percentile: {:.2f} "
      "mm\nmax: {:.2f} mm\nsurface within {:g} mm of a point: {:.2f} %\n",
      distances.count, 1e3 * distances.rmse_m, 1e3 * distances.mean_m, 1e3 * distances.median_m,
      1e3 * distances.p95_m, 1e3 * distances.max_m, 1e3 * options.within_m,
      1e2 * comparison.completeness);
}

void add_results(const Comparison& comparison, libmap::Manifest& manifest) {
  const libmap::DistanceStatistics& distances = comparison.distances;
  manifest.frame = "mesh";
  manifest.results.emplace_back("points", static_cast<std::int64_t>(distances.count));
  manifest.results.emplace_back("rmse_m", distances.rmse_m);
  manifest.results.emplace_back("mean_m", distances.mean_m);
  manifest.results.emplace_back("median_m", distances.median_m);
  manifest.results.emplace_back("p95_m", distances.p95_m);
  manifest.results.emplace_back("max_m", distances.max_m);
  manifest.results.emplace_back("completeness", comparison.completeness);
}

void compare(const CompareOptions& options, Run& run) {
  const auto box = parse_box(options.box);
  if (!options.output.empty()) {
    libmap::require_cloud_format(options.output);
    run.claim_output(options.output, {options.cloud, options.mesh});
  }
  const libmap::PointCloud whole = libmap::transform_cloud(libmap::read_cloud(options.cloud).cloud,
                                                           mesh_from_cloud(options.transform));
  libmap::PointCloud cloud = part_in_box(whole, box, options.cloud);
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.mesh).mesh;
  require_nearness(mesh, cloud, options);
  std::vector<double> distances =
      run.timed("distances", [&] { return libmap::distances_to_surface(cloud.positions, mesh); });
  Comparison comparison;
  comparison.distances = libmap::distance_statistics(distances);
  comparison.completeness = run.timed("completeness", [&] {
    return completeness_of(mesh, whole, box, options, comparison.samples);
  });
  print(comparison, options);
  if (options.output.empty()) return;
  cloud.add_field("distance", libmap::ScalarType::float32).values = std::move(distances);
  run.add_input(options.cloud);
  run.add_input(options.mesh);
  run.manifest().parameters.emplace_back("transform", options.transform);
  run.manifest().parameters.emplace_back("box", options.box);
  add_results(comparison, run.manifest());
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  CompareOptions options;
  graspmap_tools::Command command(
      "compare", "How far a cloud lies from a true surface, and how much of it the cloud covers.");
  command.input("CLOUD", options.cloud, "cloud (.pcd, .ply, .vtp, .csv)");
  command.input("MESH", options.mesh, "the true surface (.ply, .obj, .stl, .off, .glb, .vtp)");
  command.output(options.output, "the cloud in the mesh's frame with the field `distance`", false);
  command.option("--transform", "X,Y,Z,ROLL,PITCH,YAW", options.transform,
                 "mesh_from_cloud, metres and degrees about the fixed axes, roll first");
  command.option("--box", "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX", options.box,
                 "compare only what lies in this box of the mesh's frame");
  command.flag("--json", options.json, "as JSON");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { compare(options, run); });
}
