#include "libmap/geometry/normal_sides.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/test_support.h"

namespace normal_sides_test {

using Eigen::Vector3d;
using Eigen::Vector3f;
using libmap::opposing_fraction;
using libmap::up_of_normals;
using libmap::UpOfNormals;

struct Oriented {
  std::vector<Vector3d> positions;
  std::vector<Vector3f> normals;
};

// Rolling ground of 2 x 2 m, z up.
Oriented ground() {
  Oriented made;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j) {
      const double x = i / 30.0, y = j / 30.0;
      made.positions.emplace_back(x, y, 0.2 * std::sin(4 * x) * std::cos(3 * y));
      made.normals.push_back(Vector3d(-0.8 * std::cos(4 * x) * std::cos(3 * y),
                                      0.6 * std::sin(4 * x) * std::sin(3 * y), 1.0)
                                 .normalized()
                                 .cast<float>());
    }
  return made;
}

Oriented ball() {
  Oriented made;
  for (int n = 0; n < 3000; ++n) {
    const double z = 1 - (2 * n + 1.0) / 3000, angle = n * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    made.positions.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    made.normals.push_back(made.positions.back().cast<float>());
  }
  return made;
}

UpOfNormals up_of(const std::vector<Vector3f>& normals) {
  std::vector<Vector3d> apart;
  for (std::size_t n = 0; n < normals.size(); ++n) apart.emplace_back(static_cast<double>(n), 0, 0);
  return up_of_normals(apart, normals);
}

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180 /
         std::numbers::pi;
}

TEST(UpOfNormals, DirectionOfGroundAndWalls) {
  using Normals = std::vector<Vector3f>;
  const Vector3d z = Vector3d::UnitZ();
  EXPECT_EQ(up_of({}).direction, z);
  EXPECT_FALSE(up_of({}).decided);
  EXPECT_EQ(up_of(Normals(5, Vector3f::Zero())).direction, z);
  EXPECT_EQ(up_of(Normals(5, Vector3f(0.1F, 0, 3))).direction, z) << "within 20 degrees";
  const Vector3f forward(0, 0.1F, -1);
  EXPECT_LT(degrees_between(up_of(Normals(5, forward)).direction, forward.cast<double>()), 1e-4);
  // A floor in a room: the walls cancel, except one that is as large as the floor.
  Normals room(1000, {1, 0, 0});
  room.insert(room.end(), 1000, {0, 0, 1});
  room.insert(room.end(), 1000, {0, 0, -1});
  room.insert(room.end(), 900, {0, 1, 0});
  EXPECT_LT(degrees_between(up_of(room).direction, {1, 0, 0}), 1);
  Normals everywhere;
  for (int n = 0; n < 999; ++n) {
    const double angle = n * 2 * std::numbers::pi / 999;
    everywhere.emplace_back(static_cast<float>(std::cos(angle)),
                            static_cast<float>(std::sin(angle)), 0.1F);
  }
  EXPECT_EQ(up_of(everywhere).direction, z);
  EXPECT_EQ(up_of({{std::numeric_limits<float>::quiet_NaN(), 0, 0}}).direction, z);
}

// Also upside down, as a cloud in the frame of a camera.
TEST(UpOfNormals, OrientedNormalsDecide) {
  Oriented made = ground();
  UpOfNormals up = up_of_normals(made.positions, made.normals);
  EXPECT_TRUE(up.decided);
  EXPECT_EQ(up.fraction, 1.0);
  EXPECT_LT(up.opposing, 0.01);
  for (Vector3f& normal : made.normals) normal = -normal;
  up = up_of_normals(made.positions, made.normals);
  EXPECT_TRUE(up.decided);
  EXPECT_LT(up.direction.z(), -0.9);
}

TEST(UpOfNormals, RandomSidesDoNotDecide) {
  for (int draw = 0; draw < 10; ++draw) {
    Oriented made = ground();
    for (Vector3f& normal : made.normals)
      if (graspmap_test::uniform(0, 1) < 0.5) normal = -normal;
    const UpOfNormals up = up_of_normals(made.positions, made.normals);
    EXPECT_FALSE(up.decided);
    EXPECT_EQ(up.direction, Vector3d::UnitZ());
    EXPECT_NEAR(up.fraction, 0.5, 0.05);
    EXPECT_NEAR(up.opposing, 0.5, 0.05);
  }
}

// Patches of one side each, as from eigenvector solvers: the majority is random.
TEST(UpOfNormals, PatchesOfBothSidesDoNotDecide) {
  Oriented made = ground();
  for (std::size_t n = 0; n < made.normals.size(); ++n)
    if (made.positions[n].x() > 0.5) made.normals[n] = -made.normals[n];
  const UpOfNormals up = up_of_normals(made.positions, made.normals);
  EXPECT_FALSE(up.decided);
  EXPECT_EQ(up.direction, Vector3d::UnitZ());
  EXPECT_NEAR(up.fraction, 0.75, 0.05);
}

// The normals of a closed surface sum to zero, but neighbors agree.
TEST(UpOfNormals, ClosedSurfacesDoNotDecide) {
  const Oriented made = ball();
  const UpOfNormals up = up_of_normals(made.positions, made.normals);
  EXPECT_FALSE(up.decided);
  EXPECT_EQ(up.direction, Vector3d::UnitZ());
  EXPECT_NEAR(up.fraction, 0.5, 0.01);
  EXPECT_EQ(up.opposing, 0.0);
}

TEST(OpposingShare, SkipsWhatIsNoDirectionAndCreases) {
  EXPECT_EQ(opposing_fraction({}, {}), 0.0);
  Oriented made = ground();
  for (std::size_t n = 0; n < made.normals.size(); n += 3) made.normals[n] = Vector3f::Zero();
  for (std::size_t n = 1; n < made.normals.size(); n += 3)
    made.positions[n].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(opposing_fraction(made.positions, made.normals), 0.0);
  // Pairs of points, each far from the others: two faces of an edge, two sides of a sheet.
  Oriented edges, sheets;
  for (int n = 0; n < 200; ++n)
    for (const double beside : {0.0, 0.01}) {
      edges.positions.emplace_back(n, beside, 0);
      edges.normals.push_back(beside > 0 ? Vector3f(0.9F, 0, -0.5F) : Vector3f(0, 0, 1));
      sheets.normals.emplace_back(0, 0, beside > 0 ? -1 : 1);
    }
  EXPECT_EQ(opposing_fraction(edges.positions, edges.normals), 0.0);
  EXPECT_GT(opposing_fraction(edges.positions, sheets.normals), 0.3);
  sheets.normals.resize(20);
  EXPECT_EQ(opposing_fraction(edges.positions, sheets.normals), 0.0) << "too few to say";
}

}  // namespace normal_sides_test
