// Rows of numbers in text, as clouds and meshes hold them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Lines of blank-separated words; empty lines are passed over.
class TextRows {
 public:
  // `line` is the number, from 1, of the line that begins at `position`.
  TextRows(std::string_view text, std::size_t position, std::size_t line)
      : text_(text), position_(position), line_(line) {}
  // The next line's words, or false at the end.
  bool next(std::vector<std::string_view>& words);
  std::size_t line() const { return line_ - 1; }  // of the words given last
  std::size_t remaining() const { return text_.size() - position_; }
  // A word as a number that fits `type`. Throws Error naming field and line.
  double number(std::string_view word, const std::string& field, ScalarType type) const;

 private:
  std::string_view text_;
  std::size_t position_;
  std::size_t line_;
};

// Throws Error if `rows` lines of `words` words cannot stand in `bytes` bytes.
void require_room_for_text(std::uint64_t rows, std::uint64_t words, std::uint64_t bytes,
                           const std::string& what);

}  // namespace libmap
