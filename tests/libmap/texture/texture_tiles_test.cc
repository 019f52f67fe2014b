// Textures of meshes in pieces against that of the whole mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

#include "libmap/core/single_precision.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/texture/texture_model.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/tile_samples.h"
#include "tests/libmap/texture/painted_scan.h"
#include "tests/libmap/texture/textured_samples.h"
#include "tests/support/test_support.h"

namespace texture_tiles_test {

using graspmap_test::circle_of_cameras;
using graspmap_test::grid_mesh;
using graspmap_test::PaintedScan;
using graspmap_test::small_camera;
using graspmap_test::soft_marks;
using libmap::MeshTileIndex;
using libmap::TexturedMesh;
using libmap::TextureOptions;
using libmap::TextureReport;
using libmap::TriangleMesh;

constexpr double tile_m = 0.4;

const graspmap_test::Paint marks = [](std::uint32_t, const Eigen::Vector3d& point) {
  return soft_marks(point);
};

// A level square whose vertices files keep exactly.
TriangleMesh ground(int cells, double size_m) {
  TriangleMesh mesh = grid_mesh(cells, size_m, 0.0);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex = libmap::rounded_to_single(vertex);
  return mesh;
}

MeshTileIndex pieces_of(const TriangleMesh& mesh) {
  return MeshTileIndex(graspmap_test::write_tiles(mesh, tile_m, graspmap_test::scratch_folder()));
}

std::vector<TexturedMesh> textured(const TriangleMesh& mesh, const PaintedScan& scan,
                                   const TextureOptions& options, double margin_m,
                                   TextureReport& report) {
  MeshTileIndex index = pieces_of(mesh);
  libmap::TileTexturing texturing(index, margin_m, scan, scan.poses(), options);
  const libmap::TextureExposure exposure = texturing.find_exposure();
  report = texturing.report();
  std::vector<TexturedMesh> models;
  for (std::size_t n = 0; n < index.size(); ++n) {
    libmap::TileTexturing::Tile tile = texturing.make(n, exposure);
    tile.model.check();
    libmap::merge_into<libmap::TextureCounts>(report, tile.counts);
    models.push_back(std::move(tile.model));
  }
  libmap::require_seen(report);
  return models;
}

// The vertices all of whose triangles are in the image and near enough.
std::vector<bool> shown_vertices(const TriangleMesh& mesh, const libmap::PhotoProjector& projector,
                                 const libmap::TextureViewOptions& options) {
  const auto is_shown = [&](std::uint32_t v) {
    const Eigen::Vector3d pixel = projector.project(mesh.vertices[v]);
    const double border = options.border_px;
    return pixel.z() > 0.0 && pixel.x() >= border && pixel.y() >= border &&
           pixel.x() <= projector.camera().width - 1 - border &&
           pixel.y() <= projector.camera().height - 1 - border;
  };
  const auto is_near = [&](const libmap::Triangle& triangle) {
    return options.max_depth_m == 0.0 ||
           projector.project(center_of(mesh, triangle)).z() <= options.max_depth_m;
  };
  std::vector<bool> shown(mesh.vertices.size(), true);
  for (const libmap::Triangle& triangle : mesh.triangles)
    if (!std::all_of(triangle.begin(), triangle.end(), is_shown) || !is_near(triangle))
      for (const std::uint32_t v : triangle) shown[v] = false;
  return shown;
}

using Position = std::array<double, 3>;
Position position_of(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

// The largest difference of colors in the middles of edges that two pieces have, 0 to 255.
struct SeamErrors {
  double mean = 0.0;
  double max = 0.0;
  int count = 0;
};
SeamErrors errors_at_seams(const std::vector<TexturedMesh>& models) {
  std::map<std::array<Position, 2>, std::pair<std::size_t, Eigen::Vector3f>> edges;
  SeamErrors errors;
  for (std::size_t tile = 0; tile < models.size(); ++tile)
    for (std::uint32_t t = 0; t < models[tile].mesh.triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k) {
        const libmap::Triangle& corners = models[tile].mesh.triangles[t];
        std::array<Position, 2> ends = {
            position_of(models[tile].mesh.vertices[corners[k]]),
            position_of(models[tile].mesh.vertices[corners[(k + 1) % 3]])};
        if (ends[1] < ends[0]) std::swap(ends[0], ends[1]);
        const Eigen::Vector3f color =
            graspmap_test::texture_color(models[tile], t, k == 2 ? 0.0 : 0.5, k == 0 ? 0.0 : 0.5);
        const auto [other, is_new] = edges.try_emplace(ends, tile, color);
        if (is_new || other->second.first == tile) continue;
        const auto error =
            static_cast<double>((color - other->second.second).cwiseAbs().maxCoeff());
        errors.mean += error;
        errors.max = std::max(errors.max, error);
        ++errors.count;
      }
  errors.mean /= errors.count;
  return errors;
}

// Mean absolute difference of colors in the middles of the triangles of both.
double difference_of(const std::vector<TexturedMesh>& models, const TexturedMesh& whole) {
  std::map<Position, Eigen::Vector3f> colors;
  const auto place = [](const TexturedMesh& model, std::uint32_t t) {
    return position_of(center_of(model.mesh, model.mesh.triangles[t]));
  };
  for (std::uint32_t t = 0; t < whole.mesh.triangles.size(); ++t)
    colors[place(whole, t)] = graspmap_test::texture_color(whole, t, 0.33, 0.33);
  double sum = 0.0;
  std::size_t count = 0;
  for (const TexturedMesh& model : models)
    for (std::uint32_t t = 0; t < model.mesh.triangles.size(); ++t, ++count)
      sum += static_cast<double>(
          (graspmap_test::texture_color(model, t, 0.33, 0.33) - colors.at(place(model, t)))
              .cwiseAbs()
              .mean());
  EXPECT_EQ(count, whole.mesh.triangles.size());
  return sum / static_cast<double>(count);
}

TEST(TextureTiles, ColorsAreThoseOfTheWholeMeshAndMeetAtSeams) {
  const TriangleMesh mesh = ground(40, 0.8);
  PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(8, 0.4, 0.8));
  std::vector<Eigen::Vector3d> gains;
  graspmap_test::spoil(scan, gains);
  const libmap::TextureResult whole = libmap::texture_mesh(mesh, scan, scan.poses());
  TextureReport report;
  const std::vector<TexturedMesh> models = textured(mesh, scan, {}, 0.5, report);
  ASSERT_EQ(models.size(), 4U);
  EXPECT_EQ(report.seen_triangles, whole.seen_triangles);
  EXPECT_NEAR(report.seen_m2, 0.64, 1e-6);
  EXPECT_NEAR(report.texel_size_m(), whole.texel_size_m(), 0.05 * whole.texel_size_m());
  // Photographs differ by up to half of their brightness: pieces of their own exposure would show.
  const SeamErrors seams = errors_at_seams(models);
  EXPECT_GE(seams.count, 4 * 20);
  EXPECT_LT(seams.mean, 1.5);
  EXPECT_LE(seams.max, 3.0);
  EXPECT_LT(difference_of(models, whole.model), 0.3);
  EXPECT_EQ(report.exposure.gains.size(), 8U);
  for (std::size_t i = 0; i < 8; ++i)
    EXPECT_LT((report.exposure.gains[i] - whole.exposure.gains[i]).norm(), 0.01F);
}

TEST(TextureTiles, LongSidesAreCutAlikeOnBothSidesOfASeam) {
  const TriangleMesh mesh = ground(8, 0.72);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(6, 0.4, 0.8));
  TextureReport report;
  const std::vector<TexturedMesh> models = textured(mesh, scan, {}, 0.5, report);
  EXPECT_EQ(report.cut_triangles, libmap::texture_mesh(mesh, scan, scan.poses()).cut_triangles);
  const SeamErrors seams = errors_at_seams(models);
  EXPECT_GE(seams.count, 4 * 8);
  EXPECT_LE(seams.max, 3.0);
}

TEST(TextureTiles, VerticesOnSeamsAreSeenAlikeByBothPieces) {
  const TriangleMesh mesh = ground(40, 0.8);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(8, 0.4, 0.8));
  const libmap::TexturePhotos photos(scan, scan.poses(), true, libmap::no_progress(), 1 << 24);
  MeshTileIndex index = pieces_of(mesh);
  std::map<Position, std::vector<libmap::ViewQuality>> seen;
  int common = 0;
  for (std::size_t tile = 0; tile < index.size(); ++tile) {
    const libmap::MeshWithMargin part = index.with_margin(tile, 0.5);
    const libmap::ViewTable views =
        libmap::find_texture_views(part.mesh, photos, {}, {part.triangles, 1, 4, 0},
                                   libmap::no_progress())
            .of_vertices;
    for (std::uint32_t v = 0; v < views.rows(); ++v) {
      if (views[v].empty()) continue;
      const auto [other, is_new] =
          seen.try_emplace(position_of(part.mesh.vertices[v]), views[v].begin(), views[v].end());
      if (is_new) continue;
      ++common;
      ASSERT_EQ(other->second.size(), views[v].size());
      for (std::size_t i = 0; i < views[v].size(); ++i) {
        EXPECT_EQ(other->second[i].photo, views[v][i].photo);
        EXPECT_EQ(other->second[i].quality, views[v][i].quality);
      }
    }
  }
  EXPECT_GE(common, 4 * 20);
}

// On open ground nothing hides a vertex: it is seen where the photograph shows its triangles from
// near enough. Each camera shows another part, so that nothing of the photographs before may be
// left; large triangles reach from what it shows to where nothing is looked at.
TEST(TextureViews, VerticesAreSeenWhereThePhotographShowsAllTheirTriangles) {
  std::map<std::pair<int, double>, std::size_t> seen;
  for (const auto& [cells, max_depth_m] :
       {std::pair(60, 0.0), std::pair(10, 0.0), std::pair(60, 0.8), std::pair(10, 1.35)}) {
    const TriangleMesh mesh = ground(cells, 3.0);
    const double height = 0.35 + 9.0 / cells;
    std::vector<libmap::Pose> cameras;
    for (const double x : {-1.2, 0.9, -0.4, 0.2, 1.3})
      for (const double y : {-1.0, 0.6})
        cameras.push_back(graspmap_test::looking_at({x, y, height}, {0.8 * x, 0.7 * y + 0.1, 0.0}));
    const PaintedScan scan(mesh, marks, small_camera(), cameras);
    const libmap::TexturePhotos photos(scan, scan.poses(), true, libmap::no_progress(), 1 << 24);
    libmap::TextureViewOptions options;
    options.max_depth_m = max_depth_m;
    const libmap::ViewTable views =
        libmap::find_texture_views(mesh, photos, options,
                                   {mesh.triangles.size(), 1, cameras.size(), 0},
                                   libmap::no_progress())
            .of_vertices;
    std::size_t& count = seen[{cells, max_depth_m}];
    for (std::uint32_t photo = 0; photo < photos.size(); ++photo) {
      const std::vector<bool> expected = shown_vertices(mesh, photos[photo].projector, options);
      for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
        const bool found = std::any_of(views[v].begin(), views[v].end(),
                                       [&](const auto& view) { return view.photo == photo; });
        ASSERT_EQ(found, expected[v]) << photo << ", vertex " << v;
        count += found ? 1 : 0;
      }
    }
    EXPECT_GT(count, cameras.size());
    EXPECT_LT(count, mesh.vertices.size() * cameras.size() / 2);
  }
  EXPECT_LT((seen[{60, 0.8}]), (seen[{60, 0.0}]));
  EXPECT_LT((seen[{10, 1.35}]), (seen[{10, 0.0}]));
}

// A red plate in separate pieces occludes the ground of other pieces.
TEST(TextureTiles, NeighborsHideWhatIsBehindThem) {
  const std::size_t of_ground = 2 * 50 * 50;
  TriangleMesh plate = grid_mesh(12, 0.24, 0.25);
  for (Eigen::Vector3d& vertex : plate.vertices) vertex.x() += 0.16;
  const TriangleMesh mesh = graspmap_test::join_meshes(ground(50, 1.0), plate);
  const graspmap_test::Paint red_plate = [&](std::uint32_t t, const Eigen::Vector3d& point) {
    const Eigen::Vector3d color = soft_marks(point);
    return t < of_ground ? Eigen::Vector3d(color.y(), color.y(), color.z())
                         : Eigen::Vector3d(250, 0, 0);
  };
  const PaintedScan scan(mesh, red_plate, small_camera(), circle_of_cameras(6, 0.6, 1.0));
  const auto red_places = [&](double margin_m) {
    TextureReport report;
    int count = 0;
    for (const TexturedMesh& model : textured(mesh, scan, {}, margin_m, report))
      for (std::uint32_t t = 0; t < model.mesh.triangles.size(); ++t) {
        if (center_of(model.mesh, model.mesh.triangles[t]).z() > 0.1) continue;
        const Eigen::Vector3f color = graspmap_test::texture_color(model, t, 0.33, 0.33);
        count += color[0] - color[1] > 12.0F ? 1 : 0;
      }
    return count;
  };
  EXPECT_EQ(red_places(0.6), 0);
  EXPECT_GT(red_places(0.0), 20);
}

TEST(TextureTiles, OnePieceIsTheWholeMesh) {
  const TriangleMesh mesh = ground(12, 0.36);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(5, 0.4, 0.8));
  libmap::write_mesh(graspmap_test::scratch_folder() / "piece_0_0.ply", mesh);
  MeshTileIndex index({graspmap_test::scratch_folder() / "piece_0_0.ply"});
  const libmap::TextureResult whole = libmap::texture_mesh(
      libmap::read_mesh(graspmap_test::scratch_folder() / "piece_0_0.ply").mesh, scan,
      scan.poses());
  libmap::TileTexturing texturing(index, 2.0, scan, scan.poses(), {});
  const libmap::TileTexturing::Tile tile = texturing.make(0, texturing.find_exposure());
  EXPECT_EQ(tile.model.texture_coordinates, whole.model.texture_coordinates);
  ASSERT_EQ(tile.model.pages.size(), whole.model.pages.size());
  for (std::size_t page = 0; page < whole.model.pages.size(); ++page)
    EXPECT_EQ(tile.model.pages[page].pixels, whole.model.pages[page].pixels);
  EXPECT_EQ(tile.counts.charts, whole.charts);
}

TEST(TextureTiles, APieceThatNobodySeesIsGray) {
  const TriangleMesh mesh = ground(40, 0.8);
  const PaintedScan scan(mesh, marks, small_camera(),
                         {graspmap_test::looking_at({0.25, 0.25, 0.3}, {0.25, 0.25, 0})});
  TextureReport report;
  const std::vector<TexturedMesh> models = textured(mesh, scan, {}, 0.5, report);
  EXPECT_EQ(graspmap_test::texture_color(models.front(), 0, 0.3, 0.3),
            Eigen::Vector3f::Constant(128));
  EXPECT_GT(report.unseen_triangles, mesh.triangles.size() / 2);
  const PaintedScan below(mesh, marks, small_camera(),
                          {graspmap_test::looking_at({0, 0, -1}, {0, 0, 0})});
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { textured(mesh, below, {}, 0.5, report); }),
      {.about = "1 photograph"}));
}

}  // namespace texture_tiles_test
