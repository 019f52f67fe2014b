// A table of the named parameters of one or more option structs: the single place where a field
// meets its key, its description and its bound. Command-line flags, YAML files, --print-config and
// the manifest all go through it, so that a default stands once, in the struct.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

enum class ParameterType { boolean, integer, real, text };  // of a flag's or key's value

// What a number may be. An open end excludes its value.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_open = false;
  bool max_open = false;
};
inline constexpr Range any_number{};
inline constexpr Range not_negative{0.0};
inline constexpr Range positive{0.0, std::numeric_limits<double>::infinity(), true, false};
inline constexpr Range zero_to_one{0.0, 1.0};
std::string describe(const Range& range);  // e.g. "> 0", ">= 0 and <= 1"

struct Parameter {
  std::string key;          // as in YAML, with its unit: "voxel_size_m"
  std::string description;  // one line
  ParameterType type = ParameterType::text;
  std::vector<std::string> choices{};  // for enumerations
  std::function<std::string()> get;
  std::function<void(std::string_view)> set;  // throws Error naming key, value and bound
  std::function<void()> check{};  // the field's own value; throws as `set`; none: any is right
};

class ParameterTable {
 public:
  void add(std::string key, double& field, Range range, std::string description);
  // "auto" for no value.
  void add(std::string key, std::optional<double>& field, Range range, std::string description);
  void add(std::string key, int& field, Range range, std::string description);
  void add(std::string key, std::uint64_t& field, Range range, std::string description);
  void add(std::string key, bool& field, std::string description);
  void add(std::string key, std::string& field, std::string description);
  // An enumeration by its names.
  template <typename Enum>
  void add(std::string key, Enum& field, const std::vector<std::pair<std::string, Enum>>& names,
           std::string description);

  // Keys "PREFIX.KEY" are collected as text, for a second table that is filled from a file first
  // ("gripper.opening_angle_deg"), the last text of each key; who applies them checks their names.
  void add_overrides(std::string prefix, std::vector<std::pair<std::string, std::string>>& texts);

  const std::vector<Parameter>& parameters() const { return parameters_; }
  std::vector<std::string> keys() const;              // in the order in which they were added
  const Parameter* find(std::string_view key) const;  // the parameter of that key, or nullptr
  // Whether set() takes this key: a parameter, or one with the prefix of overrides.
  bool knows(std::string_view key) const;
  // Every key and its value as text, overrides included, as set_from_yaml would take them.
  std::vector<std::pair<std::string, std::string>> values() const;

  // The first key whose value differs from that of `other`, a table of the same keys.
  std::optional<std::string> first_difference(const ParameterTable& other) const;

  // Sets one parameter from text. Throws Error: unknown key (with the nearest known one), or a
  // value that is not of its type or outside its bound.
  void set(std::string_view key, std::string_view value) const;

  // Throws the Error of set() for the first field whose value is outside its bound.
  void check() const;

 private:
  using Overrides = std::vector<std::pair<std::string, std::string>>;
  Overrides* overrides_of(std::string_view key) const;

  std::vector<Parameter> parameters_;
  std::vector<std::pair<std::string, Overrides*>> overrides_;  // by prefix
};

// Throws Error naming field, value and bound if a field of `options` is outside the range, or is
// none of the choices, that bind(table, options) declares for it.
template <typename Options>
void check_parameters(Options options) {
  ParameterTable table;
  bind(table, options);
  table.check();
}

// The key of the first field that `bind` declares and that does not have its default, if any.
template <typename Options>
std::optional<std::string> changed_key(Options options, void (*bind)(ParameterTable&, Options&)) {
  Options unset;
  ParameterTable table;
  ParameterTable defaults;
  bind(table, options);
  bind(defaults, unset);
  return table.first_difference(defaults);
}

// "voxel_size_m" -> "--voxel-size": the flag of a key, without the unit at its end.
std::string flag_of(std::string_view key);

// A YAML map of scalars, `text` (named `file` in errors), into the table; a section "a: {b: 1}"
// holds the keys "a.b". A key that is not in the table, is a duplicate or holds no scalar is an
// Error; nothing is set halfway: all keys are known before the first is set. Returns the keys that
// the text holds.
std::vector<std::string> set_from_yaml(const ParameterTable& table, const std::string& text,
                                       const std::string& file);

// The table as YAML that set_from_yaml reads back, each line followed by its description.
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
