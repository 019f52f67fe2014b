// Tests ground with errors: its random draws and their effect on the trials.
#include "libgtd/grasp/surface_error.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "libgtd/grasp/grasp_table.h"
#include "libgtd/grasp/grasp_trials.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace surface_error_test {

using grasp_test::gripper;
using grasp_test::height_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libgtd::Ground;
using libgtd::GroundErrors;
using libgtd::GroundPatch;

const Eigen::AlignedBox3d no_box;

TEST(SurfaceError, FieldHasItsDeviationAndCorrelation) {
  constexpr double length = 0.02;
  constexpr int draws = 20000;
  const Eigen::Vector3d place(0.0371, -0.12, 0.4);
  double mean = 0.0;
  double square = 0.0;
  std::array<double, 4> products{};
  const std::array<double, 4> lags = {0.5, 1.0, 2.0, 5.0};
  for (int n = 0; n < draws; ++n) {
    libgtd::RandomField field(length, 3, static_cast<std::uint64_t>(n), no_box);
    const double here = field.at(place);
    mean += here / draws;
    square += here * here / draws;
    for (std::size_t lag = 0; lag < lags.size(); ++lag)
      products[lag] +=
          here * field.at(place + lags[lag] * length * Eigen::Vector3d::UnitY()) / draws;
  }
  constexpr double tolerance = 0.025;  // three and a half standard errors
  EXPECT_NEAR(mean, 0.0, tolerance);
  EXPECT_NEAR(square, 1.0, 1.5 * tolerance);
  // Along an axis, for positions t and t + 1: mean of t (1 - t) / (t^2 + (1 - t)^2).
  EXPECT_NEAR(products[1], std::numbers::pi / 4 - 0.5, tolerance);
  EXPECT_GT(products[0], products[1] + 0.2);
  EXPECT_NEAR(products[2], 0.0, tolerance);
  EXPECT_NEAR(products[3], 0.0, tolerance);
}

TEST(SurfaceError, FieldIsContinuousAndTheSameOutsideOfItsBox) {
  const Eigen::AlignedBox3d box(Eigen::Vector3d(-0.1, -0.1, -0.1), Eigen::Vector3d(0.1, 0.1, 0.1));
  libgtd::RandomField with_box(0.02, 1, 2, box);
  libgtd::RandomField without(0.02, 1, 2, no_box);
  libgtd::RandomField other(0.02, 1, 3, box);
  double before = without.at({-0.3, 0.01, 0.02});
  for (double x = -0.3; x < 0.3; x += 0.0001) {
    const double here = without.at({x, 0.01, 0.02});
    EXPECT_EQ(with_box.at({x, 0.01, 0.02}), here);
    EXPECT_NEAR(here, before, 0.06);
    before = here;
  }
  EXPECT_NE(other.at({0, 0, 0}), without.at({0, 0, 0}));
  EXPECT_TRUE(std::isfinite(without.at({1e300, 0, -1e300})));
}

// A plane with a slope of 45 degrees: vertices move along its normal.
TEST(SurfaceError, DisplacesAlongTheNormalByTheError) {
  const auto mesh = height_mesh(0.1, 20, [](double x, double) { return -x; });
  GroundErrors errors;
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    errors.vertex_errors_m.push_back(vertex.y() < 0 ? 0.001 : 0.003);
  errors.is_unscanned.assign(mesh.triangles.size(), 0);
  const Ground ground(mesh, errors);
  const GroundPatch patch = ground.patch({0, 0, 0}, Eigen::Vector3d::UnitZ(), 0.05, 0.05);
  ASSERT_EQ(patch.vertex_errors_m.size(), patch.vertices.size());
  ASSERT_EQ(patch.is_unscanned.size(), patch.triangles.size());
  const Eigen::Vector3d normal = Eigen::Vector3d(1, 0, 1).normalized();
  std::array<double, 2> squares{};
  std::array<int, 2> counts{};
  for (std::uint64_t key = 0; key < 300; ++key) {
    const GroundPatch drawn = libgtd::displace_vertices(patch, 0.02, 1, key);
    ASSERT_EQ(drawn.triangles, patch.triangles);
    for (std::size_t n = 0; n < patch.vertices.size(); ++n) {
      const Eigen::Vector3d moved = drawn.vertices[n] - patch.vertices[n];
      EXPECT_LT((moved - moved.dot(normal) * normal).norm(), 1e-12);
      const std::size_t side = patch.vertices[n].y() < 0 ? 0 : 1;
      squares[side] += moved.squaredNorm();
      ++counts[side];
    }
    const auto& [a, b, c] = drawn.triangles[0];
    EXPECT_EQ(drawn.centers[0], (drawn.vertices[a] + drawn.vertices[b] + drawn.vertices[c]) / 3.0);
  }
  EXPECT_NEAR(std::sqrt(squares[0] / counts[0]), 0.001, 5e-5);
  EXPECT_NEAR(std::sqrt(squares[1] / counts[1]), 0.003, 1.5e-4);
}

libgtd::GraspOptions options_of(double load_n) {
  libgtd::GraspOptions options;
  options.poses = 40;
  options.draws = 1;
  options.best_draws = 0;
  options.offset_m = options.tilt_deg = 0;
  options.closing.max_unseen = 1;
  options.load_n = load_n;
  return options;
}

std::vector<libgtd::LocationResult> test_on(const Ground& ground,
                                            const libgtd::GraspOptions& options) {
  return libgtd::test_grasps(ground, grasp_test::with_lean(gripper(), 60), {{0, 0, -0.002}},
                             options, libmap::no_progress());
}

libmap::TriangleMesh cone() {
  const double fall = std::tan(35 * libmap::radians_per_degree);
  std::vector<Eigen::Vector2d> profile;
  for (int n = 0; n < 60; ++n) profile.emplace_back(0.001 + 0.005 * n, -fall * 0.005 * n);
  return grasp_test::revolved(profile, 120);
}

std::string text_of(const std::vector<libgtd::LocationResult>& results) {
  std::string text;
  for (const std::string& cell : libgtd::grasp_cells(results.front())) text += cell + ",";
  return text;
}

TEST(SurfaceError, NoneIsTheSameToTheBit) {
  const auto mesh = cone();
  libgtd::GraspOptions options = options_of(10);
  options.offset_m = 0.005;
  const std::string without = text_of(test_on(Ground(mesh), options));
  const GroundErrors zero{std::vector<double>(mesh.vertices.size(), 0.0),
                          std::vector<std::uint8_t>(mesh.triangles.size(), 0)};
  EXPECT_EQ(text_of(test_on(Ground(mesh, zero), options)), without);
  EXPECT_EQ(text_of(test_on(Ground(mesh, libgtd::constant_error(mesh, 0.0, {})), options)),
            without);
  const Ground known(mesh, libgtd::constant_error(mesh, 0.001, {}));
  const std::string with = text_of(test_on(known, options));
  EXPECT_NE(with, without);
  EXPECT_EQ(text_of(test_on(known, options)), with);
}

// A location that narrowly holds or fails on the exact surface is uncertain on a surface with
// errors, increasingly with the error.
TEST(SurfaceError, MarginalPlacesMoveTowardOneHalf) {
  const auto mesh = cone();
  const auto exact = test_on(Ground(mesh), options_of(10)).front();
  ASSERT_NEAR(exact.force_n[0], exact.force_n[2], 0.01 * exact.force_n[0]);
  const auto probability = [&](double load_n, double error_m) {
    return test_on(Ground(mesh, libgtd::constant_error(mesh, error_m, {})), options_of(load_n))
        .front()
        .hold_probability;
  };
  const double load = exact.force_n[1];
  EXPECT_EQ(probability(0.97 * load, 0), 1.0);
  EXPECT_EQ(probability(1.03 * load, 0), 0.0);
  EXPECT_LT(probability(0.97 * load, 0.001), 0.95);
  EXPECT_GT(probability(0.6 * load, 0.0002), 0.9);
  EXPECT_GE(probability(0.6 * load, 0.0002), probability(0.6 * load, 0.002));
  EXPECT_GT(probability(1.03 * load, 0.001), 0.02);
}

TEST(SurfaceError, UnsureGroundIsUnseen) {
  auto mesh = height_mesh(0.4, 80, [](double, double) { return 0.0; });
  EXPECT_EQ(error_of([&] { libgtd::errors_of(mesh, {}); }).context().field, "expected_error");
  std::vector<double> errors(mesh.vertices.size(), 0.001);
  mesh.vertex_fields.push_back({"expected_error", libmap::ScalarType::float32, errors});
  std::vector<double>& of_vertex = mesh.vertex_fields[0].values;
  libgtd::GraspOptions options = options_of(10);
  options.closing.max_unseen = 0.1;
  const auto unseen = [&] {
    const Ground ground(mesh, libgtd::errors_of(mesh, {}));
    return libgtd::test_grasps(ground, grasp_test::with_lean(gripper(), 60), {{0, 0, 0}}, options,
                               libmap::no_progress())
        .front();
  };
  EXPECT_EQ(unseen().unseen, 0.0);
  // Beyond a line through the location.
  for (const double error : {0.0051, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    for (std::size_t n = 0; n < of_vertex.size(); ++n)
      of_vertex[n] = mesh.vertices[n].x() > 0 ? error : 0.001;
    const libgtd::LocationResult half = unseen();
    EXPECT_NEAR(half.unseen, 0.5, 0.1);
    EXPECT_EQ(half.outcomes[static_cast<std::size_t>(libgtd::TrialOutcome::unseen)], half.trials);
  }
  of_vertex = errors;
  mesh.face_fields.push_back(
      {"filled", libmap::ScalarType::uint8, std::vector<double>(mesh.triangles.size(), 1.0)});
  EXPECT_NEAR(unseen().unseen, 1.0, 1e-12);
  mesh.face_fields.clear();
  of_vertex[7] = -1e-9;
  EXPECT_EQ(error_of([&] { libgtd::errors_of(mesh, {}); }).context().field,
            "expected_error of vertex 7");
  EXPECT_TRUE(is_error(error_of([&] {
                         Ground(mesh, {{0.1}, {}});
                       }),
                       {.field = "errors of the mesh"}));
}

}  // namespace surface_error_test
