// Stream of a cloud's points in blocks, for clouds that do not fit into memory.
#pragma once

#include <cstddef>
#include <functional>

#include "libmap/core/point_cloud.h"

namespace libmap {

class PointStream {
 public:
  virtual ~PointStream() = default;
  // Block size of streams from files; the last block can be smaller. Fixed blocks make sums
  // independent of how the points are distributed over files.
  static constexpr std::size_t block_points = 65536;
  // Attributes that `visit` uses. The stream can omit all other attributes.
  enum class Need { positions, positions_and_normals };
  using Visit = std::function<void(const PointCloud& block)>;
  // Visits all points in order; can be called repeatedly. Either all blocks or no block have
  // normals, and all blocks have the same viewpoint.
  virtual void for_each_block(Need need, const Visit& visit) const = 0;
};

// Stream of a cloud in memory as a single block of any size.
class CloudAsStream : public PointStream {
 public:
  explicit CloudAsStream(const PointCloud& cloud) : cloud_(cloud) {}
  void for_each_block(Need, const Visit& visit) const override { visit(cloud_); }

 private:
  const PointCloud& cloud_;  // outlives the stream
};

}  // namespace libmap
