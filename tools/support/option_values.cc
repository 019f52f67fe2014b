#include "tools/support/option_values.h"

#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace graspmap_tools {

std::vector<std::string> split_texts(std::string_view text) {
  std::vector<std::string> parts;
  if (text.empty()) return parts;
  while (true) {
    const std::size_t end = text.find('|');
    parts.emplace_back(libmap::trim(text.substr(0, end)));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

std::vector<std::string> split_texts(std::string_view text, std::size_t max_count,
                                     const std::string& reason, const std::string& field) {
  std::vector<std::string> texts = split_texts(text);
  if (texts.size() <= max_count) return texts;
  throw libmap::Error(reason, {.field = field,
                               .value = std::to_string(texts.size()),
                               .bound = "<= " + std::to_string(max_count)});
}

std::optional<std::vector<double>> split_numbers(std::string_view text, std::size_t count) {
  std::vector<double> numbers;
  while (numbers.size() < count) {
    const std::size_t comma = text.find(',');
    const auto number = libmap::parse_double(text.substr(0, comma));
    const bool is_last = comma == std::string_view::npos;
    if (!number || !std::isfinite(*number) || is_last != (numbers.size() + 1 == count)) break;
    numbers.push_back(*number);
    if (is_last) return numbers;
    text.remove_prefix(comma + 1);
  }
  return std::nullopt;
}

std::vector<double> parse_numbers(const std::string& text, std::size_t count,
                                  const std::string& field, const std::string& bound) {
  if (const auto numbers = split_numbers(text, count)) return *numbers;
  throw libmap::Error("not " + std::to_string(count) + " numbers",
                      {.field = field, .value = text, .bound = bound});
}

Eigen::Vector3d parse_vector(const std::string& text, const std::string& field) {
  if (const auto numbers = split_numbers(text, 3)) return Eigen::Vector3d(numbers->data());
  throw libmap::Error("not three numbers", {.field = field, .value = text, .bound = "X,Y,Z"});
}

std::optional<Eigen::Vector2d> split_size(std::string_view text) {
  const std::size_t by = text.find_first_of("xX");
  const auto x = libmap::parse_double(text.substr(0, by));
  const auto y = by == std::string_view::npos ? x : libmap::parse_double(text.substr(by + 1));
  if (!x || !y || !(*x > 0.0) || !(*y > 0.0) || !std::isfinite(*x * *y)) return std::nullopt;
  return Eigen::Vector2d(*x, *y);
}

std::optional<double> parse_number_or(std::string_view word, const std::string& text,
                                      const std::string& reason, const std::string& field,
                                      const std::string& bound) {
  if (text == word) return std::nullopt;
  const auto number = libmap::parse_double(text);
  if (number && std::isfinite(*number)) return number;
  throw libmap::Error(reason, {.field = field, .value = text, .bound = bound});
}

}  // namespace graspmap_tools
