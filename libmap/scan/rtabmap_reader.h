// Reads RTAB-Map databases without RTAB-Map: versions 0.10 to 0.23, and the images of older ones.
//
// The version is recognized by columns. The reader does not write to the file or its folder, and
// another program may have the file open (see SqliteFile). Nodes, links and poses are read on
// opening, images one node at a time.
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

// Data of a node, recognized from the headers of its images.
struct NodeContent {
  int node = 0;                       // node id
  std::optional<ImageInfo> color{};   // nullopt: not stored
  std::optional<DepthInfo> depth{};   // nullopt: not stored
  std::optional<ImageInfo> right{};   // right image of a stereo pair, instead of depth
  std::size_t color_bytes = 0;        // size of the stored color image; 0: not stored
  std::size_t depth_bytes = 0;        // size of the stored depth or right image; 0: not stored
  Calibration calibration{};          // empty if not stored
  std::size_t laser_scan_bytes = 0;   // size of the stored laser scan; 0: not stored
  std::size_t user_data_bytes = 0;    // size of the stored user data; 0: not stored
  std::vector<std::string> faults{};  // part and reason for unreadable headers, e.g. "image: ..."
};

// Map stored by RTAB-Map; 0 or nullopt if a part is not stored.
struct StoredMap {
  int grid_width = 0;                  // cells of the occupancy grid
  int grid_height = 0;                 // cells of the occupancy grid
  double grid_resolution_m = 0.0;      // edge length of a cell
  std::size_t cloud_points = 0;        // number of points of the cloud
  std::size_t polygons = 0;            // polygons of the mesh
  std::optional<ImageInfo> texture{};  // image of the mesh's texture
  std::optional<ImageInfo> preview{};  // preview image of the database
  std::optional<Pose> last_localization_map_from_base{};
};

// Stored images and calibration of a node; empty if absent.
struct FrameBlobs {
  std::string image;
  std::string depth;  // depth image, or right image of a stereo pair
  std::string calibration;
};
// Decodes a frame; node and stamp are 0. Throws Error naming the blob that is damaged.
RgbdFrame decode_frame(const FrameBlobs& blobs, FrameParts parts = {});

class RtabmapDatabase : public ScanSource {
 public:
  // Throws Error if the file is not an SQLite file, not an RTAB-Map database, or damaged.
  explicit RtabmapDatabase(const std::filesystem::path& path);
  ~RtabmapDatabase() override;

  const std::filesystem::path& path() const override { return path_; }
  const PoseGraph& graph() const override { return graph_; }
  // Converts gray images to color. Images in the column `depth` that are not depth become `right`.
  RgbdFrame read_frame(int node, FrameParts parts = {}) const override;

  // Version that the file contains (Admin.version); empty if missing.
  const std::string& version() const { return version_; }
  // Version by the columns of the tables (RtabmapColumns::recognized_version).
  std::string recognized_version() const { return columns_.recognized_version(); }
  // Reports dropped nodes, links and poses, and unknown tables and columns.
  const std::vector<std::string>& warnings() const override { return warnings_; }

  // Returns RTAB-Map's parameters by name, as last stored; empty if none are stored.
  std::map<std::string, std::string> parameters() const;
  std::size_t word_count() const;     // number of visual words in the dictionary
  std::size_t feature_count() const;  // number of image features of all nodes
  // Returns the sizes of the stored map. Throws Error naming file and column for damaged data.
  StoredMap stored_map() const;
  // Calls `use` for each node in the table of images, ascending by id. Reads headers only.
  void each_content(const std::function<void(const NodeContent&)>& use) const;

  // Returns a node's stored images; color is JPEG or PNG. Throws Error for an unknown node.
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

// True for a warning about a table or column of a later RTAB-Map version, which is not a fault.
bool is_about_unknown_part(const std::string& warning);

}  // namespace libmap
