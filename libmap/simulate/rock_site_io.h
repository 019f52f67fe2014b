// Test sites as YAML:
//
//   seed: 1
//   ground: {size_x_m: 4, size_y_m: 4, unevenness_m: 0.02}
//   layout: {site_size_m: 3, free_square_m: 1.5}
//   field_points: {count: 30}
//   bumps:
//     - {height_m: -0.5, radius_m: 1.5, x_m: 0.2}
//   rocks:
//     - {name: R01, height_m: 0.67, overhang_deg: 15}
//     - {name: C01, shape: cobble, height_m: 0.15, x_m: 1, y_m: 0.2}
//
// Every part may be missing. A rock needs its height; what else is not given is drawn from its
// seed, and its seed from the site's; rocks without x_m and y_m are placed within the layout.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "libmap/simulate/rock_site.h"

namespace libmap {

// With a `seed`, that one in place of the file's. Throws Error naming `file`, the entry, the key,
// the value and the bound, and for unknown keys the nearest known one.
RockSite parse_site(const std::string& text, const std::string& file,
                    std::optional<std::uint64_t> seed = std::nullopt);
RockSite load_site(const std::filesystem::path& path,
                   std::optional<std::uint64_t> seed = std::nullopt);

// Text with nothing left to draw: parse_site reads back an equal site.
std::string to_yaml(const RockSite& site);

}  // namespace libmap
