#include "libmap/io/columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

struct TypeTraits {
  const char* name;
  std::size_t size;
  double min;
  double max;
};

template <typename T>
constexpr TypeTraits traits_of(const char* name) {
  return {name, sizeof(T), static_cast<double>(std::numeric_limits<T>::lowest()),
          static_cast<double>(std::numeric_limits<T>::max())};
}

constexpr std::array<TypeTraits, 10> type_traits = {
    traits_of<std::int8_t>("int8"),   traits_of<std::uint8_t>("uint8"),
    traits_of<std::int16_t>("int16"), traits_of<std::uint16_t>("uint16"),
    traits_of<std::int32_t>("int32"), traits_of<std::uint32_t>("uint32"),
    traits_of<float>("float32"),      traits_of<double>("float64"),
    traits_of<std::int64_t>("int64"), traits_of<std::uint64_t>("uint64")};

const TypeTraits& traits(StoredType type) { return type_traits[static_cast<std::size_t>(type)]; }
const TypeTraits& traits(ScalarType type) { return type_traits[static_cast<std::size_t>(type)]; }

bool is_float(ScalarType type) {
  return type == ScalarType::float32 || type == ScalarType::float64;
}

template <typename T>
void store(double value, bool swap_bytes, char* at) {
  std::array<char, sizeof(T)> bytes =
      std::bit_cast<std::array<char, sizeof(T)>>(static_cast<T>(value));
  if (swap_bytes) std::reverse(bytes.begin(), bytes.end());
  std::memcpy(at, bytes.data(), sizeof(T));
}

// Writes the column as T, with `step` bytes between rows.
template <typename T>
void store_rows(const Column& column, std::size_t rows, bool swap_bytes, char* at,
                std::size_t step) {
  // Numbers stored in their declared type need no rounding.
  const bool rounds = column.stored != stored_as(column.type);
  for_each_value(column, rows, [&](std::size_t row, double value) {
    store<T>(rounds ? as_type(value, column.type) : value, swap_bytes, at + row * step);
  });
}

std::string number_text(double value, ScalarType type) {
  const double held = as_type(value, type);
  if (type == ScalarType::float64) return to_text(held);
  if (type == ScalarType::float32) return to_text(static_cast<float>(held));
  return to_text(static_cast<std::int64_t>(held));
}

}  // namespace

std::string to_text(FileEncoding encoding) {
  constexpr std::array<const char*, 3> names = {"ascii", "binary", "binary_compressed"};
  return names[static_cast<std::size_t>(encoding)];
}

std::string to_text(ScalarType type) { return traits(type).name; }

StoredType stored_as(ScalarType type) { return static_cast<StoredType>(type); }

ScalarType scalar_type_of(StoredType type) {
  const bool wide = type == StoredType::int64 || type == StoredType::uint64;
  return wide ? ScalarType::float64 : static_cast<ScalarType>(type);
}

std::size_t size_of(StoredType type) { return traits(type).size; }

const Column* ColumnSet::find(std::string_view name) const {
  for (const Column& column : columns)
    if (column.name == name) return &column;
  return nullptr;
}

double* ColumnSet::add_numbers(std::string name, ScalarType type) {
  auto numbers = std::make_shared<std::vector<double>>(rows);
  columns.push_back({std::move(name), type, StoredType::float64,
                     reinterpret_cast<const std::byte*>(numbers->data()), sizeof(double), false});
  storage.push_back(numbers);
  return numbers->data();
}

double as_type(double value, ScalarType type) {
  if (type == ScalarType::float64) return value;
  if (type == ScalarType::float32) {
    if (std::isfinite(value) && std::abs(value) > traits(type).max)
      return std::copysign(std::numeric_limits<double>::infinity(), value);
    return static_cast<double>(static_cast<float>(value));
  }
  if (std::isnan(value)) return 0.0;
  return std::clamp(std::round(value), traits(type).min, traits(type).max);
}

bool fits_type(double value, ScalarType type) {
  return is_float(type) || as_type(value, type) == value;
}

double number_of(const TextLine& line, std::size_t word, const std::string& field,
                 ScalarType type) {
  const std::string_view text = line.words[word];
  const std::optional<double> value = parse_double(text);
  const char* const fault = !value                     ? ": not a number"
                            : !fits_type(*value, type) ? ": not representable in the field's type"
                                                       : nullptr;
  if (fault == nullptr) return *value;
  throw Error(name_of(line) + fault, {.field = field,
                                      .value = std::string(text.substr(0, 40)),
                                      .bound = value ? "of type " + to_text(type) : std::string()});
}

std::size_t record_size(const std::vector<Column>& columns) {
  std::size_t size = 0;
  for (const Column& column : columns) size += size_of(stored_as(column.type));
  return size;
}

void append_records(const std::vector<Column>& columns, std::size_t begin, std::size_t end,
                    bool swap_bytes, std::string& out) {
  const std::size_t record = record_size(columns);
  const std::size_t start = out.size();
  out.resize(start + record * (end - begin));
  parallel_for(end - begin, rows_per_chunk, [&](std::size_t first, std::size_t last) {
    char* at = out.data() + start + first * record;
    for (Column column : columns) {
      column.first += (begin + first) * column.stride;
      with_type(stored_as(column.type), [&](auto number) {
        store_rows<decltype(number)>(column, last - first, swap_bytes, at, record);
      });
      at += size_of(stored_as(column.type));
    }
  });
}

void append_rows_of_text(const std::vector<Column>& columns, std::size_t begin, std::size_t end,
                         char separator, std::string& out) {
  for (std::size_t row = begin; row < end; ++row) {
    bool first_word = true;
    for (Column column : columns) {
      column.first += row * column.stride;
      if (!first_word) out += separator;
      first_word = false;
      for_each_value(column, 1,
                     [&](std::size_t, double value) { out += number_text(value, column.type); });
    }
    out += '\n';
  }
}

void write_rows(std::size_t rows, std::ostream& out,
                const std::function<void(std::size_t, std::size_t, std::string&)>& append) {
  constexpr std::size_t rows_at_once = 65536;
  std::string text;
  for (std::size_t row = 0; row < rows; row += rows_at_once) {
    text.clear();
    append(row, std::min(rows, row + rows_at_once), text);
    out.write(text.data(), static_cast<std::streamsize>(text.size()));
  }
}

std::array<double, 7> viewpoint_numbers(const Pose& viewpoint) {
  const Eigen::Quaterniond q(viewpoint.rotation());
  const Eigen::Vector3d t = viewpoint.translation();
  return {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()};
}

std::string viewpoint_words(const Pose& viewpoint) {
  std::string words;
  for (const double number : viewpoint_numbers(viewpoint)) words += " " + to_text(number);
  return words;
}

std::optional<Pose> pose_of_viewpoint(const std::array<double, 7>& numbers) {
  const Eigen::Quaterniond rotation(numbers[3], numbers[4], numbers[5], numbers[6]);
  if (!(rotation.norm() > 0.0)) return std::nullopt;
  return make_pose({numbers[0], numbers[1], numbers[2]}, rotation);
}

}  // namespace libmap
