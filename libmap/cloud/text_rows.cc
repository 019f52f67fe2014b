#include "libmap/cloud/text_rows.h"

#include <algorithm>
#include <optional>

#include "libmap/cloud/columns.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

}  // namespace

bool TextRows::next(std::vector<std::string_view>& words) {
  words.clear();
  while (words.empty() && position_ < text_.size()) {
    const std::size_t end = std::min(text_.find('\n', position_), text_.size());
    std::size_t at = position_;
    while (at < end) {
      while (at < end && is_blank(text_[at])) ++at;
      const std::size_t word = at;
      while (at < end && !is_blank(text_[at])) ++at;
      if (at > word) words.push_back(text_.substr(word, at - word));
    }
    position_ = std::min(end + 1, text_.size());
    ++line_;
  }
  return !words.empty();
}

double TextRows::number(std::string_view word, const std::string& field, ScalarType type) const {
  const std::optional<double> value = parse_double(word);
  const std::string where = "line " + std::to_string(line());
  if (!value)
    throw Error(where + " contains no number there",
                {.field = field, .value = std::string(word.substr(0, 40))});
  if (!fits_type(*value, type))
    throw Error(where + " contains a number that its type cannot represent",
                {.field = field,
                 .value = std::string(word.substr(0, 40)),
                 .bound = "of type " + to_text(type)});
  return *value;
}

void require_room_for_text(std::uint64_t rows, std::uint64_t words, std::uint64_t bytes,
                           const std::string& what) {
  // A word takes a character and a blank, but for the file's last one.
  const std::uint64_t line_bytes = 2 * words;
  if (line_bytes > 0 && rows > (bytes + 1) / line_bytes)
    throw Error("the header promises " + std::to_string(rows) + " " + what + ", but only " +
                std::to_string(bytes) + " bytes of text follow");
}

}  // namespace libmap
