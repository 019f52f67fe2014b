// Writes scans as RTAB-Map databases of schema 0.23 that RTAB-Map's own tools open.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/rgbd_frame.h"

namespace libmap {

enum class DepthEncoding { rvl, png16, float_png };
enum class ColorEncoding { jpeg, png };

struct RtabmapWriterOptions {
  DepthEncoding depth = DepthEncoding::rvl;  // rvl and png16: whole millimetres up to 65.534 m
  ColorEncoding color = ColorEncoding::jpeg;
  int jpeg_quality = 95;                            // RTAB-Map's default
  std::map<std::string, std::string> parameters{};  // into Info.parameters
};

class RtabmapWriter {
 public:
  // Makes a new file at `path`, which callers give as an OutputFile's temporary path. Throws Error.
  explicit RtabmapWriter(const std::filesystem::path& path,
                         const RtabmapWriterOptions& options = {});
  ~RtabmapWriter();
  RtabmapWriter(const RtabmapWriter&) = delete;
  RtabmapWriter& operator=(const RtabmapWriter&) = delete;

  // One node with its images, in any order of ids. Throws Error if the id is taken.
  void add_node(const GraphNode& node, const RgbdFrame& frame);
  // Stored in both directions, the inverse with the same information matrix, as RTAB-Map does;
  // priors, gravity and landmarks in one.
  void add_link(const PoseLink& link);
  void set_optimized_poses(const std::map<int, Pose>& map_from_base);
  // Writes what is left and closes the file: no journal is left beside it. A writer that goes away
  // without it leaves a file that is no whole scan.
  void finish();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// `source` copied to `target` with other optimised poses; everything else stays as it is.
void copy_with_optimized_poses(const std::filesystem::path& source,
                               const std::filesystem::path& target,
                               const std::map<int, Pose>& map_from_base);

}  // namespace libmap
