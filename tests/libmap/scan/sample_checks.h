// Common checks of the tests of databases of all schemas.
#pragma once

#include <gtest/gtest.h>

#include <optional>

#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

// Path of the sample in this test's scratch folder.
inline std::filesystem::path sample_file(SchemaVersion version = {}) {
  const std::filesystem::path file = scratch_folder() / (version.text() + ".db");
  write_sample(file, version);
  return file;
}

inline const libmap::PoseLink* find_link(const libmap::PoseGraph& graph, int from, int to,
                                         libmap::LinkType type) {
  for (const libmap::PoseLink& link : graph.links)
    if (link.from == from && link.to == to && link.type == type) return &link;
  return nullptr;
}

// Expects equal poses within float32's rounding, and a proper rotation.
inline void expect_same_pose(const std::optional<libmap::Pose>& actual,
                             const libmap::Pose& expected) {
  ASSERT_TRUE(actual);
  EXPECT_TRUE(actual->isApprox(expected, 1e-6)) << actual->matrix() << "\n" << expected.matrix();
  EXPECT_LT((actual->linear().transpose() * actual->linear() - Eigen::Matrix3d::Identity()).norm(),
            1e-14);
}

}  // namespace graspmap_test
