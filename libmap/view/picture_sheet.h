// Several scenes or pictures side by side on one page, in rows and columns, with captions and one
// legend for all.
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

// A scene is made when it is needed, twice, so that memory holds one at a time. A picture is shown
// whole, made smaller where it is larger than its cell.
struct SheetCell {
  std::string caption;
  std::function<Scene()> scene{};  // empty: the picture is shown
  Viewpoint view = Viewpoint::top;
  ColorImage picture{};
};

// Which scenes are shown at the same scale and place, so that they can be compared cell by cell.
enum class SharedView { sheet, row };

struct PictureSheetOptions {
  int columns = 0;  // 0: the fewest that make the page at least as wide as it is high
  int cell_width_px = 480;
  int cell_height_px = 0;  // 0: from what the cells show
  std::string title;
  std::vector<std::string> column_titles;  // above the columns; may be empty
  std::vector<std::string> row_titles;     // before the rows; may be empty
  SharedView shared_view = SharedView::sheet;
  std::string background = "#5f6b7a";  // of scenes
  bool scale_bar = true;
  std::vector<Legend> legends;  // before those of the scenes
};

// Where everything goes, whole pixels from the top left corner.
struct SheetLayout {
  int width = 0;
  int height = 0;
  int columns = 0;
  int font_px = 12;
  std::optional<PixelRect> title;
  std::optional<PixelRect> legend;
  std::vector<PixelRect> cells;     // one a cell, row by row
  std::vector<PixelRect> captions;  // below them; empty if no cell has one
  std::vector<PixelRect> column_titles;
  std::vector<PixelRect> row_titles;
  std::vector<PixelRect> scale_bars;  // one a row, or one; empty if there is none
};

// `aspect` is the height of a cell over its width where the options leave it open. Throws Error: no
// cell, a number of columns or a size out of its bound, more titles than rows or columns.
SheetLayout plan_sheet(const std::vector<SheetCell>& cells, const PictureSheetOptions& options,
                       const std::vector<Legend>& legends, double aspect);

// Continuous colors whose range the scenes leave open share one: from the least to the largest
// that each would have had. Throws Error as plan_sheet and render_scene do, and what a cell's
// `scene` throws; (failed) if no picture can be drawn here.
ColorImage draw_sheet(const std::vector<SheetCell>& cells, const PictureSheetOptions& options);

}  // namespace libmap
