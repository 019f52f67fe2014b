// Writes a scan as a folder of plain files that FrameFolder (frame_folder.h) reads: images,
// calibrations, poses, links.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

// Returns the names of all files and folders that the writer can create.
std::vector<std::string> frame_folder_names();

// Encoded images of a frame, which are stored unchanged. Empty: the frame's image, encoded as PNG.
struct StoredImages {
  std::string color{};  // JPEG or PNG
  std::string depth{};  // PNG with 16-bit depth in millimeters
  std::string right{};  // JPEG or PNG
};

struct FrameFolderCounts {
  std::size_t color_images = 0;  // numbers of written files
  std::size_t depth_images = 0;
  std::size_t right_images = 0;
  std::size_t calibrations = 0;
  std::size_t associations = 0;  // nodes with color and depth
};

class FrameFolderWriter {
 public:
  // Writes to `folder`, which must exist and contain no scan. All functions throw Error (failed) if
  // a file or folder cannot be written.
  explicit FrameFolderWriter(std::filesystem::path folder);

  // Writes the images and calibrations of a frame, e.g. color/000012.jpg for node 12. Depth that is
  // not in `stored` is rounded to millimeters, and 0 above 65.534 m.
  void add_frame(const RgbdFrame& frame, const StoredImages& stored = {});

  // Writes nodes, poses and links of `graph`, associations.txt and scan.yaml. Call once, last.
  FrameFolderCounts finish(const PoseGraph& graph);

 private:
  struct Files {
    std::string color{};
    std::string depth{};
    std::string right{};
    std::string calibrations{};
    std::string baselines_m{};
  };

  std::string write_image(const char* folder, int node, const std::string& bytes);
  std::string write_camera(const Camera& camera);
  void write_nodes(const PoseGraph& graph) const;
  std::size_t write_associations(const PoseGraph& graph) const;
  void write_poses(const PoseGraph& graph) const;

  std::filesystem::path folder_;
  FrameFolderCounts counts_;
  std::map<int, Files> files_;                  // by node
  std::map<std::string, std::string> cameras_;  // file name by content
};

}  // namespace libmap
