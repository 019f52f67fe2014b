// GDAL's programs (Debian: gdal-bin) as independent readers and writers of rasters.
#pragma once

#include <nlohmann/json.hpp>

#include <cstring>
#include <stdexcept>

#include "libmap/core/text.h"
#include "tests/support/run_program.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline std::string gdal(std::vector<std::string> words) {
  words.insert(words.begin(), "/usr/bin/env");
  const ProgramResult result = run_program(words, {.folder = scratch_folder()});
  if (result.exit_code != 0) throw std::runtime_error(words[1] + ": " + result.standard_error);
  return result.standard_output;
}

inline nlohmann::json gdalinfo(const std::string& file) {
  return nlohmann::json::parse(gdal({"gdalinfo", "-json", file}));
}

struct AsciiGrid {
  double west = 0.0;  // x of the lower left corner
  double south = 0.0;
  double pixel = 1.0;
  std::vector<std::vector<double>> rows;  // from the north; -9999: none
};

// Writes GRID.tif in the scratch folder from ESRI's text format by gdal_translate with `words`.
inline std::filesystem::path write_dem(const std::string& name, const AsciiGrid& grid,
                                       std::vector<std::string> words = {}) {
  std::string text = "ncols " + std::to_string(grid.rows.front().size()) + "\nnrows " +
                     std::to_string(grid.rows.size()) + "\nxllcorner " +
                     libmap::to_text(grid.west) + "\nyllcorner " + libmap::to_text(grid.south) +
                     "\ncellsize " + libmap::to_text(grid.pixel) + "\nNODATA_value -9999\n";
  for (const auto& row : grid.rows) {
    for (const double height : row) text += libmap::to_text(height) + " ";
    text += "\n";
  }
  write_text(scratch_folder() / "grid.asc", text);
  words.insert(words.begin(), {"gdal_translate", "-q", "-ot", "Float64"});
  words.insert(words.end(), {"grid.asc", name});
  gdal(words);
  return scratch_folder() / name;
}

// Values of a band in row-major order, as raw output of GDAL.
inline std::vector<double> gdal_values(const std::string& file, int band) {
  gdal({"gdal_translate", "-q", "-b", std::to_string(band), "-of", "ENVI", "-ot", "Float64", file,
        "values.raw"});
  const std::string bytes = read_text(scratch_folder() / "values.raw");
  std::vector<double> values(bytes.size() / sizeof(double));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(double));
  return values;
}

}  // namespace graspmap_test
