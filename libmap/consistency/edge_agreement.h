// Detects depth that is not registered to color, by comparing edges of depth and color images.
#pragma once

#include <cstddef>
#include <string>

#include "libmap/core/pose.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Agreement of the edges of depth images with the edges of color images.
struct EdgeAgreement {
  std::size_t frames = 0;  // number of compared frames
  std::size_t edges = 0;   // number of edge pixels
  // Mean contrast of the color images at the edges of depth, 0 to 1: with the stored calibration,
  // and with the best other pose and focal length of the depth camera ("the alternative").
  double stored = 0.0;
  double aligned = 0.0;
  // Increase of the contrast by the alternative, in standard errors, in frames that were not used
  // to estimate the alternative.
  double significance = 0.0;
  double displacement_px = 0.0;      // RMS displacement of edges by the alternative, depth pixels
  double uncertainty_px = 0.0;       // RMS difference of the alternatives of two halves
  double min_displacement_px = 0.0;  // the images agree if the displacement is smaller
  Pose color_from_depth = Pose::Identity();  // the alternative, without a shift along the axis
  double focal_factor = 1.0;                 // focal length of depth, relative to the stored one

  // Returns true if depth is clearly not registered to color.
  bool is_displaced() const;
  // Returns true if the depth camera clearly has another focal length than stored.
  bool is_scaled() const;
  // Returns a sentence on the displacement, for messages; empty if the images agree.
  std::string sentence() const;
};

// Compares up to 24 frames of a scan with one camera and color. Frames that cannot be read are
// skipped. With fewer than 6 usable frames or 2000 edge pixels, the result reports no displacement.
EdgeAgreement check_edge_agreement(const ScanSource& scan);

}  // namespace libmap
