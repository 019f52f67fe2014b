// Checked parsing of untrusted JSON. `Json` is a type of the library nlohmann, which itself casts
// between all number types and does not limit the nesting depth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"

namespace libmap {

// Parses `text`. Throws Error if arrays and objects are nested deeper than 64 levels or an object
// has more than 10,000 members (ordered_json searches linearly). Also throws as Json::parse does.
template <typename Json>
Json parse_json(const std::string& text) {
  constexpr int max_depth = 64;
  constexpr std::size_t max_members = 10'000;
  std::vector<std::size_t> members;  // member counts of the enclosing objects
  return Json::parse(text, [&](int depth, typename Json::parse_event_t event, auto&) {
    if (depth > max_depth) throw Error("is nested deeper than 64 levels");
    if (event == Json::parse_event_t::object_start) members.push_back(0);
    if (event == Json::parse_event_t::object_end) members.pop_back();
    if (event == Json::parse_event_t::key && ++members.back() > max_members)
      throw Error("contains more than 10000 members", {.field = "object"});
    return true;
  });
}

// Returns `json` as an Integer. Throws Error naming `field` if it is not a whole number in range.
template <typename Integer, typename Json>
Integer integer_of(const Json& json, const std::string& field) {
  if (json.is_number_unsigned()) {
    const auto value = json.template get<std::uint64_t>();
    if (std::in_range<Integer>(value)) return static_cast<Integer>(value);
  } else if (json.is_number_integer()) {
    const auto value = json.template get<std::int64_t>();
    if (std::in_range<Integer>(value)) return static_cast<Integer>(value);
  }
  throw Error("not a whole number, or out of range",
              {.field = field, .value = json.is_number() ? json.dump() : json.type_name()});
}

// Returns the member `key` of an object as an Integer. Throws as integer_of and Json::at do.
template <typename Integer, typename Json>
Integer integer_at(const Json& json, const char* key) {
  return integer_of<Integer>(json.at(key), key);
}

}  // namespace libmap
