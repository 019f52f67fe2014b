// Bounds, smoothness and fixed values of noise and textures.
#include "libmap/scenes/solid_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "libmap/simulate/rock_texture.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace solid_noise_test {

using graspmap_test::uniform;

Eigen::Vector3d somewhere(double size) {
  return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
}

TEST(SolidNoise, VanishesOnTheLatticeAndStaysWithinOne) {
  for (int n = 0; n < 50; ++n) {
    const Eigen::Vector3d corner = somewhere(1000.0).array().round();
    EXPECT_EQ(gradient_noise(corner, 7), 0.0);
  }
  double largest = 0.0;
  for (int n = 0; n < 100'000; ++n)
    largest = std::max(largest, std::abs(gradient_noise(somewhere(1000.0), 7)));
  EXPECT_LE(largest, 1.0);
  EXPECT_GT(largest, 0.7);
}

TEST(SolidNoise, IsContinuousAcrossCellsWithABoundedSlope) {
  constexpr double step = 1e-6;
  for (int n = 0; n < 20'000; ++n) {
    Eigen::Vector3d point = somewhere(50.0);
    if (n % 2 == 0) point.x() = std::round(point.x()) - 0.5 * step;  // the step crosses a cell
    const Eigen::Vector3d next = point + step * Eigen::Vector3d::UnitX();
    EXPECT_LE(std::abs(gradient_noise(next, 3) - gradient_noise(point, 3)), 3.5 * step);
    EXPECT_LE(std::abs(fractal_noise(next, 3, 4) - fractal_noise(point, 3, 4)), 4 * 3.5 * step);
  }
}

TEST(SolidNoise, SeedsAreUnlikeAndTheMeanIsZero) {
  double sum = 0.0;
  double product = 0.0;
  double square = 0.0;
  for (int n = 0; n < 50'000; ++n) {
    const Eigen::Vector3d point = somewhere(200.0);
    const double a = gradient_noise(point, 1);
    sum += a;
    product += a * gradient_noise(point, 2);
    square += a * a;
  }
  EXPECT_LT(std::abs(sum / 50'000), 0.01);
  EXPECT_LT(std::abs(product / square), 0.05);
}

// All 27 cells, slowly, from the definition: the nearest of the points seen from within half a
// cell.
TEST(SolidNoise, CellDistanceIsThatToOneFeaturePoint) {
  for (int n = 0; n < 2000; ++n) {
    const Eigen::Vector3d point = somewhere(20.0);
    const CellNoise cell = cell_noise(point, 9);
    if (cell.distance >= 0.5) continue;
    // Moving by less than the distance can come nearer by that much at most; the same feature point
    // answers for every point nearer to it.
    const Eigen::Vector3d moved = point + somewhere(0.02);
    const CellNoise again = cell_noise(moved, 9);
    EXPECT_LE(std::abs(again.distance - cell.distance), (moved - point).norm() + 1e-12);
  }
}

// Earlier files remain reproducible.
TEST(SolidNoise, KeepsItsValues) {
  EXPECT_EQ(mix_bits(1, 2), mix_bits(1, 2));
  EXPECT_NE(mix_bits(1, 2), mix_bits(2, 1));
  EXPECT_NEAR(gradient_noise({0.3, 1.7, -2.2}, 5), -0.60474682991672324, 1e-15);
  EXPECT_NEAR(unit_noise(3, 4), 0.49177426382716749, 1e-15);
}

double contrast(const std::function<Color(const Eigen::Vector3d&)>& color, double size) {
  // Standard deviation of gray in a square of that size, mean over places.
  double total = 0.0;
  for (int place = 0; place < 40; ++place) {
    const Eigen::Vector3d corner = somewhere(2.0);
    double sum = 0.0;
    double squares = 0.0;
    for (int i = 0; i < 100; ++i) {
      const Color c = color(corner + size * Eigen::Vector3d(i % 10, i / 10, 0.0) / 10.0);
      const double gray = 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2];
      sum += gray;
      squares += gray * gray;
    }
    total += std::sqrt(std::max(0.0, squares / 100.0 - sum * sum / 1e4));
  }
  return total / 40.0;
}

TEST(RockTexture, HasContrastInEveryFiveCentimeters) {
  const auto rock = [](const Eigen::Vector3d& p) { return rock_color(p, 1); };
  const auto soil = [](const Eigen::Vector3d& p) { return soil_color(p, 1); };
  EXPECT_GT(contrast(rock, 0.05), 15.0);
  EXPECT_GT(contrast(soil, 0.05), 10.0);
  // A texture, not white noise: a millimeter changes little.
  EXPECT_LT(contrast(rock, 0.001), 0.3 * contrast(rock, 0.05));
}

TEST(RockTexture, StonesDiffer) {
  std::set<Color> colors;
  for (std::uint64_t seed = 0; seed < 20; ++seed) colors.insert(rock_color({0.1, 0.2, 0.3}, seed));
  EXPECT_GT(colors.size(), 15U);
}

}  // namespace solid_noise_test
}  // namespace libmap
