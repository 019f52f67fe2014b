// Caches image features on disk for later runs: one file per frame, named by a hash of the inputs.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/file_output.h"
#include "libmap/features/features.h"

namespace libmap {

// Returns the SHA-256 of the frame's images and cameras, the options and the format version. Equal
// keys mean equal features, even if the frames are in different scan files.
std::string feature_key(const RgbdFrame& frame, const FeatureOptions& options);

// Safe for use by several threads and processes at once. A file is written atomically. It contains
// one line with the SHA-256 of the bytes after this line, which are CBOR (RFC 8949).
class FeatureCache {
 public:
  FeatureCache() = default;  // disabled: read() and write() return false
  // The folder is created when the first frame is stored; the parent folder must exist.
  explicit FeatureCache(std::filesystem::path folder) : folder_(std::move(folder)) {}

  bool enabled() const { return !folder_.empty(); }
  // Reads features, descriptors and surfaces into `frame` (frame.type: set before);
  // `depth_cameras` has one camera per surface. Returns false and leaves `frame` unchanged if there
  // is no valid file for `key`.
  bool read(const std::string& key, const std::vector<Camera>& depth_cameras,
            FrameFeatures& frame) const;
  // Creates a file for FrameFeatures::descriptor_file; nullptr if disabled or this fails.
  std::shared_ptr<TempFile> temp_file() const;
  // Stores the frame. Returns false, without an error, if disabled or the file cannot be written.
  bool write(const std::string& key, const FrameFeatures& frame) const;

 private:
  std::filesystem::path folder_;

  std::filesystem::path path_of(const std::string& key) const;
};

}  // namespace libmap
