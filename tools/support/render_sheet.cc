// graspmap sheet: several maps, clouds, meshes or pictures side by side in one picture.
#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/image_codec.h"
#include "libmap/view/picture_sheet.h"
#include "tools/command_line.h"
#include "tools/map_window.h"
#include "tools/scene_file.h"
#include "tools/text_list.h"

namespace {

using graspmap_tools::Run;

struct SheetOptions {
  std::vector<std::string> files;
  std::string output;
  // Texts with '|' between.
  std::string captions;
  std::string column_titles;
  std::string row_titles;
  libmap::Viewpoint view = libmap::Viewpoint::top;
  graspmap_tools::SceneFileOptions scene;
  libmap::PictureSheetOptions sheet;
};

// Only the views that need no place.
std::vector<std::pair<std::string, libmap::Viewpoint>> view_names() {
  auto names = libmap::viewpoint_names();
  std::erase_if(names, [](const auto& name) { return name.second == libmap::Viewpoint::camera; });
  return names;
}

void bind(libmap::ParameterTable& table, SheetOptions& options) {
  libmap::PictureSheetOptions& sheet = options.sheet;
  table.add("columns", sheet.columns, libmap::Range{0, 1000},
            "columns of cells; 0: as many as make the page about square");
  table.add("cell_width_px", sheet.cell_width_px, libmap::Range{16, 16384}, "of a cell, pixels");
  table.add("cell_height_px", sheet.cell_height_px, libmap::Range{0, 16384},
            "of a cell, pixels; 0: from what the cells show");
  table.add("title", sheet.title, "above all");
  table.add("captions", options.captions,
            "below the cells, in the order of the files, with | between; files that it leaves out "
            "have their names");
  table.add("column_titles", options.column_titles, "above the columns, with | between");
  table.add("row_titles", options.row_titles, "before the rows, with | between");
  table.add("shared_view", sheet.shared_view, libmap::shared_view_names(),
            "which maps are shown at one scale and place: those of the sheet, or of a row");
  table.add("view", options.view, view_names(), "from where");
  bind(table, options.scene);
  table.add("scale_bar", sheet.scale_bar, "show the scale bar");
  table.add("background", sheet.background, "#rrggbb or a name");
}

libmap::ColorImage read_picture(const std::string& file) {
  constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 30;
  try {
    return libmap::decode_color(libmap::read_whole_file(file, max_file_bytes),
                                libmap::max_picture_pixels);
  } catch (const libmap::Error& error) {
    throw error.in_file(file);
  }
}

libmap::SheetCell cell_of(const SheetOptions& options, const std::string& file,
                          const std::string& caption, Run& run) {
  libmap::SheetCell cell;
  cell.caption = caption;
  cell.view = options.view;
  if (libmap::format_of(file) == ".png")
    cell.picture = read_picture(file);
  else
    cell.scene = [&options, &run, file] { return read_scene(file, options.scene, run).scene; };
  return cell;
}

std::vector<libmap::SheetCell> read_cells(const SheetOptions& options, Run& run) {
  const std::vector<std::string> captions = graspmap_tools::split_texts(options.captions);
  if (captions.size() > options.files.size())
    throw libmap::Error("more captions than files",
                        {.field = "--captions",
                         .value = std::to_string(captions.size()),
                         .bound = "<= " + std::to_string(options.files.size())});
  std::vector<libmap::SheetCell> cells;
  for (std::size_t i = 0; i < options.files.size(); ++i) {
    const std::string& file = options.files[i];
    cells.push_back(cell_of(
        options, file,
        i < captions.size() ? captions[i] : std::filesystem::path(file).stem().string(), run));
  }
  return cells;
}

void sheet(SheetOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".png")
    throw libmap::Error("pictures are written as .png", {.file = options.output});
  std::vector<std::string> inputs;
  for (std::string& file : options.files) {
    file = graspmap_tools::without_trailing_slash(file);
    inputs.push_back(file);
  }
  inputs.push_back(options.scene.points);
  run.claim_output(options.output, inputs);
  options.sheet.column_titles = graspmap_tools::split_texts(options.column_titles);
  options.sheet.row_titles = graspmap_tools::split_texts(options.row_titles);
  const std::vector<libmap::SheetCell> cells = read_cells(options, run);
  const libmap::ColorImage image =
      run.timed("draw", [&] { return libmap::draw_sheet(cells, options.sheet); });
  for (const std::string& file : options.files) run.add_input(graspmap_tools::scene_input(file));
  if (!options.scene.points.empty()) run.add_input(options.scene.points);
  run.manifest().results.emplace_back("cells", static_cast<std::int64_t>(cells.size()));
  run.say(fmt::format("{} cells, {} x {} pixels", cells.size(), image.width, image.height));
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_text(temporary, libmap::to_png(image));
  });
}

}  // namespace

int main(int argc, char** argv) {
  SheetOptions options;
  graspmap_tools::Command command(
      "sheet", "Several maps, clouds, meshes or pictures side by side, with one legend.");
  command.inputs("FILE", options.files, "maps, clouds, meshes, tile stores or pictures (.png)");
  command.output(options.output, "picture (.png)");
  command.option("--points", "POINTS.csv", options.scene.points,
                 "places to mark on each map: CSV with the columns x, y, z in metres");
  options.scene.heading = graspmap_tools::MapHeading::input;  // maps of one cloud lie alike
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { sheet(options, run); });
}
