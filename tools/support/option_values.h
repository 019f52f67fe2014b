// What the texts of options say.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace graspmap_tools {

// "a| b||c" at '|' -> a, b, "", c; nothing for an empty text.
std::vector<std::string> split_texts(std::string_view text);
// The same. Throws Error with `reason` and `field` if there are more than `most`.
std::vector<std::string> split_texts(std::string_view text, std::size_t most,
                                     const std::string& reason, const std::string& field);

// `count` finite numbers with commas between them; nothing for any other text.
std::optional<std::vector<double>> split_numbers(std::string_view text, std::size_t count);
// The same. Throws Error naming `field` and `bound`, the form that it must have.
std::vector<double> parse_numbers(const std::string& text, std::size_t count,
                                  const std::string& field, const std::string& bound);

// "X,Y,Z". Throws Error naming `field`.
Eigen::Vector3d parse_vector(const std::string& text, const std::string& field);

// "3x2", or "3" for both: two finite numbers above 0; nothing for any other text.
std::optional<Eigen::Vector2d> split_size(std::string_view text);

// A finite number; nothing for `word`. Throws Error with `reason`, `field` and `bound`.
std::optional<double> parse_number_or(std::string_view word, const std::string& text,
                                      const std::string& reason, const std::string& field,
                                      const std::string& bound);

}  // namespace graspmap_tools
