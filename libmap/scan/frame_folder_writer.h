// Writes a scan as a folder of plain files that FrameFolder reads back (frame_folder.h): color and
// depth images, calibrations, poses, links.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

// What may stand in such a folder, files and folders.
std::vector<std::string> frame_folder_names();

// Image files to be kept as they are; empty: the frame's image becomes a PNG.
struct StoredImages {
  std::string color{};  // JPEG or PNG
  std::string depth{};  // PNG of 16-bit millimeters
  std::string right{};  // JPEG or PNG
};

struct FrameFolderCounts {
  std::size_t color_images = 0;
  std::size_t depth_images = 0;
  std::size_t right_images = 0;
  std::size_t calibrations = 0;
  std::size_t associations = 0;  // nodes with color and depth
};

class FrameFolderWriter {
 public:
  // `folder` is there, and holds nothing of a scan. Throws Error (failed).
  explicit FrameFolderWriter(std::filesystem::path folder);

  // Images and calibrations go to files at once: color/000012.jpg for node 12. Depth is rounded to
  // whole millimeters; 0 beyond 65.534 m.
  void add_frame(const RgbdFrame& frame, const StoredImages& stored = {});

  // The nodes, with the files of those whose frames were added; poses, links, scan.yaml.
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
  std::map<std::string, std::string> cameras_;  // file by its text
};

}  // namespace libmap
