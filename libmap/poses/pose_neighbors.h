// Which poses lie nearest to each other.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace libmap {

class PoseNeighbors {
 public:
  // Of these places, known by their index.
  explicit PoseNeighbors(std::vector<Eigen::Vector3d> places);
  ~PoseNeighbors();
  PoseNeighbors(const PoseNeighbors&) = delete;
  PoseNeighbors& operator=(const PoseNeighbors&) = delete;

  // Number and distance of the `count` nearest to the n-th within the radius, itself left out.
  std::vector<std::pair<std::size_t, double>> nearest(std::size_t n, std::size_t count,
                                                      double radius_m) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace libmap
