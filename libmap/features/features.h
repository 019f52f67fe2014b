// What the poses of a scan are estimated from: the features of each frame's pictures with the depth
// behind them, and its depth downsampled to a grid of planes. Frames are read one by one; a few
// hundred kilobytes of each are kept.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/parameters.h"
#include "libmap/core/progress.h"
#include "libmap/features/depth_surface.h"
#include "libmap/fusion/depth_planes.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// SIFT (Lowe 2004) with square-rooted descriptors (Arandjelovic and Zisserman 2012), or ORB (Rublee
// et al. 2011).
enum class FeatureType { sift, orb };

// Of one feature's descriptor.
std::size_t descriptor_bytes(FeatureType type);

struct FeatureOptions {
  FeatureType type = FeatureType::sift;
  int max_features = 800;         // >= 1: of a camera, the strongest
  double min_contrast = 0.02;     // > 0: SIFT's, of a picture with values from 0 to 1
  double pixel_noise_px = 0.15;   // > 0: of a feature's place in the picture, at the finest scale
  double scale_noise = 0.06;      // >= 0: ... and what each pixel of its size adds (squared), px/px
  double surface_noise_m = 5e-4;  // >= 0: of a fitted plane's depth, whatever the number of pixels
  int surface_step_px = 3;        // 1 to 32: of the grid of planes, at least
  DepthPlaneOptions planes{};     // of the depth images
  // Not bound, for long scans: of all frames' surfaces; and frames whose descriptors are in memory,
  // those of more are on disk beside the cache.
  std::size_t max_surface_bytes = std::size_t{256} << 20U;
  std::size_t max_frames_in_memory = 300;
};
void bind(ParameterTable& table, FeatureOptions& options);

// The step of the grid with which the surfaces of so many frames with these cameras' pictures take
// at most max_surface_bytes: 32 if none does.
int surface_step(std::size_t frames, const std::vector<Camera>& cameras,
                 const FeatureOptions& options);

struct Feature {
  Eigen::Vector2f ray = Eigen::Vector2f::Zero();  // x/z and y/z in its camera
  float depth_m = 0.0F;                           // of the plane through its pixel, > 0
  float depth_noise_m = 0.0F;                     // standard deviations
  float pixel_noise_px = 0.0F;
  std::uint16_t camera = 0;
};

struct FrameFeatures {
  int node = 0;
  double stamp_s = 0.0;         // of the pictures
  double depth_later_s = 0.0;   // RgbdFrame::depth_later_s
  std::vector<Camera> cameras;  // of the color images
  std::vector<Feature> features;
  FeatureType type = FeatureType::sift;
  std::vector<std::uint8_t> descriptors;  // 128 (SIFT) or 32 (ORB) bytes a feature; may be dropped
                                          // when all that look alike has been found
  std::shared_ptr<const TempFile> descriptor_file;  // where they are instead, if any
  std::uint64_t descriptors_begin = 0;              // in it
  std::vector<DepthSurface> surfaces;               // one a camera
  std::size_t without_depth = 0;                    // features that were dropped for it

  // Where feature n lies by its depth, in its camera's optical frame; in the frame of the base.
  Eigen::Vector3d point_in_camera(std::size_t n) const;
  Eigen::Vector3d point_in_base(std::size_t n) const;
};

struct FeatureResult {
  std::vector<FrameFeatures> frames;           // by ascending node
  std::vector<std::pair<int, Error>> skipped;  // node and what it lacks
  std::size_t from_cache = 0;                  // frames
};

class FeatureCache;

// The frames of `nodes`. The same for any number of threads, with a cache and without. Frames that
// cannot be read, or have no depth, are listed and left out; a frame without color has surfaces
// only. Throws Error for options out of their ranges.
FeatureResult find_features(const ScanSource& scan, const std::vector<int>& nodes,
                            const FeatureOptions& options = {}, Progress& progress = no_progress(),
                            const FeatureCache* cache = nullptr);

// The features of one picture with its depth, without surfaces.
void add_features(const CameraView& view, const DepthPlanes& planes, const FeatureOptions& options,
                  FrameFeatures& frame);

// One unit vector a column; their products order as the descriptors' likeness does.
Eigen::MatrixXf descriptor_vectors(const FrameFeatures& frame);

}  // namespace libmap
