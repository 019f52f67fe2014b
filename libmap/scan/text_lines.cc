#include "libmap/scan/text_lines.h"

#include <cmath>
#include <cstdint>
#include <optional>

#include "libmap/core/error.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

std::vector<std::string_view> split_words(std::string_view text) {
  constexpr std::string_view separators = " \t\r,;";
  std::vector<std::string_view> words;
  for (std::size_t begin = text.find_first_not_of(separators); begin != std::string_view::npos;) {
    const std::size_t end = text.find_first_of(separators, begin);
    words.push_back(text.substr(begin, end - begin));
    begin = text.find_first_not_of(separators, end);
  }
  return words;
}

void require_word(const TextLine& line, std::size_t word, const std::string& file) {
  if (word >= line.words.size())
    throw wrong_columns("ends too early", line, file, ">= " + std::to_string(word + 1));
}

}  // namespace

std::vector<TextLine> split_lines(std::string_view text) {
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  if (text.substr(0, byte_order_mark.size()) == byte_order_mark)
    text.remove_prefix(byte_order_mark.size());
  std::vector<TextLine> lines;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    TextLine line{.number = number, .text = text.substr(0, end)};
    line.words = split_words(line.text);
    if (!line.words.empty()) lines.push_back(std::move(line));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return lines;
}

std::string name_of(const TextLine& line) { return "line " + std::to_string(line.number); }

std::vector<double> numbers_of(const TextLine& line, std::size_t first, std::size_t count,
                               const std::string& file) {
  if (count == 0) return {};
  require_word(line, first + count - 1, file);
  std::vector<double> numbers;
  for (std::size_t i = first; i < first + count; ++i) {
    const std::optional<double> value = parse_double(line.words[i]);
    if (!value || !std::isfinite(*value))
      throw in_line("not a number", line, file, std::string(line.words[i]), "a finite number");
    numbers.push_back(*value);
  }
  return numbers;
}

std::int64_t large_integer_of(const TextLine& line, std::size_t word, const std::string& file) {
  require_word(line, word, file);
  const std::optional<std::int64_t> value = parse_integer(line.words[word]);
  if (!value)
    throw in_line("not a whole number", line, file, std::string(line.words[word]), "of 64 bits");
  return *value;
}

int integer_of(const TextLine& line, std::size_t word, const std::string& file) {
  require_word(line, word, file);
  const std::optional<int> value = parse_int(line.words[word]);
  if (!value)
    throw in_line("not a whole number", line, file, std::string(line.words[word]), "of 32 bits");
  return *value;
}

Error in_line(const std::string& reason, const TextLine& line, const std::string& file,
              std::string value, std::string bound) {
  return Error(
      reason,
      {.file = file, .field = name_of(line), .value = std::move(value), .bound = std::move(bound)});
}

Error wrong_columns(const std::string& reason, const TextLine& line, const std::string& file,
                    std::string bound) {
  return in_line(reason, line, file, std::to_string(line.words.size()) + " columns",
                 std::move(bound));
}

Error duplicate(const TextLine& line, const std::string& record, const std::string& file) {
  return in_line("is a duplicate", line, file, record);
}

Pose pose_of(const TextLine& line, const Eigen::Vector3d& translation,
             const Eigen::Quaterniond& rotation, const std::string& file) {
  constexpr double length_tolerance = 0.05;
  const double length = rotation.norm();
  if (!(std::abs(length - 1.0) <= length_tolerance))
    throw in_line("no rotation", line, file, to_text(length), "a quaternion of length 1");
  const double distance = translation.cwiseAbs().maxCoeff();
  if (!(distance <= max_position_m))
    throw in_line("no position", line, file, to_text(distance), "<= 1e8 m");
  return make_pose(translation, rotation);
}

std::string to_words(std::initializer_list<double> numbers) {
  std::string text;
  for (const double number : numbers) text += " " + to_text(number);
  return text;
}

Eigen::Quaterniond quaternion_of(const Pose& pose) {
  Eigen::Quaterniond rotation(pose.linear());
  rotation.normalize();
  if (rotation.w() < 0.0) rotation.coeffs() *= -1.0;
  return rotation;
}

}  // namespace libmap
