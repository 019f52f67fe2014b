// Meshes and checks that the tests of mesh cleaning share.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/surface/mesh_cleaning.h"

namespace graspmap_test {

// Repairs alone: nothing that depends on lengths in meters.
libmap::MeshCleaningOptions repairs();
libmap::MeshCleaningOptions holes_up_to(double diameter_m);

libmap::TriangleMesh mesh_of(std::vector<Eigen::Vector3d> vertices,
                             std::vector<libmap::Triangle> triangles);

// A mesh with every kind of value.
libmap::TriangleMesh with_values(libmap::TriangleMesh mesh);

const libmap::ScalarField& field_of(const std::vector<libmap::ScalarField>& fields,
                                    const std::string& name);

// The triangles for whose middle `keep` holds.
libmap::TriangleMesh kept_where(const libmap::TriangleMesh& mesh,
                                const std::function<bool(const Eigen::Vector3d&)>& keep);

testing::AssertionResult same_geometry(const libmap::TriangleMesh& a,
                                       const libmap::TriangleMesh& b);
testing::AssertionResult same_mesh(const libmap::TriangleMesh& a, const libmap::TriangleMesh& b);

// No fault in its report, an independent count of the same, arrays that fit.
void expect_clean(const libmap::TriangleMesh& mesh);

// Clean, and cleaning it again changes nothing.
libmap::MeshCleaningResult cleaned(const libmap::TriangleMesh& mesh,
                                   const libmap::MeshCleaningOptions& options);

}  // namespace graspmap_test
