// Unit tests of the steps of texturing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/texture/texture_atlas.h"
#include "libmap/texture/texture_photos.h"
#include "libmap/texture/texture_steps.h"
#include "libmap/texture/texture_views.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/texture/painted_scan.h"
#include "tests/support/test_support.h"

namespace texture_parts_test {

using graspmap_test::grid_mesh;
using graspmap_test::random_engine;
using graspmap_test::uniform;
using libmap::TriangleMesh;
using libmap::ViewTable;

TEST(ViewTable, KeepsTheBestInOrder) {
  for (int round = 0; round < 50; ++round) {
    ViewTable table(1, 4);
    std::vector<libmap::ViewQuality> all;
    for (std::uint32_t photo = 0; photo < 9; ++photo) {
      // Equal qualities occur.
      all.push_back({photo, static_cast<float>(std::floor(uniform(1, 5)))});
      table.insert(0, all.back());
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.quality > b.quality; });
    ASSERT_EQ(table[0].size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(table[0][i].photo, all[i].photo);
      EXPECT_EQ(table[0][i].quality, all[i].quality);
    }
  }
}

TEST(ShareViews, AddUpToOneAndEndSoftly) {
  ViewTable table(3, 3);
  table.insert(0, {5, 4.0F});
  table.insert(0, {6, 2.0F});
  table.insert(0, {7, 1.0F});
  table.insert(1, {2, 3.0F});
  const libmap::BlendingWeights two = libmap::blending_weights(table, 2, 1.0);
  EXPECT_EQ(two.first, (std::vector<std::uint32_t>{0, 2, 3, 3}));
  // Less the third best: 3/4 to 1/4 of the best.
  EXPECT_FLOAT_EQ(two.weights[0].weight, 0.75F);
  EXPECT_FLOAT_EQ(two.weights[1].weight, 0.25F);
  EXPECT_EQ(two.weights[1].photo, 6U);
  EXPECT_FLOAT_EQ(two.weights[2].weight, 1.0F);
  const libmap::BlendingWeights sharper = libmap::blending_weights(table, 2, 2.0);
  EXPECT_FLOAT_EQ(sharper.weights[0].weight, 15.0F / 18.0F);
  EXPECT_TRUE(libmap::blending_weights(table, 1, 1.0).weights.empty());
}

struct LabelProblem {
  TriangleMesh mesh;
  std::vector<libmap::HalfEdge> opposite;
  ViewTable views;
};

LabelProblem problem_on(TriangleMesh mesh, std::uint32_t photos) {
  LabelProblem problem;
  problem.opposite =
      libmap::opposites_of(mesh.triangles, libmap::edges_of(mesh.triangles, mesh.vertices.size()));
  problem.views = ViewTable(mesh.triangles.size(), photos);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::uint32_t photo = 0; photo < photos; ++photo)
      if (uniform(0, 1) < 0.8)
        problem.views.insert(t, {photo, static_cast<float>(uniform(0.1, 1.0))});
  problem.mesh = std::move(mesh);
  return problem;
}

double energy_of(const LabelProblem& problem, const std::vector<std::uint32_t>& photos,
                 double seam_cost_m) {
  double energy = 0.0;
  const auto& triangles = problem.mesh.triangles;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto views = problem.views[t];
    if (views.empty()) continue;
    for (const libmap::ViewQuality& view : views)
      if (view.photo == photos[t])
        energy += 0.5 * libmap::area_normal(problem.mesh, triangles[t]).norm() *
                  (static_cast<double>(views[0].quality / view.quality) - 1.0);
    for (libmap::HalfEdge h = 3 * t; h < 3 * t + 3; ++h) {
      if (!libmap::is_joined(problem.opposite[h])) continue;
      const std::uint32_t other = problem.opposite[h] / 3;
      if (other < t || problem.views[other].empty() || photos[other] == photos[t]) continue;
      energy += seam_cost_m * (problem.mesh.vertices[libmap::source_of(triangles, h)] -
                               problem.mesh.vertices[libmap::target_of(triangles, h)])
                                  .norm();
    }
  }
  return energy;
}

// By trying all combinations.
double min_energy(const LabelProblem& problem, double seam_cost_m) {
  std::vector<std::uint32_t> photos(problem.mesh.triangles.size(), libmap::no_photo);
  double least = 1e30;
  const std::function<void(std::size_t)> choose = [&](std::size_t t) {
    if (t == photos.size()) {
      least = std::min(least, energy_of(problem, photos, seam_cost_m));
      return;
    }
    if (problem.views[t].empty()) return choose(t + 1);
    for (const libmap::ViewQuality& view : problem.views[t]) {
      photos[t] = view.photo;
      choose(t + 1);
    }
  };
  choose(0);
  return least;
}

TEST(LabelTriangles, TheLeastEnergyOfAStripAndOfASmallRing) {
  for (int round = 0; round < 30; ++round) {
    // A strip of triangles is a tree: one forest finds its optimum.
    TriangleMesh strip;
    for (std::uint32_t i = 0; i < 10; ++i) {
      strip.vertices.emplace_back(0.1 * i, i % 2, 0);
      if (i >= 2) strip.triangles.push_back({i - 2, i - 1, i});
    }
    // Six triangles around a vertex are a circle.
    TriangleMesh ring;
    ring.vertices.emplace_back(0, 0, 0);
    for (std::uint32_t i = 0; i < 6; ++i) {
      ring.vertices.emplace_back(std::cos(i), std::sin(i), 0);
      ring.triangles.push_back({0, 1 + i, 1 + (i + 1) % 6});
    }
    for (const TriangleMesh& mesh : {strip, ring}) {
      const LabelProblem problem = problem_on(mesh, 3);
      const double cost = uniform(0.01, 0.3);
      const libmap::TextureLabels labels =
          libmap::label_triangles(problem.mesh, problem.opposite, problem.views, {cost});
      const double least = min_energy(problem, cost);
      EXPECT_NEAR(labels.energy, energy_of(problem, labels.photos, cost), 1e-5);
      if (mesh.vertices.size() == strip.vertices.size())
        EXPECT_NEAR(labels.energy, least, 1e-5);
      else
        EXPECT_LE(labels.energy, 1.1 * least + 1e-5);
    }
  }
}

TEST(LabelTriangles, FewerSeamsOfPhotographsThatSeeThem) {
  const LabelProblem problem = problem_on(grid_mesh(30, 1.0, 0.0), 5);
  const libmap::TextureLabels labels =
      libmap::label_triangles(problem.mesh, problem.opposite, problem.views, {0.05});
  EXPECT_LT(labels.seams_m, 0.5 * labels.seams_before_m);
  EXPECT_LT(labels.energy, 0.7 * labels.energy_before);
  for (std::size_t t = 0; t < labels.photos.size(); ++t) {
    const auto views = problem.views[t];
    const bool sees = std::any_of(views.begin(), views.end(),
                                  [&](const auto& view) { return view.photo == labels.photos[t]; });
    EXPECT_TRUE(sees || (views.empty() && labels.photos[t] == libmap::no_photo));
  }
  // Without a cost of seams every triangle has its best view.
  const libmap::TextureLabels best =
      libmap::label_triangles(problem.mesh, problem.opposite, problem.views, {0.0});
  for (std::size_t t = 0; t < best.photos.size(); ++t)
    EXPECT_EQ(best.photos[t],
              problem.views[t].empty() ? libmap::no_photo : problem.views[t][0].photo);
}

TEST(PackRectangles, InsideTheirPagesAndApart) {
  for (const int size : {16, 64, 500}) {
    std::vector<libmap::PackedRectangle> rectangles;
    double area = 0.0;
    for (int i = 0; i < 400; ++i) {
      const int most = i % 50 == 0 ? size : std::max(1, size / 8);
      libmap::PackedRectangle r;
      r.width = 1 + static_cast<int>(uniform(0, most - 0.01));
      r.height = 1 + static_cast<int>(uniform(0, most - 0.01));
      area += r.width * r.height;
      rectangles.push_back(r);
    }
    const std::size_t pages = libmap::pack_rectangles(rectangles, size);
    std::vector<libmap::Image<std::uint8_t>> used(pages, libmap::Image<std::uint8_t>(size, size));
    for (const libmap::PackedRectangle& r : rectangles) {
      ASSERT_LT(r.page, pages);
      ASSERT_TRUE(r.column >= 0 && r.row >= 0 && r.column + r.width <= size &&
                  r.row + r.height <= size);
      for (int y = r.row; y < r.row + r.height; ++y)
        for (int x = r.column; x < r.column + r.width; ++x) {
          ASSERT_EQ(used[r.page].at(x, y), 0);
          used[r.page].at(x, y) = 1;
        }
    }
    EXPECT_GT(area / (static_cast<double>(pages) * size * size), size == 16 ? 0.4 : 0.6);
  }
}

struct AtlasCase {
  TriangleMesh mesh = grid_mesh(30, 0.8, 0.0);
  graspmap_test::PaintedScan scan{
      mesh,
      [](std::uint32_t, const Eigen::Vector3d&) { return Eigen::Vector3d::Constant(100).eval(); },
      graspmap_test::small_camera(), graspmap_test::circle_of_cameras(3, 0.4, 0.9)};
  libmap::TexturePhotos photos{scan, scan.poses(), false, libmap::no_progress(), 1 << 24};
  std::vector<libmap::HalfEdge> opposite =
      libmap::opposites_of(mesh.triangles, libmap::edges_of(mesh.triangles, mesh.vertices.size()));
};

TEST(TextureAtlas, ChartsLieApartInsideTheirPagesWithPadding) {
  const AtlasCase c;
  std::vector<std::uint32_t> label;
  for (std::size_t t = 0; t < c.mesh.triangles.size(); ++t)
    label.push_back(t % 97 == 0 ? libmap::no_photo : static_cast<std::uint32_t>(t / 150 % 3));
  for (const int size : {64, 128, 2048}) {
    for (const int padding : {1, 4}) {
      libmap::TextureAtlasOptions options;
      options.texture_size = size;
      options.padding_px = padding;
      const libmap::TextureAtlas atlas =
          libmap::make_texture_atlas(c.mesh, c.opposite, label, c.photos, options);
      std::vector<libmap::Image<std::uint8_t>> used;
      for (const libmap::PageSize& page : atlas.pages) used.emplace_back(page.width, page.height);
      std::vector<int> charts_of(c.mesh.triangles.size(), 0);
      const libmap::TexturedMesh model = atlas.make_model(c.mesh, c.photos);
      model.check();
      for (const libmap::TextureChart& chart : atlas.charts) {
        for (int y = chart.row; y < chart.row + chart.height; ++y)
          for (int x = chart.column; x < chart.column + chart.width; ++x)
            ASSERT_EQ(used[static_cast<std::size_t>(chart.page)].at(x, y)++, 0);
        for (const std::uint32_t t : chart.triangles) {
          ++charts_of[t];
          EXPECT_EQ(label[t], chart.photo);
          EXPECT_EQ(model.page_of_triangle[t], chart.page);
          const auto& page = atlas.pages[static_cast<std::size_t>(chart.page)];
          for (const Eigen::Vector2f& corner : model.texture_coordinates[t]) {
            const double x = static_cast<double>(corner.x()) * page.width - 0.5;
            const double y = static_cast<double>(corner.y()) * page.height - 0.5;
            EXPECT_GE(x, chart.column + padding - 1e-2);
            EXPECT_GE(y, chart.row + padding - 1e-2);
            EXPECT_LE(x, chart.column + chart.width - 1 - padding + 1e-2);
            EXPECT_LE(y, chart.row + chart.height - 1 - padding + 1e-2);
          }
        }
      }
      for (std::size_t t = 0; t < label.size(); ++t)
        EXPECT_EQ(charts_of[t], label[t] == libmap::no_photo ? 0 : 1);
      EXPECT_EQ(atlas.split_charts > 0, size < 2048);
      EXPECT_EQ(atlas.shrunk_charts, 0U);
    }
  }
}

TEST(TextureAtlas, ATriangleLargerThanAPageFillsIt) {
  AtlasCase c;
  c.mesh.triangles = {{0, 30, 960}};
  c.opposite.assign(3, libmap::open_edge);
  for (int size = 64; size < 130; ++size) {
    libmap::TextureAtlasOptions options;
    options.texture_size = size;
    const libmap::TextureAtlas atlas =
        libmap::make_texture_atlas(c.mesh, c.opposite, {2}, c.photos, options);
    ASSERT_EQ(atlas.charts.size(), 1U);
    EXPECT_EQ(atlas.shrunk_charts, 1U);
    EXPECT_EQ(atlas.pages.size(), 1U);
    EXPECT_EQ(std::max(atlas.charts[0].width, atlas.charts[0].height), size);
  }
}

TEST(TextureAtlas, TexelsAreThePhotographsPixels) {
  const AtlasCase c;
  const std::vector<std::uint32_t> label(c.mesh.triangles.size(), 1);
  libmap::TextureAtlasOptions options;
  options.texels_per_pixel = 1.0;
  const libmap::TextureAtlas atlas =
      libmap::make_texture_atlas(c.mesh, c.opposite, label, c.photos, options);
  ASSERT_EQ(atlas.charts.size(), 1U);
  for (const Eigen::Vector3d& vertex : c.mesh.vertices) {
    const Eigen::Vector2d pixel = c.photos[1].projector.project(vertex).head<2>();
    const Eigen::Vector2d texel = libmap::texel_of(atlas.charts[0], c.photos[1].projector, vertex);
    const Eigen::Vector2d shift = texel - pixel;
    EXPECT_NEAR(shift.x(), std::round(shift.x()), 1e-9);
    EXPECT_NEAR(shift.y(), std::round(shift.y()), 1e-9);
  }
}

TEST(Exposure, GainsOfPhotographsThatDifferAndLeftOversThatDoNotFit) {
  std::vector<libmap::ColorObservation> observations;
  const std::vector<double> gains = {0.8, 1.0, 1.25};
  for (std::uint32_t vertex = 0; vertex < 3000; ++vertex) {
    const Eigen::Vector3d color(uniform(30, 150), uniform(30, 150), uniform(30, 150));
    for (std::uint32_t photo = 0; photo < 3; ++photo) {
      const auto r2 = static_cast<float>(uniform(0, 1));
      const double shade = std::exp(-0.3 * static_cast<double>(r2));
      // One of twenty shows something else.
      const double wrong = uniform(0, 1) < 0.05 ? 1.5 : 1.0;
      observations.push_back({.vertex = vertex,
                              .photo = photo,
                              .radius2 = r2,
                              .color = (wrong * shade * gains[photo] * color).cast<float>()});
    }
  }
  std::shuffle(observations.begin(), observations.end(), random_engine());
  const libmap::TextureExposure exposure = libmap::estimate_exposure(observations, 4, {});
  ASSERT_EQ(exposure.gains.size(), 4U);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(static_cast<double>(exposure.gains[i][0] / exposure.gains[1][0]), gains[i], 0.01);
  EXPECT_NEAR(std::log(static_cast<double>(exposure.factor(3, 0.5)[1] / exposure.gains[3][1])),
              -0.15, 0.01);
  // A photograph without overlap is not changed.
  EXPECT_NEAR(static_cast<double>(exposure.gains[3][2]), 1.0, 0.08);
  EXPECT_EQ(libmap::estimate_exposure({}, 2, {}).gains[1], Eigen::Vector3f::Ones());
}

// Number of edges with one triangle, and with more than two.
std::pair<std::size_t, std::size_t> edge_uses(const TriangleMesh& mesh) {
  const libmap::MeshEdges edges = libmap::edges_of(mesh.triangles, mesh.vertices.size());
  std::pair<std::size_t, std::size_t> uses{0, 0};
  for (std::size_t e = 0; e < edges.size(); ++e) {
    uses.first += edges.count(e) == 1 ? 1 : 0;
    uses.second += edges.count(e) > 2 ? 1 : 0;
  }
  return uses;
}

TEST(SplitLongSides, SameSurfaceWithoutGaps) {
  constexpr std::uint64_t most = 10'000'000;
  TriangleMesh ball = graspmap_test::ball_mesh(6, 8, {0, 0, 0});
  ball.vertex_colors.resize(ball.vertices.size());
  for (std::size_t v = 0; v < ball.vertices.size(); ++v)
    ball.vertex_colors[v] = {static_cast<std::uint8_t>(v), 0, 0};
  ball.face_fields.push_back({"number", libmap::ScalarType::int32, {}});
  for (std::size_t t = 0; t < ball.triangles.size(); ++t)
    ball.face_fields[0].values.push_back(static_cast<double>(t));
  for (const double side : {2.0, 0.3, 0.1}) {
    const libmap::SubdivisionResult fine = libmap::split_long_sides(ball, side, most);
    fine.mesh.check();
    EXPECT_NEAR(libmap::surface_area(fine.mesh), libmap::surface_area(ball), 1e-9);
    EXPECT_NEAR(libmap::signed_volume(fine.mesh), libmap::signed_volume(ball), 1e-9);
    for (const libmap::Triangle& t : fine.mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_LE((fine.mesh.vertices[t[k]] - fine.mesh.vertices[t[(k + 1) % 3]]).norm(), side);
    EXPECT_EQ(edge_uses(fine.mesh), edge_uses(ball)) << "both triangles of a side are cut";
    for (std::size_t v = 0; v < ball.vertices.size(); ++v)
      EXPECT_EQ(fine.mesh.vertices[v], ball.vertices[v]);
    for (std::size_t t = 0; t < fine.mesh.triangles.size(); ++t) {
      EXPECT_EQ(fine.mesh.face_fields[0].values[t], fine.source[t]);
      const Eigen::Vector3d whole = libmap::area_normal(ball, ball.triangles[fine.source[t]]);
      if (whole.norm() < 1e-9) continue;  // at the poles
      EXPECT_LT(
          (libmap::area_normal(fine.mesh, fine.mesh.triangles[t]).normalized() - whole.normalized())
              .norm(),
          1e-6);
    }
  }
  EXPECT_EQ(libmap::split_long_sides(ball, 2.0, most).mesh.triangles, ball.triangles);
  // The number of triangles is limited for large meshes.
  const TriangleMesh wide = graspmap_test::square_mesh(0.0, 5000.0);
  const libmap::SubdivisionResult bounded = libmap::split_long_sides(wide, 0.05, 10000);
  EXPECT_LT(bounded.mesh.triangles.size(), 10001U);
  EXPECT_GT(bounded.max_side_m, 50.0);
}

TEST(SplitLongSides, OnlyWhereItIsNeeded) {
  const TriangleMesh wide = graspmap_test::square_mesh(0.0, 100.0);
  const Eigen::Vector3d place(20, 30, 0);
  const auto is_near = [&place](const TriangleMesh& mesh, const libmap::Triangle& t) {
    const Eigen::Vector3d center =
        (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0;
    double radius = 0.0;
    for (const std::uint32_t corner : t)
      radius = std::max(radius, (mesh.vertices[corner] - center).norm());
    return (center - place).norm() <= radius + 1.0;
  };
  const libmap::SubdivisionResult fine = libmap::split_long_sides(wide, 0.1, 10'000'000, is_near);
  EXPECT_EQ(fine.max_side_m, 0.1);
  EXPECT_LT(fine.mesh.triangles.size(), 10000U) << "some 10^7 of them without a bound";
  EXPECT_NEAR(libmap::surface_area(fine.mesh), libmap::surface_area(wide), 1e-6);
  EXPECT_EQ(edge_uses(fine.mesh).second, 0U);
  int near = 0;
  for (const libmap::Triangle& t : fine.mesh.triangles) {
    if ((fine.mesh.vertices[t[0]] - place).norm() > 1.0) continue;
    ++near;
    for (std::size_t k = 0; k < 3; ++k)
      ASSERT_LE((fine.mesh.vertices[t[k]] - fine.mesh.vertices[t[(k + 1) % 3]]).norm(), 0.1);
  }
  EXPECT_GT(near, 500);
  // Without gaps: each side inside the square has a triangle on both of its sides.
  const libmap::MeshEdges edges = libmap::edges_of(fine.mesh.triangles, fine.mesh.vertices.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (edges.count(e) == 2) continue;
    const libmap::HalfEdge h = edges.half_edges[edges.first[e]];
    const Eigen::Vector3d middle = (fine.mesh.vertices[libmap::source_of(fine.mesh.triangles, h)] +
                                    fine.mesh.vertices[libmap::target_of(fine.mesh.triangles, h)]) /
                                   2.0;
    ASSERT_EQ(middle.cwiseAbs().maxCoeff(), wide.vertices[0].cwiseAbs().maxCoeff());
  }
}

TEST(SplitLongSides, EndsWhereSidesAreRounded) {
  TriangleMesh far = graspmap_test::square_mesh(0.0, 2.0);
  for (Eigen::Vector3d& vertex : far.vertices) vertex += Eigen::Vector3d(1e15, 0, 0);
  EXPECT_GT(libmap::split_long_sides(far, 0.05, 1'000'000).max_side_m, 100.0);
}

libmap::Camera any_camera(int kind) {
  libmap::Camera camera = graspmap_test::small_camera();
  camera.fy = camera.fx * uniform(0.5, 2.0);
  if (kind == 1) {
    camera.distortion_model = libmap::DistortionModel::radial_tangential;
    camera.distortion = {uniform(-0.1, 0.1), uniform(-0.02, 0.02), 1e-3, -1e-3};
  }
  if (kind == 2) {
    camera.distortion_model = libmap::DistortionModel::equidistant;
    camera.distortion = {uniform(-0.05, 0.05), 1e-3, 0.0, 0.0};
  }
  return camera;
}

TEST(PhotoProjector, NoLengthInABallTakesMorePixels) {
  int shown = 0;
  int hidden = 0;
  for (int round = 0; round < 3000; ++round) {
    const libmap::Camera camera = any_camera(round % 3);
    libmap::Pose pose = libmap::Pose::Identity();
    pose.linear() = Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), 1.0)
                        .normalized()
                        .toRotationMatrix();
    pose.translation() = Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    const libmap::PhotoProjector projector(camera, pose);
    const Eigen::Vector3d center(uniform(-3, 3), uniform(-3, 3), uniform(-3, 3));
    const double radius = std::pow(10.0, uniform(-3, 0.5));
    const auto in_ball = [&] {
      return Eigen::Vector3d(
          center +
          radius * uniform(0, 1) *
              Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized());
    };
    const auto in_image = [&camera](const Eigen::Vector3d& seen) {
      return seen.z() > 0.0 && seen.x() >= -0.5 && seen.y() >= -0.5 &&
             seen.x() <= camera.width - 0.5 && seen.y() <= camera.height - 0.5;
    };
    bool any = false;
    for (int i = 0; i < 30; ++i) {
      const Eigen::Vector3d a = in_ball();
      const Eigen::Vector3d b = in_ball();
      const Eigen::Vector3d at = projector.project(a);
      const Eigen::Vector3d bt = projector.project(b);
      any = any || in_image(at);
      if (!in_image(at) || !in_image(bt)) continue;
      ASSERT_LE((at - bt).head<2>().norm(), projector.max_pixels(center, radius, (a - b).norm()));
    }
    const double most = projector.max_pixels(center, radius, 1.0);
    ASSERT_TRUE(most > 0.0 || !any);
    shown += most > 0.0 ? 1 : 0;
    hidden += most > 0.0 ? 0 : 1;
  }
  EXPECT_GT(shown, 500);
  EXPECT_GT(hidden, 500);
}

}  // namespace texture_parts_test
