// OUTPUT.json: what made an output, and from what. All but the section "run" is the same for the
// same input, seed and version.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/georeference.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/core/result_table.h"

namespace libmap {

// A real or whole number; nothing for another type and for no value.
std::optional<double> number_of(const ManifestValue* value);

struct ManifestInput {
  std::string path;    // as the user named it
  std::string sha256;  // 64 hexadecimal digits
  std::uint64_t bytes = 0;
};

struct Manifest {
  std::string command;
  std::string version;
  std::vector<std::pair<std::string, ManifestValue>> parameters;
  std::vector<ManifestInput> inputs;
  std::string frame;  // of the output's coordinates; lengths are meters
  std::vector<std::pair<std::string, Pose>> transforms;  // by name, e.g. "terrain_from_input"
  // Of the frame before site_from_map and terrain_from_input.
  std::optional<Georeference> georeference;
  std::vector<std::pair<std::string, ManifestValue>> results;  // counts, residuals
  std::vector<std::pair<std::string, double>> timings_s;       // in the section "run"
  unsigned threads = 0;                                        // in the section "run"

  void add_parameters(const ParameterTable& table);   // each key with the value in force
  void add_results(const ResultTable& table);         // those with a value
  void add_input(const std::filesystem::path& path);  // reads and hashes the file
  const ManifestValue* find_parameter(std::string_view name) const;  // or nullptr
  const ManifestValue* find_result(std::string_view name) const;     // or nullptr
  const Pose* find_transform(std::string_view name) const;           // or nullptr
};

// "map.pcd" -> "map.pcd.json".
std::filesystem::path manifest_path(const std::filesystem::path& output);

std::string to_json(const Manifest& manifest);  // fixed order; numbers read back the same
// The other way round; the section "run" may be missing. Throws Error naming `file`.
Manifest parse_manifest(const std::string& json, const std::string& file);
// Throws Error naming file and field. Nothing if there is no manifest beside `output`.
std::optional<Manifest> read_manifest_of(const std::filesystem::path& output);

// SHA-256 (FIPS 180-4) of a file's bytes, 64 hexadecimal digits.
std::string sha256_of_file(const std::filesystem::path& path);
std::string sha256_of(std::string_view bytes);

}  // namespace libmap
