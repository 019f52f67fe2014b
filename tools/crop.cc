// graspmap crop: levels a map and crops it to the test site.
#include "libmap/site/crop.h"

#include <limits>
#include <numbers>

#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/option_values.h"
#include "tools/support/tile_folder.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using libmap::CropRegion;

struct CropCommandOptions {
  std::string input;
  std::string output;
  std::string box;
  std::string polygon;
  std::string size;
  bool border = false;
  std::string border_size;
  std::string up = "auto";
  std::string yaw = "auto";
  bool level = true;
  libmap::CropOptions crop;
};

void bind(libmap::ParameterTable& table, CropCommandOptions& options) {
  table.add("level", options.level, {{"auto", true}, {"none", false}},
            "leveling of the site; auto: the ground becomes z = 0; none: the map's z is unchanged");
  table.add("up", options.up,
            "up direction: X,Y,Z in the input map's frame; auto: by its normals, else its z axis");
  table.add("frame", options.crop.frame,
            {{"level", libmap::CropFrame::level}, {"map", libmap::CropFrame::map}},
            "frame of the box or polygon to keep; level: after leveling and rotation; map: frame "
            "of the input map");
  table.add("yaw_deg", options.yaw,
            "rotation of the site about z, degrees; auto: with --size or --border, such that the "
            "sides are parallel to x and y, else none");
  bind(table, options.crop);
}

libmap::Bounds3d box_of(const std::string& text) {
  const char* bound = "XMIN,YMIN,XMAX,YMAX or XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX in meters";
  constexpr double open = std::numeric_limits<double>::infinity();
  const std::size_t count = std::count(text.begin(), text.end(), ',') == 5 ? 6 : 4;
  const std::vector<double> n = parse_numbers(text, count, "--box", bound);
  libmap::Bounds3d box = n.size() == 6 ? libmap::Bounds3d{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}}
                                       : libmap::Bounds3d{{n[0], n[1], -open}, {n[2], n[3], open}};
  if (!(box.min.array() < box.max.array()).all())
    throw libmap::Error("a minimum of the box is not below its maximum",
                        {.field = "--box", .value = text, .bound = bound});
  return box;
}

Eigen::Vector2d size_of(const std::string& text, const std::string& field) {
  if (const auto size = split_size(text)) return *size;
  throw libmap::Error(
      "not a size",
      {.field = field, .value = text, .bound = "WIDTHxHEIGHT in meters, each > 0, e.g. 3x3"});
}

std::vector<Eigen::Vector2d> polygon_of(const std::string& file) {
  const libmap::Table table = libmap::read_csv(file);
  const std::size_t x = table.column("x");
  const std::size_t y = table.column("y");
  std::vector<Eigen::Vector2d> corners;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    corners.emplace_back(table.number(row, x), table.number(row, y));
  return in_file(file, [&] { return libmap::XyPolygon(corners).corners(); });
}

void read_region(CropCommandOptions& options) {
  libmap::CropOptions& crop = options.crop;
  const auto is_given = [](const std::string& text) { return text.empty() ? 0 : 1; };
  if (is_given(options.box) + is_given(options.polygon) + is_given(options.size) +
          (options.border ? 1 : 0) >
      1)
    throw libmap::Error("--box, --polygon, --size and --border exclude each other");
  if (!options.box.empty()) {
    crop.region = CropRegion::box;
    crop.box = box_of(options.box);
  } else if (!options.polygon.empty()) {
    crop.region = CropRegion::polygon;
    crop.polygon = polygon_of(options.polygon);
  } else if (!options.size.empty()) {
    crop.region = CropRegion::size;
    crop.size_m = size_of(options.size, "--size");
  } else if (options.border) {
    crop.region = CropRegion::border;
  }
  if (!options.border_size.empty()) {
    if (!options.border)
      throw libmap::Error("requires --border",
                          {.field = "--border-size", .value = options.border_size});
    crop.border_size_m = size_of(options.border_size, "--border-size");
  }
  crop.level = options.level;
  if (options.up != "auto" && !crop.level)
    throw libmap::Error("cannot be combined with --level none",
                        {.field = "--up", .value = options.up});
  if (options.up != "auto") crop.up = parse_vector(options.up, "--up");
  crop.yaw_deg = parse_number_or("auto", options.yaw, "not an angle", "--yaw", "auto or degrees");
  if (crop.region == CropRegion::whole && !crop.level && !crop.yaw_deg && !crop.center)
    throw libmap::Error("requires a region to crop, --yaw or --center",
                        {.field = "--level", .value = "none"});
}

// "site.ply" -> "site.site_from_map.txt".
fs::path transform_path(const std::string& output) {
  fs::path path = output;
  return path.replace_extension(".site_from_map.txt");
}

// Rows of the matrix in the format of CloudCompare and PCL.
std::string matrix_text(const libmap::Pose& pose) {
  std::string text;
  for (Eigen::Index row = 0; row < 4; ++row)
    for (Eigen::Index column = 0; column < 4; ++column)
      text += libmap::to_text(pose.matrix()(row, column)) + (column == 3 ? "\n" : " ");
  return text;
}

void tell_ground(const std::string& input, const libmap::CropReport& report, Run& run) {
  if (!report.ground) return;
  const libmap::GroundPlane& ground = *report.ground;
  const double tilt =
      std::atan2(ground.normal.head<2>().norm(), ground.normal.z()) * 180.0 / std::numbers::pi;
  run.add_results({{"ground_tilt_deg", tilt},
                   {"ground_rmse_m", ground.rmse_m},
                   {"ground_share", ground.fraction},
                   {"up", report.up}});
  run.info("ground: {:.2f} deg from the map's z, {:.1f} mm RMSE of {:.1f} % of the points", tilt,
           1e3 * ground.rmse_m, 1e2 * ground.fraction);
  if (!report.up_of_normals) return;
  const libmap::UpOfNormals& by_normals = *report.up_of_normals;
  if (by_normals.fraction > 0.0) run.add_results({{"up_normals_share", by_normals.fraction}});
  if (by_normals.fraction > 0.0 && !by_normals.decided)
    run.warn("{}: {}: up is the map's z; --up X,Y,Z sets it", input,
             libmap::disagreement_text(by_normals.fraction, by_normals.opposing));
  else if (tilt > 45.0)
    run.warn("up by the normals is {:.0f} deg from the map's z; --up 0,0,1 selects the map's z",
             tilt);
}

void tell_scale(const libmap::BorderBand& band, const libmap::BorderScale& scale, Run& run) {
  run.add_results(
      {{"border_sides_m", std::vector<double>(band.sides_m.begin(), band.sides_m.end())},
       {"border_scale", scale.factor},
       {"border_scale_deviation", scale.deviation}});
  run.info(
      "border: sides of {:.4f} m determine the scale x {:.5f} +- {:.5f}; refine --scale {:.5f} "
      "applies it to poses and depth",
      fmt::join(band.sides_m, ", "), scale.factor, scale.deviation, scale.factor);
}

void tell_site(const libmap::CropReport& report, const libmap::Bounds3d& bounds, Run& run) {
  const Eigen::Vector3d size = bounds.max - bounds.min;
  run.add_results({{"size_m", size}});
  if (report.rectangle) {
    run.add_results({{"site_yaw_deg", report.rectangle->yaw_deg},
                     {"site_clearance_m", report.rectangle->clearance_m}});
    run.info("site: rotated by {:.2f} deg, {:.2f} m of data around it", report.rectangle->yaw_deg,
             report.rectangle->clearance_m);
  }
  if (report.band) {
    run.add_results({{"band_seen", report.band->seen}, {"white_level", report.band->white_level}});
    run.info("border: white (gray >= {:.0f}) along {:.0f} % of the least visible side",
             report.band->white_level, 1e2 * report.band->seen);
  }
  if (report.border_scale) tell_scale(*report.band, *report.border_scale, run);
  if (!report.outline.empty()) {
    std::vector<double> corners;
    for (const Eigen::Vector2d& corner : report.outline)
      corners.insert(corners.end(), {corner.x(), corner.y()});
    run.add_results(
        {{"outline_area_m2", libmap::XyPolygon(report.outline).area_m2()}, {"outline_m", corners}});
  }
  run.info("size: {:.3f} x {:.3f} x {:.3f} m", size.x(), size.y(), size.z());
}

void report_crop(const CropCommandOptions& options, const libmap::CropReport& report,
                 const libmap::Bounds3d& bounds, Run& run) {
  run.add_input(options.input);
  if (!options.polygon.empty()) run.add_input(options.polygon);
  // The new site_from_map includes that of an input that was cropped before.
  const libmap::Pose before = site_from_map_of(options.input).value_or(libmap::Pose::Identity());
  run.manifest().transforms.emplace_back(site_from_map_name, report.site_from_map * before);
  copy_truth_transform(options.input, run);
  copy_georeference(options.input, run);
  run.manifest().frame = "site";
  tell_ground(options.input, report, run);
  tell_site(report, bounds, run);
}

void write_site(const CropCommandOptions& options, Run& run, const Run::Writer& write) {
  const std::string matrix = matrix_text(*run.manifest().find_transform(site_from_map_name));
  run.write_outputs(options.output, {{transform_path(options.output), Run::text_writer(matrix)},
                                     {options.output, write}});
}

void crop_cloud(const CropCommandOptions& options, Run& run) {
  const libmap::CloudReadResult read = libmap::read_cloud(options.input);
  if (read.dropped_points > 0)
    run.warn("{} points without a position were dropped", read.dropped_points);
  const libmap::CropCloudResult result =
      run.timed("crop", [&] { return libmap::crop_cloud(read.cloud, options.crop); });
  report_crop(options, result.report, libmap::bounds_of(result.cloud.positions), run);
  run.add_results({{"points", result.cloud.size()}});
  run.info("{} of {} points", result.cloud.size(), read.cloud.size());
  write_site(options, run, [&](const fs::path& to) { libmap::write_cloud(to, result.cloud); });
}

void crop_mesh(const CropCommandOptions& options, Run& run) {
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.input).mesh;
  const libmap::CropMeshResult result =
      run.timed("crop", [&] { return libmap::crop_mesh(mesh, options.crop); });
  report_crop(options, result.report, libmap::bounds_of(result.mesh.vertices), run);
  const double area = libmap::surface_area(result.mesh);
  run.add_results({{"surface_area_m2", area},
                   {"vertices", result.mesh.vertices.size()},
                   {"triangles", result.mesh.triangles.size()}});
  run.info("{} of {} triangles, {:.3f} m2 of surface", result.mesh.triangles.size(),
           mesh.triangles.size(), area);
  write_site(options, run, [&](const fs::path& to) { libmap::write_mesh(to, result.mesh); });
}

// Reads, crops and writes the tiles one by one.
void crop_tiles(const CropCommandOptions& options, const std::vector<fs::path>& tiles,
                const fs::path& folder, Run& run) {
  std::size_t next = 0;
  std::size_t written = 0, triangles = 0;
  double area_m2 = 0.0;
  Eigen::AlignedBox3d box;
  const auto each = [&](const libmap::UseMesh& use) {
    for (const fs::path& tile : tiles) use(libmap::read_mesh(tile).mesh);
  };
  const auto write = [&](const libmap::TriangleMesh& mesh) {
    const fs::path& tile = tiles[next++];
    if (mesh.triangles.empty()) return;
    ++written;
    triangles += mesh.triangles.size();
    area_m2 += libmap::surface_area(mesh);
    for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
    libmap::write_mesh(folder / (tile.stem().string() + ".ply"), mesh);
  };
  const libmap::CropReport report =
      run.timed("crop", [&] { return libmap::crop_mesh_tiles(each, options.crop, write); });
  report_crop(options, report, {box.min(), box.max()}, run);
  run.add_results({{"tiles", written}, {"surface_area_m2", area_m2}, {"triangles", triangles}});
  run.info("{} triangles in {} of {} tiles, {:.3f} m2 of surface", triangles, written, tiles.size(),
           area_m2);
}

void crop_folder(const CropCommandOptions& options, Run& run) {
  const std::vector<fs::path> tiles = libmap::mesh_tiles(options.input);
  const std::vector<std::string> names = tile_folder_names(options.output, tiles, ".ply");
  run.claim_output_tree(options.output, names, {options.input, options.polygon});
  run.write_output_tree(options.output, names, [&](const fs::path& folder) {
    if (!folder.empty()) crop_tiles(options, tiles, folder, run);
  });
}

void note_region(const CropCommandOptions& options, Run& run) {
  run.manifest().parameters.emplace_back("box", options.box);
  run.manifest().parameters.emplace_back("polygon", options.polygon);
  run.manifest().parameters.emplace_back("size", options.size);
  run.manifest().parameters.emplace_back("border", options.border);
  run.manifest().parameters.emplace_back("border_size", options.border_size);
}

void crop_file(const CropCommandOptions& options, Run& run) {
  const bool is_mesh = libmap::file_kind(options.input) == libmap::FileKind::mesh;
  if (is_mesh)
    libmap::require_mesh_format(options.output);
  else
    libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.input, options.polygon});
  run.require_own_companions(options.output, {transform_path(options.output)});
  is_mesh ? crop_mesh(options, run) : crop_cloud(options, run);
}

void crop(CropCommandOptions& options, Run& run) {
  read_region(options);
  note_region(options, run);
  try {
    is_tile_folder(options.output) ? crop_folder(options, run) : crop_file(options, run);
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(options.input) : error;
  }
}

}  // namespace

int main(int argc, char** argv) {
  CropCommandOptions options;
  Command command("crop");
  command.input("MAP", options.input,
                "mesh (.ply .obj .stl .tif ...), a folder of its tiles, or cloud (.pcd .ply .csv)");
  command.output(options.output,
                 "cropped mesh, cloud or folder of tiles, with STEM.site_from_map.txt (transform)");
  command.option("--box", "XMIN,YMIN[,ZMIN],XMAX,YMAX[,ZMAX]", options.box,
                 "box to keep, m (its frame: --frame)");
  command.option("--polygon", "FILE.csv", options.polygon,
                 "corners of the area to keep, in order: CSV with columns x, y, m; may be concave");
  command.option(
      "--size", "WIDTHxHEIGHT", options.size,
      "size of the rectangle to keep, m, placed as far as possible from the data's border");
  command.flag("--border", options.border, "keep the area inside a white band on the ground");
  command.option(
      "--border-size", "WIDTHxHEIGHT", options.border_size,
      "true size of the area inside the white band, which determines the scale of the map, m");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { crop(options, run); });
}
