// graspmap compare: distances between two clouds or meshes.
#include <array>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "libmap/core/pose.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/reference_surface.h"
#include "libmap/mesh/surface_alignment.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/view/scene_view.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/placement.h"
#include "tools/support/results.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

using Json = nlohmann::ordered_json;

struct CompareOptions {
  std::string a;
  std::string b;
  std::string output;
  std::string image;
  std::string transform;
  std::string box;
  double within_m = 0.01;
  double samples_per_m2 = 20000.0;
  std::uint64_t seed = 1;
  bool icp = false;
  libmap::SurfaceAlignmentOptions alignment;
  double image_range_m = 0.0;
  libmap::SceneViewOptions view;
  bool json = false;
};

void bind(libmap::ParameterTable& table, CompareOptions& options) {
  table.add("within_m", options.within_m, libmap::positive,
            "distance within which a point matches the other surface (precision, completeness), m");
  table.add("samples_per_m2", options.samples_per_m2, libmap::positive,
            "number of sample points per area of a mesh's surface, per m2");
  table.add("seed", options.seed, {}, "random seed of the sample points on meshes");
  table.add("icp", options.icp, "align A with B by point-to-plane ICP before the comparison");
  bind(table, options.alignment);
  table.add_former_key("picture_range_m", "image_range_m");
  table.add_former_key("picture_view", "image_view");
  table.add("image_range_m", options.image_range_m, libmap::not_negative,
            "distance at the end of the image's color scale, m; 0: the 98th percentile");
  table.add("image_view", options.view.view,
            {{"top", libmap::Viewpoint::top},
             {"oblique", libmap::Viewpoint::oblique},
             {"front", libmap::Viewpoint::front},
             {"side", libmap::Viewpoint::side}},
            "viewpoint of the image, as in render --view");
}

// A cloud, or a mesh with samples of its surface.
struct Shape {
  std::optional<libmap::TriangleMesh> mesh;
  libmap::PointCloud points;
};

Shape read_shape(const std::string& file, const CompareOptions& options) {
  Shape shape;
  if (libmap::file_kind(file) == libmap::FileKind::cloud) {
    shape.points = libmap::read_cloud(file).cloud;
    return shape;
  }
  shape.mesh = libmap::read_mesh(file).mesh;
  shape.points = in_file(file, [&] {
    return libmap::points_on_surface(
        *shape.mesh, libmap::sample_triangles(*shape.mesh, options.samples_per_m2, options.seed));
  });
  return shape;
}

// Throws Error for a distant cloud, which indicates a wrong transform and would take long: the time
// to compute a distance from a mesh increases with the distance.
void require_nearness(const libmap::ReferenceSurface& surface, const libmap::PointCloud& cloud,
                      const CompareOptions& options) {
  constexpr double max_sizes = 100;
  const libmap::Bounds3d& b = surface.bounds();
  const libmap::Bounds3d a = libmap::bounds_of(cloud.positions);
  const double size = (b.max - b.min).norm();
  if (size == 0.0) return;  // the time does not depend on the distance to a point
  const double apart = ((a.max + a.min) / 2 - (b.max + b.min) / 2).norm();
  if (!(apart <= max_sizes * size))
    throw libmap::Error("A is too far from B to be compared; check the frames and --transform",
                        {.file = options.a,
                         .field = "distance of the centers",
                         .value = libmap::to_text(static_cast<float>(apart)) + " m",
                         .bound = "<= " + libmap::to_text(static_cast<float>(max_sizes * size)) +
                                  " m, 100 times the size of " + options.b});
}

libmap::ReferenceSurface reference_of(const Shape& shape, const std::string& file) {
  return in_file(file, [&] {
    return shape.mesh ? libmap::ReferenceSurface(*shape.mesh)
                      : libmap::ReferenceSurface(shape.points);
  });
}

// Transform from A to B; `crop`: from the site_from_map of both manifests.
libmap::Pose b_from_a_of(const CompareOptions& options) {
  if (options.transform != "crop") return parse_transform(options.transform, "--transform");
  const auto a_from_map = site_from_map_of(options.a);
  const auto b_from_map = site_from_map_of(options.b);
  if (!a_from_map && !b_from_map)
    throw libmap::Error("neither A nor B was cropped, so their manifests have no transform",
                        {.file = options.a,
                         .field = "--transform",
                         .value = options.transform,
                         .bound = "a manifest with " + std::string(site_from_map_name)});
  return b_from_map.value_or(libmap::Pose::Identity()) *
         a_from_map.value_or(libmap::Pose::Identity()).inverse();
}

struct Comparison {
  libmap::Pose b_from_a = libmap::Pose::Identity();
  std::optional<libmap::SurfaceAlignmentResult> alignment;
  libmap::PointCloud points;  // A's points in the box, in B's frame
  libmap::PointDistances distances;
  libmap::DistanceStatistics statistics;
  std::optional<double> bias_m;
  double precision = 0.0;     // share of A near B
  double completeness = 0.0;  // share of B near A
  // Shares of A within one and two standard deviations by its field expected_error.
  std::optional<std::array<double, 2>> within_deviations;
  std::size_t samples = 0;  // number of B's samples in the box
};

auto count_within(const std::vector<double>& distances, double bound_m) {
  return std::count_if(distances.begin(), distances.end(),
                       [&](double distance) { return distance <= bound_m; });
}

// About 0.68 and 0.95 for correct deviations and normally distributed errors.
std::optional<std::array<double, 2>> fractions_within_deviations(const Comparison& comparison) {
  const libmap::ScalarField* stated = comparison.points.find_field("expected_error");
  if (stated == nullptr || stated->values.empty()) return std::nullopt;
  std::array<double, 2> within{};
  for (std::size_t n = 0; n < stated->values.size(); ++n)
    for (std::size_t k = 0; k < within.size(); ++k)
      within[k] +=
          comparison.distances.distance_m[n] <= static_cast<double>(k + 1) * stated->values[n]
              ? 1.0
              : 0.0;
  for (double& fraction : within) fraction /= static_cast<double>(stated->values.size());
  return within;
}

// Measures the share of B's samples in the box that are near A. Parts of A outside the box count
// too, because they may cover samples at its border.
void measure_completeness(const Shape& a, const Shape& b, const CompareOptions& options,
                          const std::optional<libmap::Bounds3d>& box, Comparison& comparison) {
  const libmap::Pose a_from_b = comparison.b_from_a.inverse();
  std::vector<Eigen::Vector3d> samples;
  for (const Eigen::Vector3d& point : b.points.positions)
    if (is_inside(box, point)) samples.push_back(a_from_b * point);
  comparison.samples = samples.size();
  if (!a.mesh) {
    comparison.completeness =
        libmap::fraction_of(libmap::covered(samples, a.points.positions, options.within_m));
    return;
  }
  // Samples outside the mesh's enlarged box cannot be near; measuring them would be slow.
  const libmap::Bounds3d bounds = libmap::bounds_of(a.mesh->vertices);
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(options.within_m);
  const libmap::Bounds3d near{bounds.min - margin, bounds.max + margin};
  std::erase_if(samples, [&](const auto& point) { return !is_inside(near, point); });
  const std::vector<double> distances = libmap::distances_to_surface(samples, *a.mesh);
  if (comparison.samples > 0)
    comparison.completeness = static_cast<double>(count_within(distances, options.within_m)) /
                              static_cast<double>(comparison.samples);
}

// Aligns A after a number of quarter turns about B's z axis.
libmap::SurfaceAlignmentResult align_turned(const Shape& a, const libmap::ReferenceSurface& surface,
                                            const CompareOptions& options,
                                            const std::optional<libmap::Bounds3d>& box,
                                            const libmap::Pose& b_from_a, int quarter_turns) {
  const libmap::Pose turn =
      libmap::make_pose_from_rpy(Eigen::Vector3d::Zero(), {0.0, 0.0, 90.0 * quarter_turns});
  const libmap::PointCloud start =
      part_in_box(libmap::transform_cloud(a.points, turn * b_from_a), box, options.a);
  require_nearness(surface, start, options);
  libmap::SurfaceAlignmentResult found = in_file(
      surface.is_oriented() ? options.a : options.b,
      [&] { return libmap::align_to_surface(start.positions, surface, options.alignment); });
  found.surface_from_points = found.surface_from_points * turn;
  return found;
}

// Tries other quarter turns, because the world of true poses may have another x axis.
std::optional<libmap::SurfaceAlignmentResult> align_other_turns(
    const Shape& a, const libmap::ReferenceSurface& surface, const CompareOptions& options,
    const std::optional<libmap::Bounds3d>& box, const libmap::Pose& b_from_a, Run& run) {
  std::optional<libmap::SurfaceAlignmentResult> best;
  int turns_of_best = 0;
  for (int turns = 1; turns < 4; ++turns) {
    try {
      const auto found = align_turned(a, surface, options, box, b_from_a, turns);
      if (!found.converged || (best && best->inliers >= found.inliers)) continue;
      best = found;
      turns_of_best = turns;
    } catch (const libmap::Error&) {
      // The overlap with B is too small after this turn.
    }
  }
  if (best)
    run.warn("ICP converged only after a rotation of {} degrees about the z axis",
             90 * turns_of_best);
  return best;
}

void align(const Shape& a, const libmap::ReferenceSurface& surface, const CompareOptions& options,
           const std::optional<libmap::Bounds3d>& box, Comparison& comparison, Run& run) {
  std::exception_ptr failure;
  try {
    comparison.alignment = align_turned(a, surface, options, box, comparison.b_from_a, 0);
  } catch (const libmap::Error&) {
    failure = std::current_exception();
  }
  if (failure || !comparison.alignment->converged) {
    if (const auto turned = align_other_turns(a, surface, options, box, comparison.b_from_a, run))
      comparison.alignment = turned;
    else if (failure)
      std::rethrow_exception(failure);
  }
  const libmap::SurfaceAlignmentResult& found = *comparison.alignment;
  comparison.b_from_a = found.surface_from_points * comparison.b_from_a;
  if (!found.converged) run.warn("ICP did not converge in {} iterations", found.iterations);
  if (found.free_motions > 0)
    run.warn(
        "ICP leaves {} of 6 degrees of freedom unchanged, which the surface does not determine",
        found.free_motions);
}

Comparison compare_shapes(const Shape& a, const Shape& b, const CompareOptions& options, Run& run) {
  const auto box = parse_box(options.box);
  Comparison comparison;
  comparison.b_from_a = b_from_a_of(options);
  const libmap::ReferenceSurface surface =
      run.timed("reference", [&] { return reference_of(b, options.b); });
  if (options.icp) run.timed("icp", [&] { align(a, surface, options, box, comparison, run); });
  comparison.points =
      part_in_box(libmap::transform_cloud(a.points, comparison.b_from_a), box, options.a);
  require_nearness(surface, comparison.points, options);
  comparison.distances = run.timed(
      "distances", [&] { return libmap::distances_to(surface, comparison.points.positions); });
  const std::vector<double>& distances = comparison.distances.distance_m;
  comparison.statistics = libmap::distance_statistics(distances);
  double sum = 0.0;
  for (const double distance : comparison.distances.signed_distance_m) sum += distance;
  const auto count = static_cast<double>(distances.size());
  comparison.precision = static_cast<double>(count_within(distances, options.within_m)) / count;
  if (surface.is_oriented()) comparison.bias_m = sum / count;
  comparison.within_deviations = fractions_within_deviations(comparison);
  run.timed("completeness", [&] { measure_completeness(a, b, options, box, comparison); });
  return comparison;
}

double turn_deg(const libmap::Pose& pose) {
  return Eigen::AngleAxisd(pose.linear()).angle() * 180.0 / std::numbers::pi;
}

// Displacement of the center of A's points by ICP, m.
double moved_m(const Comparison& comparison) {
  const libmap::Bounds3d bounds = libmap::bounds_of(comparison.points.positions);
  const Eigen::Vector3d middle = (bounds.min + bounds.max) / 2;
  return (comparison.alignment->surface_from_points.inverse() * middle - middle).norm();
}

libmap::ResultTable distance_results(const Comparison& comparison) {
  libmap::ResultTable table = {{"points", comparison.statistics.count}};
  table.append("", libmap::described(comparison.statistics));
  table.add("bias_m", comparison.bias_m);
  return table;
}

libmap::ResultTable fraction_results(const Comparison& comparison) {
  libmap::ResultTable table = {{"precision", comparison.precision},
                               {"completeness", comparison.completeness}};
  if (const auto& within = comparison.within_deviations) {
    table.add("within_one_deviation", within->at(0));
    table.add("within_two_deviations", within->at(1));
  }
  return table;
}

Json json_of(const Comparison& comparison, const Shape& a, const Shape& b,
             const CompareOptions& options) {
  Json json = {{"a", options.a},
               {"a_kind", a.mesh ? "mesh" : "cloud"},
               {"b", options.b},
               {"b_kind", b.mesh ? "mesh" : "cloud"}};
  json.update(to_json(distance_results(comparison)));
  json["within_m"] = options.within_m;
  json.update(to_json(fraction_results(comparison)));
  json["surface_samples"] = comparison.samples;
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    Json numbers = Json::array();
    for (int column = 0; column < 4; ++column)
      numbers.push_back(comparison.b_from_a.matrix()(row, column));
    rows.push_back(numbers);
  }
  json["b_from_a"] = rows;
  if (!comparison.alignment) return json;
  const libmap::SurfaceAlignmentResult& found = *comparison.alignment;
  json["icp"] = {{"converged", found.converged},
                 {"iterations", found.iterations},
                 {"points", found.points},
                 {"overlap", found.overlap},
                 {"inliers", found.inliers},
                 {"rmse_m", found.rmse_m},
                 {"free_motions", found.free_motions},
                 {"curvature", found.curvature},
                 {"moved_m", moved_m(comparison)},
                 {"turned_deg", turn_deg(found.surface_from_points)}};
  return json;
}

void print(const Comparison& comparison, const Shape& a, const Shape& b,
           const CompareOptions& options) {
  if (options.json) return print_json(json_of(comparison, a, b, options));
  if (comparison.alignment) {
    const libmap::SurfaceAlignmentResult& found = *comparison.alignment;
    std::cout << fmt::format(
        "icp: {} after {} iterations, {} of {} points, rmse {:.2f} mm, moved {:.2f} mm and {:.3f} "
        "deg\ntransform: {}\n",
        found.converged ? "converged" : "not converged", found.iterations, found.inliers,
        found.points, 1e3 * found.rmse_m, 1e3 * moved_m(comparison),
        turn_deg(found.surface_from_points), transform_text(comparison.b_from_a));
  }
  const libmap::DistanceStatistics& statistics = comparison.statistics;
  std::cout << fmt::format(
      "points: {}\nrmse: {:.2f} mm\nmean: {:.2f} mm\nmedian: {:.2f} mm\n95th percentile: {:.2f} "
      "mm\nmax: {:.2f} mm\n",
      statistics.count, 1e3 * statistics.rmse_m, 1e3 * statistics.mean_m, 1e3 * statistics.median_m,
      1e3 * statistics.p95_m, 1e3 * statistics.max_m);
  if (comparison.bias_m) std::cout << fmt::format("bias: {:+.2f} mm\n", 1e3 * *comparison.bias_m);
  if (const auto& within = comparison.within_deviations)
    std::cout << fmt::format(
        "points within one and two expected errors: {:.1f} % and {:.1f} % (normal: 68.3 and "
        "95.4)\n",
        1e2 * within->at(0), 1e2 * within->at(1));
  const char* of_b = b.mesh ? "surface" : "cloud";
  std::cout << fmt::format("points within {:g} mm of the {}: {:.2f} %\n", 1e3 * options.within_m,
                           of_b, 1e2 * comparison.precision)
            << fmt::format("{} within {:g} mm of a point: {:.2f} %\n", of_b, 1e3 * options.within_m,
                           1e2 * comparison.completeness);
}

void add_results(const Comparison& comparison, Run& run) {
  run.manifest().frame = "b";
  run.manifest().transforms.emplace_back("b_from_a", comparison.b_from_a);
  run.add_results(distance_results(comparison));
  run.add_results(fraction_results(comparison));
  if (!comparison.alignment) return;
  const libmap::SurfaceAlignmentResult& found = *comparison.alignment;
  run.add_results({{"icp_converged", found.converged},
                   {"icp_iterations", found.iterations},
                   {"icp_overlap", found.overlap},
                   {"icp_inliers", found.inliers},
                   {"icp_rmse_m", found.rmse_m},
                   {"icp_free_motions", found.free_motions}});
}

// Image of A's points, colored by their signed distance in millimeters.
libmap::ColorImage image_of(const Comparison& comparison, const CompareOptions& options) {
  const bool has_sides = comparison.bias_m.has_value();
  const std::string name = has_sides ? "signed distance [mm]" : "distance [mm]";
  libmap::PointCloud cloud;
  cloud.positions = comparison.points.positions;
  libmap::ScalarField& field = cloud.add_field(name, libmap::ScalarType::float32);
  for (std::size_t n = 0; n < cloud.size(); ++n)
    field.values[n] = 1e3 * comparison.distances.signed_distance_m[n];
  libmap::SceneLayer layer;
  layer.shape = std::move(cloud);
  layer.coloring.mode = libmap::ColorMode::field;
  layer.coloring.field = name;
  if (has_sides) layer.coloring.scale = libmap::ColorScale::diverging;
  layer.coloring.range_max = 1e3 * options.image_range_m;
  layer.coloring.range_min = has_sides ? -layer.coloring.range_max : 0.0;
  libmap::Scene scene;
  scene.layers.push_back(std::move(layer));
  libmap::SceneViewOptions view = options.view;
  view.title = fmt::format(
      "{} to {}: RMSE {:.2f} mm", std::filesystem::path(options.a).filename().string(),
      std::filesystem::path(options.b).filename().string(), 1e3 * comparison.statistics.rmse_m);
  return libmap::render_scene(std::move(scene), view);
}

void write_outputs(Comparison& comparison, const CompareOptions& options, Run& run) {
  if (options.output.empty() && options.image.empty()) return;
  run.add_input(options.a);
  run.add_input(options.b);
  if (std::filesystem::is_regular_file(options.transform)) run.add_input(options.transform);
  run.manifest().parameters.emplace_back("transform", options.transform);
  run.manifest().parameters.emplace_back("box", options.box);
  add_results(comparison, run);
  if (!options.image.empty()) {
    const libmap::ColorImage image =
        run.timed("picture", [&] { return image_of(comparison, options); });
    run.write_text(options.image, libmap::to_png(image));
  }
  if (options.output.empty()) return;
  libmap::PointCloud& cloud = comparison.points;
  cloud.add_field("distance", libmap::ScalarType::float32).values = comparison.distances.distance_m;
  if (comparison.bias_m)
    cloud.add_field("signed_distance", libmap::ScalarType::float32).values =
        comparison.distances.signed_distance_m;
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
}

void compare(const CompareOptions& options, Run& run) {
  if (!options.output.empty()) {
    libmap::require_cloud_format(options.output);
    run.claim_output(options.output, {options.a, options.b, options.transform});
  }
  if (!options.image.empty()) {
    if (libmap::format_of(options.image) != ".png")
      throw libmap::Error("images are written as .png", {.file = options.image});
    run.claim_output(options.image, {options.a, options.b, options.transform});
  }
  const Shape a = run.timed("read", [&] { return read_shape(options.a, options); });
  const Shape b = run.timed("read", [&] { return read_shape(options.b, options); });
  Comparison comparison = compare_shapes(a, b, options, run);
  print(comparison, a, b, options);
  write_outputs(comparison, options, run);
}

int compare_surfaces(int argc, char** argv) {
  CompareOptions options;
  Command command("compare");
  command.input("A", options.a, "measured cloud or mesh (.pcd .ply .csv .obj .stl .off .glb)");
  command.input("B", options.b, "reference surface: a mesh or a cloud");
  command.output(options.output,
                 "A's points in B's frame with the fields distance and signed_distance, m", false);
  command.renamed_flag("--picture", "--image");
  command.option("--image", "FILE.png", options.image,
                 "image of A's points, colored by their signed distance from B");
  command.option("--transform", "X,Y,Z,ROLL,PITCH,YAW|FILE|crop", options.transform,
                 "transform from A's frame to B's: m and degrees about the fixed axes, roll first; "
                 "a file of four rows of four numbers, as crop writes; crop: from the manifests, "
                 "if A, B or both were cropped from one map");
  command.option("--box", "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX", options.box,
                 "box in B's frame, m; only points inside it are compared");
  command.flag("--json", options.json, "print the results as JSON");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { compare(options, run); });
}

}  // namespace

int main(int argc, char** argv) {
  const bool edges =
      std::any_of(argv, argv + argc, [](const std::string& word) { return word == "--edges"; });
  return run_subcommand(argc, argv, {compare_surfaces, compare_edges},
                        edges ? compare_edges : compare_surfaces);
}
