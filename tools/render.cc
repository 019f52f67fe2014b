// graspmap render: a picture of a cloud, a mesh or a map.
#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/view/scene_view.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_window.h"
#include "tools/support/render_sheet.h"
#include "tools/support/scene_file.h"

namespace {

using graspmap_tools::MapHeading;
using graspmap_tools::Run;
using graspmap_tools::SheetOptions;

struct RenderOptions {
  std::vector<std::string> files;
  std::string output;
  std::string camera_position;
  std::string camera_target;
  graspmap_tools::SceneFileOptions scene;
  libmap::SceneViewOptions view;
  SheetOptions sheet;
};

// Of a picture of one file.
void bind_one(libmap::ParameterTable& table, RenderOptions& options) {
  constexpr libmap::Range pixels{1.0, 16384.0};
  table.add("width_px", options.view.width, pixels, "width of the picture, pixels");
  table.add("height_px", options.view.height, pixels, "height of the picture, pixels");
  table.add("legend", options.view.legend, "show the legend");
  table.add("axes", options.view.axes, "show the axes");
  table.add("camera_position", options.camera_position, "X,Y,Z with view: camera");
  table.add("camera_target", options.camera_target, "X,Y,Z with view: camera");
}

void bind(libmap::ParameterTable& table, RenderOptions& options) {
  table.add("view", options.view.view, libmap::viewpoint_names(), "from where");
  table.add("title", options.view.title, "above the scene");
  bind(table, options.scene);
  table.add("scale_bar", options.view.scale_bar, "show the scale bar");
  table.add("background", options.view.background, "#rrggbb or a name");
  bind_one(table, options);
  bind(table, options.sheet);
}

libmap::ColorImage draw_one(RenderOptions& options, Run& run) {
  const std::string& file = options.files.front();
  if (options.view.view == libmap::Viewpoint::camera) {
    options.view.camera.position =
        graspmap_tools::parse_vector(options.camera_position, "--camera-position");
    options.view.camera.focal_point =
        graspmap_tools::parse_vector(options.camera_target, "--camera-target");
  }
  if (options.scene.heading == MapHeading::automatic) options.scene.heading = MapHeading::terrain;
  graspmap_tools::SceneFile shown;
  libmap::ColorImage image;
  try {
    shown = run.timed("read", [&] { return read_scene(file, options.scene, run); });
    image = run.timed("render", [&] { return libmap::render_scene(shown.scene, options.view); });
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(file) : error;
  }
  if (shown.columns_per_point > 0)
    run.manifest().results.emplace_back("columns_per_point", shown.columns_per_point);
  if (shown.columns_per_point > 1)
    run.say(fmt::format("one point for {0} x {0} columns: --box shows a part in full",
                        shown.columns_per_point));
  return image;
}

libmap::ColorImage draw_several(const RenderOptions& options, Run& run) {
  if (options.view.view == libmap::Viewpoint::camera)
    throw libmap::Error("is for one file", {.field = "--view", .value = "camera"});
  if (const auto key = libmap::changed_key(options, bind_one))
    throw libmap::Error("is for one file", {.field = libmap::flag_of(*key)});
  SheetOptions sheet = options.sheet;
  sheet.files = options.files;
  sheet.view = options.view.view;
  sheet.scene = options.scene;
  // Maps of one cloud are shown alike.
  if (sheet.scene.heading == MapHeading::automatic) sheet.scene.heading = MapHeading::input;
  sheet.sheet.title = options.view.title;
  sheet.sheet.scale_bar = options.view.scale_bar;
  sheet.sheet.background = options.view.background;
  return draw_sheet(sheet, run);
}

void render(RenderOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".png")
    throw libmap::Error("pictures are written as .png", {.file = options.output});
  for (std::string& file : options.files) file = graspmap_tools::without_trailing_slash(file);
  std::vector<std::string> inputs = options.files;
  inputs.push_back(options.scene.points);
  run.claim_output(options.output, inputs);
  // A page of several files, or of one with what only a page has, such as a caption.
  const bool several = options.files.size() > 1 ||
                       libmap::changed_key<SheetOptions>(options.sheet, graspmap_tools::bind);
  const libmap::ColorImage image = several ? draw_several(options, run) : draw_one(options, run);
  for (const std::string& file : options.files) run.add_input(graspmap_tools::scene_input(file));
  if (!options.scene.points.empty()) run.add_input(options.scene.points);
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_text(temporary, libmap::to_png(image));
  });
}

}  // namespace

int main(int argc, char** argv) {
  RenderOptions options;
  graspmap_tools::Command command("render");
  command.inputs("FILE", options.files,
                 "cloud, mesh, graspability map or tile store (.tiles); several, also pictures "
                 "(.png), are drawn side by side with one legend");
  command.output(options.output, "picture (.png)");
  command.option("--points", "POINTS.csv", options.scene.points,
                 "places to mark: CSV with the columns x, y, z in meters");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { render(options, run); });
}
