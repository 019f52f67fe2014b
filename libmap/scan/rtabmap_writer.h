// Writes scans as RTAB-Map databases of schema 0.23 for RTAB-Map's own tools.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

struct RtabmapWriterOptions {
  DepthFormat depth = DepthFormat::rvl;   // rvl and png16: whole millimeters up to 65.534 m
  ImageFormat color = ImageFormat::jpeg;  // also for right images of stereo pairs
};

// Encodes a depth image in the given format; returns an empty text for an empty image.
std::string encode_depth(const DepthImage& depth, DepthFormat format);

// Writer of a database. The same calls in the same order write the same bytes: the nodes' stamps
// replace the current time that RTAB-Map writes.
class RtabmapWriter {
 public:
  // Creates or replaces the file `path`; pass the temporary path of an OutputFile. All functions
  // throw Error (failed) if the file cannot be written.
  explicit RtabmapWriter(const std::filesystem::path& path,
                         const RtabmapWriterOptions& options = {});
  ~RtabmapWriter();
  RtabmapWriter(const RtabmapWriter&) = delete;
  RtabmapWriter& operator=(const RtabmapWriter&) = delete;

  // Adds a node with images. Nodes can be added in any order of ids. Poses are stored as float32.
  void add_node(const GraphNode& node, const RgbdFrame& frame);
  // Adds a link in both directions with equal information matrix, as RTAB-Map does; priors, gravity
  // and landmark links in one direction. The nodes may be added later.
  void add_link(const PoseLink& link);
  // Completes and closes the file; no journal remains next to it. Without this call, the file is
  // not a valid scan.
  void finish();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// Copies the database `source` to `target`, replacing `target`, with `map_from_base` (node id ->
// pose) as optimized poses (Admin.opt_ids, opt_poses); other nodes have no optimized pose. All
// other rows are unchanged, except:
//   - The last localization (Admin.opt_last_localization): if it equals a node's earlier optimized
//     pose, it becomes the node's new pose; otherwise, it is removed.
//   - Optimized poses of landmarks: each moves with the first node that sees the landmark.
//   - The stored grid, cloud and mesh, which belong to the earlier poses, are removed; RTAB-Map
//     computes them again.
//   - `links` are added in both directions between nodes that are not linked yet.
//   - With a calibration, cameras and depth images are changed as by apply_calibration
//     (scan_source.h); depth formats are kept.
// `source` can be open in other programs. Throws Error if it is not a database of RTAB-Map 0.13 or
// later, or the calibration does not fit a node.
void copy_with_optimized_poses(const std::filesystem::path& source,
                               const std::filesystem::path& target,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<PoseLink>& links = {},
                               const std::optional<CameraFile>& calibration = std::nullopt);

}  // namespace libmap
