#include "tools/support/message_text.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace graspmap_tools {

namespace {

constexpr std::size_t max_bytes = 1000;

bool is_continuation(char c) { return (static_cast<std::uint8_t>(c) & 0xC0) == 0x80; }

// Bytes of the printable UTF-8 character that `text` begins with (RFC 3629), 0 if there is none.
std::size_t character_bytes(std::string_view text) {
  const auto first = static_cast<std::uint8_t>(text[0]);
  if (first < 0x80) return first >= 0x20 && first != 0x7F ? 1 : 0;
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < bytes) return 0;
  std::uint32_t code = first & (0xFFU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if (!is_continuation(text[i])) return 0;
    code = code << 6 | (static_cast<std::uint8_t>(text[i]) & 0x3FU);
  }
  const bool is_overlong = bytes > 2 && code < (bytes == 3 ? 0x800U : 0x10000U);
  const bool is_surrogate = code >= 0xD800 && code <= 0xDFFF;
  const bool is_control = code < 0xA0;
  return is_overlong || is_surrogate || is_control || code > 0x10FFFF ? 0 : bytes;
}

std::string printable(std::string_view text) {
  std::string line;
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    if (bytes > 0)
      line += text.substr(0, bytes);
    else if (text[0] == '\n')
      line += ' ';
    else
      line += fmt::format("\\x{:02x}", static_cast<std::uint8_t>(text[0]));
    text.remove_prefix(bytes > 0 ? bytes : 1);
  }
  return line;
}

}  // namespace

std::string message_text(const std::string& text) {
  if (text.size() <= max_bytes) return printable(text);
  std::size_t head = max_bytes / 2;
  std::size_t tail = text.size() - max_bytes / 2;
  while (head > 0 && is_continuation(text[head])) --head;
  while (tail < text.size() && is_continuation(text[tail])) ++tail;
  return printable(std::string_view(text).substr(0, head)) + " ... " +
         printable(std::string_view(text).substr(tail));
}

}  // namespace graspmap_tools
