#include "libmap/core/parameters.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>

#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

Error wrong_value(const std::string& key, std::string_view text, const std::string& reason,
                  const std::string& bound) {
  return Error(reason, {.field = key, .value = std::string(text), .bound = bound});
}

void require_in_range(const std::string& key, std::string_view text, double value,
                      const Range& range) {
  const bool above = range.min_open ? value > range.min : value >= range.min;
  const bool below = range.max_open ? value < range.max : value <= range.max;
  if (std::isfinite(value) && above && below) return;
  throw wrong_value(key, text, "out of range", describe(range));
}

// `text` as a double, int or std::uint64_t within `range`.
template <typename Number>
Number parse_number(const std::string& key, std::string_view text, const Range& range) {
  constexpr bool is_real = std::is_floating_point_v<Number>;
  std::conditional_t<is_real, std::optional<double>, std::optional<std::int64_t>> value;
  if constexpr (is_real)
    value = parse_double(text);
  else
    value = parse_integer(text);
  if (!value)
    throw wrong_value(key, text, is_real ? "not a number" : "not a whole number", describe(range));
  require_in_range(key, text, static_cast<double>(*value), range);
  if constexpr (sizeof(Number) < sizeof(std::int64_t)) {
    if (*value > std::numeric_limits<Number>::max() || *value < std::numeric_limits<Number>::min())
      throw wrong_value(key, text, "too large for 32 bits", describe(range));
  }
  return static_cast<Number>(*value);
}

template <typename Number>
Parameter number_parameter(const std::string& key, Number& field, const Range& range,
                           std::string description) {
  constexpr bool is_real = std::is_floating_point_v<Number>;
  Parameter parameter;
  parameter.key = key;
  parameter.description = std::move(description);
  parameter.type = is_real ? ParameterType::real : ParameterType::integer;
  parameter.get = [&field] {
    if constexpr (is_real)
      return to_text(field);
    else
      return std::to_string(field);
  };
  parameter.set = [&field, key, range](std::string_view text) {
    field = parse_number<Number>(key, text, range);
  };
  parameter.check = [&field, key, range, get = parameter.get] {
    require_in_range(key, get(), static_cast<double>(field), range);
  };
  return parameter;
}

}  // namespace

std::string describe(const Range& range) {
  std::string text;
  if (std::isfinite(range.min)) text = (range.min_open ? "> " : ">= ") + to_text(range.min);
  if (std::isfinite(range.max)) {
    if (!text.empty()) text += " and ";
    text += (range.max_open ? "< " : "<= ") + to_text(range.max);
  }
  return text.empty() ? "a finite number" : text;
}

void ParameterTable::add(std::string key, double& field, Range range, std::string description) {
  parameters_.push_back(number_parameter(key, field, range, std::move(description)));
}

void ParameterTable::add(std::string key, std::optional<double>& field, Range range,
                         std::string description) {
  const auto get = [&field] { return field ? to_text(*field) : std::string("auto"); };
  const auto set = [&field, key, range](std::string_view text) {
    field = text == "auto" ? std::nullopt : std::optional(parse_number<double>(key, text, range));
  };
  parameters_.push_back({.key = key,
                         .description = std::move(description),
                         .type = ParameterType::real,
                         .choices = {},
                         .get = get,
                         .set = set,
                         .check = [get, set] { set(get()); }});
}

void ParameterTable::add(std::string key, int& field, Range range, std::string description) {
  parameters_.push_back(number_parameter(key, field, range, std::move(description)));
}

void ParameterTable::add(std::string key, std::uint64_t& field, Range range,
                         std::string description) {
  if (range.min < 0.0) range = {0.0, range.max, false, range.max_open};
  parameters_.push_back(number_parameter(key, field, range, std::move(description)));
}

void ParameterTable::add(std::string key, bool& field, std::string description) {
  const auto set = [&field, key](std::string_view text) {
    const std::optional<bool> value = parse_bool(text);
    if (!value) throw wrong_value(key, text, "not a boolean", "true or false");
    field = *value;
  };
  parameters_.push_back({.key = key,
                         .description = std::move(description),
                         .type = ParameterType::boolean,
                         .choices = {},
                         .get = [&field] { return std::string(field ? "true" : "false"); },
                         .set = set,
                         .check = {}});
}

void ParameterTable::add(std::string key, std::string& field, std::string description) {
  parameters_.push_back({.key = key,
                         .description = std::move(description),
                         .type = ParameterType::text,
                         .choices = {},
                         .get = [&field] { return field; },
                         .set = [&field](std::string_view text) { field = std::string(text); },
                         .check = {}});
}

std::vector<std::string> ParameterTable::keys() const {
  std::vector<std::string> keys;
  for (const Parameter& parameter : parameters_) keys.push_back(parameter.key);
  return keys;
}

void ParameterTable::add_former_key(std::string earlier, std::string now) {
  former_keys_.emplace(std::move(earlier), std::move(now));
}

const Parameter* ParameterTable::find(std::string_view key) const {
  if (const auto former = former_keys_.find(key); former != former_keys_.end())
    key = former->second;
  for (const Parameter& parameter : parameters_)
    if (parameter.key == key) return &parameter;
  return nullptr;
}

void ParameterTable::add_overrides(std::string prefix, Overrides& texts) {
  overrides_.emplace_back(std::move(prefix) + ".", &texts);
}

ParameterTable::Overrides* ParameterTable::overrides_of(std::string_view key) const {
  for (const auto& [prefix, texts] : overrides_)
    if (key.size() > prefix.size() && key.starts_with(prefix)) return texts;
  return nullptr;
}

bool ParameterTable::knows(std::string_view key) const {
  return find(key) != nullptr || overrides_of(key) != nullptr;
}

std::vector<std::pair<std::string, std::string>> ParameterTable::values() const {
  std::vector<std::pair<std::string, std::string>> values;
  for (const Parameter& parameter : parameters_)
    values.emplace_back(parameter.key, parameter.get());
  for (const auto& [prefix, texts] : overrides_)
    for (const auto& [key, text] : *texts) values.emplace_back(prefix + key, text);
  return values;
}

std::optional<std::string> ParameterTable::first_difference(const ParameterTable& other) const {
  for (std::size_t n = 0; n < parameters_.size(); ++n)
    if (parameters_[n].get() != other.parameters_[n].get()) return parameters_[n].key;
  return std::nullopt;
}

void ParameterTable::set(std::string_view key, std::string_view value) const {
  const Parameter* parameter = find(key);
  if (Overrides* texts = overrides_of(key); parameter == nullptr && texts != nullptr) {
    const std::string name(key.substr(key.find('.') + 1));
    for (auto& [known, text] : *texts) {
      if (known != name) continue;
      text = value;
      return;
    }
    texts->emplace_back(name, value);
    return;
  }
  if (parameter == nullptr) throw unknown_key(key, keys());
  parameter->set(value);
}

void ParameterTable::check() const {
  for (const Parameter& parameter : parameters_)
    if (parameter.check) parameter.check();
}

std::string flag_of(std::string_view key) {
  for (const std::string_view unit : {"_m", "_mm", "_deg", "_px", "_s", "_n"})
    if (key.ends_with(unit)) {
      key.remove_suffix(unit.size());
      break;
    }
  std::string flag = "--";
  for (const char c : key) flag += c == '_' ? '-' : c;
  return flag;
}

std::vector<std::string> set_from_yaml(const ParameterTable& table, const std::string& text,
                                       const std::string& file) {
  std::set<std::string> seen;
  std::vector<std::pair<std::string, std::string>> values;
  const std::vector<std::string> known = table.keys();
  const std::function<void(const YAML::Node&, const std::string&)> collect =
      [&](const YAML::Node& map, const std::string& prefix) {
        for (const auto& entry : map) {
          const std::string key = prefix + entry.first.as<std::string>();
          if (entry.second.IsMap() &&
              std::any_of(known.begin(), known.end(),
                          [&](const auto& name) { return name.starts_with(key + "."); })) {
            collect(entry.second, key + ".");
            continue;
          }
          if (!table.knows(key)) throw unknown_key(key, known);
          const Parameter* parameter = table.find(key);
          if (!seen.insert(parameter == nullptr ? key : parameter->key).second)
            throw Error("occurs twice", {.field = key});
          if (!entry.second.IsScalar()) throw Error("is not a single value", {.field = key});
          values.emplace_back(key, entry.second.as<std::string>());
        }
      };
  read_yaml(text, file, [&](const YAML::Node& root) {
    if (root.IsNull()) return;
    if (!root.IsMap()) throw Error("not a YAML mapping of keys to values");
    collect(root, "");
    for (const auto& [key, value] : values) table.set(key, value);
  });
  return {seen.begin(), seen.end()};
}

std::string to_yaml(const ParameterTable& table) {
  std::string yaml;
  for (const auto& [key, text] : table.values()) {
    const Parameter* parameter = table.find(key);
    YAML::Emitter value;
    // Free text is quoted, because YAML could parse it as another type.
    if (parameter == nullptr ||
        (parameter->type == ParameterType::text && parameter->choices.empty()))
      value << YAML::DoubleQuoted;
    value << text;
    yaml += key + ": " + value.c_str();
    yaml += parameter == nullptr ? "\n" : "  # " + parameter->description + "\n";
  }
  return yaml;
}

}  // namespace libmap
