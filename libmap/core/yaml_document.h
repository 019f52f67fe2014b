// A text of YAML, with errors that name file and line.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/error.h"

namespace YAML {
class Node;
}

namespace libmap {

// Of a file of YAML that is read whole.
inline constexpr std::uint64_t max_yaml_bytes = std::uint64_t{16} << 20;

// Gives the one document in `text` to `read`, a null node where there is none. Throws Error naming
// `file` where the text is no YAML or holds more documents, and names `file` in what `read` throws.
void read_yaml(const std::string& text, const std::string& file,
               const std::function<void(const YAML::Node&)>& read);

// "unknown key", then `whose`, then the nearest known key.
Error unknown_key(std::string_view key, const std::vector<std::string>& known,
                  const std::string& whose = "");

// Each key of the map known and there once: YAML itself lets the first or the last of two stand.
// Throws Error: another one, of which it says "unknown key" and then `whose`.
void check_keys(const YAML::Node& map, const std::vector<std::string>& known,
                const std::string& whose = "");

// The error of what `node` holds, at PLACE.FIELD (line N).
Error at_node(const Error& error, const std::string& place, const YAML::Node& node);

}  // namespace libmap
