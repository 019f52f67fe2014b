// Writes scans as RTAB-Map databases of schema 0.23 that RTAB-Map's own tools open.
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
  ImageFormat color = ImageFormat::jpeg;  // of the right image of a stereo pair too
};

// The depth image as RTAB-Map stores it; empty for an empty one.
std::string encode_depth(const DepthImage& depth, DepthFormat format);

// The same calls in the same order give the same bytes: where RTAB-Map writes the present time, the
// stamps of the nodes stand.
class RtabmapWriter {
 public:
  // Makes a new file at `path`, which callers give as an OutputFile's temporary path; what stood
  // there is lost. Throws Error, as all calls do where the file cannot be written.
  explicit RtabmapWriter(const std::filesystem::path& path,
                         const RtabmapWriterOptions& options = {});
  ~RtabmapWriter();
  RtabmapWriter(const RtabmapWriter&) = delete;
  RtabmapWriter& operator=(const RtabmapWriter&) = delete;

  // One node with its images, in any order of ids; poses are kept as float32.
  void add_node(const GraphNode& node, const RgbdFrame& frame);
  // Stored in both directions, the inverse with the same information matrix, as RTAB-Map does;
  // priors, gravity and landmarks in one. The nodes may come later.
  void add_link(const PoseLink& link);
  // Writes what is left and closes the file: no journal is left beside it. A writer that goes away
  // without it leaves a file that is no whole scan.
  void finish();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// `source` copied to `target`, whatever stood there, with other optimized poses (Admin.opt_ids,
// opt_poses) of its nodes; everything else stays as it is, row for row. Where the last localisation
// stood at an optimized pose it moves with its node, else it is dropped; landmarks among the
// optimized poses move with the first node that sees them. A grid, cloud or mesh that RTAB-Map
// stored with the earlier poses goes: it makes them anew. `links` between its nodes are added, in
// both directions, where the two have no link yet. With a calibration the camera and the depth
// images of all nodes become what apply_calibration makes of them, depth in the format that it has.
// `source` may be open elsewhere. Throws Error: no database of RTAB-Map 0.13 or later, or a node
// whose camera is another.
void copy_with_optimized_poses(const std::filesystem::path& source,
                               const std::filesystem::path& target,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<PoseLink>& links = {},
                               const std::optional<CameraFile>& calibration = std::nullopt);

}  // namespace libmap
