// Reads RTAB-Map databases of all schemas from 0.10 to 0.23 (and images of older ones), without
// RTAB-Map.
//
// The schema is recognized by columns, not by version. The reader does not write to the file or the
// folder, and another program can have the file open (see SqliteFile). Nodes, links and poses are
// read on opening, images one node at a time.
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

// Data that a node contains, by the headers of the images. Sizes in bytes are of the stored blobs.
struct NodeContent {
  int node = 0;
  std::optional<ImageInfo> color{};
  std::optional<DepthInfo> depth{};
  std::optional<ImageInfo> right{};  // right image of a stereo pair, instead of depth
  std::size_t color_bytes = 0;
  std::size_t depth_bytes = 0;
  Calibration calibration{};
  std::size_t laser_scan_bytes = 0;
  std::size_t user_data_bytes = 0;
  std::vector<std::string> faults{};  // unreadable headers and the reason, e.g. "image: ..."
};

// Map data stored by RTAB-Map; 0 or nullopt if not stored.
struct StoredMap {
  int grid_width = 0;  // cells
  int grid_height = 0;
  double grid_resolution_m = 0.0;  // edge length of a cell
  std::size_t cloud_points = 0;
  std::size_t polygons = 0;  // number of polygons of the mesh
  std::optional<ImageInfo> texture{};
  std::optional<ImageInfo> preview{};
  std::optional<Pose> last_localization_map_from_base{};
};

// Stored images and calibration of a node; empty if absent.
struct FrameBlobs {
  std::string image;
  std::string depth;  // or the right image of a stereo pair
  std::string calibration;
};
// Decodes a frame; node and stamp are 0. Throws Error naming the damaged one of the three blobs.
RgbdFrame decode_frame(const FrameBlobs& blobs, FrameParts parts = {});

class RtabmapDatabase : public ScanSource {
 public:
  // Throws Error if the file is not an SQLite file, not an RTAB-Map database, or damaged.
  explicit RtabmapDatabase(const std::filesystem::path& path);
  ~RtabmapDatabase() override;

  const std::filesystem::path& path() const override { return path_; }
  const PoseGraph& graph() const override { return graph_; }
  // Converts grayscale to color. An image in the column depth that is not depth becomes `right`.
  RgbdFrame read_frame(int node, FrameParts parts = {}) const override;

  // Version stored in the file (Admin.version; empty if missing), and version by the columns.
  const std::string& version() const { return version_; }
  std::string recognized_version() const { return columns_.recognized_version(); }
  // Reports dropped nodes, links and poses, and unknown tables and columns.
  const std::vector<std::string>& warnings() const override { return warnings_; }

  // Returns RTAB-Map's parameters by name, as of the last write; empty if they are not stored.
  std::map<std::string, std::string> parameters() const;
  std::size_t word_count() const;     // visual words of the dictionary
  std::size_t feature_count() const;  // image features of all nodes
  // Throws Error naming the file and the column if the data are damaged.
  StoredMap stored_map() const;
  // Calls `use` for each node with a row of images, in ascending order; reads headers only.
  void each_content(const std::function<void(const NodeContent&)>& use) const;

  // Returns a node's stored images; color is a JPEG or PNG file. Throws Error for an unknown node.
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

// True if a warning is about a table or column of a later RTAB-Map version, which is not a fault.
bool is_about_unknown_part(const std::string& warning);

}  // namespace libmap
