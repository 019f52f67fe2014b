#include "libmap/core/result_table.h"

#include <algorithm>

namespace libmap {

namespace {

template <typename Number>
Number merged(const Number& whole, const Number& tile, Merge merge) {
  switch (merge) {
    case Merge::sum:
      return whole + tile;
    case Merge::max:
      return std::max(whole, tile);
    case Merge::min:
      return std::min(whole, tile);
  }
  return whole;
}

// Tables of constant and mutable results have the same type; merge_into passes a mutable result.
template <typename Number>
Number& writable(const Number* field) {
  return const_cast<Number&>(*field);
}

}  // namespace

ManifestValue TileField::value() const {
  if (const auto* count = std::get_if<const std::size_t*>(&field))
    return static_cast<std::int64_t>(**count);
  return *std::get<const double*>(field);
}

void TileField::set(const ManifestValue& value) const {
  if (const auto* count = std::get_if<const std::size_t*>(&field))
    writable(*count) = static_cast<std::size_t>(std::get<std::int64_t>(value));
  else
    writable(std::get<const double*>(field)) = std::get<double>(value);
}

void ResultTable::append(const std::string& prefix, ResultTable table) {
  for (NamedResult& result : table.results_) {
    result.key.insert(0, prefix);
    results_.push_back(std::move(result));
  }
}

void ResultTable::merge(const ResultTable& tile) const {
  for (std::size_t n = 0; n < tile_fields_.size(); ++n) {
    const TileField& to = tile_fields_[n];
    std::visit(
        [&](const auto* whole) {
          using Field = decltype(whole);
          writable(whole) =
              merged(*whole, *std::get<Field>(tile.tile_fields_.at(n).field), to.merge);
        },
        to.field);
  }
}

}  // namespace libmap
