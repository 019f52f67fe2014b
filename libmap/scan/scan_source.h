// A scan as all later stages see it, whatever file it comes from: poses and links at once, frames
// one by one.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

// Which images of a frame to decode. Cameras are always read.
struct FrameParts {
  bool color = true;
  bool depth = true;
};

// What a node is in the file that it comes from.
struct SourceNode {
  std::filesystem::path path;
  int node = 0;
};

class ScanSource {
 public:
  virtual ~ScanSource() = default;

  // As the user named it.
  virtual const std::filesystem::path& path() const = 0;
  // Read when the scan was opened.
  virtual const PoseGraph& graph() const = 0;
  // What was left out when it was opened, and why.
  virtual const std::vector<std::string>& warnings() const {
    static const std::vector<std::string> none;
    return none;
  }
  // Of several scans that were joined, each has a path and numbers of its own.
  virtual SourceNode source_of(int node) const { return {path(), node}; }
  // The name of the file of the node's color image, without its folder; empty where images are not
  // files.
  virtual std::string image_name([[maybe_unused]] int node) const { return {}; }
  // May be called from several threads at once. Images that are not stored are left empty. Throws
  // Error naming the file, the node and the part that is broken.
  virtual RgbdFrame read_frame(int node, FrameParts parts = {}) const = 0;
};

// An RTAB-Map database, a folder in the layout of the TUM RGB-D benchmark, or a folder of
// databases, joined in the order of their names (join_scans). Throws Error if the path is none of
// them.
std::unique_ptr<ScanSource> open_scan(const std::filesystem::path& path);

// Several scans as one, such as those of different days: each session stays in a frame of its own.
// Nodes of the n-th scan, from 0, are numbered n * step higher, where step is the lowest power of
// ten above all numbers: node 12 of the second of two small scans is 112. Sessions and landmarks
// are told apart in the same way; optimized poses are left out, since each scan's are in another
// frame. A single scan is returned as it is. Throws Error: no scan, too large numbers, or the same
// file twice.
std::unique_ptr<ScanSource> join_scans(std::vector<std::unique_ptr<ScanSource>> scans);

// Opens and joins all; of one path as open_scan does.
std::unique_ptr<ScanSource> open_scans(const std::vector<std::filesystem::path>& paths);

// The frame with the focal lengths, principal point and distortion of `calibration`, and its depth
// corrected and registered; where the camera is mounted stays, and pictures keep their rolling
// shutter. Throws Error for a frame of several cameras, of a
// stereo pair, or of another size than the calibration's.
void apply_calibration(RgbdFrame& frame, const CameraFile& calibration);

// `scan` with the calibration applied to each frame; read_frame throws Error naming the node where
// that is not possible.
std::unique_ptr<ScanSource> with_calibration(std::unique_ptr<ScanSource> scan,
                                             const CameraFile& calibration);

}  // namespace libmap
