#include "libmap/view/scene_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "libmap/core/text.h"
#include "libmap/view/charts.h"

namespace libmap {
namespace {

constexpr Color ink{25, 28, 32};
constexpr Color paper{255, 255, 255};
constexpr Color frame_color{90, 96, 104};
constexpr double row_height = 1.55;       // of the legend; this and the following are in font sizes
constexpr double title_row_height = 1.9;  // a legend's title
constexpr double bar_height = 13.0;       // the scalar bar
constexpr double bar_width = 1.3;
constexpr double swatch = 1.05;
constexpr double legend_gap = 1.2;  // between two legends
constexpr int max_ticks = 6;
constexpr std::size_t many_markers = 5000;  // more markers are downsampled

// Round numbers within the legend's range, or its ends if there are fewer than two.
std::vector<double> ticks_of(const Legend& legend) {
  std::vector<double> ticks = round_ticks(legend.min, legend.max, max_ticks);
  if (ticks.size() < 2) ticks = {legend.min, legend.max};
  return ticks;
}

// Texts beside the scalar bar and the swatches.
std::vector<std::string> texts_of(const Legend& legend) {
  std::vector<std::string> texts;
  if (legend.continuous) texts = tick_texts(ticks_of(legend));
  for (const LegendEntry& entry : legend.entries) texts.push_back(entry.text);
  return texts;
}

// Sets the legend's rectangle if it fits at any font size.
void plan_legend(const SceneViewOptions& options, const std::vector<Legend>& legends,
                 double title_height, ScenePage& page) {
  if (!options.legend || legends.empty()) return;
  const double available = options.height - title_height - 0.8 * page.font_px;
  for (int font = page.font_px; font >= std::min(8, page.font_px); --font) {
    const Eigen::Vector2d size = legends_size(legends, font);
    const double column = std::ceil(size.x() + 1.8 * font);
    if (column > 0.42 * options.width || size.y() > available) continue;
    page.legend_font_px = font;
    page.legend =
        PixelRect{options.width - column, title_height, column, options.height - title_height};
    return;
  }
}

struct Bands {
  bool title;
  bool legend;
  bool axes;
  bool scale_bar;
};

ScenePage plan_with(const SceneViewOptions& options, const std::vector<Legend>& legends,
                    const Bands& bands) {
  ScenePage page;
  page.font_px = options.font_px > 0
                     ? options.font_px
                     : std::clamp(std::min(options.width, options.height) / 48, min_font_px, 160);
  const double f = page.font_px;
  const double title_height = bands.title ? std::round(2.4 * f) : 0.0;
  const double bottom_height = bands.axes        ? std::round(4.8 * f)
                               : bands.scale_bar ? std::round(2.4 * f)
                                                 : 0.0;
  if (bands.legend) plan_legend(options, legends, title_height, page);
  const double right = page.legend ? page.legend->left : options.width;
  page.plot = {0.0, title_height, right, options.height - title_height - bottom_height};
  if (bands.title) page.title = PixelRect{0.0, 0.0, double(options.width), title_height};
  const double axes_width = bands.axes ? std::round(5.2 * f) : 0.0;
  if (bands.axes) page.axes = PixelRect{0.0, page.plot.bottom(), axes_width, bottom_height};
  if (bands.scale_bar)
    page.scale_bar = PixelRect{axes_width, page.plot.bottom(), right - axes_width, bottom_height};
  return page;
}

bool roomy(const SceneViewOptions& options, const ScenePage& page) {
  return page.plot.width >= 0.5 * options.width && page.plot.height >= 0.55 * options.height &&
         (!page.axes || page.axes->right() <= page.plot.right());
}

void draw_scalar_bar(const Legend& legend, double left, double top, int font, Canvas& canvas) {
  const double height = bar_height * font;
  const PixelRect bar{left, top, bar_width * font, height};
  const double hair = std::max(1.0, font / 14.0);
  canvas.rectangle({bar.left - hair, bar.top - hair, bar.width + 2 * hair, bar.height + 2 * hair},
                   frame_color);
  constexpr int strips = 128;
  for (int strip = 0; strip < strips; ++strip) {
    const double fraction = static_cast<double>(strip) / strips;
    // Strips overlap, so that no seams are visible.
    canvas.rectangle({bar.left, bar.top, bar.width, height * (1.0 - fraction)},
                     color_at(legend.scale, (strip + 0.5) / strips));
  }
  const std::vector<double> ticks = ticks_of(legend);
  const std::vector<std::string> texts = tick_texts(ticks);
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double y = bar.bottom() - height * (ticks[i] - legend.min) / (legend.max - legend.min);
    canvas.rectangle({bar.right(), y - hair / 2.0, 0.3 * font, hair}, frame_color);
    canvas.text({bar.right() + 0.5 * font, y}, texts[i], {.size_px = font});
  }
}

void draw_arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width,
                const Color& color, Canvas& canvas) {
  const Eigen::Vector2d along = (to - from).normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  const Eigen::Vector2d neck = to - 2.6 * width * along;
  canvas.polyline({from, neck}, width, color);
  canvas.polygon({to, neck + 1.7 * width * across, neck - 1.7 * width * across}, color);
}

Color verdict_color(Verdict verdict) {
  switch (verdict) {
    case Verdict::pass:
      return {0, 140, 50};
    case Verdict::fail:
      return {205, 20, 20};
    case Verdict::none:
      break;
  }
  return {40, 44, 52};
}

struct SeenMarker {
  const Marker* marker;
  Eigen::Vector2d pixel;
};

std::vector<SeenMarker> seen_markers(const ScenePage& page, const SceneCamera& camera,
                                     const std::vector<Marker>& markers) {
  std::vector<SeenMarker> seen;
  for (const Marker& marker : markers) {
    if (!marker.position.allFinite() || !(camera.depth_of(marker.position) > 0.0)) continue;
    const Eigen::Vector2d pixel = camera.pixel_of(marker.position);
    if (page.plot.contains(pixel)) seen.push_back({&marker, pixel});
  }
  return seen;
}

// Keeps markers with drawn labels, and the first of all others per verdict and square.
void downsample_markers(double side_px, bool labeled, std::vector<SeenMarker>& seen) {
  std::set<std::tuple<Verdict, long, long>> taken;
  std::erase_if(seen, [&](const SeenMarker& one) {
    if (labeled && !one.marker->label.empty()) return false;
    const Eigen::Vector2d square = one.pixel / side_px;
    return !taken
                .emplace(one.marker->verdict, std::lround(std::floor(square.x())),
                         std::lround(std::floor(square.y())))
                .second;
  });
}

// Returns false if square labels of this height would cover more than the plot.
bool have_room_for_labels(const std::vector<SeenMarker>& seen, const PixelRect& plot,
                          double height_px) {
  const auto labels = std::count_if(
      seen.begin(), seen.end(), [](const SeenMarker& one) { return !one.marker->label.empty(); });
  return static_cast<double>(labels) * height_px * height_px <= plot.width * plot.height;
}

constexpr int rings = 9;
// Directions of labels in order of preference.
constexpr std::array<std::array<double, 2>, 8> directions{{{1.0, 0.0},
                                                           {-1.0, 0.0},
                                                           {0.0, -1.0},
                                                           {0.0, 1.0},
                                                           {1.0, -1.0},
                                                           {-1.0, -1.0},
                                                           {1.0, 1.0},
                                                           {-1.0, 1.0}}};

double overlap_area(const PixelRect& a, const PixelRect& b) {
  const double width = std::min(a.right(), b.right()) - std::max(a.left, b.left);
  const double height = std::min(a.bottom(), b.bottom()) - std::max(a.top, b.top);
  return width > 0.0 && height > 0.0 ? width * height : 0.0;
}

// Box whose edge or corner toward the point is at a distance of `gap` pixels.
PixelRect box_beside(const LabelRequest& request, const std::array<double, 2>& direction,
                     double gap) {
  const Eigen::Vector2d toward(direction[0], direction[1]);
  const Eigen::Vector2d half(request.width_px / 2.0, request.height_px / 2.0);
  const Eigen::Vector2d middle =
      request.anchor + toward.cwiseProduct(half + Eigen::Vector2d::Constant(gap));
  return {middle.x() - half.x(), middle.y() - half.y(), request.width_px, request.height_px};
}

// Area of `box` that overlaps occupied rectangles or is outside the bounds.
double covered_area(const PixelRect& box, const std::vector<PixelRect>& taken,
                    const PixelRect& bounds) {
  double area = box.width * box.height - overlap_area(box, bounds);
  for (const PixelRect& other : taken) area += overlap_area(box, other);
  return area;
}

}  // namespace

Eigen::Vector2d legends_size(const std::vector<Legend>& legends, int font_px) {
  const TextStyle style{.size_px = font_px};
  const TextStyle title_style{.size_px = font_px, .bold = true};
  double width = 0.0;
  double height = 0.0;
  for (const Legend& legend : legends) {
    if (height > 0.0) height += legend_gap * font_px;
    height += title_row_height * font_px;
    width = std::max(width, text_size(legend.title, title_style).x());
    for (const std::string& text : texts_of(legend))
      width = std::max(width, (bar_width + 0.6) * font_px + text_size(text, style).x());
    if (legend.continuous) height += (bar_height + 0.9) * font_px;
    height += row_height * font_px * static_cast<double>(legend.entries.size());
  }
  return {width, height};
}

ScenePage plan_page(const SceneViewOptions& options, const std::vector<Legend>& legends) {
  Bands bands{!options.title.empty(), options.legend, options.axes, options.scale_bar};
  ScenePage page = plan_with(options, legends, bands);
  for (bool* band : {&bands.legend, &bands.axes, &bands.scale_bar, &bands.title}) {
    if (roomy(options, page)) return page;
    *band = false;
    page = plan_with(options, legends, bands);
  }
  return page;
}

double round_length_m(double longest_m) {
  const double decade = std::pow(10.0, std::floor(std::log10(longest_m) + 1e-9));
  for (const double factor : {5.0, 2.0})
    if (factor * decade <= longest_m * (1.0 + 1e-9)) return factor * decade;
  return decade;
}

std::string length_text(double length_m) {
  struct Unit {
    double m;
    const char* name;
  };
  constexpr std::array<Unit, 4> units{
      {{1000.0, " km"}, {1.0, " m"}, {0.01, " cm"}, {0.001, " mm"}}};
  for (const Unit& unit : units)
    if (length_m >= unit.m * (1.0 - 1e-9))
      return to_text(static_cast<float>(length_m / unit.m)) + unit.name;
  return to_text(static_cast<float>(length_m * 1000.0)) + " mm";
}

void draw_title(const ScenePage& page, const std::string& title, Canvas& canvas) {
  if (!page.title) return;
  TextStyle style{.size_px = static_cast<int>(1.3 * page.font_px), .bold = true};
  const double room = page.title->width - 1.6 * page.font_px;
  while (style.size_px > min_font_px && text_size(title, style).x() > room) --style.size_px;
  canvas.text({0.8 * page.font_px, page.title->height / 2.0}, shortened_text(title, style, room),
              style);
}

void draw_legends(const ScenePage& page, const std::vector<Legend>& legends, Canvas& canvas) {
  if (!page.legend) return;
  const int font = page.legend_font_px;
  const double left = std::round(page.legend->left + 0.9 * font);
  const double hair = std::max(1.0, font / 14.0);
  double y = page.legend->top + 0.4 * font;
  for (const Legend& legend : legends) {
    canvas.text({left, y + title_row_height * font / 2.0}, legend.title,
                {.size_px = font, .bold = true});
    y += title_row_height * font;
    if (legend.continuous) {
      draw_scalar_bar(legend, left, y + 0.3 * font, font, canvas);
      y += (bar_height + 0.9) * font;
    }
    for (const LegendEntry& entry : legend.entries) {
      const double side = std::round(swatch * font);
      const PixelRect box{left, std::round(y + (row_height * font - side) / 2.0),
                          std::round(bar_width * font), side};
      canvas.rectangle(
          {box.left - hair, box.top - hair, box.width + 2 * hair, box.height + 2 * hair},
          frame_color);
      canvas.rectangle(box, entry.color);
      canvas.text({box.right() + 0.5 * font, y + row_height * font / 2.0}, entry.text,
                  {.size_px = font});
      y += row_height * font;
    }
    y += legend_gap * font;
  }
}

void draw_axes(const ScenePage& page, const SceneCamera& camera, Canvas& canvas) {
  if (!page.axes) return;
  const double f = page.font_px;
  const double length = 2.3 * f;
  const std::array<const char*, 3> names{"x", "y", "z"};
  const std::array<Color, 3> colors{{{200, 30, 30}, {20, 130, 40}, {40, 80, 210}}};
  std::array<Eigen::Vector2d, 3> tips;
  Eigen::Vector2d low = Eigen::Vector2d::Zero();
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    tips[k] = length * Eigen::Vector2d(camera.right[axis], -camera.up[axis]);
    low = low.cwiseMin(tips[k]);
    high = high.cwiseMax(tips[k]);
  }
  const Eigen::Vector2d middle(page.axes->left + page.axes->width / 2.0,
                               page.axes->top + page.axes->height / 2.0);
  const Eigen::Vector2d origin = middle - (low + high) / 2.0;
  // Axes are drawn from back to front.
  std::array<std::size_t, 3> order{0, 1, 2};
  std::sort(order.begin(), order.end(), [&camera](std::size_t a, std::size_t b) {
    return camera.forward[static_cast<Eigen::Index>(a)] >
           camera.forward[static_cast<Eigen::Index>(b)];
  });
  const double width = std::max(1.5, 0.14 * f);
  for (const std::size_t k : order) {
    TextStyle style{
        .size_px = page.font_px, .bold = true, .color = colors[k], .align = TextAlign::center};
    if (tips[k].norm() > 0.15 * length) {
      draw_arrow(origin, origin + tips[k], width, colors[k], canvas);
      canvas.text(origin + tips[k] + 0.6 * f * tips[k].normalized(), names[k], style);
      continue;
    }
    // An axis along the view is a ring, with a dot if it points toward the viewer.
    canvas.disc(origin, 0.38 * f, colors[k]);
    canvas.disc(origin, 0.38 * f - std::max(1.0, 0.1 * f), paper);
    if (camera.forward[static_cast<Eigen::Index>(k)] < 0.0)
      canvas.disc(origin, 0.14 * f, colors[k]);
    const Eigen::Vector2d free_side = -(low + high) / 2.0;
    canvas.text(
        origin + 0.85 * f *
                     (free_side.norm() > 0.0 ? free_side.normalized() : Eigen::Vector2d(0.0, 1.0)),
        names[k], style);
  }
}

void draw_scale_bar(const ScenePage& page, const SceneCamera& camera,
                    const Eigen::Vector3d& reference, Canvas& canvas) {
  if (!page.scale_bar) return;
  const double depth = camera.depth_of(reference);
  if (!(depth > 0.0)) return;
  const double f = page.font_px;
  const TextStyle style{.size_px = page.font_px};
  const PixelRect& band = *page.scale_bar;
  const double pixels_per_m = camera.pixels_per_m(depth);
  const double longest_px = std::min(0.3 * page.plot.width, 0.5 * (band.width - 1.6 * f));
  if (longest_px < 2.0 * f) return;
  const double length_m = round_length_m(longest_px / pixels_per_m);
  const double length_px = length_m * pixels_per_m;
  const double left = band.left + 0.8 * f;
  const double y = std::round(band.top + band.height / 2.0);
  const double thickness = std::max(2.0, std::round(0.16 * f));
  const double tick = 0.45 * f;
  canvas.rectangle({left, y - thickness / 2.0, length_px, thickness}, ink);
  for (const double x : {left, left + length_px - thickness})
    canvas.rectangle({x, y - tick, thickness, 2.0 * tick}, ink);
  std::string text = length_text(length_m);
  const double room = band.width - length_px - 2.2 * f;
  if (camera.perspective && text_size(text + " at the center", style).x() <= room)
    text += " at the center";
  if (text_size(text, style).x() <= room) canvas.text({left + length_px + 0.6 * f, y}, text, style);
}

std::vector<PixelRect> place_labels(const std::vector<LabelRequest>& requests,
                                    double point_radius_px, const PixelRect& bounds) {
  std::vector<PixelRect> taken;
  taken.reserve(2 * requests.size());
  for (const LabelRequest& request : requests)
    taken.push_back({request.anchor.x() - point_radius_px, request.anchor.y() - point_radius_px,
                     2.0 * point_radius_px, 2.0 * point_radius_px});
  std::vector<PixelRect> boxes;
  for (const LabelRequest& request : requests) {
    PixelRect best;
    double least = std::numeric_limits<double>::infinity();
    for (int ring = 0; ring < rings && least > 1e-6; ++ring) {
      const double gap = point_radius_px * 1.25 + ring * 0.6 * request.height_px;
      for (const auto& direction : directions) {
        const PixelRect box = box_beside(request, direction, gap);
        const double covered = covered_area(box, taken, bounds);
        if (covered >= least) continue;
        least = covered;
        best = box;
        if (least <= 1e-6) break;
      }
    }
    boxes.push_back(best);
    taken.push_back(best);
  }
  return boxes;
}

void draw_markers(const ScenePage& page, const SceneCamera& camera,
                  const std::vector<Marker>& markers, Canvas& canvas) {
  const double f = page.font_px;
  const double radius = std::max(3.0, 0.32 * f);
  const double border = std::max(1.0, std::round(0.1 * f));
  const TextStyle style{.size_px = std::max(min_font_px, static_cast<int>(0.85 * f)),
                        .align = TextAlign::center};
  std::vector<SeenMarker> seen = seen_markers(page, camera, markers);
  const bool labeled = have_room_for_labels(seen, page.plot, 1.3 * style.size_px);
  if (seen.size() > many_markers) downsample_markers(radius, labeled, seen);
  std::vector<LabelRequest> requests;
  if (labeled)
    for (const SeenMarker& one : seen) {
      LabelRequest& request = requests.emplace_back(LabelRequest{.anchor = one.pixel});
      if (one.marker->label.empty()) continue;
      request.width_px = text_size(one.marker->label, style).x() + 0.6 * f + 2.0 * border;
      request.height_px = 1.3 * style.size_px + 2.0 * border;
    }
  const std::vector<PixelRect> boxes = place_labels(requests, radius + border, page.plot);

  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (requests[i].width_px == 0.0) continue;
    const PixelRect& box = boxes[i];
    const Eigen::Vector2d middle(box.left + box.width / 2.0, box.top + box.height / 2.0);
    canvas.polyline({requests[i].anchor, middle}, border, ink);
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Color color = verdict_color(seen[i].marker->verdict);
    canvas.disc(seen[i].pixel, radius + border, paper);
    canvas.disc(seen[i].pixel, radius, color);
    if (!labeled || seen[i].marker->label.empty()) continue;
    const PixelRect& box = boxes[i];
    canvas.rectangle(box, color);
    canvas.rectangle(
        {box.left + border, box.top + border, box.width - 2.0 * border, box.height - 2.0 * border},
        paper);
    canvas.text({box.left + box.width / 2.0, box.top + box.height / 2.0}, seen[i].marker->label,
                style);
  }
}

void draw_dimension_lines(const ScenePage& page, const SceneCamera& camera,
                          const std::vector<DimensionLine>& lines, Canvas& canvas) {
  const double f = page.font_px;
  const double width = std::max(1.0, std::round(0.09 * f));
  for (const DimensionLine& line : lines) {
    if (!(camera.depth_of(line.from) > 0.0) || !(camera.depth_of(line.to) > 0.0)) continue;
    const Eigen::Vector2d from = camera.pixel_of(line.from);
    const Eigen::Vector2d to = camera.pixel_of(line.to);
    const Eigen::Vector2d middle = (from + to) / 2.0;
    if ((to - from).norm() < 1.0) continue;
    draw_arrow(middle, from, width, ink, canvas);
    draw_arrow(middle, to, width, ink, canvas);
    const Eigen::Vector2d along = (to - from).normalized();
    TextStyle style{.size_px = page.font_px, .align = TextAlign::center};
    Eigen::Vector2d label_position = middle - Eigen::Vector2d(0.0, 0.8 * f);
    if (std::abs(along.y()) > std::abs(along.x())) {
      style.align = TextAlign::left;
      label_position = middle + Eigen::Vector2d(0.6 * f, 0.0);
    }
    canvas.text(label_position, line.text, style);
  }
}

}  // namespace libmap
