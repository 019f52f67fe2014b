// Detects depth that is not registered to color, by comparing edges of depth and color images.
#pragma once

#include <cstddef>
#include <string>

#include "libmap/core/pose.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Agreement of depth edges (borders of a nearer surface in depth images) with color images. "The
// alternative" is the pose and focal length of the depth camera with the best agreement.
struct EdgeAgreement {
  std::size_t frames = 0;  // number of compared frames
  std::size_t edges = 0;   // number of pixels on depth edges
  // Mean contrast of the color images at depth edges, 0 to 1; 0 if too few frames were compared.
  double stored = 0.0;   // with the stored calibration
  double aligned = 0.0;  // with the alternative
  // Increase of the contrast from `stored` to `aligned` in standard errors, in frames that were not
  // used to estimate the alternative.
  double significance = 0.0;
  double displacement_px = 0.0;  // RMS displacement of edges by the alternative, depth pixels
  double uncertainty_px = 0.0;   // RMS edge distance between alternatives from even and odd frames
  double min_displacement_px = 0.0;          // a smaller displacement_px means agreement
  Pose color_from_depth = Pose::Identity();  // pose of the alternative; z is 0
  double focal_factor = 1.0;  // focal length of the alternative, relative to the stored one

  // True if significance > 3, and displacement_px > min_displacement_px and > 4 * uncertainty_px.
  bool is_displaced() const;
  // True if is_displaced() and focal_factor differs from 1 by more than 0.03.
  bool is_scaled() const;
  // Returns a sentence on the displacement, for messages; empty if not is_displaced().
  std::string sentence() const;
};

// Compares up to 24 frames, evenly distributed over the scan. Only frames with one camera, color
// and depth are used; unreadable frames are skipped. With fewer than 6 usable frames or 2000 edge
// pixels, the result has no displacement.
EdgeAgreement check_edge_agreement(const ScanSource& scan);

}  // namespace libmap
