// What a run found, each figure named once: for the manifest, for --json and for text.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "libmap/core/manifest.h"

namespace graspmap_tools {

// Any whole number, a number, a text, or several numbers. An empty std::optional is null in JSON
// and left out of the manifest.
struct Result {
  template <typename Value>
  Result(std::string result_name, const Value& found)
      : name(std::move(result_name)), value(held(found)) {}

  std::string name;
  std::optional<libmap::ManifestValue> value;

 private:
  template <typename Value>
  static std::optional<libmap::ManifestValue> held(const Value& found) {
    if constexpr (requires { found.has_value(); })
      return found ? held(*found) : std::nullopt;
    else if constexpr (std::is_same_v<Value, bool>)
      return found;
    else if constexpr (std::is_integral_v<Value>)
      return static_cast<std::int64_t>(found);
    else if constexpr (std::is_arithmetic_v<Value>)
      return static_cast<double>(found);
    else if constexpr (std::is_convertible_v<const Value&, std::string_view>)
      return std::string(std::string_view(found));
    else
      return std::vector<double>(found.begin(), found.end());
  }
};
using Results = std::vector<Result>;

// Those with a value.
void add_results(const Results& results, libmap::Manifest& manifest);
nlohmann::ordered_json to_json(const libmap::ManifestValue& value);
nlohmann::ordered_json to_json(const Results& results);

// To standard output, with what is no UTF-8 replaced.
void print_json(const nlohmann::ordered_json& json);

}  // namespace graspmap_tools
