// RTAB-Map databases of every schema from 0.10 to 0.23 (and images of older ones), without
// RTAB-Map.
//
// A schema is recognized by its columns, never refused for its version. The file is never written
// to, nothing appears beside it, and another program may have it open (see SqliteFile). Nodes,
// links and poses are read at once, images one node at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libmap/camera/calibration_codec.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/scan/rtabmap_schema.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

class SqliteFile;

// What a node's row of images holds, by the first bytes of each.
struct NodeContent {
  int node = 0;
  std::optional<ImageInfo> color{};
  std::optional<DepthInfo> depth{};
  std::optional<ImageInfo> right{};  // of a stereo pair, in place of depth
  std::size_t color_bytes = 0;
  std::size_t depth_bytes = 0;
  Calibration calibration{};
  std::size_t laser_scan_bytes = 0;
  std::size_t user_data_bytes = 0;
  std::vector<std::string> faults{};  // "image: ...": headers that cannot be read
};

// What RTAB-Map keeps of the whole map; 0 or nothing where not stored.
struct StoredMap {
  int grid_width = 0;  // cells
  int grid_height = 0;
  double grid_resolution_m = 0.0;
  std::size_t cloud_points = 0;
  std::size_t polygons = 0;
  std::optional<ImageInfo> texture{};
  std::optional<ImageInfo> preview{};
  std::optional<Pose> last_localization_map_from_base{};
};

// A node's images and calibration as stored; empty where absent.
struct FrameBlobs {
  std::string image;
  std::string depth;
  std::string calibration;
};
// Node and stamp are left 0. Throws Error naming "image", "depth" or "calibration".
RgbdFrame decode_frame(const FrameBlobs& blobs, FrameParts parts = {});

class RtabmapDatabase : public ScanSource {
 public:
  // Throws Error: not an SQLite file, not a scan, broken.
  explicit RtabmapDatabase(const std::filesystem::path& path);
  ~RtabmapDatabase() override;

  const std::filesystem::path& path() const override { return path_; }
  const PoseGraph& graph() const override { return graph_; }
  // Grayscale becomes color; the depth column's image is `right` where it is no depth.
  RgbdFrame read_frame(int node, FrameParts parts = {}) const override;

  // As the file says (Admin.version), empty if it does not; and as its columns say.
  const std::string& version() const { return version_; }
  std::string recognized_version() const { return columns_.recognized_version(); }
  // What could not be used of nodes, links and poses, and what no known version has.
  const std::vector<std::string>& warnings() const override { return warnings_; }

  // RTAB-Map's parameters when it last wrote the file.
  std::map<std::string, std::string> parameters() const;
  std::size_t word_count() const;
  std::size_t feature_count() const;
  StoredMap stored_map() const;
  // Nodes in ascending order, from headers alone.
  void each_content(const std::function<void(const NodeContent&)>& use) const;

  // The image is a file of its own: JPEG or PNG.
  FrameBlobs read_blobs(int node) const { return read_blobs(node, {}); }

  const SqliteFile& file() const { return *file_; }
  const RtabmapColumns& columns() const { return columns_; }

 private:
  FrameBlobs read_blobs(int node, FrameParts parts) const;

  std::filesystem::path path_;
  std::unique_ptr<SqliteFile> file_;
  RtabmapColumns columns_;
  std::string version_;
  PoseGraph graph_;
  std::vector<std::string> warnings_;
};

// Whether a warning of warnings() is about a table or column that RTAB-Map got after this was
// written: nothing is broken.
bool is_about_unknown_part(const std::string& warning);

}  // namespace libmap
