#include "libmap/cloud/vtp_checks.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

// zlib unpacks at most 1032 bytes of one.
constexpr std::uint64_t max_ratio = 1032;

struct XmlTag {
  std::string_view name;
  std::vector<std::pair<std::string_view, std::string_view>> attributes;

  std::string_view attribute(std::string_view key) const {
    for (const auto& [name_of_attribute, value] : attributes)
      if (name_of_attribute == key) return value;
    return {};
  }
};

// The next tag from `at` on, which moves behind it; nothing at the end.
std::optional<XmlTag> next_tag(std::string_view xml, std::size_t& at) {
  at = xml.find('<', at);
  if (at == std::string_view::npos) return std::nullopt;
  const std::size_t end = std::min(xml.find('>', at), xml.size());
  std::string_view rest = xml.substr(at + 1, end - at - 1);
  at = end;
  XmlTag tag{rest.substr(0, rest.find_first_of(" \t\r\n")), {}};
  rest.remove_prefix(tag.name.size());
  while (true) {
    const std::size_t equals = rest.find('=');
    if (equals == std::string_view::npos) return tag;
    const std::size_t open = rest.find_first_of("\"'", equals);
    if (open == std::string_view::npos) return tag;
    const std::size_t close = std::min(rest.find(rest[open], open + 1), rest.size());
    tag.attributes.emplace_back(trim(rest.substr(0, equals)),
                                rest.substr(open + 1, close - open - 1));
    rest.remove_prefix(std::min(close + 1, rest.size()));
  }
}

void require_sane(bool sane, const XmlTag& tag, std::string_view attribute) {
  if (sane) return;
  throw Error(
      "nothing that this file can hold",
      {.file = {},
       .field = std::string(tag.name.substr(0, 40)) + " " + std::string(attribute.substr(0, 40)),
       .value = "'" + std::string(tag.attribute(attribute).substr(0, 40)) + "'",
       .bound = {}});
}

struct NumberType {
  std::string_view name;
  std::uint64_t size;
};
constexpr std::array<NumberType, 10> number_types = {{{"Int8", 1},
                                                      {"UInt8", 1},
                                                      {"Int16", 2},
                                                      {"UInt16", 2},
                                                      {"Int32", 4},
                                                      {"UInt32", 4},
                                                      {"Int64", 8},
                                                      {"UInt64", 8},
                                                      {"Float32", 4},
                                                      {"Float64", 8}}};

// How the file's blocks of data are written.
struct BlockLayout {
  std::uint64_t word_bytes = 4;
  bool big_endian = false;
  bool compressed = false;
};

void require_block(bool sane) {
  if (!sane) throw Error("a block of data claims more than the file holds");
}

int base64_value(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+') return 62;
  return c == '/' ? 63 : -1;
}

// The first `count` bytes of base64 text; fewer if it ends or is none.
std::string base64_prefix(std::string_view text, std::uint64_t count) {
  std::string bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const int value = base64_value(c);
    if (value < 0 || bytes.size() >= count) break;
    bits = (bits << 6 | static_cast<std::uint32_t>(value)) & 0xFFFFFF;
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes += static_cast<char>(bits >> held & 0xFF);
  }
  return bytes.substr(0, count);
}

std::uint64_t word_at(const std::string& bytes, std::uint64_t index, const BlockLayout& layout) {
  require_block((index + 1) * layout.word_bytes <= bytes.size());
  std::uint64_t word = 0;
  for (std::uint64_t i = 0; i < layout.word_bytes; ++i) {
    const std::uint64_t from = layout.big_endian ? i : layout.word_bytes - 1 - i;
    word = word << 8 | static_cast<unsigned char>(bytes[index * layout.word_bytes + from]);
  }
  return word;
}

// A block of `data`: its length, or how many pieces of which sizes are compressed in it.
void require_sane_block(std::string_view data, bool base64, const BlockLayout& layout,
                        std::uint64_t number_bytes, bool may_be_empty) {
  const auto head = [&](std::uint64_t words) {
    const std::uint64_t size = words * layout.word_bytes;
    return base64 ? base64_prefix(data, size) : std::string(data.substr(0, size));
  };
  const std::uint64_t room = base64 ? data.size() / 4 * 3 + 3 : data.size();
  if (!layout.compressed) {
    const std::uint64_t length = word_at(head(1), 0, layout);
    require_block(length <= room && length % number_bytes == 0);
    return;
  }
  const std::string sizes = head(3);
  // An array without data may have a header of one word.
  const std::uint64_t pieces = word_at(sizes, 0, layout);
  if (pieces == 0) return require_block(may_be_empty);
  const std::uint64_t piece = word_at(sizes, 1, layout);
  const std::uint64_t last = word_at(sizes, 2, layout);
  const std::uint64_t most = room * max_ratio;
  require_block(pieces <= room / layout.word_bytes && piece > 0 && piece <= most && last <= piece &&
                piece % number_bytes == 0 && last % number_bytes == 0 &&
                pieces <= most / piece + 1);
  const std::string all = head(3 + pieces);
  std::uint64_t left = room;
  for (std::uint64_t i = 0; i < pieces; ++i) {
    const std::uint64_t packed = word_at(all, 3 + i, layout);
    require_block(packed <= left);
    left -= packed;
  }
}

// The promises of a tag's attributes; for an array, the size of one of its numbers.
std::uint64_t require_sane_tag(const XmlTag& tag, double max_count) {
  constexpr double max_components = 4096.0;
  for (const auto& [name, value] : tag.attributes) {
    if (!name.starts_with("NumberOf")) continue;
    const std::optional<std::int64_t> count = parse_integer(value);
    const double limit = name == "NumberOfComponents" ? max_components : max_count;
    require_sane(count && *count >= 0 && static_cast<double>(*count) <= limit, tag, name);
  }
  if (tag.name == "VTKFile") require_sane(tag.attribute("type") == "PolyData", tag, "type");
  if (tag.name != "DataArray") return 0;
  const auto type =
      std::find_if(number_types.begin(), number_types.end(),
                   [&tag](const NumberType& known) { return known.name == tag.attribute("type"); });
  require_sane(type != number_types.end(), tag, "type");
  const std::string_view format = tag.attribute("format");
  require_sane(format == "ascii" || format == "binary" || format == "appended", tag, "format");
  return type->size;
}

BlockLayout layout_of(const XmlTag& tag) {
  BlockLayout layout;
  const std::string_view header_type = tag.attribute("header_type");
  const std::string_view order = tag.attribute("byte_order");
  require_sane(header_type.empty() || header_type == "UInt32" || header_type == "UInt64", tag,
               "header_type");
  require_sane(order == "LittleEndian" || order == "BigEndian", tag, "byte_order");
  layout.word_bytes = header_type == "UInt64" ? 8 : 4;
  layout.big_endian = order == "BigEndian";
  layout.compressed = !tag.attribute("compressor").empty();
  return layout;
}

// Which arrays hold data: those of a part of the file that is not empty.
class Parts {
 public:
  void enter(const XmlTag& tag) {
    if (tag.name == "Piece") piece_ = tag;
    constexpr std::array<std::string_view, 8> parts = {
        "FieldData", "PointData", "CellData", "Points", "Verts", "Lines", "Strips", "Polys"};
    if (std::find(parts.begin(), parts.end(), tag.name) != parts.end()) part_ = tag.name;
  }
  bool is_empty(const XmlTag& array) const {
    if (part_ == "FieldData") return array.attribute("NumberOfTuples") == "0";
    if (part_ == "Points" || part_ == "PointData") return is_zero("NumberOfPoints");
    if (part_ == "CellData")
      return is_zero("NumberOfVerts") && is_zero("NumberOfLines") && is_zero("NumberOfStrips") &&
             is_zero("NumberOfPolys");
    return is_zero("NumberOf" + std::string(part_));
  }

 private:
  bool is_zero(std::string_view count) const {
    return parse_integer(piece_.attribute(count)).value_or(0) == 0;
  }
  XmlTag piece_;
  std::string_view part_;
};

// The appended data behind their underscore; empty if there are none.
std::string_view appended_data(std::string_view bytes, bool& base64) {
  const std::size_t open = bytes.find("<AppendedData");
  const std::size_t close = open == std::string_view::npos ? open : bytes.find('>', open);
  if (close == std::string_view::npos) return {};
  std::size_t at = open;
  const std::string_view encoding = next_tag(bytes, at)->attribute("encoding");
  if (encoding != "raw" && encoding != "base64")
    throw Error("the appended data have no known encoding");
  base64 = encoding == "base64";
  const std::size_t begin = bytes.find_first_not_of(" \t\r\n", close + 1);
  if (begin == std::string_view::npos || bytes[begin] != '_')
    throw Error("the appended data do not begin with '_'");
  return bytes.substr(begin + 1);
}

}  // namespace

void require_sane_vtp(std::string_view bytes) {
  if (bytes.empty()) throw Error("is empty");
  const std::string_view xml = bytes.substr(0, bytes.find("<AppendedData"));
  if (xml.find("<VTKFile") == std::string_view::npos) throw Error("not a VTK XML file");
  bool base64 = false;
  const std::string_view appended = appended_data(bytes, base64);
  const double max_count = static_cast<double>(bytes.size()) * static_cast<double>(max_ratio);
  BlockLayout layout;
  Parts parts;
  std::size_t at = 0;
  while (const std::optional<XmlTag> tag = next_tag(xml, at)) {
    const std::uint64_t number_bytes = require_sane_tag(*tag, max_count);
    if (tag->name == "VTKFile") layout = layout_of(*tag);
    parts.enter(*tag);
    if (tag->name != "DataArray" || tag->attribute("format") == "ascii") continue;
    if (tag->attribute("format") == "appended") {
      const std::optional<std::int64_t> offset = parse_integer(tag->attribute("offset"));
      require_sane(offset && *offset >= 0 && static_cast<std::uint64_t>(*offset) < appended.size(),
                   *tag, "offset");
      require_sane_block(appended.substr(static_cast<std::size_t>(*offset)), base64, layout,
                         number_bytes, parts.is_empty(*tag));
    } else {
      const std::size_t begin = xml.find_first_not_of(" \t\r\n", std::min(at + 1, xml.size()));
      const std::string_view data = xml.substr(std::min(begin, xml.size()));
      if (!data.starts_with('<') || !parts.is_empty(*tag))
        require_sane_block(data.substr(0, data.find('<')), true, layout, number_bytes,
                           parts.is_empty(*tag));
    }
  }
}

}  // namespace libmap
