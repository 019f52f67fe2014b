// Text formats of one record per line.
#pragma once

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
  std::size_t number = 0;  // from 1
  std::string_view text{};
  std::vector<std::string_view> words{};  // between spaces, tabs and commas
};

// The lines that hold a word, those that begin with '#' too; without a byte order mark.
std::vector<TextLine> split_lines(std::string_view text);

inline bool is_comment(const TextLine& line) { return line.words.front().front() == '#'; }

// "line 12".
std::string name_of(const TextLine& line);

// Words `first` to `first + count - 1` as finite numbers. Throws Error naming file and line.
std::vector<double> numbers_of(const TextLine& line, std::size_t first, std::size_t count,
                               const std::string& file);
int integer_of(const TextLine& line, std::size_t word, const std::string& file);
std::int64_t large_integer_of(const TextLine& line, std::size_t word, const std::string& file);

// "REASON" in that line of `file`.
Error in_line(const std::string& reason, const TextLine& line, const std::string& file,
              std::string value, std::string bound = {});
// The same of a line's number of words.
Error wrong_columns(const std::string& reason, const TextLine& line, const std::string& file,
                    std::string bound);
// For a record that an earlier line already has.
Error duplicate(const TextLine& line, const std::string& record, const std::string& file);

// A pose whose numbers stand in that line. Throws Error: the quaternion's length is off by more
// than 5 %, the position lies more than 1e8 m away.
Pose pose_of(const TextLine& line, const Eigen::Vector3d& translation,
             const Eigen::Quaterniond& rotation, const std::string& file);

// Numbers as words with a space before each.
std::string to_words(std::initializer_list<double> numbers);
// Of the two quaternions of a pose's rotation the one with qw >= 0.
Eigen::Quaterniond quaternion_of(const Pose& pose);

}  // namespace libmap
