// What color a point of a map gets, and the legend that says so.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/score_color.h"

namespace libmap {

// automatic: the given field; else "hold_probability", else "score" in the classes of mode score,
//   else own colors where they are not all the same, else height.
// own:    the colors that the data bring.
// score:  the seven classes of the graspability map's legend.
// field:  any scalar field, or "x", "y", "z", on a color scale.
// flags:  convex points blue, intersection ("graspable") dark green, obstacles (1 steep face, 2 out
//   of reach) brown and ochre where there is such a field, the rest light gray.
// height: z of the terrain frame on a color scale.
// single: one color.
// texture: the pictures that a textured mesh brings; `automatic` where there are any.
enum class ColorMode { automatic, own, score, field, flags, height, single, texture };

// Colors of continuous values. diverging: blue below and red above the gray middle, for values
// with a sign.
enum class ColorScale { viridis, diverging };

// One box of a legend, or the color at one value of a scalar bar.
struct LegendEntry {
  Color color{};
  std::string text;

  bool operator==(const LegendEntry&) const = default;
};

// Discrete classes from the best to the worst; before them a scalar bar from `min` to `max` if
// `continuous`. Nothing at all where colors need no explanation.
struct Legend {
  std::string title;
  bool continuous = false;
  double min = 0.0;
  double max = 0.0;
  ColorScale scale = ColorScale::viridis;
  std::vector<LegendEntry> entries;

  bool empty() const { return !continuous && entries.empty(); }
  bool operator==(const Legend&) const = default;
};

struct Coloring {
  ColorMode mode = ColorMode::automatic;
  std::string field{};             // of mode `field`; another field than "score" in mode `score`
  std::optional<double> load_n{};  // of hold_probability, for the legend
  ColorScale scale = ColorScale::viridis;  // of the modes field and height
  // Values at the ends of the scale. Both equal: the data's 2nd and 98th percentile; of a diverging
  // scale plus and minus the 98th percentile of their sizes.
  double range_min = 0.0;
  double range_max = 0.0;
  // Points with z below it are white in the modes score, field, flags and height.
  double zero_plane_m = -std::numeric_limits<double>::infinity();
  std::string color = "#b0a89c";  // of mode `single`: "#rrggbb" or a name
  Legend own_legend{};            // of mode `own`: what the colors mean
};

// Appends it, unless it is empty or among them already.
void add_legend(const Legend& legend, std::vector<Legend>& legends);

// What is to be colored: points (or the centers of triangles) in the terrain frame, meters.
struct ColorSource {
  const std::vector<Eigen::Vector3d>& positions;
  const std::vector<Color>& own_colors;  // may be empty
  const std::vector<ScalarField>& fields;
};

struct ColoredPoints {
  ColorMode mode = ColorMode::single;  // never `automatic`
  std::vector<Color> colors;           // one a position
  Legend legend;
};

// Throws Error: a field that is not there (with the nearest known one), a range upside down, own
// colors asked of data without any, a color that is none.
ColoredPoints color_points(const ColorSource& source, const Coloring& coloring);

// The classes of core/score_color.h.
Legend score_legend();

// viridis (S. van der Walt and N. Smith, 2015, CC0) at t in 0..1, clamped; NaN is gray.
Color viridis(double t);

// Blue, gray, red (Moreland 2009, "Diverging Color Maps for Scientific Visualization"), likewise.
Color diverging(double t);
Color color_at(ColorScale scale, double t);

// "#rrggbb", or white, black, gray, light-gray, dark-gray, red, green, blue, yellow, orange.
// Throws Error naming `field`.
Color parse_color(std::string_view text, const std::string& field);

inline constexpr Color convex_color{40, 90, 220};
inline constexpr Color intersection_color{0, 100, 0};
inline constexpr Color obstacle_color{178, 60, 40};
inline constexpr Color unreachable_color{235, 170, 90};
inline constexpr Color rest_color{211, 211, 211};

}  // namespace libmap
