// Points of a large terrain sorted into squares of the x-y plane on disk, so that those near a
// place can be had without the others.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "libmap/core/file_output.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

struct PointSpoolOptions {
  double square_m = 1.0;                              // edge of a square
  bool has_normals = false;                           // of the points to come
  std::size_t buffer_bytes = std::size_t{64} << 20U;  // of all squares together
};

class PointSpool {
 public:
  // Takes 32 bytes of disk a point, 44 with normals, in a file without a name in `folder`: nothing
  // is left of it, however the process ends. Throws Error (failed).
  PointSpool(const std::filesystem::path& folder, const PointSpoolOptions& options);

  // Positions must be finite and less than 2^40 squares away from the origin.
  void add(const PointCloud& cloud);
  // Ends the adding.
  void finish() { flush(); }

  // The points with low <= (x, y) <= high, in the order in which they were added; a few whole
  // squares are read.
  PointCloud points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const;
  // How many there are at most: those of the squares that points_in would read.
  std::size_t count_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const;
  std::size_t size() const { return size_; }

 private:
  using Square = std::pair<std::int64_t, std::int64_t>;
  struct Extent {
    std::uint64_t begin = 0;
    std::size_t bytes = 0;
  };
  struct Records {
    std::vector<char> buffer;  // not yet written
    std::vector<Extent> written;
    std::size_t count = 0;
  };
  Square square_of(double x, double y) const;
  void flush();
  void read_square(const Records& records, std::vector<char>& bytes) const;
  template <typename Visit>
  void for_squares_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high,
                      const Visit& visit) const;

  TempFile file_;
  PointSpoolOptions options_;
  std::size_t record_bytes_ = 0;
  std::size_t buffered_ = 0;
  std::size_t size_ = 0;
  std::map<Square, Records> squares_;
};

}  // namespace libmap
