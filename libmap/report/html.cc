#include "libmap/report/html.h"

#include <openssl/evp.h>

#include <boost/algorithm/hex.hpp>
#include <boost/algorithm/string/replace.hpp>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/manifest.h"

namespace libmap {

std::string breakable_html(std::string_view name) {
  std::string html;
  for (const char c : escape_html(name)) {
    html += c;
    if (c == '_' || c == '/' || c == '.') html += "<wbr>";
  }
  return html;
}

std::string escape_json_in_script(std::string json) {
  boost::replace_all(json, "<", "\\u003c");
  return json;
}

std::string escape_code(std::string_view code) {
  std::string text(code);
  std::erase(text, '\r');
  boost::replace_all(text, "</script", "<\\/script");
  boost::replace_all(text, "</style", "<\\/style");
  boost::replace_all(text, "<!--", "<\\!--");
  return text;
}

std::string to_base64(std::string_view bytes) {
  constexpr std::size_t max_bytes = static_cast<std::size_t>(std::numeric_limits<int>::max()) / 2;
  if (bytes.size() > max_bytes)
    throw Error("too large for the report's page",
                {.value = std::to_string(bytes.size()) + " bytes",
                 .bound = "<= " + std::to_string(max_bytes)});
  std::string text((bytes.size() + 2) / 3 * 4 + 1, '\0');
  const int length = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                     reinterpret_cast<const unsigned char*>(bytes.data()),
                                     static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(length));
  return text;
}

std::string csp_hash(std::string_view code) {
  return "'sha256-" + to_base64(boost::algorithm::unhex(sha256_of(code))) + "'";
}

std::string attribute(std::string_view name, std::string_view value) {
  if (value.empty()) return "";
  return " " + std::string(name) + "=\"" + escape_html(value) + "\"";
}

}  // namespace libmap
