#include "libmap/features/bundle_residuals.h"

#include <gtest/gtest.h>

#include "tests/libmap/features/synthetic_features.h"

namespace bundle_residuals_test {

using graspmap_test::see_points;
using graspmap_test::uniform;
using libmap::CalibratedObservation;
using libmap::FrameFeatures;
using libmap::Pose;
using libmap::Vector6d;

Vector6d random_six() {
  Vector6d six;
  for (int n = 0; n < 6; ++n) six[n] = uniform(-1.0, 1.0);
  return six;
}

// Parameters of an observation in one vector: step of the pose, motion, point, and camera
// parameters with four spline coefficients.
constexpr Eigen::Index motion_at = 6;
constexpr Eigen::Index point_at = 12;
constexpr Eigen::Index camera_at = 15;
constexpr Eigen::Index spline_at = camera_at + libmap::spline_at;
using Unknowns = Eigen::Matrix<double, spline_at + 4, 1>;

libmap::CalibratedResidual seen_at(const libmap::CalibratedFeature& feature, const Pose& pose,
                                   const Unknowns& at) {
  libmap::CalibratedResidual seen;
  EXPECT_TRUE(feature.evaluate(libmap::moved(pose, at.head<6>()), at.segment<6>(motion_at),
                               at.data() + camera_at, at.segment<3>(point_at), seen, true));
  return seen;
}

// Derivatives by central differences.
TEST(CalibratedFeature, DerivativesAreThoseOfDifferences) {
  const libmap::Camera camera = graspmap_test::feature_camera();
  const FrameFeatures frame = see_points(1, Pose::Identity(), {{1.6, 0.3, -0.2}});
  CalibratedObservation calibrated{true, true, true, true};
  calibrated.terms = {0, {0.1, 0.4, 0.4, 0.1}, {0.3, 0.09, 0.5}};
  calibrated.by_step = random_six();
  calibrated.known_step = 0.01 * random_six();
  calibrated.image_row_fraction = 0.37;
  const libmap::CalibratedFeature feature(frame.features[0], camera, calibrated);
  const Pose pose = libmap::make_pose({0.02, -0.01, 0.03}, libmap::rotation_of({0.05, -0.08, 0.1}));
  Unknowns at = Unknowns::Zero();
  at.segment<6>(motion_at) << 0.5, -0.3, 0.2, 0.4, -0.6, 0.3;
  at.segment<3>(point_at) << 1.61, 0.28, -0.19;
  at.segment<libmap::spline_at>(camera_at) << 0.01, -0.02, 3.0, -2.0, 0.002, -0.001, 0.003, 0.004,
      0.001, -0.002, 0.012, 0.02, 0.004, -0.002, 0.001;
  at.tail<4>() << 0.001, 0.002, -0.001, 0.003;
  const libmap::CalibratedResidual seen = seen_at(feature, pose, at);
  Eigen::Matrix<double, 3, Unknowns::SizeAtCompileTime> found;
  found << seen.by_pose, seen.by_motion, seen.by_point, seen.by_camera,
      Eigen::Matrix<double, 3, 4>::Zero();
  found.bottomRightCorner<1, 4>() = seen.depth_by_spline;
  constexpr double step = 1e-6;
  for (Eigen::Index n = 0; n < at.size(); ++n) {
    const Unknowns by = step * Unknowns::Unit(n);
    const Eigen::Vector3d expected =
        (seen_at(feature, pose, at + by).residual - seen_at(feature, pose, at - by).residual) /
        (2.0 * step);
    EXPECT_LT((found.col(n) - expected).norm(), 1e-5 * std::max(1.0, expected.norm())) << n;
  }
}

}  // namespace bundle_residuals_test
