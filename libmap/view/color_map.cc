#include "libmap/view/color_map.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

// Every 15th of matplotlib's 256 entries; between them the map is linear to within a byte.
constexpr std::array<std::array<double, 3>, 18> viridis_points{{
    {0.267004, 0.004874, 0.329415},
    {0.281924, 0.089666, 0.412415},
    {0.280255, 0.165693, 0.476498},
    {0.263663, 0.237631, 0.518762},
    {0.237441, 0.305202, 0.541921},
    {0.208623, 0.367752, 0.552675},
    {0.182256, 0.426184, 0.557120},
    {0.159194, 0.482237, 0.558073},
    {0.137770, 0.537492, 0.554906},
    {0.121148, 0.592739, 0.544641},
    {0.128087, 0.647749, 0.523491},
    {0.180653, 0.701402, 0.488189},
    {0.274149, 0.751988, 0.436601},
    {0.395174, 0.797475, 0.367757},
    {0.535621, 0.835785, 0.281908},
    {0.688944, 0.865448, 0.182725},
    {0.845561, 0.887322, 0.099702},
    {0.993248, 0.906157, 0.143936},
}};

// The 33 colors of the paper's table, from blue over gray to red.
constexpr std::array<Color, 33> diverging_points{{
    {59, 76, 192},   {68, 90, 204},   {77, 104, 215},  {87, 117, 225},  {98, 130, 234},
    {108, 142, 241}, {119, 154, 247}, {130, 165, 251}, {141, 176, 254}, {152, 185, 255},
    {163, 194, 255}, {174, 201, 253}, {184, 208, 249}, {194, 213, 244}, {204, 217, 238},
    {213, 219, 230}, {221, 221, 221}, {229, 216, 209}, {236, 211, 197}, {241, 204, 185},
    {245, 196, 173}, {247, 187, 160}, {247, 177, 148}, {247, 166, 135}, {244, 154, 123},
    {241, 141, 111}, {236, 127, 99},  {229, 112, 88},  {222, 96, 77},   {213, 80, 66},
    {203, 62, 56},   {192, 40, 47},   {180, 4, 38},
}};

struct NamedColor {
  const char* name;
  Color color;
};
constexpr std::array<NamedColor, 10> named_colors{{
    {"white", {255, 255, 255}},
    {"black", {0, 0, 0}},
    {"gray", {128, 128, 128}},
    {"light-gray", {211, 211, 211}},
    {"dark-gray", {70, 70, 70}},
    {"red", {214, 24, 24}},
    {"green", {34, 170, 34}},
    {"blue", {40, 90, 220}},
    {"yellow", {255, 235, 0}},
    {"orange", {255, 140, 0}},
}};

[[noreturn]] void throw_unknown_field(const ColorSource& source, const std::string& name) {
  std::vector<std::string> known;
  for (const ScalarField& field : source.fields) known.push_back(field.name);
  for (const char* axis : {"x", "y", "z"}) known.emplace_back(axis);
  std::string bound = "one of";
  for (const std::string& candidate : known) bound += " " + candidate;
  throw Error("no such field" + did_you_mean(name, known),
              {.field = "field", .value = name, .bound = bound});
}

std::vector<double> values_of(const ColorSource& source, const std::string& name) {
  if (const ScalarField* field = find_field(source.fields, name)) {
    if (field->values.size() != source.positions.size())
      throw Error("not one value per point",
                  {.field = name,
                   .value = std::to_string(field->values.size()) + " values",
                   .bound = std::to_string(source.positions.size())});
    return field->values;
  }
  if (name != "x" && name != "y" && name != "z") throw_unknown_field(source, name);
  const Eigen::Index axis = name[0] - 'x';
  std::vector<double> values;
  values.reserve(source.positions.size());
  for (const Eigen::Vector3d& position : source.positions) values.push_back(position[axis]);
  return values;
}

// The 2nd and 98th percentile (nearest rank), or the full range if both are equal; symmetric about
// 0 for the diverging scale.
std::pair<double, double> percentile_range(std::vector<double> values, ColorScale scale) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return {0.0, 0.0};
  if (scale == ColorScale::diverging)
    for (double& value : values) value = std::abs(value);
  const auto at = [&values](double fraction) {
    const auto rank =
        static_cast<std::ptrdiff_t>(std::lround(fraction * static_cast<double>(values.size() - 1)));
    std::nth_element(values.begin(), values.begin() + rank, values.end());
    return values[static_cast<std::size_t>(rank)];
  };
  // The full range makes rare values visible if nearly all values are equal, for example of a flag.
  const auto [least, greatest] = std::ranges::minmax(values);
  if (scale == ColorScale::diverging) {
    const double end = at(0.98) > 0.0 ? at(0.98) : greatest;
    return {-end, end};
  }
  if (const std::pair ends{at(0.02), at(0.98)}; ends.first < ends.second) return ends;
  return {least, greatest};
}

// Colors points below the zero plane white and adds a legend entry for them.
void finish(const ColorSource& source, const Coloring& coloring, ColoredPoints& result) {
  bool any_below = false;
  for (std::size_t i = 0; i < result.colors.size(); ++i) {
    if (!(source.positions[i].z() < coloring.zero_plane_m)) continue;
    result.colors[i] = below_plane_color;
    any_below = true;
  }
  if (any_below) result.legend.entries.push_back({below_plane_color, "below zero plane"});
}

void add_no_value(const std::vector<double>& values, Legend& legend) {
  if (std::any_of(values.begin(), values.end(), [](double value) { return std::isnan(value); }))
    legend.entries.push_back({no_value_color, "no value"});
}

constexpr const char* hold_probability = "hold_probability";

bool is_score(const std::string& name) { return name == "score" || name == hold_probability; }

// Legend title: forces with their unit, a probability with its load, other fields by name.
std::string title_of(std::string name, const Coloring& coloring) {
  if (name == hold_probability)
    return "probability to hold" + (coloring.load_n ? " " + to_text(*coloring.load_n) + " N" : "");
  if (!name.ends_with("_n")) return name;
  std::replace(name.begin(), name.end(), '_', ' ');
  return name.substr(0, name.size() - 1) + "[N]";
}

void color_by_score(const ColorSource& source, const Coloring& coloring, ColoredPoints& result) {
  const bool is_held = coloring.mode == ColorMode::automatic &&
                       find_field(source.fields, hold_probability) != nullptr;
  const std::string name = !coloring.field.empty() ? coloring.field
                           : is_held               ? hold_probability
                                                   : "score";
  const std::vector<double> values = values_of(source, name);
  for (const double value : values) result.colors.push_back(score_color(value));
  result.legend = score_legend();
  result.legend.title = title_of(name, coloring);
  add_no_value(values, result.legend);
  finish(source, coloring, result);
}

void color_by_field(const ColorSource& source, const Coloring& coloring, const std::string& name,
                    const std::string& title, ColoredPoints& result) {
  if (!std::isfinite(coloring.range_min) || !std::isfinite(coloring.range_max) ||
      coloring.range_max < coloring.range_min)
    throw Error("the color range is descending or not finite",
                {.field = "range_max",
                 .value = to_text(coloring.range_max),
                 .bound = ">= range_min = " + to_text(coloring.range_min)});
  const std::vector<double> values = values_of(source, name);
  auto [low, high] = std::pair{coloring.range_min, coloring.range_max};
  if (low == high) std::tie(low, high) = percentile_range(values, coloring.scale);
  for (const double value : values) {
    // A constant field gets the middle color; NaN stays NaN.
    const double t = high > low ? (value - low) / (high - low) : value - value + 0.5;
    result.colors.push_back(color_at(coloring.scale, t));
  }
  result.legend = {.title = title,
                   .continuous = high > low,
                   .min = low,
                   .max = high,
                   .scale = coloring.scale,
                   .entries = {}};
  if (high == low)
    result.legend.entries.push_back(
        {color_at(coloring.scale, 0.5), to_text(static_cast<float>(low))});
  add_no_value(values, result.legend);
  finish(source, coloring, result);
}

void color_by_flags(const ColorSource& source, const Coloring& coloring, ColoredPoints& result) {
  const bool has_convex = find_field(source.fields, "convex") != nullptr;
  const bool has_graspable = find_field(source.fields, "graspable") != nullptr;
  if (!has_convex && !has_graspable) throw_unknown_field(source, "convex");
  const std::size_t count = source.positions.size();
  const std::vector<double> convex =
      has_convex ? values_of(source, "convex") : std::vector<double>(count, 0.0);
  const std::vector<double> graspable =
      has_graspable ? values_of(source, "graspable") : std::vector<double>(count, 0.0);
  const bool has_obstacles = find_field(source.fields, "obstacle") != nullptr;
  const std::vector<double> obstacle =
      has_obstacles ? values_of(source, "obstacle") : std::vector<double>(count, 0.0);
  for (std::size_t i = 0; i < count; ++i)
    result.colors.push_back(graspable[i] > 0.0  ? graspable_color
                            : obstacle[i] > 1.0 ? unreachable_color
                            : obstacle[i] > 0.0 ? obstacle_color
                            : convex[i] > 0.0   ? convex_color
                                                : rest_color);
  result.legend.title = "graspable areas";
  if (has_graspable) result.legend.entries.push_back({graspable_color, "graspable"});
  if (has_obstacles) {
    result.legend.entries.push_back({obstacle_color, "steep face"});
    result.legend.entries.push_back({unreachable_color, "out of reach"});
  }
  if (has_convex) result.legend.entries.push_back({convex_color, "convex"});
  result.legend.entries.push_back({rest_color, "other"});
  finish(source, coloring, result);
}

ColorMode automatic_mode(const ColorSource& source, const std::string& field) {
  if (!field.empty()) return is_score(field) ? ColorMode::score : ColorMode::field;
  if (find_field(source.fields, "score") != nullptr ||
      find_field(source.fields, hold_probability) != nullptr)
    return ColorMode::score;
  const auto& own = source.own_colors;
  const bool varied = std::any_of(own.begin(), own.end(),
                                  [&own](const Color& color) { return color != own.front(); });
  return varied ? ColorMode::own : ColorMode::height;
}

std::uint8_t to_byte(double fraction) {
  return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(fraction, 0.0, 1.0)));
}

// Index of the color below t among `count` evenly spaced ones, and the fraction to the next.
std::pair<std::size_t, double> segment_of(std::size_t count, double t) {
  const double index = std::clamp(t, 0.0, 1.0) * static_cast<double>(count - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(index), count - 2);
  return {below, index - static_cast<double>(below)};
}

// Interpolates evenly spaced points, whose maximum channel value is `full`, at t.
template <typename Points>
Color interpolated(const Points& points, double full, double t) {
  if (std::isnan(t)) return no_value_color;
  const auto [below, fraction] = segment_of(points.size(), t);
  Color color{};
  for (std::size_t c = 0; c < 3; ++c)
    color[c] =
        to_byte(((1.0 - fraction) * points[below][c] + fraction * points[below + 1][c]) / full);
  return color;
}

}  // namespace

void add_legend(const Legend& legend, std::vector<Legend>& legends) {
  if (!legend.empty() && std::find(legends.begin(), legends.end(), legend) == legends.end())
    legends.push_back(legend);
}

ColoredPoints color_points(const ColorSource& source, const Coloring& coloring) {
  ColoredPoints result;
  result.mode = coloring.mode == ColorMode::automatic ? automatic_mode(source, coloring.field)
                                                      : coloring.mode;
  result.colors.reserve(source.positions.size());
  switch (result.mode) {
    case ColorMode::own:
      if (source.own_colors.size() != source.positions.size())
        throw Error("the data contain no colors", {.field = "color mode", .value = "own"});
      result.colors = source.own_colors;
      result.legend = coloring.own_legend;
      break;
    case ColorMode::score:
      color_by_score(source, coloring, result);
      break;
    case ColorMode::field:
      if (coloring.field.empty()) throw_unknown_field(source, coloring.field);
      color_by_field(source, coloring, coloring.field, title_of(coloring.field, coloring), result);
      break;
    case ColorMode::flags:
      color_by_flags(source, coloring, result);
      break;
    case ColorMode::height:
      color_by_field(source, coloring, "z", "height [m]", result);
      break;
    case ColorMode::single:
    case ColorMode::automatic:
    case ColorMode::texture:
      result.colors.assign(source.positions.size(), parse_color(coloring.color, "color"));
      break;
  }
  return result;
}

Legend score_legend() {
  Legend legend;
  legend.title = "score";
  for (const ScoreClass& entry : score_classes) legend.entries.push_back({entry.color, entry.text});
  return legend;
}

Color viridis(double t) { return interpolated(viridis_points, 1.0, t); }

Color diverging(double t) { return interpolated(diverging_points, 255.0, t); }

Color color_at(ColorScale scale, double t) {
  return scale == ColorScale::diverging ? diverging(t) : viridis(t);
}

Color parse_color(std::string_view text, const std::string& field) {
  for (const NamedColor& named : named_colors)
    if (text == named.name) return named.color;
  unsigned value = 0;
  if (text.size() == 7 && text.front() == '#') {
    const auto [end, status] = std::from_chars(text.data() + 1, text.data() + 7, value, 16);
    if (status == std::errc{} && end == text.data() + 7)
      return {static_cast<std::uint8_t>(value >> 16U), static_cast<std::uint8_t>(value >> 8U),
              static_cast<std::uint8_t>(value)};
  }
  std::vector<std::string> known;
  known.reserve(named_colors.size());
  for (const NamedColor& named : named_colors) known.emplace_back(named.name);
  std::string bound = "#rrggbb or one of";
  for (const std::string& name : known) bound += " " + name;
  throw Error("not a color" + did_you_mean(text, known),
              {.field = field, .value = std::string(text), .bound = bound});
}

}  // namespace libmap
