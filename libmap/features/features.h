// Extracts the inputs of pose estimation from a scan: image features with depth, and depth images
// downsampled to a grid of planes. Each frame needs a few hundred kilobytes of memory.
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

// Returns the size of one descriptor in bytes.
std::size_t descriptor_bytes(FeatureType type);

struct FeatureOptions {
  FeatureType type = FeatureType::sift;
  int max_features = 800;         // >= 1: maximum per image; the strongest are kept
  double min_contrast = 0.02;     // > 0: minimum contrast for SIFT, image values from 0 to 1
  double pixel_noise_px = 0.15;   // > 0: standard deviation of image position at the finest scale
  double scale_noise = 0.06;      // >= 0: pixel noise per px of feature size, added in quadrature
  double surface_noise_m = 5e-4;  // >= 0: standard deviation of depth, not reduced by averaging
  int surface_step_px = 3;        // 1 to 32: minimum step of the grid of planes
  DepthPlaneOptions planes{};     // fit of planes to the depth images, with depth range and noise
  // The following fields have no command option.
  bool surfaces_only = false;  // true: color is not read, and frames have no features
  // Maximum memory of the surfaces of all frames, bytes; surface_step_px is increased if necessary.
  std::size_t max_surface_bytes = std::size_t{256} << 20U;
  std::size_t max_frames_in_memory = 300;  // with more, descriptors are stored on disk
};
void bind(ParameterTable& table, FeatureOptions& options);

// Returns the smallest grid step (px), at least surface_step_px, for which the surfaces of `frames`
// frames with these cameras need at most max_surface_bytes; 32 if no step suffices.
int surface_step(std::size_t frames, const std::vector<Camera>& cameras,
                 const FeatureOptions& options);

struct Feature {
  Eigen::Vector2f ray = Eigen::Vector2f::Zero();  // x/z and y/z in the camera's optical frame
  float depth_m = 0.0F;                           // depth of the plane at the pixel, > 0
  float depth_noise_m = 0.0F;                     // standard deviation of depth_m
  float pixel_noise_px = 0.0F;                    // standard deviation of the image position
  std::uint16_t camera = 0;                       // index in FrameFeatures::cameras
};

struct FrameFeatures {
  int node = 0;
  double stamp_s = 0.0;               // time of the color images
  double depth_stamp_offset_s = 0.0;  // time of the depth images minus stamp_s
  std::vector<Camera> cameras;        // cameras of the color images
  std::vector<Feature> features;
  FeatureType type = FeatureType::sift;
  // 128 (SIFT) or 32 (ORB) bytes per feature; empty if dropped or stored in descriptor_file.
  std::vector<std::uint8_t> descriptors;
  std::shared_ptr<const TempFile> descriptor_file;  // if set, contains the descriptors
  std::uint64_t descriptors_begin = 0;              // byte offset in descriptor_file
  std::vector<DepthSurface> surfaces;               // one per camera
  std::size_t without_depth = 0;  // number of features without depth, which are dropped

  // Position of feature n from ray and depth, in the camera's optical frame or the base frame.
  Eigen::Vector3d point_in_camera(std::size_t n) const;
  Eigen::Vector3d point_in_base(std::size_t n) const;
};

struct FeatureResult {
  std::vector<FrameFeatures> frames;           // in the order of the nodes
  std::vector<std::pair<int, Error>> skipped;  // node and reason
  std::size_t from_cache = 0;                  // number of frames read from the cache
};

class FeatureCache;

// Finds the features of `nodes`. The result does not depend on the number of threads or the cache.
// Frames that cannot be read or have no depth are in `skipped`. A frame without color has surfaces
// only. Throws Error if an option is out of range.
FeatureResult find_features(const ScanSource& scan, const std::vector<int>& nodes,
                            const FeatureOptions& options = {}, Progress& progress = no_progress(),
                            const FeatureCache* cache = nullptr);

// Appends the features of one image to `frame`. The image is from the last of frame.cameras.
void add_features(const CameraView& view, const DepthPlanes& planes, const FeatureOptions& options,
                  FrameFeatures& frame);

// Returns the descriptors as unit vectors, one column per feature, for cosine similarity. Throws
// Error if the descriptor file cannot be read.
Eigen::MatrixXf descriptor_vectors(const FrameFeatures& frame);

}  // namespace libmap
