// Colors of graspability scores, as in "Graspable Target Detection for Hexapod Robots" (2023).
#pragma once

#include <array>
#include <limits>

#include "libmap/core/point_cloud.h"

namespace libmap {

struct ScoreClass {
  double min_score = 0.0;  // lower limit, included in the class; scores are 0 to 1
  Color color{};
  const char* text = "";  // text in the legend
};

// From the best to the worst: dark green, green, yellow-green, yellow, light orange, orange, red.
inline constexpr std::array<ScoreClass, 7> score_classes{{
    {0.9, {0, 100, 0}, "0.9 and above"},
    {0.8, {34, 170, 34}, "0.8 to 0.9"},
    {0.7, {154, 205, 50}, "0.7 to 0.8"},
    {0.6, {255, 235, 0}, "0.6 to 0.7"},
    {0.5, {255, 200, 110}, "0.5 to 0.6"},
    {0.4, {255, 140, 0}, "0.4 to 0.5"},
    {-std::numeric_limits<double>::infinity(), {214, 24, 24}, "below 0.4"},
}};
inline constexpr Color below_plane_color{255, 255, 255};  // for z < zero_plane_m of a map (libgtd)
inline constexpr Color no_value_color{128, 128, 128};     // for NaN

// Returns the color of a score's class; gray for NaN. Class limits have a tolerance of 1e-6, so
// that storage in single precision does not change the class.
constexpr Color score_color(double score) {
  for (const ScoreClass& one : score_classes)
    if (score >= one.min_score - 1e-6) return one.color;
  return no_value_color;
}

}  // namespace libmap
