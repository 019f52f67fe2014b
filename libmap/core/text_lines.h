// Parses text formats with one record per line of words, such as TUM, g2o and OBJ.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/pose.h"

namespace libmap {

struct TextLine {
  std::size_t number = 0;  // number of the line in its file, from 1
  std::string_view text{};
  std::vector<std::string_view> words{};
};

class LineReader {
 public:
  // `first_line` is the number of the first line of `text`. Each of `separators` separates words.
  explicit LineReader(std::string_view text, std::size_t first_line = 1,
                      std::string_view separators = " \t\r\v\f");
  // Reads the next line that has a word. Returns false at the end.
  bool next(TextLine& line);
  std::size_t remaining() const { return text_.size(); }  // bytes after the last line read

 private:
  std::string_view text_;
  std::size_t next_number_;
  std::array<bool, 256> is_separator_{};
};

// Returns the words of one line, separated by white space.
std::vector<std::string_view> words_of(std::string_view line);

// Returns all lines with at least one word, including comments. Words are separated by spaces,
// tabs, commas and semicolons. A byte order mark is skipped.
std::vector<TextLine> split_lines(std::string_view text);

// True for a line that begins with '#'. The line must have a word.
inline bool is_comment(const TextLine& line) { return line.words.front().front() == '#'; }
// Returns e.g. "line 12", the field of Errors about this line.
std::string name_of(const TextLine& line);

// Returns the words at the indices `first` to `first + count - 1` as finite numbers. Throws Error
// naming file and line if a word is missing or invalid.
std::vector<double> numbers_of(const TextLine& line, std::size_t first, std::size_t count,
                               const std::string& file);
// Return the word at index `word` as an integer of 32 or 64 bits. Throw as numbers_of does.
int integer_of(const TextLine& line, std::size_t word, const std::string& file);
std::int64_t large_integer_of(const TextLine& line, std::size_t word, const std::string& file);

// Returns the error "FILE: line N is VALUE: REASON (must be BOUND)".
Error in_line(const std::string& reason, const TextLine& line, const std::string& file,
              std::string value, std::string bound = {});
// Returns the error "FILE: line N is 7 columns long: REASON (must be BOUND)" for 7 words.
Error wrong_columns(const std::string& reason, const TextLine& line, const std::string& file,
                    std::string bound);
// Returns an error for a record, e.g. "node 7", that an earlier line has already defined.
Error duplicate(const TextLine& line, const std::string& record, const std::string& file);

// Throw Error unless `bytes` bytes can contain `rows` rows of `row_bytes` bytes (require_rows) or
// `rows` lines of `words` words (require_room_for_text). `what` names the rows, e.g. "points".
void require_rows(std::uint64_t rows, std::uint64_t row_bytes, std::uint64_t bytes,
                  const std::string& what);
void require_room_for_text(std::uint64_t rows, std::uint64_t words, std::uint64_t bytes,
                           const std::string& what);

// Returns the pose of a translation (m) and a quaternion that `line` contains. Throws Error if the
// quaternion's length differs from 1 by more than 5 % or a coordinate is outside -1e8 to 1e8 m.
Pose pose_of(const TextLine& line, const Eigen::Vector3d& translation,
             const Eigen::Quaterniond& rotation, const std::string& file);

// Returns numbers as text, with a space before each.
std::string to_words(std::initializer_list<double> numbers);
// Returns the quaternion of a pose's rotation with qw >= 0.
Eigen::Quaterniond quaternion_of(const Pose& pose);

}  // namespace libmap
