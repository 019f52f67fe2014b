// graspmap render: a picture of a cloud, a mesh or a map.
#include "libmap/cloud/cloud_io.h"
#include "libmap/image/image_codec.h"
#include "libmap/view/picture_sheet.h"
#include "libmap/view/scene_view.h"
#include "tools/support/command_line.h"
#include "tools/support/map_tiles.h"
#include "tools/support/option_values.h"
#include "tools/support/scene_file.h"

using namespace graspmap_tools;

namespace {

struct RenderOptions {
  std::vector<std::string> files;
  std::string output;
  std::string camera_position;
  std::string camera_target;
  SceneFileOptions scene;
  libmap::SceneViewOptions view;
  // Of a page of several files; texts with '|' between.
  std::string captions;
  std::string column_titles;
  std::string row_titles;
  libmap::PictureSheetOptions sheet;
};

// Of a picture of one file.
void bind_one(libmap::ParameterTable& table, RenderOptions& options) {
  libmap::bind_single(table, options.view);
  table.add("camera_position", options.camera_position, "X,Y,Z with view: camera");
  table.add("camera_target", options.camera_target, "X,Y,Z with view: camera");
}

// Of a page of several files.
void bind_page(libmap::ParameterTable& table, RenderOptions& options) {
  libmap::PictureSheetOptions& sheet = options.sheet;
  table.add("columns", sheet.columns, libmap::Range{0, 1000},
            "of several files: columns of cells; 0: as many as make the page about square");
  table.add("cell_width_px", sheet.cell_width_px, libmap::Range{16, 16384},
            "of several files: width of a cell, pixels");
  table.add("cell_height_px", sheet.cell_height_px, libmap::Range{0, 16384},
            "of several files: height of a cell, pixels; 0: from what the cells show");
  table.add("captions", options.captions,
            "of several files: texts below the cells, with | between; default: the files' names "
            "without extension");
  table.add("column_titles", options.column_titles,
            "of several files: above the columns, with | between");
  table.add("row_titles", options.row_titles, "of several files: before the rows, with | between");
  table.add("shared_view", sheet.shared_view, libmap::shared_view_names(),
            "of several files: which maps share scale and extent: all, or those of a row");
}

void bind(libmap::ParameterTable& table, RenderOptions& options) {
  bind(table, options.view);
  bind(table, options.scene);
  bind_one(table, options);
  bind_page(table, options);
}

libmap::ColorImage draw_one(RenderOptions& options, Run& run) {
  const std::string& file = options.files.front();
  if (options.view.view == libmap::Viewpoint::camera) {
    options.view.camera.position = parse_vector(options.camera_position, "--camera-position");
    options.view.camera.focal_point = parse_vector(options.camera_target, "--camera-target");
  }
  if (options.scene.heading == MapHeading::automatic) options.scene.heading = MapHeading::terrain;
  SceneFile shown;
  libmap::ColorImage image;
  try {
    shown = run.timed("read", [&] { return read_scene(file, options.scene, run); });
    image = run.timed("render",
                      [&] { return libmap::render_scene(std::move(shown.scene), options.view); });
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(file) : error;
  }
  if (shown.columns_per_point > 0)
    run.add_results({{"columns_per_point", shown.columns_per_point}});
  if (shown.columns_per_point > 1)
    run.say("one point for {0} x {0} columns: --box shows a part in full", shown.columns_per_point);
  return image;
}

libmap::ColorImage read_picture(const std::string& file) {
  constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 30;
  return in_file(file, [&] {
    return libmap::decode_color(libmap::read_whole_file(file, max_file_bytes),
                                libmap::max_picture_pixels);
  });
}

std::vector<libmap::SheetCell> read_cells(const RenderOptions& options, Run& run) {
  const std::vector<std::string> captions =
      split_texts(options.captions, options.files.size(), "more captions than files", "--captions");
  std::vector<libmap::SheetCell> cells;
  for (const std::string& file : options.files) {
    libmap::SheetCell& cell = cells.emplace_back();
    cell.caption = cells.size() <= captions.size() ? captions[cells.size() - 1]
                                                   : std::filesystem::path(file).stem().string();
    cell.view = options.view.view;
    if (libmap::format_of(file) == ".png")
      cell.picture = read_picture(file);
    else
      cell.scene = [&options, &run, file] { return read_scene(file, options.scene, run).scene; };
  }
  return cells;
}

libmap::ColorImage draw_several(RenderOptions& options, Run& run) {
  if (options.view.view == libmap::Viewpoint::camera)
    throw libmap::Error("is for one file", {.field = "--view", .value = "camera"});
  refuse_set(options, bind_one, "is for one file");
  // Maps of one cloud are shown alike.
  if (options.scene.heading == MapHeading::automatic) options.scene.heading = MapHeading::input;
  options.sheet.column_titles = split_texts(options.column_titles);
  options.sheet.row_titles = split_texts(options.row_titles);
  options.sheet.title = options.view.title;
  options.sheet.scale_bar = options.view.scale_bar;
  options.sheet.background = options.view.background;
  const std::vector<libmap::SheetCell> cells = read_cells(options, run);
  libmap::ColorImage image =
      run.timed("draw", [&] { return libmap::draw_sheet(cells, options.sheet); });
  run.add_results({{"cells", cells.size()}});
  run.say("{} cells, {} x {} pixels", cells.size(), image.width, image.height);
  return image;
}

void render(RenderOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".png")
    throw libmap::Error("pictures are written as .png", {.file = options.output});
  for (std::string& file : options.files) file = without_trailing_slash(file);
  std::vector<std::string> inputs = options.files;
  inputs.push_back(options.scene.points);
  run.claim_output(options.output, inputs);
  // A page of several files, or of one with what only a page has, such as a caption.
  const bool several = options.files.size() > 1 || libmap::changed_key(options, bind_page);
  const libmap::ColorImage image = several ? draw_several(options, run) : draw_one(options, run);
  for (const std::string& file : options.files) run.add_input(scene_input(file));
  if (!options.scene.points.empty()) run.add_input(options.scene.points);
  run.write_text(options.output, libmap::to_png(image));
}

}  // namespace

int main(int argc, char** argv) {
  RenderOptions options;
  Command command("render");
  command.inputs("FILE", options.files,
                 "cloud, mesh, graspability map or tile store (.tiles); several, also pictures "
                 "(.png), are drawn side by side with one legend");
  command.output(options.output, "picture (.png)");
  command.option("--points", "POINTS.csv", options.scene.points,
                 "places to mark: CSV with the columns x, y, z in meters");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { render(options, run); });
}
