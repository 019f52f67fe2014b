#include "libmap/view/image_grid.h"

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/view/offscreen.h"
#include "libmap/view/scene_page.h"

namespace libmap {
namespace {

constexpr double cell_px_per_font_px = 30.0;  // cell width in pixels per pixel of the font size
constexpr double caption_height = 2.0;        // this and the following heights are in font sizes
constexpr double title_height = 2.6;
constexpr double gap = 0.8;  // between cells

void check_whole(const char* field, int value, int low, int high) {
  if (value < low || value > high)
    throw Error("out of range",
                {.field = field,
                 .value = std::to_string(value),
                 .bound = ">= " + std::to_string(low) + " and <= " + std::to_string(high)});
}

void check(const std::vector<SheetCell>& cells, const ImageGridOptions& options) {
  if (cells.empty()) throw no_elements("images of the sheet");
  check_whole("columns", options.columns, 0, 1000);
  check_whole("cell_width_px", options.cell_width_px, 16, max_side_px);
  if (options.cell_height_px != 0)
    check_whole("cell_height_px", options.cell_height_px, 16, max_side_px);
  parse_color(options.background, "background");
}

void check_titles(const char* field, std::size_t titles, int bands) {
  if (titles > static_cast<std::size_t>(bands))
    throw Error(
        "more titles than rows or columns",
        {.field = field, .value = std::to_string(titles), .bound = "<= " + std::to_string(bands)});
}

int rows_of(std::size_t cells, int columns) {
  return (static_cast<int>(cells) + columns - 1) / columns;
}

int columns_of(const ImageGridOptions& options, std::size_t cells, int height) {
  const int count = static_cast<int>(cells);
  if (options.columns > 0) return std::min(options.columns, count);
  int columns = 1;
  while (columns < count && columns * options.cell_width_px < rows_of(cells, columns) * height)
    ++columns;
  return columns;
}

double widest(const std::vector<std::string>& texts, const TextStyle& style) {
  double width = 0.0;
  for (const std::string& text : texts) width = std::max(width, text_size(text, style).x());
  return width;
}

bool any_scene(const std::vector<SheetCell>& cells) {
  return std::any_of(cells.begin(), cells.end(),
                     [](const SheetCell& cell) { return bool(cell.scene); });
}

// Places the rows of cells from `top`, with titles, captions and scale bars. Returns their bottom.
double plan_rows(const std::vector<SheetCell>& cells, const ImageGridOptions& options, double left,
                 double top, int cell_height, SheetLayout& layout) {
  const double f = layout.font_px;
  const double step_x = options.cell_width_px + std::round(gap * f);
  const bool captions = std::any_of(cells.begin(), cells.end(),
                                    [](const SheetCell& cell) { return !cell.caption.empty(); });
  const double caption = captions ? std::round(caption_height * f) : 0.0;
  const bool bars = options.scale_bar && any_scene(cells);
  const int rows = rows_of(cells.size(), layout.columns);
  double y = top;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < layout.columns; ++column) {
      if (layout.cells.size() == cells.size()) break;
      const PixelRect cell{left + column * step_x, y, double(options.cell_width_px),
                           double(cell_height)};
      layout.cells.push_back(cell);
      if (captions) layout.captions.push_back({cell.left, cell.bottom(), cell.width, caption});
    }
    if (static_cast<std::size_t>(row) < options.row_titles.size())
      layout.row_titles.push_back({0.0, y, left, double(cell_height)});
    y += cell_height + caption;
    if (bars && (options.shared_view == SharedView::row || row + 1 == rows)) {
      layout.scale_bars.push_back(
          {left, y, double(options.cell_width_px), std::round(caption_height * f)});
      y += std::round(caption_height * f);
    }
    y += std::round(gap * f);
  }
  return y;
}

// Places the legend to the right of the cells.
void plan_legend(const std::vector<Legend>& legends, double left, double top, double bottom,
                 SheetLayout& layout) {
  if (legends.empty()) {
    layout.width = static_cast<int>(left);
    return;
  }
  const Eigen::Vector2d size = legends_size(legends, layout.font_px);
  const double column = std::ceil(size.x() + 1.8 * layout.font_px);
  layout.legend = PixelRect{left, top, column, std::max(size.y() + layout.font_px, bottom - top)};
  layout.width = static_cast<int>(left + column);
  layout.height = std::max(layout.height, static_cast<int>(std::ceil(layout.legend->bottom())));
}

// --- content of the cells ---------------------------------------------------------------------

struct Contents {
  std::vector<std::optional<Bounds3d>> extents;  // one per cell; nullopt for an image
  std::vector<Legend> legends;
};

void widen(Bounds3d& box, const Bounds3d& other) {
  box.min = box.min.cwiseMin(other.min);
  box.max = box.max.cwiseMax(other.max);
}

bool same_scale(const Legend& a, const Legend& b) {
  return a.continuous && b.continuous && a.title == b.title && a.scale == b.scale;
}

// Adds a legend, or widens the range of a legend that differs only in its range.
void join_legend(const Legend& legend, std::vector<Legend>& legends) {
  for (Legend& known : legends) {
    if (!same_scale(legend, known)) continue;
    known.min = std::min(known.min, legend.min);
    known.max = std::max(known.max, legend.max);
    return;
  }
  add_legend(legend, legends);
}

Contents look_at(const std::vector<SheetCell>& cells, const ImageGridOptions& options) {
  Contents contents;
  contents.legends = options.legends;
  for (const SheetCell& cell : cells) {
    if (!cell.scene) {
      contents.extents.emplace_back();
      continue;
    }
    const SceneContents shown = contents_of(cell.scene());
    contents.extents.emplace_back(shown.extent);
    for (const Legend& legend : shown.legends) join_legend(legend, contents.legends);
  }
  return contents;
}

// Height over width of a cell's content in its view; nullopt for a perspective view.
std::optional<double> aspect_of(const SheetCell& cell, const std::optional<Bounds3d>& extent) {
  if (!extent)
    return cell.image.width > 0 ? std::optional(1.0 * cell.image.height / cell.image.width)
                                : std::nullopt;
  const Eigen::Vector3d size = extent->max - extent->min;
  switch (cell.view) {
    case Viewpoint::top:
      return size.y() / size.x();
    case Viewpoint::front:
      return size.z() / size.x();
    case Viewpoint::side:
      return size.z() / size.y();
    case Viewpoint::oblique:
    case Viewpoint::camera:
      break;
  }
  return std::nullopt;
}

double common_aspect(const std::vector<SheetCell>& cells, const Contents& contents) {
  double aspect = 0.0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::optional<double> one = aspect_of(cells[i], contents.extents[i]);
    if (one && std::isfinite(*one)) aspect = std::max(aspect, *one);
  }
  return aspect > 0.0 ? std::clamp(aspect, 0.25, 2.0) : 0.75;
}

// View extents of the cells: the union of the extents in each group of a shared view.
std::vector<std::optional<Bounds3d>> shared_extents(const Contents& contents, int columns,
                                                    SharedView shared) {
  std::vector<std::optional<Bounds3d>> result = contents.extents;
  const auto group_of = [&](std::size_t cell) {
    return shared == SharedView::sheet ? std::size_t{0} : cell / static_cast<std::size_t>(columns);
  };
  for (std::size_t i = 0; i < result.size(); ++i)
    for (std::size_t j = 0; j < result.size(); ++j)
      if (result[i] && contents.extents[j] && group_of(i) == group_of(j))
        widen(*result[i], *contents.extents[j]);
  return result;
}

void share_ranges(const std::vector<Legend>& legends, Scene& scene) {
  for (const Legend& own : contents_of(scene).legends) {
    for (const Legend& legend : legends) {
      if (!same_scale(own, legend)) continue;
      for (SceneLayer& layer : scene.layers) {
        layer.coloring.range_min = legend.min;
        layer.coloring.range_max = legend.max;
      }
    }
  }
}

// --- pixels ------------------------------------------------------------------------------------

// Centers an image in `cell`, in whole pixels, and scales it down if it is larger.
PixelRect fitted(const ColorImage& image, const PixelRect& cell) {
  const double scale = std::min({1.0, cell.width / image.width, cell.height / image.height});
  const double width = std::max(1.0, std::round(scale * image.width));
  const double height = std::max(1.0, std::round(scale * image.height));
  return {cell.left + std::floor((cell.width - width) / 2.0),
          cell.top + std::floor((cell.height - height) / 2.0), width, height};
}

ScenePage page_around(const PixelRect& cell, const SheetLayout& layout) {
  ScenePage page;
  page.plot = cell;
  page.font_px = page.legend_font_px = layout.font_px;
  return page;
}

void draw_text(const PixelRect& rect, const std::string& text, TextStyle style, Canvas& canvas) {
  const double x = style.align == TextAlign::center ? rect.left + rect.width / 2.0
                                                    : rect.left + 0.4 * style.size_px;
  canvas.text({x, rect.top + rect.height / 2.0},
              shortened_text(text, style, rect.width - 0.4 * style.size_px), style);
}

void draw_page(const std::vector<SheetCell>& cells, const ImageGridOptions& options,
               const std::vector<Legend>& legends, const SheetLayout& layout, Canvas& canvas) {
  const TextStyle plain{.size_px = layout.font_px};
  TextStyle head = plain;
  head.bold = true;
  ScenePage page = page_around({}, layout);
  page.title = layout.title;
  draw_title(page, options.title, canvas);
  page.legend = layout.legend;
  draw_legends(page, legends, canvas);
  for (std::size_t i = 0; i < layout.captions.size(); ++i)
    draw_text(layout.captions[i], cells[i].caption, plain, canvas);
  for (std::size_t i = 0; i < layout.row_titles.size(); ++i)
    draw_text(layout.row_titles[i], options.row_titles[i], head, canvas);
  head.align = TextAlign::center;
  for (std::size_t i = 0; i < layout.column_titles.size(); ++i)
    draw_text(layout.column_titles[i], options.column_titles[i], head, canvas);
}

struct DrawnScene {
  ColorImage image;
  std::optional<SceneCamera> camera;  // orthographic views only
};

DrawnScene draw_scene(const SheetCell& cell, const PixelRect& rect,
                      const std::optional<Bounds3d>& extent, const std::vector<Legend>& legends,
                      const ImageGridOptions& options, int font_px) {
  const int width = static_cast<int>(rect.width);
  const int height = static_cast<int>(rect.height);
  Scene scene = cell.scene();
  share_ranges(legends, scene);
  SceneViewOptions view;
  view.width = width;
  view.height = height;
  view.view = cell.view;
  view.axes = view.scale_bar = view.legend = false;
  view.background = options.background;
  view.extent = extent;
  view.font_px = font_px;
  DrawnScene drawn;
  drawn.camera = camera_of(scene, view);
  drawn.image = render_scene(std::move(scene), view);
  if (drawn.camera->perspective) drawn.camera.reset();
  return drawn;
}

}  // namespace

SheetLayout plan_sheet(const std::vector<SheetCell>& cells, const ImageGridOptions& options,
                       const std::vector<Legend>& legends, double aspect) {
  check(cells, options);
  SheetLayout layout;
  const int height =
      options.cell_height_px > 0
          ? options.cell_height_px
          : std::max(16, static_cast<int>(std::lround(options.cell_width_px * aspect)));
  layout.columns = columns_of(options, cells.size(), height);
  check_titles("column_titles", options.column_titles.size(), layout.columns);
  check_titles("row_titles", options.row_titles.size(), rows_of(cells.size(), layout.columns));
  layout.font_px =
      std::clamp(static_cast<int>(options.cell_width_px / cell_px_per_font_px), min_font_px, 40);
  const double f = layout.font_px;
  double top = options.title.empty() ? std::round(gap * f) : std::round(title_height * f);
  const TextStyle head{.size_px = layout.font_px, .bold = true};
  const double left = options.row_titles.empty()
                          ? std::round(gap * f)
                          : std::ceil(widest(options.row_titles, head) + 1.2 * f);
  const double step = options.cell_width_px + std::round(gap * f);
  for (std::size_t i = 0; i < options.column_titles.size(); ++i)
    layout.column_titles.push_back({left + static_cast<double>(i) * step, top,
                                    double(options.cell_width_px), std::round(caption_height * f)});
  if (!options.column_titles.empty()) top += std::round(caption_height * f);
  const double bottom = plan_rows(cells, options, left, top, height, layout);
  layout.height = static_cast<int>(bottom);
  plan_legend(legends, left + layout.columns * step, top, bottom, layout);
  if (!options.title.empty())
    layout.title = PixelRect{0.0, 0.0, double(layout.width), std::round(title_height * f)};
  if (layout.width > max_side_px || layout.height > max_side_px)
    throw Error("the sheet would have " + std::to_string(layout.width) + " x " +
                    std::to_string(layout.height) + " pixels, more than " +
                    std::to_string(max_side_px) + " per side; use smaller cells",
                {.field = "cell_width_px", .value = std::to_string(options.cell_width_px)});
  return layout;
}

ColorImage draw_sheet(const std::vector<SheetCell>& cells, const ImageGridOptions& options) {
  check(cells, options);
  const Contents contents = look_at(cells, options);
  const SheetLayout layout =
      plan_sheet(cells, options, contents.legends, common_aspect(cells, contents));
  const auto extents = shared_extents(contents, layout.columns, options.shared_view);
  // One X server for all scenes.
  std::optional<VirtualDisplay> display;
  if (any_scene(cells)) display.emplace();
  Canvas canvas(layout.width, layout.height);
  draw_page(cells, options, contents.legends, layout, canvas);
  std::size_t bars = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    DrawnScene drawn;
    if (cells[i].scene)
      drawn = draw_scene(cells[i], layout.cells[i], extents[i], contents.legends, options,
                         layout.font_px);
    const ColorImage& image = cells[i].scene ? drawn.image : cells[i].image;
    canvas.image(image, fitted(image, layout.cells[i]));
    // The scale bar of a row is that of its first orthographic scene.
    const std::size_t row = i / static_cast<std::size_t>(layout.columns);
    const bool wanted = options.shared_view == SharedView::sheet ? bars == 0 : bars <= row;
    if (!drawn.camera || layout.scale_bars.empty() || !wanted) continue;
    ScenePage page = page_around(layout.cells[i], layout);
    page.scale_bar = layout.scale_bars[options.shared_view == SharedView::sheet ? 0 : row];
    const Bounds3d& box = *extents[i];
    draw_scale_bar(page, *drawn.camera, (box.min + box.max) / 2.0, canvas);
    bars = row + 1;
  }
  return canvas.pixels();
}

}  // namespace libmap
