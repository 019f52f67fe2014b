// Locale-independent conversion of numbers and names to and from text.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

// Returns the shortest text that parses to the same number; "nan", "inf", "-inf".
std::string to_text(double value);
std::string to_text(float value);
std::string to_text(std::int64_t value);
// Returns fixed-point notation with `decimals` digits after the point.
std::string to_fixed_text(double value, int decimals);

// Return the number in `text` (ignoring outer white space); nullopt if invalid or out of range.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_integer(std::string_view text);
std::optional<int> parse_int(std::string_view text);
// Parses true/false, yes/no, on/off, 1/0, in upper or lower case. Returns nullopt for other text.
std::optional<bool> parse_bool(std::string_view text);

std::string_view trim(std::string_view text);   // removes white space at both ends
std::string lower_case(std::string_view text);  // converts ASCII letters only

// Splits at commas and drops empty parts: "a, b,,c" -> a, b, c.
std::vector<std::string> split_list(std::string_view text);

// Returns the candidate with the smallest Levenshtein distance to `name`, at most name.size() / 2;
// else the first that begins with `name`, if name.size() >= 3; else nullopt. Case-insensitive.
std::optional<std::string> nearest_name(std::string_view name,
                                        const std::vector<std::string>& candidates);

// Returns " (did you mean 'X'?)" for the nearest candidate, or an empty text.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace libmap
