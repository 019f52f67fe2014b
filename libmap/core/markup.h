// Escapes text for HTML and XML.
#pragma once

#include <string>
#include <string_view>

namespace libmap {

// Escapes text for elements and quoted attributes: & < > " ' are escaped, control characters other
// than tab and newline are replaced by U+FFFD.
std::string escape_html(std::string_view text);

}  // namespace libmap
