#include "tools/support/render_sheet.h"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/image/image_codec.h"
#include "libmap/view/picture_sheet.h"
#include "tools/support/command_line.h"
#include "tools/support/map_window.h"
#include "tools/support/scene_file.h"
#include "tools/support/text_list.h"

namespace graspmap_tools {

void bind(libmap::ParameterTable& table, SheetOptions& options) {
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

namespace {

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
  const std::vector<std::string> captions = split_texts(options.captions);
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

}  // namespace

libmap::ColorImage draw_sheet(SheetOptions options, Run& run) {
  options.sheet.column_titles = split_texts(options.column_titles);
  options.sheet.row_titles = split_texts(options.row_titles);
  const std::vector<libmap::SheetCell> cells = read_cells(options, run);
  libmap::ColorImage image =
      run.timed("draw", [&] { return libmap::draw_sheet(cells, options.sheet); });
  run.manifest().results.emplace_back("cells", static_cast<std::int64_t>(cells.size()));
  run.say(fmt::format("{} cells, {} x {} pixels", cells.size(), image.width, image.height));
  return image;
}

}  // namespace graspmap_tools
