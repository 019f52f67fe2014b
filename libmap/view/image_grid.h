// Arranges scenes and images in a grid on one page, with captions and a common legend.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/view/color_map.h"
#include "libmap/view/image_io.h"
#include "libmap/view/scene_camera.h"
#include "libmap/view/scene_view.h"

namespace libmap {

// Content of a cell: a scene or an image. Scenes are created on demand (twice each), so that only
// one is in memory. Images larger than the cell are scaled down.
struct SheetCell {
  std::string caption;             // below the cell; empty: none
  std::function<Scene()> scene{};  // empty: show `image`
  Viewpoint view = Viewpoint::top;
  ColorImage image{};
};

// Group of scenes that are drawn with the same view and extent: the whole sheet, or each row.
enum class SharedView { sheet, row };

struct ImageGridOptions {
  int columns = 0;  // 0: minimum number for which the page is at least as wide as high
  int cell_width_px = 480;
  int cell_height_px = 0;                  // 0: from the aspect ratio of the cells' content
  std::string title;                       // above all; empty: none
  std::vector<std::string> column_titles;  // above the columns; may be empty
  std::vector<std::string> row_titles;     // before the rows; may be empty
  SharedView shared_view = SharedView::sheet;
  std::string background = "#5f6b7a";  // behind scenes: "#rrggbb" or a name
  bool scale_bar = true;
  std::vector<Legend> legends;  // shown before the legends of the scenes
};

// Rectangles of all parts, whole pixels from the top left corner.
struct SheetLayout {
  int width = 0;
  int height = 0;
  int columns = 0;  // number of columns
  int font_px = 12;
  std::optional<PixelRect> title;
  std::optional<PixelRect> legend;
  std::vector<PixelRect> cells;     // one per cell, row by row
  std::vector<PixelRect> captions;  // below the cells; empty if no cell has a caption
  std::vector<PixelRect> column_titles;
  std::vector<PixelRect> row_titles;
  std::vector<PixelRect> scale_bars;  // SharedView::row: one per row; otherwise one; may be empty
};

// Plans the layout. `aspect` is height / width of a cell, used if the options do not set the
// height. Throws Error if there is no cell, a number of columns, a size or the sheet is out of
// bounds, the background is invalid, or there are more titles than rows or columns.
SheetLayout plan_sheet(const std::vector<SheetCell>& cells, const ImageGridOptions& options,
                       const std::vector<Legend>& legends, double aspect);

// Draws the sheet. Continuous legends with equal title and scale share one range, which covers the
// ranges of all scenes. Throws Error as plan_sheet, render_scene and the cells' `scene` do.
ColorImage draw_sheet(const std::vector<SheetCell>& cells, const ImageGridOptions& options);

}  // namespace libmap
