// Which frames of a scan look alike: a bag of visual words (Sivic and Zisserman 2003) whose
// vocabulary is learnt from the scan itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/features/features.h"

namespace libmap {

struct PlaceRecognitionOptions {
  int words = 256;              // >= 1: of the vocabulary
  int training_samples = 8000;  // >= 1: descriptors from which it is learnt
  int training_rounds = 4;      // >= 1: of k-means (Lloyd 1982)
};

struct SimilarFrame {
  std::size_t frame = 0;    // in the order of the frames
  double similarity = 0.0;  // cosine of the tf-idf weighted words, 0 to 1
};

// For each frame the `count` others that look most like it, the best first; then as many of other
// parts, where `parts` names each frame's. Those with no word in common are left out. The same for
// any number of threads; `seed` picks the samples.
std::vector<std::vector<SimilarFrame>> find_similar_frames(
    const std::vector<FrameFeatures>& frames, std::size_t count,
    const PlaceRecognitionOptions& options, std::uint64_t seed,
    const std::vector<std::size_t>& parts = {});

}  // namespace libmap
