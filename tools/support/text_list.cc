#include "tools/support/text_list.h"

#include "libmap/core/text.h"

namespace graspmap_tools {

std::vector<std::string> split_texts(std::string_view text) {
  std::vector<std::string> parts;
  if (text.empty()) return parts;
  while (true) {
    const std::size_t end = text.find('|');
    parts.emplace_back(libmap::trim(text.substr(0, end)));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

}  // namespace graspmap_tools
