// Manifest of an output file: OUTPUT.json with command, parameters, inputs and results. All
// sections but "run" are reproducible for equal input, seed and version.
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

// Returns the value as double if it is a number; nullopt for a value of another type or nullptr.
std::optional<double> number_of(const ManifestValue* value);

struct ManifestInput {
  std::string path;    // as the user named it
  std::string sha256;  // 64 hexadecimal digits
  std::uint64_t bytes = 0;
};

struct Manifest {
  std::string command;                                            // e.g. "score"
  std::string version;                                            // version of graspmap
  std::vector<std::pair<std::string, ManifestValue>> parameters;  // by key
  std::vector<ManifestInput> inputs;
  std::string frame;                                     // frame of the output's coordinates
  std::vector<std::pair<std::string, Pose>> transforms;  // by name, e.g. "terrain_from_input"
  // Georeference of the original coordinates: before site_from_map and terrain_from_input.
  std::optional<Georeference> georeference;
  std::vector<std::pair<std::string, ManifestValue>> results;  // by key, e.g. counts and residuals
  std::vector<std::pair<std::string, double>> timings_s;       // by step; in the section "run"
  unsigned threads = 0;  // number of threads; in the section "run"

  void add_parameters(const ParameterTable& table);   // all keys with current values
  void add_results(const ResultTable& table);         // skips results without a value
  void add_input(const std::filesystem::path& path);  // hashes the file; throws as sha256_of_file
  const ManifestValue* find_parameter(std::string_view name) const;  // nullptr if there is none
  const ManifestValue* find_result(std::string_view name) const;     // nullptr if there is none
  const Pose* find_transform(std::string_view name) const;           // nullptr if there is none
};

// Returns the path of an output's manifest: "map.pcd" -> "map.pcd.json".
std::filesystem::path manifest_path(const std::filesystem::path& output);

std::string to_json(const Manifest& manifest);  // keys in fixed order; NaN and infinity are null
// Parses the output of to_json (null: NaN; "run" is optional). Throws Error naming `file`.
Manifest parse_manifest(const std::string& json, const std::string& file);
// Reads the manifest next to `output`. Returns nullopt if there is no manifest. Throws Error naming
// the manifest's path if it is invalid.
std::optional<Manifest> read_manifest_of(const std::filesystem::path& output);

// Returns the SHA-256 (FIPS 180-4) as 64 hexadecimal digits. Throws Error if a file is unreadable.
std::string sha256_of_file(const std::filesystem::path& path);
std::string sha256_of(std::string_view bytes);

}  // namespace libmap
