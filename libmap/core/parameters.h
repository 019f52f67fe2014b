// Table of parameters, bound to the fields of option structs with key, description and range.
// Flags, YAML files, --print-config and manifests use it: defaults are defined once, in the struct.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

enum class ParameterType { boolean, integer, real, text };  // type of a parameter's value

// Interval of valid numbers.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_open = false;  // true: `min` itself is invalid
  bool max_open = false;  // true: `max` itself is invalid
};
inline constexpr Range any_number{};
inline constexpr Range not_negative{0.0};
inline constexpr Range positive{0.0, std::numeric_limits<double>::infinity(), true, false};
inline constexpr Range zero_to_one{0.0, 1.0};
std::string describe(const Range& range);  // e.g. "> 0", ">= 0 and <= 1"

struct Parameter {
  std::string key;          // as in YAML, with unit: "voxel_size_m"
  std::string description;  // one line
  ParameterType type = ParameterType::text;
  std::vector<std::string> choices{};         // names of an enumeration's values; else empty
  std::function<std::string()> get;           // returns the value as text, which `set` accepts
  std::function<void(std::string_view)> set;  // throws Error naming key, value and bound
  std::function<void()> check{};  // checks the field, throws as `set`; empty: any value is valid
};

class ParameterTable {
 public:
  // Adds a parameter whose value is in `field`, which must outlive the table.
  void add(std::string key, double& field, Range range, std::string description);
  // The text "auto" sets the field to nullopt.
  void add(std::string key, std::optional<double>& field, Range range, std::string description);
  void add(std::string key, int& field, Range range, std::string description);
  void add(std::string key, std::uint64_t& field, Range range, std::string description);
  void add(std::string key, bool& field, std::string description);
  void add(std::string key, std::string& field, std::string description);
  // Adds an enumeration; `names` contains its values with their names.
  template <typename Enum>
  void add(std::string key, Enum& field, const std::vector<std::pair<std::string, Enum>>& names,
           std::string description);

  // Makes `earlier`, a key of an earlier version of graspmap, a second name of the key `now`.
  void add_former_key(std::string earlier, std::string now);
  const std::map<std::string, std::string, std::less<>>& former_keys() const {
    return former_keys_;  // current key by former key
  }

  // Makes set() accept keys "PREFIX.KEY", e.g. "gripper.opening_angle_deg", which override values
  // of a file that is read later: set() stores KEY and text in `texts`, replacing an earlier text
  // of KEY. `texts` must outlive the table. The table does not check KEY and text.
  void add_overrides(std::string prefix, std::vector<std::pair<std::string, std::string>>& texts);

  const std::vector<Parameter>& parameters() const { return parameters_; }
  std::vector<std::string> keys() const;  // in the order of insertion
  // Returns the parameter with this current or former key, or nullptr.
  const Parameter* find(std::string_view key) const;
  // True if set() accepts this key: a parameter, or a key "PREFIX.KEY" of add_overrides().
  bool knows(std::string_view key) const;
  // Returns all keys with their values as text, including the texts of add_overrides().
  std::vector<std::pair<std::string, std::string>> values() const;

  // Returns the first key with different values in two tables of equal keys, or nullopt.
  std::optional<std::string> first_difference(const ParameterTable& other) const;

  // Sets one parameter from text. Throws Error if the key is unknown (with the nearest known key),
  // or if the value has another type or is out of range.
  void set(std::string_view key, std::string_view value) const;

  // Throws the Error of set() for the first field that is out of range.
  void check() const;

 private:
  using Overrides = std::vector<std::pair<std::string, std::string>>;
  Overrides* overrides_of(std::string_view key) const;

  std::vector<Parameter> parameters_;
  std::vector<std::pair<std::string, Overrides*>> overrides_;  // by prefix
  std::map<std::string, std::string, std::less<>> former_keys_;
};

// Throws Error naming field, value and bound if a field of `options` violates the range or the
// choices that bind(table, options) declares.
template <typename Options>
void check_parameters(Options options) {
  ParameterTable table;
  bind(table, options);
  table.check();
}

// Returns the key of the first field bound by `bind` that differs from its default, or nullopt.
template <typename Options>
std::optional<std::string> changed_key(Options options, void (*bind)(ParameterTable&, Options&)) {
  Options unset;
  ParameterTable table;
  ParameterTable defaults;
  bind(table, options);
  bind(defaults, unset);
  return table.first_difference(defaults);
}

// Returns e.g. "--voxel-size" for "voxel_size_m": without the unit _m, _mm, _deg, _px, _s or _n.
std::string flag_of(std::string_view key);

// Sets the table from YAML `text`, a map of scalars; a section "a: {b: 1}" sets the key "a.b".
// Throws Error naming `file` for unknown or duplicate keys and values that are not scalars (before
// any field is set), and for invalid values. Returns the keys of the text, sorted.
std::vector<std::string> set_from_yaml(const ParameterTable& table, const std::string& text,
                                       const std::string& file);

// Returns the table as YAML for set_from_yaml, with the description as a comment on each line.
std::string to_yaml(const ParameterTable& table);

template <typename Enum>
void ParameterTable::add(std::string key, Enum& field,
                         const std::vector<std::pair<std::string, Enum>>& names,
                         std::string description) {
  Parameter parameter;
  parameter.key = key;
  parameter.description = std::move(description);
  parameter.type = ParameterType::text;
  for (const auto& [name, value] : names) parameter.choices.push_back(name);
  parameter.get = [&field, names] {
    for (const auto& [name, value] : names)
      if (value == field) return name;
    return std::string();
  };
  parameter.set = [&field, names, key, choices = parameter.choices](std::string_view text) {
    for (const auto& [name, value] : names) {
      if (name == text) {
        field = value;
        return;
      }
    }
    std::string bound = "one of";
    for (const std::string& choice : choices) bound += " " + choice;
    throw Error("unknown name" + did_you_mean(text, choices),
                {.field = key, .value = std::string(text), .bound = bound});
  };
  parameter.check = [get = parameter.get, set = parameter.set] { set(get()); };
  parameters_.push_back(std::move(parameter));
}

}  // namespace libmap
