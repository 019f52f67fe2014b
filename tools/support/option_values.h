// Parses the values of command-line options: lists, vectors, sizes, numbers.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace graspmap_tools {

// Splits at '|' and trims: "a| b||c" -> "a", "b", "", "c". Returns an empty list for an empty text.
std::vector<std::string> split_texts(std::string_view text);
// Splits at '|'. Throws Error with `reason` and `field` if there are more than `max_count` texts.
std::vector<std::string> split_texts(std::string_view text, std::size_t max_count,
                                     const std::string& reason, const std::string& field);

// Parses `count` finite numbers, separated by commas; returns nullopt for any other text.
std::optional<std::vector<double>> split_numbers(std::string_view text, std::size_t count);
// Parses `count` finite numbers. Throws Error naming `field` and `bound`, the expected form.
std::vector<double> parse_numbers(const std::string& text, std::size_t count,
                                  const std::string& field, const std::string& bound);

// Parses "X,Y,Z". Throws Error naming `field`.
Eigen::Vector3d parse_vector(const std::string& text, const std::string& field);

// Parses "3x2", or "3" for both: two finite numbers > 0. Returns nullopt for any other text.
std::optional<Eigen::Vector2d> split_size(std::string_view text);

// Parses a finite number; returns nullopt for `word`. Throws Error with `reason`, `field` and
// `bound` for any other text.
std::optional<double> parse_number_or(std::string_view word, const std::string& text,
                                      const std::string& reason, const std::string& field,
                                      const std::string& bound);

}  // namespace graspmap_tools
