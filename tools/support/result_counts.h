// Counts among the results of a manifest.
#pragma once

#include <cstdint>
#include <string>

#include "libmap/core/manifest.h"

namespace graspmap_tools {

// const ResultCounts count(manifest); count("frames", frames.size());
class ResultCounts {
 public:
  explicit ResultCounts(libmap::Manifest& manifest) : manifest_(manifest) {}
  void operator()(const std::string& name, std::size_t value) const {
    manifest_.results.emplace_back(name, static_cast<std::int64_t>(value));
  }

 private:
  libmap::Manifest& manifest_;
};

}  // namespace graspmap_tools
