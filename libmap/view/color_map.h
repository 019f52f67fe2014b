// Colors of points and triangles by score, field, flag or height, with the matching legend.
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

// automatic: the texture if there is one; else Coloring::field; else "hold_probability" or "score"
//   as in mode score; else own colors unless all are equal; else height.
// own:    colors stored in the data.
// score:  a field from 0 to 1 in the seven classes of the graspability map's legend.
// field:  any scalar field, or "x", "y", "z", on a color scale.
// flags:  by the fields "convex" (blue), "graspable" (dark green) and, if it exists, "obstacle"
//   (1: steep face, brown; 2: out of reach, ochre); all other points light gray.
// height: z in the terrain frame on a color scale.
// single: one color.
// texture: texture of a textured mesh.
enum class ColorMode { automatic, own, score, field, flags, height, single, texture };

// Color scale of continuous values. diverging: blue, gray at the center, red; for signed values.
enum class ColorScale { viridis, diverging };

// A color of a legend and the meaning of the color.
struct LegendEntry {
  Color color{};
  std::string text;

  bool operator==(const LegendEntry&) const = default;
};

// A scalar bar from `min` to `max` if `continuous`, followed by discrete classes from best to
// worst. Empty if the colors need no explanation.
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
  std::string field{};                     // mode `field`; mode `score` (empty: "score")
  std::optional<double> load_n{};          // load of the field hold_probability, N, for the legend
  ColorScale scale = ColorScale::viridis;  // modes `field` and `height`
  // Values at the ends of the scale. If equal: the 2nd and 98th percentile of the data (minimum and
  // maximum if these are equal); for diverging, +- the 98th percentile of the absolute values.
  double range_min = 0.0;
  double range_max = 0.0;
  // Points with smaller z are white in the modes score, field, flags and height.
  double zero_plane_m = -std::numeric_limits<double>::infinity();
  std::string color = "#b0a89c";  // mode `single`: "#rrggbb" or a name
  Legend own_legend{};            // mode `own`: meaning of the colors
};

// Appends a legend unless it is empty or already in the list.
void add_legend(const Legend& legend, std::vector<Legend>& legends);

// Points (or centers of triangles) to be colored, in the terrain frame, meters.
struct ColorSource {
  const std::vector<Eigen::Vector3d>& positions;
  const std::vector<Color>& own_colors;  // may be empty
  const std::vector<ScalarField>& fields;
};

struct ColoredPoints {
  ColorMode mode = ColorMode::single;  // never `automatic`
  std::vector<Color> colors;           // one per position
  Legend legend;
};

// Colors all points. Throws Error if a field is missing (naming a similar field) or has a wrong
// length, the range is descending or not finite, mode `own` has no colors, or a color is invalid.
ColoredPoints color_points(const ColorSource& source, const Coloring& coloring);

// Returns the legend of the classes of core/score_color.h.
Legend score_legend();

// viridis (S. van der Walt and N. Smith, 2015, CC0) at t in 0..1, clamped; NaN is gray.
Color viridis(double t);

// Blue, gray, red (Moreland 2009, "Diverging Color Maps for Scientific Visualization") at t in
// 0..1, clamped; NaN is gray.
Color diverging(double t);
Color color_at(ColorScale scale, double t);

// Parses "#rrggbb", or white, black, gray, light-gray, dark-gray, red, green, blue, yellow, orange.
// Throws Error, which names `field`, for any other text.
Color parse_color(std::string_view text, const std::string& field);

// Colors of mode `flags`: fields "convex", "graspable", "obstacle" 1 and 2, and the rest.
inline constexpr Color convex_color{40, 90, 220};
inline constexpr Color graspable_color{0, 100, 0};
inline constexpr Color obstacle_color{178, 60, 40};
inline constexpr Color unreachable_color{235, 170, 90};
inline constexpr Color rest_color{211, 211, 211};

}  // namespace libmap
