#include "libmap/mesh/surface_fragments.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr std::size_t pieces_a_block = 128;

const Fragment whole{0, {Eigen::Vector2d(0.0, 0.0), {1.0, 0.0}, {0.0, 1.0}}};

PlacedFragment placed_triangle(const TriangleMesh& mesh, std::size_t number) {
  const Triangle& corners = mesh.triangles[number];
  PlacedFragment piece{
      whole, {mesh.vertices[corners[0]], mesh.vertices[corners[1]], mesh.vertices[corners[2]]}};
  piece.fragment.triangle = static_cast<std::uint32_t>(number);
  return piece;
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

SurfacePieces::SurfacePieces(const TriangleMesh& mesh) : mesh_(mesh) {
  add_blocks(0, mesh.triangles.size());
}

SurfacePieces::SurfacePieces(const SurfacePieces& triangles, double longest_m,
                             std::size_t max_parts)
    : mesh_(triangles.mesh_) {
  for (const SurfaceBlock& block : triangles.blocks_) {
    if (block.longest_m <= longest_m) {
      blocks_.push_back(block);
      continue;
    }
    for (std::size_t n = block.begin; n < block.end; ++n)
      cut(triangles.piece(n), longest_m, max_parts);
  }
  add_blocks(mesh_.triangles.size(), mesh_.triangles.size() + parts_.size());
}

void SurfacePieces::cut(const PlacedFragment& fragment, double longest_m, std::size_t max_parts) {
  if (!(fragment.area_m2() > 0.0)) return;
  // At least so many parts lie along its longest side.
  const double parts = std::sqrt(fragment.square_of_longest_side()) / longest_m;
  if (static_cast<double>(parts_.size()) + parts > static_cast<double>(max_parts))
    throw Error("the mesh is too large to be cut so small",
                {.field = "size of a piece", .value = to_text(longest_m) + " m"});
  if (parts > 1.0) {
    for (const PlacedFragment& half : fragment.halves()) cut(half, longest_m, max_parts);
    return;
  }
  parts_.push_back(fragment.fragment);
}

double SurfacePieces::area_m2() const {
  double area = 0.0;
  for (const SurfaceBlock& block : blocks_) area += block.area_m2;
  return area;
}

PlacedFragment SurfacePieces::piece(std::size_t number) const {
  if (number >= mesh_.triangles.size())
    return placed(mesh_, parts_[number - mesh_.triangles.size()]);
  return placed_triangle(mesh_, number);
}

void SurfacePieces::add_blocks(std::size_t begin, std::size_t end) {
  const std::size_t first = blocks_.size();
  blocks_.resize(first + (end - begin + pieces_a_block - 1) / pieces_a_block);
  parallel_for(end - begin, pieces_a_block, [&](std::size_t from, std::size_t to) {
    blocks_[first + from / pieces_a_block] = measured(begin + from, begin + to);
  });
}

SurfaceBlock SurfacePieces::measured(std::size_t begin, std::size_t end) const {
  SurfaceBlock block;
  block.begin = begin;
  block.end = end;
  Eigen::AlignedBox3d box;
  for (std::size_t n = begin; n < end; ++n) {
    const PlacedFragment fragment = piece(n);
    block.area_m2 += fragment.area_m2();
    block.longest_m = std::max(block.longest_m, fragment.square_of_longest_side());
    for (const Eigen::Vector3d& corner : fragment.corners) box.extend(corner);
  }
  block.longest_m = std::sqrt(block.longest_m);
  block.center = box.center();
  for (std::size_t n = begin; n < end; ++n)
    for (const Eigen::Vector3d& corner : piece(n).corners)
      block.reach_m = std::max(block.reach_m, (corner - block.center).squaredNorm());
  block.reach_m = std::sqrt(block.reach_m);
  return block;
}

}  // namespace libmap
