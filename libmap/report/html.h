// Text for HTML pages: escaping, and files as data URIs.
#pragma once

#include <string>
#include <string_view>

namespace libmap {

// Text as it may stand between tags and in quoted attributes: & < > " ' escaped, control characters
// other than tab and newline replaced by U+FFFD.
std::string escape_html(std::string_view text);

// The same of a name: it may be broken after '_', '/' and '.'.
std::string breakable_html(std::string_view name);

// JSON as it may stand in a <script>: every '<' as \u003c.
std::string escape_json_in_script(std::string json);

// A script or style sheet as it may stand between its tags: "</script", "</style" and "<!--" are
// broken up, carriage returns left out, so that the bytes are those that a browser hashes.
std::string escape_code(std::string_view code);

// RFC 4648, section 4.
std::string to_base64(std::string_view bytes);

// "'sha256-...'" of `code`, as a Content-Security-Policy names it.
std::string csp_hash(std::string_view code);

// <p> for each paragraph; an empty line ends one.
std::string paragraphs(std::string_view text);

// ` name="value"`, or nothing if the value is empty.
std::string attribute(std::string_view name, std::string_view value);

}  // namespace libmap
