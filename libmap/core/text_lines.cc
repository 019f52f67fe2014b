#include "libmap/core/text_lines.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

void require_word(const TextLine& line, std::size_t word, const std::string& file) {
  if (word >= line.words.size())
    throw wrong_columns("too few columns", line, file, ">= " + std::to_string(word + 1));
}

}  // namespace

LineReader::LineReader(std::string_view text, std::size_t first_line, std::string_view separators)
    : text_(text), next_number_(first_line) {
  for (const char c : separators) is_separator_[static_cast<unsigned char>(c)] = true;
}

bool LineReader::next(TextLine& line) {
  line.words.clear();
  while (line.words.empty() && !text_.empty()) {
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    line.number = next_number_++;
    line.text = text_.substr(0, end);
    const auto separates = [&](std::size_t at) {
      return is_separator_[static_cast<unsigned char>(line.text[at])];
    };
    for (std::size_t at = 0; at < end;) {
      while (at < end && separates(at)) ++at;
      const std::size_t word = at;
      while (at < end && !separates(at)) ++at;
      if (at > word) line.words.push_back(line.text.substr(word, at - word));
    }
    text_.remove_prefix(std::min(end + 1, text_.size()));
  }
  return !line.words.empty();
}

std::vector<std::string_view> words_of(std::string_view line) {
  TextLine split;
  LineReader(line).next(split);
  return std::move(split.words);
}

std::vector<TextLine> split_lines(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  LineReader reader(text, 1, " \t\r,;");
  std::vector<TextLine> lines;
  for (TextLine line; reader.next(line);) lines.push_back(line);
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
    throw in_line("not a whole number of 64 bits", line, file, std::string(line.words[word]));
  return *value;
}

int integer_of(const TextLine& line, std::size_t word, const std::string& file) {
  require_word(line, word, file);
  const std::optional<int> value = parse_int(line.words[word]);
  if (!value)
    throw in_line("not a whole number of 32 bits", line, file, std::string(line.words[word]));
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
  return in_line(reason, line, file, std::to_string(line.words.size()) + " columns long",
                 std::move(bound));
}

Error duplicate(const TextLine& line, const std::string& record, const std::string& file) {
  return in_line("occurs twice", line, file, record);
}

void require_rows(std::uint64_t rows, std::uint64_t row_bytes, std::uint64_t bytes,
                  const std::string& what) {
  if (row_bytes > 0 && rows > bytes / row_bytes)
    throw Error("more than the data contain", {.field = "number of " + what,
                                               .value = std::to_string(rows),
                                               .bound = "<= " + std::to_string(bytes / row_bytes)});
}

void require_room_for_text(std::uint64_t rows, std::uint64_t words, std::uint64_t bytes,
                           const std::string& what) {
  // Each word needs a character and a blank, except for the last word of the file.
  require_rows(rows, 2 * words, bytes + 1, what);
}

Pose pose_of(const TextLine& line, const Eigen::Vector3d& translation,
             const Eigen::Quaterniond& rotation, const std::string& file) {
  constexpr double length_tolerance = 0.05;
  const double length = rotation.norm();
  if (!(std::abs(length - 1.0) <= length_tolerance))
    throw in_line("not the length of a unit quaternion", line, file, to_text(length), "1 +- 5 %");
  const double distance = translation.cwiseAbs().maxCoeff();
  if (!(distance <= max_position_m))
    throw in_line("a coordinate is too large", line, file, to_text(distance), "<= 1e8 m");
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
