// RTAB-Map databases of any schema, made from their table definitions.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/pose_graph.h"

namespace graspmap_test {

struct SchemaVersion {
  int minor = 23;
  int patch = 0;
  auto operator<=>(const SchemaVersion&) const = default;
  std::string text() const;
};

// Versions with different tables, 0.10.0 to 0.23.0.
std::vector<SchemaVersion> schema_versions();
std::vector<std::string> table_statements(SchemaVersion version);

template <typename T>
std::string bytes_of(const std::vector<T>& numbers) {
  return std::string(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T));
}
std::string pose_bytes(const libmap::Pose& pose);

// SQL statement with blobs for its '?'.
void execute(const std::filesystem::path& file, const std::string& statement,
             const std::vector<std::string>& blobs = {});

libmap::Pose sample_pose(int node);  // odometry
libmap::Pose sample_truth(int node);
libmap::Pose sample_optimized(int node);
libmap::ColorImage sample_color(int node);            // 32 x 24
libmap::Image<std::uint16_t> sample_depth(int node);  // mm, 32 x 24, with holes
// One camera, 32 x 24, fx 30, fy 31, cx 15.5, cy 11.5, in the layout of that version.
std::string sample_calibration(SchemaVersion version);

inline constexpr int sample_nodes = 3;
// Nodes 1 to 3 with images (PNG, RVL), poses and everything else that the schema has; neighbors in
// both directions, a closure 3 -> 1, gravity at 1, a landmark -1 seen from 2, words and features, a
// laser scan and user data at 2.
void write_sample(const std::filesystem::path& file, SchemaVersion version = {});

}  // namespace graspmap_test
