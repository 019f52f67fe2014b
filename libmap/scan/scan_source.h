// Interface of scans in any format. Poses and links are read on opening, frames one at a time.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

// Parts of a frame to decode. Cameras are always read.
struct FrameParts {
  bool color = true;
  bool depth = true;  // also the right image of a stereo pair
};

// File that contains a node, and the node's id in this file.
struct SourceNode {
  std::filesystem::path path;
  int node = 0;
};

class ScanSource {
 public:
  virtual ~ScanSource() = default;

  // Path as given by the user; for joined scans, the path of the first scan.
  virtual const std::filesystem::path& path() const = 0;
  // Nodes with poses, and links.
  virtual const PoseGraph& graph() const = 0;
  // Warnings of opening: the dropped data, with the reason.
  virtual const std::vector<std::string>& warnings() const {
    static const std::vector<std::string> none;
    return none;
  }
  // Returns the file of a node and the node's id in it; only joined scans have several files.
  virtual SourceNode source_of(int node) const { return {path(), node}; }
  // Returns the name of the node's color image without folder; empty if images are not files.
  virtual std::string image_name([[maybe_unused]] int node) const { return {}; }
  // Reads a frame; images that are not stored are empty. Thread-safe. Throws Error naming file,
  // node and part if a part is damaged, or if no such node exists.
  virtual RgbdFrame read_frame(int node, FrameParts parts = {}) const = 0;
};

// Opens an RTAB-Map database, a folder in the layout of the TUM RGB-D benchmark, or a folder of
// databases, joined in the order of names (join_scans). Throws Error for other paths.
std::unique_ptr<ScanSource> open_scan(const std::filesystem::path& path);

// Joins several scans, for example of different days. Node ids of scan n (from 0) increase by n *
// step, where step is the smallest power of ten above all ids. With step 100, node 12 of the second
// scan becomes 112, and landmark -12 becomes -112. Session numbers continue from scan to scan.
// Optimized poses are dropped, because map frames differ. A single scan is returned unchanged.
// Throws Error for no scan, too large ids, or a file given twice.
std::unique_ptr<ScanSource> join_scans(std::vector<std::unique_ptr<ScanSource>> scans);

// Opens scans with open_scan and joins them with join_scans.
std::unique_ptr<ScanSource> open_scans(const std::vector<std::filesystem::path>& paths);

// Replaces focal lengths, principal point and distortion of the frame's camera, and registers and
// corrects its depth by `calibration`. The mounting pose is kept, color is not corrected for a
// rolling shutter, and a frame without cameras is not changed. Throws Error for a frame of several
// cameras or a stereo pair, or if the image size differs from the calibration.
void apply_calibration(RgbdFrame& frame, const CameraFile& calibration);

// Returns `scan` with apply_calibration applied to each frame on reading. read_frame also throws
// the Error of apply_calibration, naming the node.
std::unique_ptr<ScanSource> with_calibration(std::unique_ptr<ScanSource> scan,
                                             const CameraFile& calibration);

}  // namespace libmap
