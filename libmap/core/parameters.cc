#include "libmap/core/parameters.h"

#include <yaml-cpp/yaml.h>

#include <array>
#include <cmath>
#include <set>

#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

Error wrong_value(const std::string& key, std::string_view text, const std::string& reason,
                  const std::string& bound) {
  return Error(reason, {.file = {}, .field = key, .value = std::string(text), .bound = bound});
}

void require_in_range(const std::string& key, std::string_view text, double value,
                      const Range& range) {
  const bool above = range.min_open ? value > range.min : value >= range.min;
  const bool below = range.max_open ? value < range.max : value <= range.max;
  if (std::isfinite(value) && above && below) return;
  throw wrong_value(key, text, "out of range", describe(range));
}

// An integer kind of field: `Integer` is int or std::uint64_t.
template <typename Integer>
std::function<void(std::string_view)> integer_setter(Integer& field, std::string key, Range range) {
  return [&field, key = std::move(key), range](std::string_view text) {
    const std::optional<std::int64_t> value = parse_integer(text);
    if (!value) throw wrong_value(key, text, "not a whole number", describe(range));
    require_in_range(key, text, static_cast<double>(*value), range);
    if constexpr (sizeof(Integer) < sizeof(std::int64_t)) {
      if (*value > std::numeric_limits<Integer>::max() ||
          *value < std::numeric_limits<Integer>::min())
        throw wrong_value(key, text, "too large", describe(range));
    }
    field = static_cast<Integer>(*value);
  };
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
  const auto set = [&field, key, range](std::string_view text) {
    const std::optional<double> value = parse_double(text);
    if (!value) throw wrong_value(key, text, "not a number", describe(range));
    require_in_range(key, text, *value, range);
    field = *value;
  };
  add_parameter({.key = key,
                 .description = std::move(description),
                 .type = ParameterType::real,
                 .choices = {},
                 .get = [&field] { return to_text(field); },
                 .set = set});
}

void ParameterTable::add(std::string key, int& field, Range range, std::string description) {
  add_parameter({.key = key,
                 .description = std::move(description),
                 .type = ParameterType::integer,
                 .choices = {},
                 .get = [&field] { return to_text(std::int64_t{field}); },
                 .set = integer_setter(field, key, range)});
}

void ParameterTable::add(std::string key, std::uint64_t& field, Range range,
                         std::string description) {
  if (range.min < 0.0) range = {0.0, range.max, false, range.max_open};
  add_parameter({.key = key,
                 .description = std::move(description),
                 .type = ParameterType::integer,
                 .choices = {},
                 .get = [&field] { return std::to_string(field); },
                 .set = integer_setter(field, key, range)});
}

void ParameterTable::add(std::string key, bool& field, std::string description) {
  const auto set = [&field, key](std::string_view text) {
    const std::optional<bool> value = parse_bool(text);
    if (!value) throw wrong_value(key, text, "not a switch", "true or false");
    field = *value;
  };
  add_parameter({.key = key,
                 .description = std::move(description),
                 .type = ParameterType::boolean,
                 .choices = {},
                 .get = [&field] { return std::string(field ? "true" : "false"); },
                 .set = set});
}

void ParameterTable::add(std::string key, std::string& field, std::string description) {
  add_parameter({.key = key,
                 .description = std::move(description),
                 .type = ParameterType::text,
                 .choices = {},
                 .get = [&field] { return field; },
                 .set = [&field](std::string_view text) { field = std::string(text); }});
}

void ParameterTable::add_parameter(Parameter parameter) {
  parameters_.push_back(std::move(parameter));
}

std::vector<std::string> ParameterTable::keys() const {
  std::vector<std::string> keys;
  for (const Parameter& parameter : parameters_) keys.push_back(parameter.key);
  return keys;
}

const Parameter* ParameterTable::find(std::string_view key) const {
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
  if (parameter == nullptr)
    throw Error("unknown key" + did_you_mean(key, keys()), {.field = std::string(key)});
  parameter->set(value);
}

std::string flag_of(std::string_view key) {
  for (const std::string_view unit : {"_m", "_mm", "_deg", "_px", "_s"})
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
  read_yaml(text, file, [&](const YAML::Node& root) {
    if (root.IsNull()) return;
    if (!root.IsMap()) throw Error("not a map of keys and values");
    for (const auto& entry : root) {
      const std::string key = entry.first.as<std::string>();
      if (!table.knows(key))
        throw Error("unknown key" + did_you_mean(key, table.keys()), {.field = key});
      if (!seen.insert(key).second) throw Error("stands twice", {.field = key});
      if (!entry.second.IsScalar()) throw Error("not a single value", {.field = key});
    }
    for (const auto& entry : root)
      table.set(entry.first.as<std::string>(), entry.second.as<std::string>());
  });
  return {seen.begin(), seen.end()};
}

std::string to_yaml(const ParameterTable& table) {
  std::string yaml;
  for (const auto& [key, text] : table.values()) {
    const Parameter* parameter = table.find(key);
    YAML::Emitter value;
    // Free text is quoted: it might read as something else.
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
