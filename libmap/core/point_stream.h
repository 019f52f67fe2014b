// Points that come in blocks, so that what needs each of them only in passing can be had of clouds
// that do not fit into memory.
#pragma once

#include <cstddef>
#include <functional>

#include "libmap/core/point_cloud.h"

namespace libmap {

class PointStream {
 public:
  virtual ~PointStream() = default;
  // Every block but the last holds block_points points, so that sums over chunks of a block are
  // the same whatever files the points come from.
  static constexpr std::size_t block_points = 65536;
  // What the visitor needs: normals may be left out if it does without.
  enum class Need { positions, positions_and_normals };
  using Visit = std::function<void(const PointCloud& block)>;
  // Visits all points from the first on, in their order; may be called any number of times. All
  // blocks have normals or none has, and all have the same viewpoint.
  virtual void for_each_block(Need need, const Visit& visit) const = 0;
};

// A cloud in memory as a single block of any size.
class CloudAsStream : public PointStream {
 public:
  explicit CloudAsStream(const PointCloud& cloud) : cloud_(cloud) {}
  void for_each_block(Need, const Visit& visit) const override { visit(cloud_); }

 private:
  const PointCloud& cloud_;  // outlives the stream
};

}  // namespace libmap
