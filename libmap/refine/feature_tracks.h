// Points that several frames have seen, from the matches of pairs of frames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/refine/loop_closure.h"

namespace libmap {

struct Observation {
  std::uint32_t frame = 0;
  std::uint32_t feature = 0;
  bool operator==(const Observation&) const = default;
};

struct FeatureTrack {
  std::vector<Observation> observations;  // by ascending frame, each frame once
};

struct FeatureTracks {
  std::vector<FeatureTrack> tracks;  // of two observations or more
  std::size_t conflicts = 0;         // matches left out: they would show a point twice in a frame
  std::size_t split = 0;             // ... or join frames without a link
};

// linked: those of a track are linked with each other, each with each; a point that many frames see
// becomes several tracks. The system of such tracks is as sparse as the graph of the links, however
// often a place is visited.
enum class TrackFrames { any, linked };

// Joins matches into tracks (union-find), those first that fit best; a match that would join two
// features of one frame is left out.
FeatureTracks build_tracks(const std::vector<FrameFeatures>& frames,
                           const std::vector<FeatureLink>& links,
                           TrackFrames together = TrackFrames::any);

}  // namespace libmap
