// A binary PCD written part by part, so that no more than one part is in memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "libmap/core/point_cloud.h"

namespace libmap {

struct PcdPartsOptions {
  std::uint64_t points = 1;        // of all parts together, at least 1
  bool float64_positions = false;  // else float32: what write_cloud would choose for the whole
};

// The file is that of write_cloud for all parts in one cloud, byte for byte.
class PcdPartsWriter {
 public:
  // Writes straight to `path`, as write_cloud does. Throws Error (failed).
  PcdPartsWriter(std::filesystem::path path, const PcdPartsOptions& options);

  // All parts have the fields of the first, and normals and colors if it has; empty ones are
  // passed over. Throws Error: one has others, more points than promised, a failed write
  // (ErrorKind::failed).
  void append(const PointCloud& part);
  // After the last part. Throws Error: fewer points than promised, a failed write.
  void finish();

 private:
  void write(const std::string& bytes);
  void require_good() const;

  std::filesystem::path path_;
  PcdPartsOptions options_;
  std::ofstream file_;
  std::string header_;  // once the first part is written
  std::uint64_t written_ = 0;
};

}  // namespace libmap
