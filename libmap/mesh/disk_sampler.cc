#include "libmap/mesh/disk_sampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/single_precision.h"
#include "libmap/core/text.h"
#include "libmap/geometry/spatial_index.h"

namespace libmap {

namespace {

constexpr std::size_t fragments_per_block = 128;

const Fragment whole{0, {Eigen::Vector2d(0.0, 0.0), {1.0, 0.0}, {0.0, 1.0}}};

PlacedFragment placed_triangle(const TriangleMesh& mesh, std::size_t number) {
  const Triangle& corners = mesh.triangles[number];
  PlacedFragment placed_fragment{
      whole, {mesh.vertices[corners[0]], mesh.vertices[corners[1]], mesh.vertices[corners[2]]}};
  placed_fragment.fragment.triangle = static_cast<std::uint32_t>(number);
  return placed_fragment;
}

}  // namespace

double PlacedFragment::area_m2() const {
  return 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm();
}

double PlacedFragment::square_of_longest_side() const {
  return std::max({(corners[1] - corners[0]).squaredNorm(), (corners[2] - corners[1]).squaredNorm(),
                   (corners[0] - corners[2]).squaredNorm()});
}

std::array<PlacedFragment, 2> PlacedFragment::halves() const {
  std::size_t longest = 0;
  double square = -1.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double side = (corners[(k + 1) % 3] - corners[k]).squaredNorm();
    if (side > square) {
      square = side;
      longest = k;
    }
  }
  const std::size_t next = (longest + 1) % 3;
  std::array<PlacedFragment, 2> parts = {*this, *this};
  parts[0].corners[next] = parts[1].corners[longest] = 0.5 * (corners[longest] + corners[next]);
  parts[0].fragment.corners[next] = parts[1].fragment.corners[longest] =
      0.5 * (fragment.corners[longest] + fragment.corners[next]);
  return parts;
}

PlacedFragment placed(const TriangleMesh& mesh, const Fragment& fragment) {
  PlacedFragment result{fragment, {}};
  for (std::size_t k = 0; k < 3; ++k)
    result.corners[k] =
        position_on(mesh, {fragment.triangle, fragment.corners[k].x(), fragment.corners[k].y()});
  return result;
}

TrianglePoint point_of(const Fragment& fragment, double first, double second) {
  // Osada et al. 2002, equation 1.
  const double root = std::sqrt(first);
  const Eigen::Vector2d at = (1.0 - root) * fragment.corners[0] +
                             root * (1.0 - second) * fragment.corners[1] +
                             root * second * fragment.corners[2];
  return {fragment.triangle, at.x(), at.y()};
}

SurfaceFragments::SurfaceFragments(const TriangleMesh& mesh) : mesh_(mesh) {
  add_blocks(0, mesh.triangles.size());
}

SurfaceFragments::SurfaceFragments(const SurfaceFragments& triangles, double longest_m,
                                   std::size_t max_parts)
    : mesh_(triangles.mesh_) {
  for (const SurfaceBlock& block : triangles.blocks_) {
    if (block.longest_m <= longest_m) {
      blocks_.push_back(block);
      continue;
    }
    for (std::size_t n = block.begin; n < block.end; ++n)
      cut(triangles.fragment_at(n), longest_m, max_parts);
  }
  add_blocks(mesh_.triangles.size(), mesh_.triangles.size() + parts_.size());
}

void SurfaceFragments::cut(const PlacedFragment& fragment, double longest_m,
                           std::size_t max_parts) {
  if (!(fragment.area_m2() > 0.0)) return;
  // Minimum number of parts along the longest side.
  const double parts = std::sqrt(fragment.square_of_longest_side()) / longest_m;
  if (static_cast<double>(parts_.size()) + parts > static_cast<double>(max_parts))
    throw Error("too small for this mesh; it is 4 sample radii, so use a larger radius",
                {.field = "fragment size", .value = to_text(longest_m) + " m"});
  if (parts > 1.0) {
    for (const PlacedFragment& half : fragment.halves()) cut(half, longest_m, max_parts);
    return;
  }
  parts_.push_back(fragment.fragment);
}

double SurfaceFragments::area_m2() const {
  double area = 0.0;
  for (const SurfaceBlock& block : blocks_) area += block.area_m2;
  return area;
}

PlacedFragment SurfaceFragments::fragment_at(std::size_t number) const {
  if (number >= mesh_.triangles.size())
    return placed(mesh_, parts_[number - mesh_.triangles.size()]);
  return placed_triangle(mesh_, number);
}

void SurfaceFragments::add_blocks(std::size_t begin, std::size_t end) {
  const std::size_t first = blocks_.size();
  blocks_.resize(first + (end - begin + fragments_per_block - 1) / fragments_per_block);
  parallel_for(end - begin, fragments_per_block, [&](std::size_t from, std::size_t to) {
    blocks_[first + from / fragments_per_block] = measured(begin + from, begin + to);
  });
}

SurfaceBlock SurfaceFragments::measured(std::size_t begin, std::size_t end) const {
  SurfaceBlock block;
  block.begin = begin;
  block.end = end;
  Eigen::AlignedBox3d box;
  for (std::size_t n = begin; n < end; ++n) {
    const PlacedFragment fragment = fragment_at(n);
    block.area_m2 += fragment.area_m2();
    block.longest_m = std::max(block.longest_m, fragment.square_of_longest_side());
    for (const Eigen::Vector3d& corner : fragment.corners) box.extend(corner);
  }
  block.longest_m = std::sqrt(block.longest_m);
  block.center = box.center();
  for (std::size_t n = begin; n < end; ++n)
    for (const Eigen::Vector3d& corner : fragment_at(n).corners)
      block.reach_m = std::max(block.reach_m, (corner - block.center).squaredNorm());
  block.reach_m = std::sqrt(block.reach_m);
  return block;
}

namespace {

// Lengths in radii.
constexpr double fragment_size = 4.0;
constexpr double first_gap_size = 1.0 / 3.0;
constexpr double smallest_gap = 1e-3;

constexpr std::size_t gaps_per_chunk = 256;
constexpr double samples_per_part = 131072.0;
constexpr std::size_t max_fragments = 30'000'000;

// Darts per round over the whole surface, relative to the expected number of samples.
constexpr std::array<double, 5> dart_rounds = {0.5, 0.5, 1.0, 2.0, 4.0};

struct Candidate {
  double order;  // random priority; smallest first
  TrianglePoint triangle_point;
  Eigen::Vector3d position;
};

// Concatenates the elements that chunk(begin, end, found) appends for ranges of at most `at_once`.
template <typename T, typename Chunk>
std::vector<T> collect(std::size_t count, std::size_t at_once, const Chunk& chunk) {
  std::vector<std::vector<T>> parts((count + at_once - 1) / at_once);
  parallel_for(count, at_once, [&](std::size_t begin, std::size_t end) {
    chunk(begin, end, parts[begin / at_once]);
  });
  std::size_t total = 0;
  for (const std::vector<T>& part : parts) total += part.size();
  std::vector<T> all;
  all.reserve(total);
  for (std::vector<T>& part : parts) {
    all.insert(all.end(), part.begin(), part.end());
    std::vector<T>().swap(part);
  }
  return all;
}

// Finds the parts of a fragment that are not covered by a single disc.
class GapSearch {
 public:
  GapSearch(const GrowingGrid& samples, double radius_m)
      : samples_(samples), radius_m_(radius_m), square_m2_(radius_m * radius_m) {}

  // True if a single disc covers the block.
  bool is_covered(const SurfaceBlock& block) const {
    const double room = radius_m_ - block.reach_m;
    return room > 0.0 && samples_.any_nearer(block.center, room, room * room);
  }

  // Appends the uncovered parts, divided until their sides are at most `longest_m`.
  void find(const PlacedFragment& fragment, double longest_m, std::vector<Fragment>& gaps) {
    if (covers(last_, fragment) || !(fragment.area_m2() > 0.0)) return;
    if (fragment.square_of_longest_side() > 4.0 * square_m2_) {
      for (const PlacedFragment& half : fragment.halves()) find(half, longest_m, gaps);
      return;
    }
    near_.clear();
    const Reach reach = reach_of(fragment);
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(radius_m_);
    const Eigen::Vector3d low =
        fragment.corners[0].cwiseMin(fragment.corners[1]).cwiseMin(fragment.corners[2]) - margin;
    const Eigen::Vector3d high =
        fragment.corners[0].cwiseMax(fragment.corners[1]).cwiseMax(fragment.corners[2]) + margin;
    const bool covered =
        samples_.any_in_box(low, high, [&](const Eigen::Vector3d& sample, std::uint32_t) {
          return is_covered(sample, fragment, reach);
        });
    if (!covered) cut(fragment, 0, longest_m * longest_m, gaps);
  }

 private:
  // Discs with centers farther from `center` do not intersect the fragment.
  struct Reach {
    Eigen::Vector3d center;
    double square_m2;
  };
  Reach reach_of(const PlacedFragment& fragment) const {
    const Eigen::Vector3d center =
        (fragment.corners[0] + fragment.corners[1] + fragment.corners[2]) / 3.0;
    double square = 0.0;
    for (const Eigen::Vector3d& corner : fragment.corners)
      square = std::max(square, (corner - center).squaredNorm());
    const double reach = radius_m_ + std::sqrt(square);
    return {center, reach * reach};
  }

  bool covers(const Eigen::Vector3d& sample, const PlacedFragment& fragment) const {
    return (sample - fragment.corners[0]).squaredNorm() <= square_m2_ &&
           (sample - fragment.corners[1]).squaredNorm() <= square_m2_ &&
           (sample - fragment.corners[2]).squaredNorm() <= square_m2_;
  }

  // True if the sample's disc covers the fragment. If it only intersects it, it is added to near_.
  bool is_covered(const Eigen::Vector3d& sample, const PlacedFragment& fragment,
                  const Reach& reach) {
    if (!((sample - reach.center).squaredNorm() <= reach.square_m2)) return false;
    if (covers(sample, fragment)) {
      last_ = sample;
      return true;
    }
    near_.push_back(sample);
    return false;
  }

  // Divides a fragment that no near sample from `begin` on covers.
  void cut(const PlacedFragment& fragment, std::size_t begin, double longest_m2,
           std::vector<Fragment>& gaps) {
    const std::size_t end = near_.size();
    if (begin == end || !(fragment.square_of_longest_side() > longest_m2)) {
      gaps.push_back(fragment.fragment);
      return;
    }
    for (const PlacedFragment& half : fragment.halves()) {
      const Reach reach = reach_of(half);
      bool covered = false;
      for (std::size_t n = begin; n < end && !covered; ++n)
        covered = is_covered(Eigen::Vector3d(near_[n]), half, reach);
      if (!covered) cut(half, end, longest_m2, gaps);
      near_.resize(end);
    }
  }

  const GrowingGrid& samples_;
  double radius_m_;
  double square_m2_;
  Eigen::Vector3d last_ = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<Eigen::Vector3d> near_;
};

class Sampler {
 public:
  Sampler(const SampledSurface& surface, double radius_m, std::uint64_t seed)
      : surface_(surface),
        radius_m_(radius_m),
        // Slack for rounding, so that no reader computes a distance below the radius.
        min_square_m2_(radius_m * radius_m * (1.0 + 1e-14)),
        seed_(seed),
        expected_(saturation_density * surface.area_m2 / (radius_m * radius_m)),
        samples_(surface.low, 2.0 * radius_m,
                 static_cast<std::size_t>(1.1 * expected_) + surface.neighbor_samples.size() + 16),
        fragments_(surface.triangles, fragment_size * radius_m, max_fragments) {
    for (const Eigen::Vector3d& other : surface.neighbor_samples) samples_.add(other);
  }

  DiskSamples run(const std::function<bool(std::size_t)>& goes_on, Progress& progress) {
    progress.begin("darts", dart_rounds.size());
    for (std::uint64_t round = 0; round < dart_rounds.size(); ++round) {
      accept(darts(round, dart_rounds[round] * std::max(expected_, 1.0) / surface_.area_m2));
      progress.advance(1);
    }
    if (goes_on(triangle_points_.size())) fill_gaps(progress);
    progress.end();
    DiskSamples result;
    result.positions.reserve(triangle_points_.size());
    for (std::size_t n = surface_.neighbor_samples.size(); n < samples_.size(); ++n)
      result.positions.push_back(samples_[n]);
    result.triangle_points = std::move(triangle_points_);
    return result;
  }

 private:
  // Processes the surface in parts, to limit the memory for gaps.
  void fill_gaps(Progress& progress) {
    const std::vector<SurfaceBlock>& blocks = fragments_.blocks();
    const double max_m2 = samples_per_part * radius_m_ * radius_m_ / saturation_density;
    progress.begin("gaps", blocks.size());
    std::uint64_t round = dart_rounds.size();
    for (std::size_t begin = 0; begin < blocks.size();) {
      double area = 0.0;
      std::size_t end = begin;
      while (end < blocks.size() && area < max_m2) area += blocks[end++].area_m2;
      for (std::vector<Fragment> gaps = first_gaps(begin, end); !gaps.empty(); ++round) {
        accept(darts_into(gaps, round));
        gaps = remaining(gaps);
      }
      progress.advance(end - begin);
      begin = end;
    }
  }

  bool place(const Fragment& fragment, RandomStream& random, Candidate& candidate) const {
    const double first = random.uniform();
    candidate.triangle_point = point_of(fragment, first, random.uniform());
    candidate.position = position_on(surface_.mesh, candidate.triangle_point);
    if (surface_.rounding_m > 0.0) candidate.position = rounded_to_single(candidate.position);
    return !samples_.any_nearer(candidate.position, radius_m_, min_square_m2_);
  }

  // Throws darts evenly over the surface. Returns those that no sample rejects.
  std::vector<Candidate> darts(std::uint64_t round, double per_m2) const {
    const std::vector<SurfaceBlock>& blocks = fragments_.blocks();
    return collect<Candidate>(
        blocks.size(), 1, [&](std::size_t begin, std::size_t end, std::vector<Candidate>& found) {
          for (std::size_t n = begin; n < end; ++n) {
            RandomStream random(mix_bits(seed_, round), n);
            throw_darts(blocks[n], per_m2, random, found);
          }
        });
  }

  // Throws one dart into each of the block's strata of equal area.
  void throw_darts(const SurfaceBlock& block, double per_m2, RandomStream& random,
                   std::vector<Candidate>& found) const {
    const double count = std::floor(block.area_m2 * per_m2 + random.uniform());
    if (!(count >= 1.0)) return;
    const double fraction = block.area_m2 / count;
    double thrown = 0.0;
    double next = random.uniform() * fraction;  // area before the next dart
    double area = 0.0;
    Candidate candidate{};
    for (std::size_t n = block.begin; n < block.end && thrown < count; ++n) {
      const PlacedFragment placed_fragment = fragments_.fragment_at(n);
      area += placed_fragment.area_m2();
      while (next < area && thrown < count) {
        candidate.order = random.uniform();
        if (place(placed_fragment.fragment, random, candidate)) found.push_back(candidate);
        thrown += 1.0;
        next = (thrown + random.uniform()) * fraction;
      }
    }
  }

  // Throws one dart into each gap. Priorities are those of a race of uniformly distributed darts,
  // in which larger gaps are hit earlier.
  std::vector<Candidate> darts_into(const std::vector<Fragment>& gaps, std::uint64_t round) const {
    return collect<Candidate>(
        gaps.size(), gaps_per_chunk,
        [&](std::size_t begin, std::size_t end, std::vector<Candidate>& found) {
          Candidate candidate{};
          for (std::size_t n = begin; n < end; ++n) {
            RandomStream random(mix_bits(seed_, round), n);
            if (!place(gaps[n], random, candidate)) continue;
            candidate.order =
                -std::log(1.0 - random.uniform()) / placed(surface_.mesh, gaps[n]).area_m2();
            found.push_back(candidate);
          }
        });
  }

  // Accepts candidates by priority if no earlier sample rejects them.
  void accept(std::vector<Candidate> candidates) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.order < b.order; });
    for (const Candidate& candidate : candidates) {
      if (samples_.any_nearer(candidate.position, radius_m_, min_square_m2_)) continue;
      samples_.add(candidate.position);
      triangle_points_.push_back(candidate.triangle_point);
    }
  }

  std::vector<Fragment> first_gaps(std::size_t first, std::size_t last) const {
    return collect<Fragment>(
        last - first, 1, [&](std::size_t begin, std::size_t end, std::vector<Fragment>& found) {
          GapSearch search(samples_, radius_m_);
          for (std::size_t n = first + begin; n < first + end; ++n) {
            const SurfaceBlock& block = fragments_.blocks()[n];
            if (search.is_covered(block)) continue;
            for (std::size_t p = block.begin; p < block.end; ++p)
              search.find(fragments_.fragment_at(p), first_gap_size * radius_m_, found);
          }
        });
  }

  // Returns the uncovered parts of the gaps, divided further. The smallest gaps are dropped: their
  // dart was rejected, so they are within their own size of a disc.
  std::vector<Fragment> remaining(const std::vector<Fragment>& gaps) const {
    // Rounding may move a dart out of a smaller gap.
    const double smallest_m = std::max(smallest_gap * radius_m_, surface_.rounding_m);
    return collect<Fragment>(gaps.size(), gaps_per_chunk,
                             [&](std::size_t begin, std::size_t end, std::vector<Fragment>& found) {
                               GapSearch search(samples_, radius_m_);
                               for (std::size_t n = begin; n < end; ++n) {
                                 const PlacedFragment gap = placed(surface_.mesh, gaps[n]);
                                 const double longest_m = std::sqrt(gap.square_of_longest_side());
                                 if (longest_m > smallest_m)
                                   search.find(gap, 0.5 * longest_m, found);
                               }
                             });
  }

  const SampledSurface& surface_;
  double radius_m_;
  double min_square_m2_;
  std::uint64_t seed_;
  double expected_;
  GrowingGrid samples_;
  std::vector<TrianglePoint> triangle_points_;
  SurfaceFragments fragments_;
};

}  // namespace

DiskSamples sample_disks(const SampledSurface& surface, double radius_m, std::uint64_t seed,
                         const std::function<bool(std::size_t)>& goes_on, Progress& progress) {
  return Sampler(surface, radius_m, seed).run(goes_on, progress);
}

double smallest_distance(const std::vector<Eigen::Vector3d>& positions, double expected_m) {
  if (positions.size() < 2) return 0.0;
  for (double reach = 1.01 * expected_m;; reach *= 2.0) {
    GrowingGrid grid(positions.front(), 2.0 * reach, positions.size());
    for (const Eigen::Vector3d& position : positions) grid.add(position);
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(reach);
    const double least = parallel_reduce(
        positions.size(), gaps_per_chunk, std::numeric_limits<double>::infinity(),
        [&](std::size_t begin, std::size_t end) {
          double square = std::numeric_limits<double>::infinity();
          for (std::size_t n = begin; n < end; ++n)
            grid.any_in_box(positions[n] - margin, positions[n] + margin,
                            [&](const Eigen::Vector3d& other, std::uint32_t index) {
                              if (index != n)
                                square = std::min(square, (other - positions[n]).squaredNorm());
                              return false;
                            });
          return square;
        },
        [](double a, double b) { return std::min(a, b); });
    if (least <= reach * reach) return std::sqrt(least);
  }
}

}  // namespace libmap
