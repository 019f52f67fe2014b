// Images and cameras for MeshLab: files, content of the images, and selection of views.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "libmap/camera/color_image.h"
#include "libmap/scan/image_export.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace bundler_io_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using graspmap_test::uniform;

Camera some_camera() {
  Camera camera;
  camera.width = 200;
  camera.height = 150;
  camera.fx = 180;
  camera.fy = 176;
  camera.cx = 103.3;
  camera.cy = 71.8;
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = {0.12, -0.2, 0.002, -0.001, 0.03};
  return camera;
}

Pose random_pose() {
  return make_pose_from_rpy({uniform(-2, 2), uniform(-2, 2), uniform(-2, 2)},
                            {uniform(-180, 180), uniform(-80, 80), uniform(-180, 180)});
}

// Bundler's projection by the text: pixels from the image's center, y up.
struct BundlerCamera {
  double f = 0, k1 = 0, k2 = 0;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;

  Eigen::Vector2d project(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d in_camera = rotation * point + translation;
    const Eigen::Vector2d p = -in_camera.head<2>() / in_camera.z();
    const double r2 = p.squaredNorm();
    return f * (1 + k1 * r2 + k2 * r2 * r2) * p;
  }
};

std::vector<BundlerCamera> read_bundle(const std::string& text) {
  std::istringstream lines(text);
  std::string header;
  std::getline(lines, header);
  EXPECT_EQ(header, "# Bundle file v0.3");
  std::size_t count = 0;
  int points = -1;
  lines >> count >> points;
  EXPECT_EQ(points, 0);
  std::vector<BundlerCamera> cameras(count);
  for (BundlerCamera& camera : cameras) {
    lines >> camera.f >> camera.k1 >> camera.k2;
    for (int n = 0; n < 9; ++n) lines >> camera.rotation(n / 3, n % 3);
    for (int n = 0; n < 3; ++n) lines >> camera.translation(n);
  }
  EXPECT_TRUE(lines.good());
  std::string rest;
  lines >> rest;
  EXPECT_EQ(rest, "");
  return cameras;
}

TEST(Bundler, PointsFallOnTheirPixels) {
  std::vector<BundlerView> views;
  for (int n = 0; n < 5; ++n)
    views.push_back(
        {"images/" + std::to_string(n) + ".jpg", centered_pinhole(some_camera()), random_pose()});
  const std::vector<BundlerCamera> cameras = read_bundle(to_bundle_text(views));
  ASSERT_EQ(cameras.size(), views.size());
  for (std::size_t n = 0; n < views.size(); ++n) {
    EXPECT_NEAR(cameras[n].rotation.determinant(), 1.0, 1e-12);
    for (int k = 0; k < 100; ++k) {
      const Eigen::Vector3d in_camera(uniform(-0.5, 0.5), uniform(-0.4, 0.4), 1.3);
      const Eigen::Vector2d pixel = *project_point(views[n].camera, in_camera);
      const Eigen::Vector2d found = cameras[n].project(views[n].world_from_camera * in_camera);
      // Pixel centers have whole coordinates: the center of 200 columns is 99.5.
      EXPECT_NEAR(found.x(), pixel.x() - (views[n].camera.width - 1) / 2.0, 1e-9);
      EXPECT_NEAR(-found.y(), pixel.y() - (views[n].camera.height - 1) / 2.0, 1e-9);
    }
  }
  EXPECT_EQ(to_bundler_list({views[0], views[1]}), "images/0.jpg\nimages/1.jpg\n");
  EXPECT_EQ(to_bundle_text({}), "# Bundle file v0.3\n0 0\n");
}

// A smooth image whose color is a function of the position.
ColorImage smooth_image(int width, int height) {
  ColorImage image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at(x, y) = {static_cast<std::uint8_t>(20 + x), static_cast<std::uint8_t>(30 + y),
                        static_cast<std::uint8_t>(60 + (x + y) / 3)};
  return image;
}

TEST(PinholeImage, ShowsWhatTheLensShowed) {
  for (const bool fisheye : {false, true}) {
    Camera lens = some_camera();
    if (fisheye) {
      lens.distortion_model = DistortionModel::equidistant;
      lens.distortion = {0.02, -0.01, 0.003, 0.0};
    }
    const ColorImage photo = smooth_image(lens.width, lens.height);
    const Camera pinhole = centered_pinhole(lens);
    EXPECT_FALSE(pinhole.is_distorted());
    EXPECT_EQ(pinhole.fx, pinhole.fy);
    const ColorImage resampled = resample_image(photo, lens, pinhole);
    ASSERT_EQ(resampled.width, pinhole.width);
    EXPECT_GT(pinhole.width, 150);
    EXPECT_GT(pinhole.height, 100);
    for (int y = 0; y < pinhole.height; ++y)
      for (int x = 0; x < pinhole.width; ++x) {
        const Eigen::Vector3d ray((x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy, 1);
        const Eigen::Vector2d at = *project_point(lens, ray);
        // Every pixel is from a position inside the source image.
        ASSERT_GE(at.minCoeff(), -1e-6);
        ASSERT_LE(at.x(), lens.width - 1 + 1e-6);
        ASSERT_LE(at.y(), lens.height - 1 + 1e-6);
        ASSERT_NEAR(resampled.at(x, y)[0], 20 + at.x(), 0.7);
        ASSERT_NEAR(resampled.at(x, y)[1], 30 + at.y(), 0.7);
      }
    // The next larger image would not fit.
    const auto fits = [&](int width, int height) {
      for (const double x : {-(width - 1) / 2.0, 0.0, (width - 1) / 2.0})
        for (const double y : {-(height - 1) / 2.0, 0.0, (height - 1) / 2.0}) {
          const Eigen::Vector2d at = *project_point(lens, {x / pinhole.fx, y / pinhole.fy, 1.0});
          if (at.minCoeff() < 0 || at.x() > lens.width - 1 || at.y() > lens.height - 1)
            return false;
        }
      return true;
    };
    EXPECT_TRUE(fits(pinhole.width, pinhole.height));
    EXPECT_FALSE(fits(pinhole.width + 12, pinhole.height) &&
                 fits(pinhole.width, pinhole.height + 12));
  }
}

TEST(PinholeImage, PixelsThatOnlyMoveAreKept) {
  Camera camera;
  camera.width = 64;
  camera.height = 48;
  camera.fx = camera.fy = 50;
  ColorImage photo(64, 48);
  for (Color& color : photo.pixels)
    for (std::uint8_t& channel : color) channel = static_cast<std::uint8_t>(random_engine()());
  struct Case {
    double cx, cy;
    int width, height, left, top;
  };
  for (const Case& c : {Case{31.5, 23.5, 64, 48, 0, 0}, Case{32, 24, 63, 47, 1, 1},
                        Case{30, 20.5, 61, 42, 0, 0}, Case{40, 30, 47, 35, 17, 13}}) {
    camera.cx = c.cx;
    camera.cy = c.cy;
    const Camera centered = centered_pinhole(camera);
    ASSERT_EQ(centered.width, c.width);
    ASSERT_EQ(centered.height, c.height);
    const ColorImage part = resample_image(photo, camera, centered);
    for (int y = 0; y < c.height; ++y)
      for (int x = 0; x < c.width; ++x) ASSERT_EQ(part.at(x, y), photo.at(x + c.left, y + c.top));
  }
}

// The larger focal length would extend the image beyond the range of int along the other axis.
TEST(PinholeImage, PixelsFarFromSquareTakeNoMoreThanTheImageHas) {
  Camera camera;
  camera.width = camera.height = 64;
  camera.fx = 1;
  camera.fy = 1e9;
  camera.cx = camera.cy = 31.5;
  const Camera pinhole = centered_pinhole(camera);
  EXPECT_EQ(pinhole.width, 2 * camera.width + 1);
  EXPECT_LE(pinhole.height, 2 * camera.height + 1);
}

TEST(PinholeImage, CamerasWithoutAnAxisInTheirImage) {
  Camera camera = some_camera();
  camera.cx = -20;
  EXPECT_TRUE(is_error(error_of([&] { centered_pinhole(camera); }),
                       {.field = "principal point", .value = "-20, 71.8"}));
  camera.fx = 0;
  EXPECT_TRUE(is_error(error_of([&] { centered_pinhole(camera); }),
                       {.field = "fx", .value = "0", .bound = "1e-06 to 1e+09"}));
  EXPECT_TRUE(is_error(error_of([] {
                         resample_image(ColorImage(20, 20), some_camera(),
                                        centered_pinhole(some_camera()));
                       }),
                       {.field = "size", .value = "20 x 20", .bound = "200 x 150"}));
}

bool resemble(const Pose& a, const Pose& b, double radius_m, double angle_deg) {
  const double cosine = std::clamp(a.linear().col(2).dot(b.linear().col(2)), -1.0, 1.0);
  return (a.translation() - b.translation()).norm() < radius_m &&
         std::acos(cosine) * 180 / M_PI < angle_deg;
}

TEST(ViewSelection, KeepsNoTwoAlikeAndOneForEachLeftOut) {
  std::vector<Pose> poses;
  std::vector<double> qualities;
  for (int n = 0; n < 400; ++n) {
    poses.push_back(make_pose_from_rpy({uniform(-1, 1), uniform(-1, 1), 0},
                                       {uniform(-40, 40), uniform(-40, 40), uniform(-180, 180)}));
    qualities.push_back(uniform(0, 1));
  }
  const std::vector<std::size_t> kept = select_views(poses, qualities);
  EXPECT_LT(kept.size(), 100U);
  EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
  for (const std::size_t a : kept)
    for (const std::size_t b : kept)
      if (a != b) {
        ASSERT_FALSE(resemble(poses[a], poses[b], 0.5, 30));
      }
  for (std::size_t n = 0; n < poses.size(); ++n)
    ASSERT_TRUE(std::any_of(kept.begin(), kept.end(), [&](std::size_t k) {
      return k == n || (resemble(poses[n], poses[k], 0.5, 30) && qualities[k] > qualities[n]);
    })) << n;
  // The order of the views does not matter.
  std::vector<Pose> reversed(poses.rbegin(), poses.rend());
  std::vector<std::size_t> again = select_views(reversed, {qualities.rbegin(), qualities.rend()});
  for (std::size_t& n : again) n = poses.size() - 1 - n;
  std::reverse(again.begin(), again.end());
  EXPECT_EQ(again, kept);
  // A rotation about the optical axis does not add a view.
  const Pose turned = poses[0] * make_pose_from_rpy({0, 0, 0}, {0, 0, 90});
  EXPECT_EQ(select_views({poses[0], turned}, {1, 1}), std::vector<std::size_t>{0});
  EXPECT_EQ(select_views({poses[0], turned}, {1, 2}), std::vector<std::size_t>{1});
}

TEST(ViewSelection, LimitsOfItsOptions) {
  const std::vector<Pose> poses = {Pose::Identity(), make_pose_from_rpy({0.3, 0, 0}, {0, 0, 0}),
                                   make_pose_from_rpy({0, 0, 0}, {0, 25, 0})};
  const std::vector<double> same = {0, 0, 0};
  using Indices = std::vector<std::size_t>;
  EXPECT_EQ(select_views(poses, same), Indices{0});
  EXPECT_EQ(select_views(poses, same, {.radius_m = 0.2}), (Indices{0, 1}));
  EXPECT_EQ(select_views(poses, same, {.angle_deg = 20}), (Indices{0, 2}));
  EXPECT_EQ(select_views(poses, same, {.radius_m = 0}), (Indices{0, 1, 2}));
  EXPECT_EQ(select_views({}, {}), Indices{});
}

TEST(ImageSharpness, BlurLowersItContrastDoesNot) {
  ColorImage sharp(80, 60);
  for (Color& color : sharp.pixels) color.fill(static_cast<std::uint8_t>(random_engine()() % 200));
  ColorImage blurred = sharp;
  ColorImage pale = sharp;
  for (int y = 1; y < 59; ++y)
    for (int x = 1; x < 79; ++x) {
      int sum = 0;
      for (int n = 0; n < 9; ++n) sum += sharp.at(x + n % 3 - 1, y + n / 3 - 1)[0];
      blurred.at(x, y).fill(static_cast<std::uint8_t>(sum / 9));
    }
  for (Color& color : pale.pixels) color.fill(static_cast<std::uint8_t>(50 + color[0] / 2));
  EXPECT_LT(image_sharpness(blurred), 0.6 * image_sharpness(sharp));
  EXPECT_NEAR(image_sharpness(pale) / image_sharpness(sharp), 1.0, 0.02);
  EXPECT_EQ(image_sharpness(ColorImage(80, 60, {9, 9, 9})), 0.0);
  EXPECT_EQ(image_sharpness(ColorImage(4, 60)), 0.0);
}

}  // namespace bundler_io_test
}  // namespace libmap
