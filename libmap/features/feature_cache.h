// Features kept between runs: a file each frame in one folder, named by what they were made of.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/file_output.h"
#include "libmap/features/features.h"

namespace libmap {

// SHA-256 of the frame's pictures, depth, cameras, the options and the version of the format: equal
// keys mean equal features, whatever file the frame comes from.
std::string feature_key(const RgbdFrame& frame, const FeatureOptions& options);

// May be used from several threads, and by several processes at once. Files are CBOR (RFC 8949)
// behind a line with the SHA-256 of the rest; they appear whole.
class FeatureCache {
 public:
  FeatureCache() = default;  // keeps nothing
  // The folder is made when the first frame is kept; its parent must be there by then.
  explicit FeatureCache(std::filesystem::path folder) : folder_(std::move(folder)) {}

  bool enabled() const { return !folder_.empty(); }
  // The features, descriptors and surfaces of the frame into `frame`, whose cameras are there;
  // `depth_cameras` are those of the surfaces. False, and the frame untouched, if there is no file
  // of the key, or it is damaged, or another program's.
  bool read(const std::string& key, const std::vector<Camera>& depth_cameras,
            FrameFeatures& frame) const;
  // In its folder; nullptr where there is none, or none can be made.
  std::shared_ptr<TempFile> unnamed_file() const;
  // A file that cannot be written is no error: the next run goes without it. False then.
  bool write(const std::string& key, const FrameFeatures& frame) const;

 private:
  std::filesystem::path folder_;

  std::filesystem::path path_of(const std::string& key) const;
};

}  // namespace libmap
