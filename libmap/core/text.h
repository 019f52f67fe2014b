// Numbers and names in text, the same under every locale.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

// The shortest text that reads back as the same number; "nan", "inf", "-inf".
std::string to_text(double value);
std::string to_text(float value);
std::string to_text(std::int64_t value);
// With that many digits after the point, however large the number.
std::string to_fixed_text(double value, int decimals);

// The whole of `text` (spaces around it allowed) as a number, or nothing.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_integer(std::string_view text);
std::optional<int> parse_int(std::string_view text);
// true/false, yes/no, on/off, 1/0.
std::optional<bool> parse_bool(std::string_view text);

std::string_view trim(std::string_view text);   // without white space at both ends
std::string lower_case(std::string_view text);  // of ASCII

// "a, b,,c" -> a, b, c.
std::vector<std::string> split_list(std::string_view text);

// The candidate with the smallest Levenshtein distance to `name`, or the first that begins with
// it; nothing if none is near (more than half of the name would have to change).
std::optional<std::string> nearest_name(std::string_view name,
                                        const std::vector<std::string>& candidates);

// " (did you mean 'X'?)", or an empty text.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace libmap
