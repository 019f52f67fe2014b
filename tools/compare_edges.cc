// graspmap compare SITE --edges: height errors along the four edges of a site.
#include <iostream>
#include <nlohmann/json.hpp>

#include "libmap/core/table.h"
#include "libmap/geometry/normal_sides.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/site/edge_check.h"
#include "libmap/site/ground_plane.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/placement.h"
#include "tools/support/results.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

using Json = nlohmann::ordered_json;

// "Graspable Target Detection for Hexapod Robots" (2023), table B 2-2: mean of 28 places.
constexpr double published_mean_m = 0.040;
constexpr const char* edge_names[] = {"a", "b", "c", "d"};

// Reference of heights. automatic: z = 0 for a leveled site (by its manifest), else fit.
enum class Ground { automatic, zero, fit };
enum class SiteOutline { axes, turned };
// Frame of the true mesh: that of the site, or of the map that the site was cropped from.
enum class TruthFrame { site, map };

struct SpotCheckCommandOptions {
  std::string file;
  std::string output;
  std::string truth;
  std::string box;
  Ground ground = Ground::automatic;
  SiteOutline outline = SiteOutline::axes;
  TruthFrame truth_frame = TruthFrame::site;
  double radius_m = 0.02;
  int min_points = 3;
  libmap::EdgeCheckOptions check;
  libmap::GroundPlaneOptions plane;
  bool json = false;
};

void bind(libmap::ParameterTable& table, SpotCheckCommandOptions& options) {
  bind(table, options.check);
  table.add("radius_m", options.radius_m, libmap::positive,
            "for a cloud: horizontal radius of the points whose median is a location's height, m");
  table.add("min_points", options.min_points, {1.0, 1e9},
            "for a cloud: minimum number of points around a location to determine its height");
  table.add("outline", options.outline,
            {{"axes", SiteOutline::axes}, {"turned", SiteOutline::turned}},
            "outline of the site, the smallest rectangle around the data; axes: parallel to x and "
            "y; turned: in any direction");
  table.add(
      "ground", options.ground,
      {{"auto", Ground::automatic}, {"zero", Ground::zero}, {"fit", Ground::fit}},
      "reference of heights; zero: z = 0; fit: fitted plane; auto: zero if the manifest contains "
      "the transform of a site or terrain frame, else fit");
  table.add("truth_frame", options.truth_frame,
            {{"site", TruthFrame::site}, {"map", TruthFrame::map}},
            "frame of the true surface; site: frame of the site; map: frame of the map from which "
            "the site was cropped");
  bind(table, options.plane);
}

struct EdgeData {
  std::optional<libmap::TriangleMesh> mesh{};
  libmap::PointCloud cloud{};
};

EdgeData read_edge_data(const std::string& file) {
  EdgeData shape;
  if (libmap::file_kind(file) == libmap::FileKind::mesh)
    shape.mesh = libmap::read_mesh(file).mesh;
  else
    shape.cloud = libmap::read_cloud(file).cloud;
  return shape;
}

struct Check {
  libmap::SiteCorners site;
  libmap::EdgeCheckResult result;
  std::string ground;  // reference of the heights
  std::optional<libmap::GroundPlane> plane{};
};

// Reads the true mesh in the frame of the site.
libmap::TriangleMesh read_truth(const SpotCheckCommandOptions& options) {
  libmap::TriangleMesh truth = libmap::read_mesh(options.truth).mesh;
  if (options.truth_frame == TruthFrame::site) return truth;
  const auto site_from_map = site_from_map_of(options.file);
  if (!site_from_map)
    throw libmap::Error("the manifest of the site has no transform from a map (graspmap crop)",
                        {.file = options.file, .field = "--truth-frame", .value = "map"});
  return libmap::transform_mesh(truth, *site_from_map);
}

// Fits the ground plane to evenly distributed points.
libmap::GroundPlane fit_ground(const EdgeData& shape, libmap::GroundPlaneOptions options) {
  constexpr double samples = 100000;
  const libmap::PointCloud cloud =
      shape.mesh ? libmap::points_on_surface(
                       *shape.mesh,
                       libmap::sample_triangles(
                           *shape.mesh, samples / libmap::surface_area(*shape.mesh), options.seed))
                 : shape.cloud;
  options.up = libmap::up_of_normals(cloud.positions, cloud.normals).direction;
  return libmap::find_ground_plane(cloud.positions, options);
}

// Returns the reference of heights; the data is transformed so that a fitted plane is z = 0.
libmap::HeightFunction find_ground(const SpotCheckCommandOptions& options, EdgeData& shape,
                                   Check& check, Run& run) {
  if (!options.truth.empty()) {
    check.ground = options.truth;
    const libmap::TriangleMesh truth = read_truth(options);
    run.add_input(options.truth);
    return libmap::heights_of(truth);
  }
  const bool zero = options.ground == Ground::zero ||
                    (options.ground == Ground::automatic && site_from_map_of(options.file));
  check.ground = zero ? "z = 0" : "fitted plane";
  libmap::HeightFunction at_zero = [](const Eigen::Vector2d&) { return 0.0; };
  if (zero) return at_zero;
  check.plane = run.timed("ground", [&] { return fit_ground(shape, options.plane); });
  const libmap::Pose level_from_map = libmap::level_from_map(*check.plane);
  run.info("ground: a plane tilted by {:.2f} deg, {} points, RMSE {:.1f} mm", check.plane->tilt_deg,
           check.plane->inliers, 1e3 * check.plane->rmse_m);
  run.manifest().transforms.emplace_back("level_from_map", level_from_map);
  if (shape.mesh)
    shape.mesh = libmap::transform_mesh(*shape.mesh, level_from_map);
  else
    shape.cloud = libmap::transform_cloud(shape.cloud, level_from_map);
  return at_zero;
}

// Returns the heights of the data, in the box if there is one.
libmap::HeightFunction heights_in(const std::optional<libmap::Bounds3d>& box, EdgeData& shape,
                                  const SpotCheckCommandOptions& options) {
  if (!shape.mesh) {
    if (box)
      std::erase_if(shape.cloud.positions, [&](const Eigen::Vector3d& point) {
        return point.z() < box->min.z() || point.z() > box->max.z();
      });
    return libmap::heights_of(shape.cloud.positions, options.radius_m, options.min_points);
  }
  if (!box) return libmap::heights_of(*shape.mesh);
  return [heights = libmap::heights_of(*shape.mesh, box->max.z()),
          bottom = box->min.z()](const Eigen::Vector2d& position) {
    const std::optional<double> height = heights(position);
    return height && *height >= bottom ? height : std::nullopt;
  };
}

Check check_site(const SpotCheckCommandOptions& options, Run& run) {
  EdgeData shape = read_edge_data(options.file);
  Check check;
  in_file(options.file, [&] {
    const libmap::HeightFunction ground = find_ground(options, shape, check, run);
    const auto box = parse_box(options.box);
    check.site =
        box ? libmap::corners_of(box->min.head<2>(), box->max.head<2>())
            : libmap::bounding_corners(shape.mesh ? shape.mesh->vertices : shape.cloud.positions,
                                       options.outline == SiteOutline::turned);
    const libmap::HeightFunction heights = heights_in(box, shape, options);
    check.result = run.timed(
        "check", [&] { return libmap::check_edges(check.site, heights, ground, options.check); });
  });
  return check;
}

std::string cell_of(const std::optional<double>& value) {
  return value ? libmap::to_fixed_text(std::abs(*value), 4) : "";
}

libmap::Table table_of(const libmap::EdgeCheckResult& result) {
  libmap::Table table;
  table.columns = {"edge"};
  for (std::size_t n = 1; n <= result.edges[0].size(); ++n)
    table.columns.push_back("e" + std::to_string(n) + "_m");
  table.columns.emplace_back("mean_m");
  for (std::size_t e = 0; e < result.edges.size(); ++e) {
    std::vector<std::string>& row = table.rows.emplace_back();
    row.emplace_back(edge_names[e]);
    for (const libmap::EdgeCheckPoint& edge_point : result.edges[e])
      row.push_back(cell_of(edge_point.error_m()));
    row.push_back(cell_of(result.mean_m[e]));
  }
  return table;
}

libmap::ResultTable results_of(const libmap::EdgeCheckResult& result) {
  return {{"measured", result.measured},
          {"missing", result.missing},
          {"mean_m", result.mean_abs_error_m},
          {"mean_signed_m", result.mean_error_m},
          {"max_m", result.max_abs_error_m}};
}

Json check_json(const Check& check, const SpotCheckCommandOptions& options) {
  const libmap::EdgeCheckResult& result = check.result;
  Json edges = Json::array();
  for (std::size_t e = 0; e < result.edges.size(); ++e) {
    Json points = Json::array();
    for (const libmap::EdgeCheckPoint& edge_point : result.edges[e])
      points.push_back(to_json({{"x_m", edge_point.position.x()},
                                {"y_m", edge_point.position.y()},
                                {"z_m", edge_point.height_m},
                                {"ground_m", edge_point.ground_m},
                                {"error_m", edge_point.error_m()}}));
    edges.push_back(to_json({{"edge", edge_names[e]}, {"mean_m", result.mean_m[e]}}));
    edges.back()["positions"] = points;
  }
  Json corners = Json::array();
  for (const Eigen::Vector2d& corner : check.site.corners)
    corners.push_back({corner.x(), corner.y()});
  Json json = {
      {"file", options.file}, {"ground", check.ground}, {"corners_m", corners}, {"edges", edges}};
  json.update(to_json(results_of(result)));
  json["published_mean_m"] = published_mean_m;
  return json;
}

void print_check(const Check& check, const SpotCheckCommandOptions& options) {
  const libmap::EdgeCheckResult& result = check.result;
  if (options.json) return print_json(check_json(check, options));
  std::cout << fmt::format("height error in m along the edges (ground: {})\n{:<6}", check.ground,
                           "edge");
  for (std::size_t n = 1; n <= result.edges[0].size(); ++n)
    std::cout << fmt::format("{:>8}", "e" + std::to_string(n));
  std::cout << fmt::format("{:>8}\n", "mean");
  const libmap::Table table = table_of(result);
  for (const std::vector<std::string>& row : table.rows) {
    std::cout << fmt::format("{:<6}", row[0]);
    for (std::size_t n = 1; n < row.size(); ++n)
      std::cout << fmt::format("{:>8}", row[n].empty() ? "-" : row[n]);
    std::cout << "\n";
  }
  std::cout << fmt::format("mean of {} locations: {:.4f} m, largest {:.4f} m\n", result.measured,
                           result.mean_abs_error_m, result.max_abs_error_m);
  if (result.missing > 0) std::cout << fmt::format("locations without data: {}\n", result.missing);
  std::cout << fmt::format("published (thesis of 2023, table B 2-2, mean of 28): {:.3f} m\n",
                           published_mean_m);
}

void edge_check(const SpotCheckCommandOptions& options, Run& run) {
  if (!options.output.empty()) {
    if (libmap::format_of(options.output) != ".csv")
      throw libmap::Error("tables are written as .csv", {.file = options.output});
    run.claim_output(options.output, {options.file, options.truth});
  }
  if (!options.truth.empty() && options.ground != Ground::automatic)
    throw libmap::Error("cannot be combined with --truth", {.field = "--ground"});
  const Check check = check_site(options, run);
  print_check(check, options);
  if (options.output.empty()) return;
  run.add_input(options.file);
  libmap::Manifest& manifest = run.manifest();
  manifest.parameters.emplace_back("truth", options.truth);
  manifest.parameters.emplace_back("box", options.box);
  manifest.frame = check.plane ? "level" : "input";
  run.add_results({{"ground", check.ground}});
  run.add_results(results_of(check.result));
  run.write_text(options.output, libmap::to_csv(table_of(check.result)));
}

}  // namespace

int graspmap_tools::compare_edges(int argc, char** argv) {
  SpotCheckCommandOptions options;
  bool edges = true;
  Command command("compare",
                  "With --edges: measures height errors along the four edges of a site: a (y = "
                  "min), then counter-clockwise b (x = max), c (y = max), d (x = min).");
  command.flag("--edges", edges, "measure height errors along the four edges of one site");
  command.input("SITE", options.file, "cloud or mesh of the site");
  command.output(options.output, "table of height errors: edge, e1_m, ..., mean_m (.csv)", false);
  command.option("--truth", "MESH", options.truth,
                 "true surface as the reference of heights (see --truth-frame)");
  command.option("--box", "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX", options.box,
                 "extent of the site, m, instead of a rectangle around all data");
  command.flag("--json", options.json, "print the results as JSON, with each location");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { edge_check(options, run); });
}
