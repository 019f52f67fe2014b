#include "libmap/mesh/mesh_tile_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/core/single_precision.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/tile_samples.h"
#include "tests/support/test_support.h"

namespace mesh_tile_index_test {

using graspmap_test::ball_mesh;
using libmap::MeshTileIndex;
using libmap::MeshWithMargin;
using libmap::TriangleMesh;

// A ball whose vertices are exact in files; each pole has many vertices.
TriangleMesh ball_in_files() {
  TriangleMesh ball = ball_mesh(24, 36, {0.1, 0.0, 0.0});
  for (Eigen::Vector3d& vertex : ball.vertices) vertex = libmap::rounded_to_single(vertex);
  return ball;
}

int open_edges(const TriangleMesh& mesh) {
  const std::vector<libmap::HalfEdge> opposite = libmap::opposites_of(mesh);
  int count = 0;
  for (libmap::HalfEdge h = 0; h < opposite.size(); ++h)
    count += !libmap::is_joined(opposite[h]) && !libmap::along(mesh, h).isZero() &&
                     std::abs(mesh.vertices[libmap::source_of(mesh.triangles, h)].z()) < 0.99
                 ? 1
                 : 0;
  return count;
}

TEST(MeshTileIndex, PiecesAreJoinedToWhatWasCut) {
  const TriangleMesh ball = ball_in_files();
  ASSERT_EQ(open_edges(ball), 0);
  MeshTileIndex index(graspmap_test::write_tiles(ball, 0.6, graspmap_test::scratch_folder()));
  ASSERT_GT(index.size(), 4U);
  std::size_t own = 0;
  for (std::size_t piece = 0; piece < index.size(); ++piece) {
    const MeshWithMargin alone = index.with_margin(piece, 0.0);
    const MeshWithMargin all = index.with_margin(piece, 10.0);
    own += all.triangles;
    EXPECT_EQ(all.mesh.triangles.size(), ball.triangles.size());
    EXPECT_EQ(open_edges(all.mesh), 0) << "seams are closed, corners of four pieces too";
    // The piece itself comes first.
    const TriangleMesh read = libmap::read_mesh(index.path(piece)).mesh;
    ASSERT_EQ(all.triangles, read.triangles.size());
    EXPECT_TRUE(
        std::equal(read.triangles.begin(), read.triangles.end(), all.mesh.triangles.begin()));
    EXPECT_TRUE(std::equal(read.vertices.begin(), read.vertices.end(), all.mesh.vertices.begin()));
    EXPECT_EQ(alone.triangles, all.triangles);
    EXPECT_LT(alone.mesh.triangles.size(), all.mesh.triangles.size());
  }
  EXPECT_EQ(own, ball.triangles.size());
}

TEST(MeshTileIndex, MarginsReachAsFarAsAsked) {
  const TriangleMesh ball = ball_in_files();
  MeshTileIndex index(graspmap_test::write_tiles(ball, 0.6, graspmap_test::scratch_folder()));
  const double margin = 0.3;
  const MeshWithMargin joined = index.with_margin(0, margin);
  Eigen::AlignedBox2d box;
  for (std::size_t t = 0; t < joined.triangles; ++t)
    for (const std::uint32_t v : joined.mesh.triangles[t])
      box.extend(joined.mesh.vertices[v].head<2>());
  const Eigen::Vector2d grown = Eigen::Vector2d::Constant(margin);
  const Eigen::AlignedBox2d around(box.min() - grown, box.max() + grown);
  const auto count = [&](const TriangleMesh& mesh) {
    return std::count_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& t) {
      return std::any_of(t.begin(), t.end(), [&](std::uint32_t v) {
        return around.contains(mesh.vertices[v].head<2>());
      });
    });
  };
  EXPECT_EQ(static_cast<std::ptrdiff_t>(joined.mesh.triangles.size()), count(ball));
  EXPECT_GT(joined.mesh.triangles.size(), joined.triangles);
  EXPECT_LT(joined.mesh.triangles.size(), ball.triangles.size());
}

}  // namespace mesh_tile_index_test
