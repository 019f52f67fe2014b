// The page around a scene: title, legends, axes and scale bar, and where the scene itself goes.
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

inline constexpr int max_side_px = 16384;  // of a picture
inline constexpr int min_font_px = 10;

struct ScenePage {
  PixelRect plot;  // whole pixels
  std::optional<PixelRect> title;
  std::optional<PixelRect> legend;
  std::optional<PixelRect> axes;
  std::optional<PixelRect> scale_bar;
  int font_px = 12;
  int legend_font_px = 12;
};

// Leaves out, in this order, legend, axes, scale bar and title where they would leave the scene
// less than half of the width or 0.55 of the height.
ScenePage plan_page(const SceneViewOptions& options, const std::vector<Legend>& legends);

// The longest length of 1, 2 or 5 times a power of ten meters that is at most `longest_m`.
double round_length_m(double longest_m);
// "50 m", "2 cm", "5 mm".
std::string length_text(double length_m);

// Pixels that legends one below the other take, wide and high.
Eigen::Vector2d legends_size(const std::vector<Legend>& legends, int font_px);

// Title, legends and axes at their places on the page.
void draw_title(const ScenePage& page, const std::string& title, Canvas& canvas);
void draw_legends(const ScenePage& page, const std::vector<Legend>& legends, Canvas& canvas);
void draw_axes(const ScenePage& page, const SceneCamera& camera, Canvas& canvas);
// In perspective the bar is true at `reference`, and says so.
void draw_scale_bar(const ScenePage& page, const SceneCamera& camera,
                    const Eigen::Vector3d& reference, Canvas& canvas);
struct LabelRequest {
  Eigen::Vector2d anchor = Eigen::Vector2d::Zero();  // pixel of the point
  double width_px = 0.0;
  double height_px = 0.0;
};

// A box for each request, in their order: beside its point if there is room, else further out; on
// no other point, on no other box and inside `bounds` wherever that is possible, else where the
// least is covered. `point_radius_px` is what is kept free around every point.
std::vector<PixelRect> place_labels(const std::vector<LabelRequest>& requests,
                                    double point_radius_px, const PixelRect& bounds);

// Markers and dimension lines in the terrain frame. Where the plot has no room for the markers'
// labels, not even if each were as narrow as high, none is drawn, and of thousands of markers that
// cover each other one in each square of a disc's radius.
void draw_markers(const ScenePage& page, const SceneCamera& camera,
                  const std::vector<Marker>& markers, Canvas& canvas);

// Their texts keep off the ends of the lines: above a line that lies, to the right of one that
// stands.
void draw_dimension_lines(const ScenePage& page, const SceneCamera& camera,
                          const std::vector<DimensionLine>& lines, Canvas& canvas);

}  // namespace libmap
