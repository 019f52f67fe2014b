// graspmap render: a picture of a cloud, a mesh or a map.
#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <variant>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/textured_mesh_io.h"
#include "libmap/view/scene_view.h"
#include "tools/command_line.h"
#include "tools/map_frame.h"
#include "tools/map_window.h"

namespace {

using graspmap_tools::Run;

struct RenderOptions {
  std::string file;
  std::string output;
  std::string points;  // CSV of marked places
  std::string label = "auto";
  std::string verdict;
  std::string zero_plane = "auto";
  std::string camera_position;
  std::string camera_target;
  graspmap_tools::PointFrame points_frame = graspmap_tools::PointFrame::input;
  double point_size_m = 0.0;
  std::string box;  // of the plan that is shown
  std::uint64_t max_points = 1'000'000;
  libmap::Coloring coloring;
  libmap::PointShape point_shape = libmap::PointShape::automatic;
  libmap::Shading shading = libmap::Shading::automatic;
  libmap::SceneViewOptions view;
};

void bind(libmap::ParameterTable& table, RenderOptions& options) {
  constexpr libmap::Range pixels{1.0, 16384.0};
  table.add("view", options.view.view, libmap::viewpoint_names(), "from where");
  table.add("width_px", options.view.width, pixels, "width of the picture, pixels");
  table.add("height_px", options.view.height, pixels, "height of the picture, pixels");
  table.add("title", options.view.title, "above the scene");
  table.add("color", options.coloring.mode, libmap::color_mode_names(), "what colours show");
  table.add("field", options.coloring.field, "field that is shown with color: field");
  table.add("color_scale", options.coloring.scale, libmap::color_scale_names(),
            "colours of continuous values; diverging: blue below and red above 0");
  table.add("range_min", options.coloring.range_min, libmap::any_number,
            "value at the lower end of the colours");
  table.add("range_max", options.coloring.range_max, libmap::any_number,
            "value at their upper end; equal to range_min: from the data");
  table.add("single_color", options.coloring.color, "colour with color: single, #rrggbb");
  table.add(
      "zero_plane", options.zero_plane,
      "height in the terrain frame below which ground is white, m; auto: the map's own, none");
  table.add("point_shape", options.point_shape, libmap::point_shape_names(), "shape of a point");
  table.add("point_size_m", options.point_size_m, libmap::not_negative,
            "edge of a point, m; 0: from their spacing");
  table.add("box", options.box,
            "show this rectangle of a cloud or map alone: X0,Y0,X1,Y1 in its frame, m");
  table.add("max_points", options.max_points, libmap::Range{1'000.0, 1e9},
            "of a tile store: larger parts are thinned to about so many points");
  table.add("shading", options.shading, libmap::shading_names(), "where light falls");
  table.add("legend", options.view.legend, "show the legend");
  table.add("axes", options.view.axes, "show the axes");
  table.add("scale_bar", options.view.scale_bar, "show the scale bar");
  table.add("background", options.view.background, "#rrggbb or a name");
  table.add("label", options.label, "column of the marked points' names; auto: the first column");
  table.add("verdict", options.verdict, "column of their verdict: 1 green, 0 red, empty neutral");
  table.add("points_frame", options.points_frame, graspmap_tools::point_frame_names(),
            "frame of the marked points: of the cloud that was scored, the terrain's, or the map's "
            "before it was cropped");
  table.add("camera_position", options.camera_position, "X,Y,Z with view: camera");
  table.add("camera_target", options.camera_target, "X,Y,Z with view: camera");
}

libmap::Verdict verdict_of(const libmap::Table& table, std::size_t row, std::size_t column) {
  const std::string& cell = table.rows[row][column];
  if (libmap::trim(cell).empty()) return libmap::Verdict::none;
  const auto verdict = libmap::parse_bool(cell);
  if (!verdict)
    throw libmap::Error("not a verdict", {.file = table.file,
                                          .field = "row " + std::to_string(row + 1) + ", column '" +
                                                   table.columns[column] + "'",
                                          .value = "'" + cell + "'",
                                          .bound = "1, 0 or empty"});
  return *verdict ? libmap::Verdict::pass : libmap::Verdict::fail;
}

// In the frame in which they are listed.
std::vector<libmap::Marker> read_markers(const RenderOptions& options) {
  const libmap::Table table = libmap::read_csv(options.points);
  const std::vector<Eigen::Vector3d> positions = graspmap_tools::positions_of(table);
  const std::size_t label = options.label == "auto" ? 0 : table.column(options.label);
  std::vector<libmap::Marker> markers;
  for (std::size_t row = 0; row < positions.size(); ++row) {
    libmap::Marker& marker = markers.emplace_back();
    marker.position = positions[row];
    marker.label = table.rows[row][label];
    if (!options.verdict.empty())
      marker.verdict = verdict_of(table, row, table.column(options.verdict));
  }
  return markers;
}

double zero_plane_of(const RenderOptions& options, const libmap::Manifest* manifest) {
  constexpr double none = -std::numeric_limits<double>::infinity();
  if (options.zero_plane == "none") return none;
  if (options.zero_plane != "auto") {
    const auto height = libmap::parse_double(options.zero_plane);
    if (height) return *height;
    throw libmap::Error(
        "not a height",
        {.field = "--zero-plane", .value = options.zero_plane, .bound = "auto, none or a number"});
  }
  const libmap::ManifestValue* value =
      manifest == nullptr ? nullptr : manifest->find_parameter("zero_plane_m");
  if (value == nullptr) return none;
  if (const auto* number = std::get_if<double>(value)) return *number;
  if (const auto* whole = std::get_if<std::int64_t>(value)) return static_cast<double>(*whole);
  return none;
}

libmap::PointCloud read_store(const RenderOptions& options, Run& run) {
  const graspmap_tools::MapTiles tiles(options.file);
  graspmap_tools::MapWindow window = graspmap_tools::read_window(
      tiles, graspmap_tools::parse_box(options.box), options.max_points);
  const auto width = static_cast<std::int64_t>(window.columns_a_point);
  run.manifest().results.emplace_back("columns_a_point", width);
  if (width > 1)
    run.say(fmt::format("one point for {} x {} columns: --box shows a part in full", width, width));
  return std::move(window.cloud);
}

libmap::Scene read_scene(const RenderOptions& options, Run& run) {
  libmap::Scene scene;
  libmap::SceneLayer layer;
  const auto box = graspmap_tools::parse_box(options.box);
  if (graspmap_tools::is_tile_store(options.file))
    layer.shape = read_store(options, run);
  else if (libmap::is_textured_format(options.file))
    layer.shape = libmap::read_textured_mesh(options.file);
  else if (libmap::file_kind(options.file) == libmap::FileKind::mesh)
    layer.shape = libmap::read_mesh(options.file).mesh;
  else
    layer.shape = libmap::read_cloud(options.file).cloud;
  if (auto* cloud = std::get_if<libmap::PointCloud>(&layer.shape); box && cloud != nullptr)
    *cloud = graspmap_tools::points_in_box(*cloud, *box);
  else if (box)
    throw libmap::Error("only clouds and maps are cut", {.file = options.file, .field = "--box"});
  const auto manifest = libmap::read_manifest_of(options.file);
  layer.coloring = options.coloring;
  layer.coloring.zero_plane_m = zero_plane_of(options, manifest ? &*manifest : nullptr);
  layer.point_shape = options.point_shape;
  layer.shading = options.shading;
  layer.point_size_m = options.point_size_m;
  scene.layers.push_back(std::move(layer));
  if (manifest && manifest->frame == "input")
    if (const libmap::Pose* terrain_from_input = manifest->find_transform("terrain_from_input"))
      scene.terrain_from_scene = *terrain_from_input;
  if (!options.points.empty()) {
    scene.markers = read_markers(options);
    const libmap::Pose scene_from_points =
        graspmap_tools::map_from_points(options.file, options.points_frame, run);
    for (libmap::Marker& marker : scene.markers)
      marker.position = scene_from_points * marker.position;
  }
  return scene;
}

void render(RenderOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".png")
    throw libmap::Error("pictures are written as .png", {.file = options.output});
  options.file = graspmap_tools::without_trailing_slash(options.file);
  run.claim_output(options.output, {options.file, options.points});
  if (options.view.view == libmap::Viewpoint::camera) {
    options.view.camera.position =
        graspmap_tools::parse_vector(options.camera_position, "--camera-position");
    options.view.camera.focal_point =
        graspmap_tools::parse_vector(options.camera_target, "--camera-target");
  }
  libmap::Scene scene;
  libmap::ColorImage image;
  try {
    scene = run.timed("read", [&] { return read_scene(options, run); });
    image = run.timed("render", [&] { return libmap::render_scene(scene, options.view); });
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(options.file) : error;
  }
  run.add_input(graspmap_tools::is_tile_store(options.file)
                    ? graspmap_tools::store_index_path(options.file)
                    : std::filesystem::path(options.file));
  if (!options.points.empty()) run.add_input(options.points);
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_text(temporary, libmap::to_png(image));
  });
}

}  // namespace

int main(int argc, char** argv) {
  RenderOptions options;
  graspmap_tools::Command command("render", "A picture of a cloud, a mesh or a map.");
  command.input("FILE", options.file, "cloud, mesh, graspability map or tile store (.tiles)");
  command.output(options.output, "picture (.png)");
  command.option("--points", "POINTS.csv", options.points,
                 "places to mark: CSV with the columns x, y, z in metres");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { render(options, run); });
}
