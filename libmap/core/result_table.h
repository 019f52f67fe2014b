// Table of the named results of a processing stage, the counterpart of ParameterTable for outputs.
// describe(table, result) next to a result struct binds each field to a key and a description. The
// manifest, --json, printed lists, the merging of tiles and the Python module use it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace libmap {

using ManifestValue = std::variant<bool, std::int64_t, double, std::string, std::vector<double>>;

struct NamedResult {
  // `found` is the value: a boolean, a number, a text, a list of numbers, or an optional of these.
  template <typename Found>
  NamedResult(std::string result_key, const Found& found, std::string text = {})
      : key(std::move(result_key)),
        description(std::move(text)),
        type(type_of<Found>()),
        may_be_absent(is_optional<Found>) {
    if constexpr (is_optional<Found>)
      value = found ? std::optional(held(*found)) : std::nullopt;
    else
      value = held(found);
  }

  std::string key;                     // with unit: "radius_m"
  std::string description;             // one line
  ManifestValue type;                  // false, 0, "" or {}: shows the type of `value`
  bool may_be_absent;                  // true for optionals
  std::optional<ManifestValue> value;  // nullopt: null with --json, omitted in the manifest

 private:
  template <typename Found>
  static constexpr bool is_optional = requires(const Found& found) {
    found.has_value();
  };

  template <typename Found>
  static ManifestValue held(const Found& found) {
    if constexpr (std::is_same_v<Found, bool>)
      return found;
    else if constexpr (std::is_integral_v<Found>)
      return static_cast<std::int64_t>(found);
    else if constexpr (std::is_arithmetic_v<Found>)
      return static_cast<double>(found);
    else if constexpr (std::is_convertible_v<const Found&, std::string_view>)
      return std::string(std::string_view(found));
    else
      return std::vector<double>(found.begin(), found.end());
  }
  template <typename Found>
  static ManifestValue type_of() {
    if constexpr (is_optional<Found>)
      return type_of<typename Found::value_type>();
    else if constexpr (std::is_same_v<Found, bool>)
      return false;
    else if constexpr (std::is_integral_v<Found>)
      return std::int64_t{0};
    else if constexpr (std::is_arithmetic_v<Found>)
      return 0.0;
    else if constexpr (std::is_convertible_v<const Found&, std::string_view>)
      return std::string();
    else
      return std::vector<double>();
  }
};

// Rule for combining the values of a result from several tiles.
enum class Merge { sum, max, min };

// Field of a result struct that is stored with each tile and merged over the tiles.
struct TileField {
  std::string key;
  std::variant<const std::size_t*, const double*> field;
  Merge merge;

  // Return and set the value of the field; set() requires that the result struct is not const.
  ManifestValue value() const;
  void set(const ManifestValue& value) const;
};

class ResultTable {
 public:
  ResultTable() = default;
  ResultTable(std::initializer_list<NamedResult> results) : results_(results) {}

  // Adds a result. With `merge`, `field` (std::size_t or double) is also added as a tile field.
  template <typename Found>
  void add(std::string key, const Found& found, std::string description = {}) {
    results_.emplace_back(std::move(key), found, std::move(description));
  }
  template <typename Number>
  void add(std::string key, const Number& field, Merge merge, std::string description) {
    add_hidden(key, field, merge);
    add(std::move(key), field, std::move(description));
  }
  // Adds only a tile field, which is merged over tiles but is not reported as a result.
  template <typename Number>
  void add_hidden(std::string key, const Number& field, Merge merge) {
    tile_fields_.push_back({std::move(key), &field, merge});
  }

  // Adds the results of another table, not its tile fields, with `prefix` before each key.
  void append(const std::string& prefix, ResultTable table);

  const std::vector<NamedResult>& results() const { return results_; }
  const std::vector<TileField>& tile_fields() const { return tile_fields_; }

  // Merges the tile fields of `tile`, a table with the same keys, into those of this table.
  void merge(const ResultTable& tile) const;

 private:
  std::vector<NamedResult> results_;
  std::vector<TileField> tile_fields_;
};

// Returns the table that describe(table, result) fills. `result` must outlive it.
template <typename Result>
ResultTable described(const Result& result) {
  ResultTable table;
  describe(table, result);
  return table;
}

// Merges the tile fields of `tile` into those of `whole` by the Merge rule of each field.
template <typename Result>
void merge_into(Result& whole, const Result& tile) {
  described(whole).merge(described(tile));
}

}  // namespace libmap
