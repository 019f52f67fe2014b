// JSON from outside by nlohmann's library (`Json` is one of its types), which by itself casts any
// number to any other, and walks through what is nested without a bound.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "libmap/core/error.h"

namespace libmap {

// Throws Error where arrays and objects are nested deeper than 64 levels, and what Json::parse
// throws.
template <typename Json>
Json parse_json(const std::string& text) {
  constexpr int max_depth = 64;
  return Json::parse(text, [](int depth, auto, auto&) {
    if (depth > max_depth) throw Error("is nested deeper than 64 levels");
    return true;
  });
}

// `json` as an Integer. Throws Error naming `field` if it is no whole number or out of range.
template <typename Integer, typename Json>
Integer integer_of(const Json& json, const std::string& field) {
  if (json.is_number_unsigned()) {
    const auto value = json.template get<std::uint64_t>();
    if (std::in_range<Integer>(value)) return static_cast<Integer>(value);
  } else if (json.is_number_integer()) {
    const auto value = json.template get<std::int64_t>();
    if (std::in_range<Integer>(value)) return static_cast<Integer>(value);
  }
  throw Error("is no whole number, or out of range",
              {.file = {},
               .field = field,
               .value = json.is_number() ? json.dump() : json.type_name(),
               .bound = {}});
}

// The member `key` of an object as an Integer. Throws as integer_of, and what Json::at throws.
template <typename Integer, typename Json>
Integer integer_at(const Json& json, const char* key) {
  return integer_of<Integer>(json.at(key), key);
}

}  // namespace libmap
