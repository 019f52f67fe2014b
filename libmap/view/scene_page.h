// Layout and drawing of the page around a scene: title, legends, axes, scale bar and markers.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "libmap/view/canvas.h"
#include "libmap/view/color_map.h"
#include "libmap/view/scene_camera.h"
#include "libmap/view/scene_view.h"

namespace libmap {

inline constexpr int max_side_px = 16384;  // maximum width and height of an image
inline constexpr int min_font_px = 10;     // minimum font size

struct ScenePage {
  PixelRect plot;                  // whole pixels
  std::optional<PixelRect> title;  // nullopt here and in the next three fields: omitted
  std::optional<PixelRect> legend;
  std::optional<PixelRect> axes;
  std::optional<PixelRect> scale_bar;
  int font_px = 12;
  int legend_font_px = 12;
};

// Plans the page. Omits legend, axes, scale bar and title, in this order, until the scene has at
// least half of the width and 0.55 of the height.
ScenePage plan_page(const SceneViewOptions& options, const std::vector<Legend>& legends);

// Returns the largest length of 1, 2 or 5 times a power of ten meters that is at most `longest_m`.
double round_length_m(double longest_m);
// Returns a length with its unit as text, e.g. "50 m", "2 cm", "5 mm".
std::string length_text(double length_m);

// Returns width and height, px, of legends that are drawn in one column.
Eigen::Vector2d legends_size(const std::vector<Legend>& legends, int font_px);

// Draw title, legends and axes into the page's rectangles, if the page has these.
void draw_title(const ScenePage& page, const std::string& title, Canvas& canvas);
void draw_legends(const ScenePage& page, const std::vector<Legend>& legends, Canvas& canvas);
void draw_axes(const ScenePage& page, const SceneCamera& camera, Canvas& canvas);
// Draws the scale bar. In perspective, scale and label are for the depth of `reference`.
void draw_scale_bar(const ScenePage& page, const SceneCamera& camera,
                    const Eigen::Vector3d& reference, Canvas& canvas);
// Size of a label, and the point that it belongs to.
struct LabelRequest {
  Eigen::Vector2d anchor = Eigen::Vector2d::Zero();  // pixel of the point
  double width_px = 0.0;
  double height_px = 0.0;
};

// Returns one box per request, in the order of the requests: beside the point, or farther away if
// there is no room. Boxes are inside `bounds` and do not overlap each other or the points (discs
// of radius `point_radius_px`); else, the area that overlaps or is outside is minimized.
std::vector<PixelRect> place_labels(const std::vector<LabelRequest>& requests,
                                    double point_radius_px, const PixelRect& bounds);

// Draws markers in the terrain frame. Labels are omitted if the plot is too small for all labels.
// With more than 5000 markers, only labeled markers and one other marker per verdict and square of
// the image (side: a marker's radius) are drawn.
void draw_markers(const ScenePage& page, const SceneCamera& camera,
                  const std::vector<Marker>& markers, Canvas& canvas);

// Draws dimension lines in the terrain frame. Text is above a horizontal line, right of a vertical.
void draw_dimension_lines(const ScenePage& page, const SceneCamera& camera,
                          const std::vector<DimensionLine>& lines, Canvas& canvas);

}  // namespace libmap
