// Finds similar frames of a scan by a bag of visual words (Sivic and Zisserman 2003). The
// vocabulary is learned from the scan itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/features/features.h"

namespace libmap {

struct PlaceRecognitionOptions {
  int words = 256;              // >= 1: size of the vocabulary
  int training_samples = 8000;  // >= 1: descriptors that the vocabulary is learned from
  int training_rounds = 4;      // >= 1: iterations of k-means (Lloyd 1982)
};

struct SimilarFrame {
  std::size_t frame = 0;    // index of the frame
  double similarity = 0.0;  // cosine of the tf-idf weighted words, 0 to 1
};

// Returns for each frame the `count` most similar other frames, best first. `parts` may contain for
// each frame the number of its part of the scan (a connected component of the pose graph); then the
// `count` most similar frames of other parts follow (maybe repeated). Frames without a common word
// are never returned. `seed` selects training samples. Throws Error if it cannot read descriptors.
std::vector<std::vector<SimilarFrame>> find_similar_frames(
    const std::vector<FrameFeatures>& frames, std::size_t count,
    const PlaceRecognitionOptions& options, std::uint64_t seed,
    const std::vector<std::size_t>& parts = {});

}  // namespace libmap
