// Disjoint-set forest (Galler and Fischer 1964), for connected components.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace libmap {

// Disjoint sets of the numbers 0..count-1, initially one per number. find(n) returns the smallest
// number of the set that contains n; join(a, b) merges the sets that contain a and b.
template <typename Index>
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }
  Index find(Index n) {
    while (parent_[n] != n) n = parent_[n] = parent_[parent_[n]];
    return n;
  }
  void join(Index a, Index b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace libmap
