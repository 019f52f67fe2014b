#include "libmap/texture/texture_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/mesh/mesh_parts.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/texture/painted_scan.h"
#include "tests/libmap/texture/textured_samples.h"
#include "tests/support/test_support.h"

namespace texture_model_test {

using graspmap_test::circle_of_cameras;
using graspmap_test::error_of;
using graspmap_test::grid_mesh;
using graspmap_test::is_error;
using graspmap_test::looking_at;
using graspmap_test::PaintedScan;
using graspmap_test::small_camera;
using graspmap_test::soft_marks;
using graspmap_test::spoil;
using graspmap_test::uniform;
using libmap::TextureOptions;
using libmap::TextureResult;
using libmap::TriangleMesh;

const graspmap_test::Paint marks = [](std::uint32_t, const Eigen::Vector3d& point) {
  return soft_marks(point);
};

// Differences from `truth`, 0 to 255, at places all over the triangles that `take` takes.
struct ColorErrors {
  double mean = 0.0;
  double max = 0.0;
  Eigen::Vector3d ratio = Eigen::Vector3d::Zero();  // texture to truth
  int count = 0;
};
ColorErrors errors_of(const libmap::TexturedMesh& model, const graspmap_test::Paint& truth,
                      const std::function<bool(std::uint32_t)>& take) {
  ColorErrors errors;
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  Eigen::Vector3d wanted = Eigen::Vector3d::Zero();
  for (std::uint32_t t = 0; t < model.mesh.triangles.size(); ++t) {
    if (!take(t)) continue;
    double u = uniform(0, 1);
    double v = uniform(0, 1);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Eigen::Vector3d point = libmap::position_on(model.mesh, {t, u, v});
    const Eigen::Vector3d color = graspmap_test::texture_color(model, t, u, v).cast<double>();
    const Eigen::Vector3d right = truth(t, point);
    const Eigen::Vector3d error = (color - right).cwiseAbs();
    errors.mean += error.mean();
    errors.max = std::max(errors.max, error.maxCoeff());
    seen += color;
    wanted += right;
    ++errors.count;
  }
  errors.mean /= errors.count;
  errors.ratio = seen.cwiseQuotient(wanted);
  return errors;
}

// In the middle of the square, away from the border of the mesh, where photographs mix in black.
std::function<bool(std::uint32_t)> within(const TriangleMesh& mesh, double half) {
  return [&mesh, half](std::uint32_t t) {
    for (const std::uint32_t corner : mesh.triangles[t])
      if (mesh.vertices[corner].head<2>().cwiseAbs().maxCoeff() > half) return false;
    return true;
  };
}

bool is_neutral(const TextureResult& result, std::uint32_t t) {
  const auto& corners = result.model.texture_coordinates[t];
  return corners[0] == corners[1] && corners[1] == corners[2];
}

TEST(TextureModel, ColorsAreThoseOfTheSurface) {
  const TriangleMesh mesh = grid_mesh(40, 0.8, 0.0);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(6, 0.7, 0.9));
  for (const int views : {1, 3, 6}) {
    TextureOptions options;
    options.blend_views = views;
    const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses(), options);
    EXPECT_EQ(result.photos, 6U);
    EXPECT_EQ(result.seen_triangles, mesh.triangles.size());
    EXPECT_EQ(result.unseen_triangles, 0U);
    EXPECT_NEAR(result.seen_m2, 0.64, 1e-9);
    const ColorErrors errors = errors_of(result.model, marks, within(result.model.mesh, 0.37));
    EXPECT_LT(errors.mean, 0.8) << views;
    EXPECT_LT(errors.max, 6.0) << views;
    EXPECT_GT(errors.count, 2000);
  }
}

TEST(TextureModel, TexelsOfTheWantedSize) {
  const TriangleMesh mesh = grid_mesh(40, 0.8, 0.0);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(5, 0.5, 0.9));
  for (const double size : {0.002, 0.004, 0.01}) {
    TextureOptions options;
    options.atlas.texel_size_m = size;
    const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses(), options);
    EXPECT_NEAR(result.texel_size_m(), size, 0.03 * size);
    const ColorErrors errors = errors_of(result.model, marks, within(result.model.mesh, 0.37));
    EXPECT_LT(errors.mean, size < 0.009 ? 1.0 : 2.0) << size;
  }
}

TEST(TextureModel, LensesThatBend) {
  const TriangleMesh mesh = grid_mesh(40, 0.8, 0.0);
  libmap::Camera camera = small_camera();
  camera.distortion_model = libmap::DistortionModel::radial_tangential;
  camera.distortion = {-0.25, 0.08, 0.001, -0.002};
  const PaintedScan scan(mesh, marks, camera, circle_of_cameras(5, 0.5, 0.8));
  const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses());
  const ColorErrors errors = errors_of(result.model, marks, within(result.model.mesh, 0.37));
  EXPECT_LT(errors.mean, 0.8);
  EXPECT_LT(errors.max, 6.0);
}

TEST(TextureModel, EvensOutExposureAndCorners) {
  const TriangleMesh mesh = grid_mesh(40, 0.8, 0.0);
  PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(8, 0.4, 0.8));
  std::vector<Eigen::Vector3d> gains;
  spoil(scan, gains);
  const TextureResult evened = libmap::texture_mesh(mesh, scan, scan.poses());
  // The mean of all gains is not known.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& gain : gains) mean += gain.array().log().matrix() / 8.0;
  mean = mean.array().exp();
  for (std::size_t i = 0; i < gains.size(); ++i)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(static_cast<double>(evened.exposure.gains[i][c]), gains[i][c] / mean[c], 0.01);
  for (const double r2 : {0.1, 0.3, 0.5})
    EXPECT_NEAR(static_cast<double>(evened.exposure.factor(0, r2)[0] / evened.exposure.gains[0][0]),
                1.0 - 0.3 * r2, 0.02);
  const graspmap_test::Paint dimmed = [&](std::uint32_t t, const Eigen::Vector3d& point) {
    return marks(t, point).cwiseProduct(mean).eval();
  };
  const auto middle = within(evened.model.mesh, 0.37);
  EXPECT_LT(errors_of(evened.model, dimmed, middle).mean, 1.5);
  EXPECT_LT(evened.exposure.log_color_deviation, 0.3 * evened.exposure.log_color_deviation_before);

  TextureOptions options;
  options.exposure = {.gains = false, .vignetting = false};
  const TextureResult raw = libmap::texture_mesh(mesh, scan, scan.poses(), options);
  EXPECT_GT(errors_of(raw.model, dimmed, middle).mean, 5.0) << "it makes a difference";
}

// A red plate above the ground.
TriangleMesh ground_and_plate() {
  TriangleMesh plate = grid_mesh(12, 0.24, 0.25);
  return graspmap_test::join_meshes(grid_mesh(50, 1.0, 0.0), plate);
}
const std::uint32_t ground_triangles = 2 * 50 * 50;
// The ground has as much red as green.
const graspmap_test::Paint red_plate = [](std::uint32_t t, const Eigen::Vector3d& point) {
  const Eigen::Vector3d color = soft_marks(point);
  return t < ground_triangles ? Eigen::Vector3d(color.y(), color.y(), color.z())
                              : Eigen::Vector3d(250, 0, 0);
};

int red_places_on_ground(const TextureResult& result) {
  int count = 0;
  for (std::uint32_t t = 0; t < ground_triangles; ++t)
    for (const auto& [u, v] : {std::pair{0.33, 0.33}, {0.05, 0.05}, {0.9, 0.05}, {0.05, 0.9}}) {
      const Eigen::Vector3f color = graspmap_test::texture_color(result.model, t, u, v);
      count += !is_neutral(result, t) && color[0] - color[1] > 12.0F ? 1 : 0;
    }
  return count;
}

TEST(TextureModel, WhatIsHiddenDoesNotTakeTheColorOfWhatHidesIt) {
  const TriangleMesh mesh = ground_and_plate();
  const PaintedScan scan(mesh, red_plate, small_camera(), circle_of_cameras(6, 0.6, 1.0));
  const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses());
  EXPECT_EQ(red_places_on_ground(result), 0);
  // Everything hidden from some camera is seen by another one.
  EXPECT_LT(result.unseen_m2, 0.03);
  const ColorErrors errors = errors_of(result.model, red_plate, [&](std::uint32_t t) {
    return !is_neutral(result, t) && within(result.model.mesh, 0.45)(t) && t < ground_triangles;
  });
  EXPECT_LT(errors.mean, 1.5);

  // Rays alone find what is hidden, but not what is so near an edge that pixels mix.
  TextureOptions sharp;
  sharp.views.occlusion_margin_px = 0;
  EXPECT_LT(red_places_on_ground(libmap::texture_mesh(mesh, scan, scan.poses(), sharp)), 20);
  TextureOptions blind;
  blind.views.occlusion_tolerance_m = 10.0;
  EXPECT_GT(red_places_on_ground(libmap::texture_mesh(mesh, scan, scan.poses(), blind)), 50);
}

TEST(TextureModel, BesideWhatHidesItAnotherViewIsTaken) {
  const TriangleMesh mesh = ground_and_plate();
  const PaintedScan scan(mesh, red_plate, small_camera(), circle_of_cameras(6, 0.6, 1.0));
  libmap::Trajectory poses = scan.poses();
  // Poses are wrong by a few pixels.
  for (libmap::TrajectoryPose& pose : poses)
    pose.world_from_base =
        pose.world_from_base *
        libmap::make_pose_from_rpy({0, 0, 0}, {uniform(-1.0, 1.0), uniform(-1.0, 1.0), 0});
  TextureOptions options;
  options.blend_views = 1;
  options.views.occlusion_margin_px = 0;
  const int without = red_places_on_ground(libmap::texture_mesh(mesh, scan, poses, options));
  options.views.occlusion_margin_px = 5;
  const int with = red_places_on_ground(libmap::texture_mesh(mesh, scan, poses, options));
  EXPECT_GT(without, 10);
  EXPECT_LT(with, without / 5);
}

TEST(TextureModel, WhatNobodySeesIsGrayAndCounted) {
  const TriangleMesh mesh = ground_and_plate();
  // From straight above: the plate hides the ground below it.
  const PaintedScan scan(mesh, red_plate, small_camera(), {looking_at({0, 0, 1.5}, {0, 0, 0})});
  const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses());
  const double shadow = std::pow(0.24 * 1.5 / 1.25, 2);
  EXPECT_NEAR(result.unseen_m2, shadow, 0.25 * shadow);
  EXPECT_NEAR(result.unseen_m2 + result.seen_m2, 1.0 + 0.24 * 0.24, 1e-9);
  EXPECT_EQ(result.seen_triangles + result.unseen_triangles, mesh.triangles.size());
  std::size_t gray = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!is_neutral(result, t)) continue;
    ++gray;
    EXPECT_EQ(graspmap_test::texture_color(result.model, t, 0.2, 0.3),
              Eigen::Vector3f::Constant(128));
  }
  EXPECT_EQ(gray, result.unseen_triangles);
  // A mesh seen from below only has no front.
  const PaintedScan below(mesh, red_plate, small_camera(), {looking_at({0, 0, -1}, {0, 0, 0})});
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh(mesh, below, below.poses()); }),
                       {.about = "1 photograph"}));
}

TEST(TextureModel, AnySizeOfPages) {
  const TriangleMesh mesh = grid_mesh(40, 0.8, 0.0);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(5, 0.5, 0.9));
  for (const int size : {64, 65, 100, 333, 1024, 16384}) {
    for (const int max_pages : {0, 3}) {
      TextureOptions options;
      options.atlas.texture_size = size;
      options.atlas.max_pages = max_pages;
      const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses(), options);
      result.model.check();
      for (const libmap::ColorImage& page : result.model.pages) {
        EXPECT_LE(std::max(page.width, page.height), size);
        EXPECT_GT(std::min(page.width, page.height), 0);
      }
      EXPECT_LE(result.model.pages.size(), max_pages > 0 ? 3U : 1000U);
      EXPECT_EQ(result.atlas_scale<1.0, max_pages> 0 && size < 200) << size;
      const ColorErrors errors = errors_of(result.model, marks, within(result.model.mesh, 0.37));
      EXPECT_LT(errors.mean, result.atlas_scale < 1.0 ? 6.0 : 0.8) << size << " " << max_pages;
    }
  }
}

TEST(TextureModel, OneTriangleAndLargeOnes) {
  TriangleMesh mesh;
  mesh.vertices = {{-0.2, -0.2, 0}, {0.2, -0.2, 0}, {0, 0.2, 0}};
  mesh.triangles = {{0, 1, 2}};
  const TriangleMesh ground = grid_mesh(2, 1.2, 0.0);
  const PaintedScan scan(ground, marks, small_camera(), circle_of_cameras(4, 0.4, 0.9));
  for (const double side : {0.0, 0.05}) {
    TextureOptions options;
    options.max_side_m = side;
    const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses(), options);
    EXPECT_EQ(result.unseen_triangles, 0U);
    EXPECT_EQ(result.cut_triangles + 1, result.model.mesh.triangles.size());
    EXPECT_EQ(result.cut_triangles > 0, side > 0.0);
    EXPECT_LT(errors_of(result.model, marks, [](std::uint32_t) { return true; }).mean, 4.0);
    // Larger than a page: its texels are.
    options.atlas.texture_size = 64;
    const TextureResult small = libmap::texture_mesh(mesh, scan, scan.poses(), options);
    EXPECT_EQ(small.shrunk_charts, side > 0.0 ? 0U : 1U);
    EXPECT_EQ(small.split_charts > 0, side > 0.0);
  }
  // The whole ground is in no photograph as two pairs of triangles, but it is in pieces.
  TextureOptions whole;
  whole.max_side_m = 0.0;
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh(ground, scan, scan.poses(), whole); }),
                       {.about = "4 photographs"}));
  EXPECT_GT(libmap::texture_mesh(ground, scan, scan.poses()).seen_m2, 0.9);
}

TEST(TextureModel, GroundThatNoPhotographShowsStaysInLargeTriangles) {
  const PaintedScan scan(grid_mesh(2, 1.2, 0.0), marks, small_camera(),
                         circle_of_cameras(4, 0.4, 0.9));
  const double seen_m2 = libmap::texture_mesh(grid_mesh(2, 1.2, 0.0), scan, scan.poses()).seen_m2;
  const TextureResult wide = libmap::texture_mesh(grid_mesh(2, 2000.0, 0.0), scan, scan.poses());
  EXPECT_LT(wide.cut_triangles, 100000U) << "10^9 and more of 5 cm";
  EXPECT_GT(wide.seen_m2, 0.95 * seen_m2);
  EXPECT_LT(wide.texel_size_m(), 0.01);
}

TEST(TextureModel, SameForAnyThreadsAndOrderOfFrames) {
  const TriangleMesh mesh = ground_and_plate();
  const PaintedScan scan(mesh, red_plate, small_camera(), circle_of_cameras(5, 0.6, 1.0));
  libmap::TexturedMesh reference;
  std::vector<Eigen::Vector3f> gains;
  for (const unsigned threads : {1U, 2U, 5U}) {
    const libmap::ThreadLimit limit(threads);
    libmap::Trajectory poses = scan.poses();
    std::shuffle(poses.begin(), poses.end(), graspmap_test::random_engine());
    const TextureResult result = libmap::texture_mesh(mesh, scan, poses);
    if (threads == 1) {
      reference = result.model;
      gains = result.exposure.gains;
    }
    EXPECT_TRUE(result.exposure.gains == gains);
    EXPECT_TRUE(result.model.pages == reference.pages);
    EXPECT_TRUE(result.model.texture_coordinates == reference.texture_coordinates);
    EXPECT_TRUE(result.model.page_of_triangle == reference.page_of_triangle);
  }
}

// A scan without some of its photographs.
class GapScan : public PaintedScan {
 public:
  using PaintedScan::PaintedScan;
  libmap::RgbdFrame read_frame(int node, libmap::FrameParts parts = {}) const override {
    if (node == broken) throw libmap::Error("broken", {.file = "painted", .field = "node 2"});
    libmap::RgbdFrame frame = PaintedScan::read_frame(node, parts);
    if (without_color) frame.color = {};
    return frame;
  }
  bool without_color = false;
  int broken = 0;
};

TEST(TextureModel, FramesThatCannotBeUsed) {
  const TriangleMesh mesh = grid_mesh(20, 0.6, 0.0);
  GapScan scan(mesh, marks, small_camera(), circle_of_cameras(4, 0.4, 0.9));
  scan.broken = 2;
  libmap::Trajectory poses = scan.poses();
  poses[2].world_from_base.translation().x() = std::nan("");
  const TextureResult result = libmap::texture_mesh(mesh, scan, poses);
  EXPECT_EQ(result.photos, 2U);
  ASSERT_EQ(result.skipped.size(), 2U);
  EXPECT_EQ(result.skipped[0].first, 2);
  EXPECT_TRUE(is_error(result.skipped[0].second, {.file = "painted", .field = "node 2"}));
  EXPECT_EQ(result.skipped[0].second.context().file, "painted");
  EXPECT_TRUE(is_error(result.skipped[1].second, {.field = "node 3"}));
  TextureOptions strict;
  strict.strict = true;
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh(mesh, scan, poses, strict); }),
                       {.file = "painted", .field = "node 2"}));
  scan.without_color = true;
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh(mesh, scan, scan.poses()); }),
                       {.file = "painted", .about = "4 frames"}));
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::texture_mesh(mesh, scan, {}); }), {.file = "painted"}));
}

TEST(TextureModel, MeshesThatCannotBeTextured) {
  const TriangleMesh mesh = grid_mesh(20, 0.6, 0.0);
  const PaintedScan scan(mesh, marks, small_camera(), circle_of_cameras(3, 0.4, 0.9));
  TriangleMesh far = mesh;
  for (Eigen::Vector3d& vertex : far.vertices) vertex += Eigen::Vector3d(1000, 0, 0);
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh(far, scan, scan.poses()); }),
                       {.about = "3 photographs"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh({}, scan, scan.poses()); }),
                       {.field = "triangles of the mesh"}));
  TriangleMesh broken = mesh;
  broken.vertices[3].z() = std::nan("");
  EXPECT_TRUE(is_error(error_of([&] { libmap::texture_mesh(broken, scan, scan.poses()); }),
                       {.field = "vertices of the mesh"}));
  // Triangles without area, and triangles with a repeated vertex, are not seen.
  TriangleMesh slivers = mesh;
  slivers.triangles.push_back({0, 0, 5});
  slivers.triangles.push_back({0, 1, 2});
  TextureOptions options;
  options.max_side_m = 0.0;
  EXPECT_EQ(libmap::texture_mesh(slivers, scan, scan.poses(), options).unseen_triangles, 2U);
  options.atlas.texture_size = 63;
  EXPECT_EQ(
      error_of([&] { libmap::texture_mesh(mesh, scan, scan.poses(), options); }).context().field,
      "texture_size_px");
}

TEST(TextureModel, FarFromTheOrigin) {
  const Eigen::Vector3d place(500000, 4000000, 700);
  TriangleMesh mesh = grid_mesh(20, 0.6, 0.0);
  std::vector<libmap::Pose> cameras = circle_of_cameras(4, 0.4, 0.9);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex += place;
  for (libmap::Pose& camera : cameras) camera.translation() += place;
  const graspmap_test::Paint moved = [&](std::uint32_t, const Eigen::Vector3d& point) {
    return soft_marks(point - place);
  };
  const PaintedScan scan(mesh, moved, small_camera(), cameras);
  const TextureResult result = libmap::texture_mesh(mesh, scan, scan.poses());
  EXPECT_EQ(result.unseen_triangles, 0U);
  EXPECT_LT(errors_of(result.model, moved,
                      [&](std::uint32_t t) {
                        for (const std::uint32_t corner : result.model.mesh.triangles[t])
                          if ((result.model.mesh.vertices[corner] - place).norm() > 0.27)
                            return false;
                        return true;
                      })
                .mean,
            0.8);
}

}  // namespace texture_model_test
