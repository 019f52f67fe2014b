// Parses YAML. The Errors name file, key and line.
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

// Maximum size of a YAML file.
inline constexpr std::uint64_t max_yaml_bytes = std::uint64_t{16} << 20;

// Calls read(document) with the only document in `text`, a null node if the text is empty. Throws
// Error naming `file` if the text is not YAML or contains several documents or more than 500,000
// values; adds `file` to Errors of `read`.
void read_yaml(const std::string& text, const std::string& file,
               const std::function<void(const YAML::Node&)>& read);

// Returns the error "unknown key" + `whose` (e.g. " of camera front") with the nearest known key.
Error unknown_key(std::string_view key, const std::vector<std::string>& known,
                  const std::string& whose = "");

// Throws Error if a key of the mapping is unknown ("unknown key" + `whose`) or a duplicate. YAML
// libraries accept duplicates silently.
void check_keys(const YAML::Node& map, const std::vector<std::string>& known,
                const std::string& whose = "");

// Returns a copy of `error` with the field "POSITION.FIELD (line N)": `position`, the field of
// `error`, and the line of `node`.
Error at_node(const Error& error, const std::string& position, const YAML::Node& node);

}  // namespace libmap
