// graspmap crop: a map levelled and cut to the test site.
#include "libmap/mesh/crop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/placement.h"

namespace {

namespace fs = std::filesystem;
using graspmap_tools::Run;
using libmap::CropRegion;

struct CropCommandOptions {
  std::string input;
  std::string output;
  std::string box;
  std::string polygon;
  std::string size;
  bool border = false;
  std::string up = "auto";
  std::string yaw = "auto";
  bool level = true;
  libmap::CropOptions crop;
};

void bind(libmap::ParameterTable& table, CropCommandOptions& options) {
  table.add("level", options.level, {{"auto", true}, {"none", false}},
            "auto: the ground becomes z = 0; none: the map's own z stays");
  table.add("up", options.up, "which way is up: auto, or a direction X,Y,Z in the map");
  table.add("frame", options.crop.frame,
            {{"level", libmap::CropFrame::level}, {"map", libmap::CropFrame::map}},
            "frame of --box and --polygon: levelled and turned, or as the map came");
  table.add("yaw_deg", options.yaw,
            "turn about z, degrees; auto: with --size and --border, so that the sides lie along x "
            "and y, else none");
  bind(table, options.crop);
}

libmap::Bounds3d box_of(const std::string& text) {
  const char* bound = "XMIN,YMIN,XMAX,YMAX or XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX in meters";
  constexpr double open = std::numeric_limits<double>::infinity();
  const std::vector<double> n = std::count(text.begin(), text.end(), ',') == 5
                                    ? graspmap_tools::parse_numbers(text, 6, "--box", bound)
                                    : graspmap_tools::parse_numbers(text, 4, "--box", bound);
  libmap::Bounds3d box = n.size() == 6 ? libmap::Bounds3d{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}}
                                       : libmap::Bounds3d{{n[0], n[1], -open}, {n[2], n[3], open}};
  if (!(box.min.array() < box.max.array()).all())
    throw libmap::Error("the box is inside out or empty",
                        {.field = "--box", .value = text, .bound = bound});
  return box;
}

Eigen::Vector2d size_of(const std::string& text) {
  const std::size_t by = text.find_first_of("xX");
  const auto x = libmap::parse_double(text.substr(0, by));
  const auto y = by == std::string::npos ? x : libmap::parse_double(text.substr(by + 1));
  if (!x || !y || !(*x > 0.0) || !(*y > 0.0) || !std::isfinite(*x) || !std::isfinite(*y))
    throw libmap::Error(
        "no such size",
        {.field = "--size", .value = text, .bound = "WIDTHxHEIGHT in meters, each > 0, e.g. 3x3"});
  return {*x, *y};
}

std::vector<Eigen::Vector2d> polygon_of(const std::string& file) {
  const libmap::Table table = libmap::read_csv(file);
  const std::size_t x = table.column("x");
  const std::size_t y = table.column("y");
  std::vector<Eigen::Vector2d> corners;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    corners.emplace_back(table.number(row, x), table.number(row, y));
  try {
    return libmap::Outline(corners).corners();
  } catch (const libmap::Error& error) {
    throw error.in_file(file);
  }
}

void read_region(CropCommandOptions& options) {
  libmap::CropOptions& crop = options.crop;
  const auto is_given = [](const std::string& text) { return text.empty() ? 0 : 1; };
  if (is_given(options.box) + is_given(options.polygon) + is_given(options.size) +
          (options.border ? 1 : 0) >
      1)
    throw libmap::Error("the cut is given in more than one way",
                        {.bound = "one of --box, --polygon, --size and --border"});
  if (!options.box.empty()) {
    crop.region = CropRegion::box;
    crop.box = box_of(options.box);
  } else if (!options.polygon.empty()) {
    crop.region = CropRegion::polygon;
    crop.polygon = polygon_of(options.polygon);
  } else if (!options.size.empty()) {
    crop.region = CropRegion::size;
    crop.size_m = size_of(options.size);
  } else if (options.border) {
    crop.region = CropRegion::border;
  }
  crop.level = options.level;
  if (options.up != "auto" && !crop.level)
    throw libmap::Error("is for levelling, which --level none leaves out",
                        {.file = {}, .field = "--up", .value = options.up});
  if (options.up != "auto") crop.up = graspmap_tools::parse_vector(options.up, "--up");
  if (options.yaw != "auto") {
    crop.yaw_deg = libmap::parse_double(options.yaw);
    if (!crop.yaw_deg || !std::isfinite(*crop.yaw_deg))
      throw libmap::Error("not an angle",
                          {.field = "--yaw", .value = options.yaw, .bound = "auto or degrees"});
  }
  if (crop.region == CropRegion::whole && !crop.level && !crop.yaw_deg && !crop.center)
    throw libmap::Error("there is nothing to do: neither level nor cut",
                        {.field = "--level", .value = "none"});
}

// "site.ply" -> "site.site_from_map.txt".
fs::path transform_path(const std::string& output) {
  fs::path path = output;
  return path.replace_extension(".site_from_map.txt");
}

// The rows of the matrix, as CloudCompare and PCL read it.
std::string matrix_text(const libmap::Pose& pose) {
  std::string text;
  for (Eigen::Index row = 0; row < 4; ++row)
    for (Eigen::Index column = 0; column < 4; ++column)
      text += libmap::to_text(pose.matrix()(row, column)) + (column == 3 ? "\n" : " ");
  return text;
}

double degrees_from_z(const Eigen::Vector3d& unit) {
  return std::atan2(unit.head<2>().norm(), unit.z()) * 180.0 / std::numbers::pi;
}

void tell_ground(const libmap::CropReport& report, bool up_by_normals, Run& run) {
  if (!report.ground) return;
  const libmap::GroundPlane& ground = *report.ground;
  const double tilt = degrees_from_z(ground.normal);
  run.manifest().results.emplace_back("ground_tilt_deg", tilt);
  run.manifest().results.emplace_back("ground_rmse_m", ground.rmse_m);
  run.manifest().results.emplace_back("ground_share", ground.share);
  run.manifest().results.emplace_back(
      "up", std::vector<double>{report.up.x(), report.up.y(), report.up.z()});
  run.say(fmt::format("ground: {:.2f} deg from the map's z, {:.1f} mm RMSE over {:.1f} % of it",
                      tilt, 1e3 * ground.rmse_m, 1e2 * ground.share));
  if (tilt > 45.0 && up_by_normals)
    run.warn(
        fmt::format("the map's z lies {:.0f} deg from up as its normals say; --up 0,0,1 takes "
                    "the map's z",
                    tilt));
}

void tell_site(const libmap::CropReport& report, const std::vector<Eigen::Vector3d>& positions,
               Run& run) {
  auto& results = run.manifest().results;
  const libmap::Bounds3d bounds = libmap::bounds_of(positions);
  const Eigen::Vector3d size = bounds.max - bounds.min;
  results.emplace_back("size_m", std::vector<double>{size.x(), size.y(), size.z()});
  if (report.rectangle) {
    results.emplace_back("site_yaw_deg", report.rectangle->yaw_deg);
    results.emplace_back("site_clearance_m", report.rectangle->clearance_m);
    run.say(fmt::format("site: turned by {:.2f} deg, {:.2f} m of data around it",
                        report.rectangle->yaw_deg, report.rectangle->clearance_m));
  }
  if (report.band) {
    results.emplace_back("band_seen", report.band->seen);
    results.emplace_back("white_level", report.band->white_level);
    run.say(fmt::format("border: white (>= {:.0f}) along {:.0f} % of the least seen side",
                        report.band->white_level, 1e2 * report.band->seen));
  }
  if (!report.outline.empty()) {
    std::vector<double> corners;
    for (const Eigen::Vector2d& corner : report.outline)
      corners.insert(corners.end(), {corner.x(), corner.y()});
    results.emplace_back("outline_area_m2", libmap::Outline(report.outline).area_m2());
    results.emplace_back("outline_m", std::move(corners));
  }
  run.say(fmt::format("size: {:.3f} x {:.3f} x {:.3f} m", size.x(), size.y(), size.z()));
}

// The input's own site_from_map, if it was cropped before, stands behind the new one.
void add_transform(const CropCommandOptions& options, const libmap::CropReport& report, Run& run) {
  const libmap::Pose before =
      graspmap_tools::site_from_map_of(options.input).value_or(libmap::Pose::Identity());
  run.manifest().transforms.emplace_back(graspmap_tools::site_from_map_name,
                                         report.site_from_map * before);
  graspmap_tools::carry_truth_transform(options.input, run);
  run.manifest().frame = "site";
}

template <typename Write>
void write_site(const CropCommandOptions& options, Run& run, const Write& write) {
  const std::string matrix =
      matrix_text(*run.manifest().find_transform(graspmap_tools::site_from_map_name));
  run.write_outputs(options.output, {{transform_path(options.output),
                                      [&](const fs::path& to) { libmap::write_text(to, matrix); }},
                                     {options.output, write}});
}

void add_inputs(const CropCommandOptions& options, Run& run) {
  run.add_input(options.input);
  if (!options.polygon.empty()) run.add_input(options.polygon);
}

void crop_cloud(const CropCommandOptions& options, Run& run) {
  const libmap::CloudReadResult read = libmap::read_cloud(options.input);
  add_inputs(options, run);
  if (read.dropped_points > 0)
    run.warn(fmt::format("{} points without a position were dropped", read.dropped_points));
  const libmap::CropCloudResult result =
      run.timed("crop", [&] { return libmap::crop_cloud(read.cloud, options.crop); });
  add_transform(options, result.report, run);
  tell_ground(result.report, !options.crop.up, run);
  tell_site(result.report, result.cloud.positions, run);
  run.manifest().results.emplace_back("points", static_cast<std::int64_t>(result.cloud.size()));
  run.say(fmt::format("{} of {} points", result.cloud.size(), read.cloud.size()));
  write_site(options, run, [&](const fs::path& to) { libmap::write_cloud(to, result.cloud); });
}

void crop_mesh(const CropCommandOptions& options, Run& run) {
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.input).mesh;
  add_inputs(options, run);
  const libmap::CropMeshResult result =
      run.timed("crop", [&] { return libmap::crop_mesh(mesh, options.crop); });
  add_transform(options, result.report, run);
  tell_ground(result.report, !options.crop.up, run);
  tell_site(result.report, result.mesh.vertices, run);
  const double area = libmap::surface_area(result.mesh);
  auto& results = run.manifest().results;
  results.emplace_back("surface_area_m2", area);
  results.emplace_back("vertices", static_cast<std::int64_t>(result.mesh.vertices.size()));
  results.emplace_back("triangles", static_cast<std::int64_t>(result.mesh.triangles.size()));
  run.say(fmt::format("{} of {} triangles, {:.3f} m2 of surface", result.mesh.triangles.size(),
                      mesh.triangles.size(), area));
  write_site(options, run, [&](const fs::path& to) { libmap::write_mesh(to, result.mesh); });
}

void crop(CropCommandOptions& options, Run& run) {
  read_region(options);
  const bool is_mesh = libmap::file_kind(options.input) == libmap::FileKind::mesh;
  if (is_mesh)
    libmap::require_mesh_format(options.output);
  else
    libmap::require_cloud_format(options.output);
  std::vector<std::string> inputs = {options.input};
  if (!options.polygon.empty()) inputs.push_back(options.polygon);
  run.claim_output(options.output, inputs);
  run.require_own_companions(options.output, {transform_path(options.output)});
  run.manifest().parameters.emplace_back("box", options.box);
  run.manifest().parameters.emplace_back("polygon", options.polygon);
  run.manifest().parameters.emplace_back("size", options.size);
  run.manifest().parameters.emplace_back("border", options.border);
  try {
    is_mesh ? crop_mesh(options, run) : crop_cloud(options, run);
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(options.input) : error;
  }
}

}  // namespace

int main(int argc, char** argv) {
  CropCommandOptions options;
  graspmap_tools::Command command("crop");
  command.input("MAP", options.input, "mesh (.ply .obj .stl ...) or cloud (.pcd .ply .csv)");
  command.output(options.output,
                 "the site, of the same kind; OUTPUT's stem + .site_from_map.txt is the transform");
  command.option("--box", "XMIN,YMIN[,ZMIN],XMAX,YMAX[,ZMAX]", options.box, "keep what is in it");
  command.option("--polygon", "FILE.csv", options.polygon,
                 "keep what stands on it: columns x, y, in order round it, convex or not");
  command.option("--size", "WIDTHxHEIGHT", options.size,
                 "keep the rectangle of this size that lies best centered in the data, m");
  command.flag("--border", options.border, "keep what a white band on the ground frames");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { crop(options, run); });
}
