// Meshes and checks for the tests of mesh cleaning.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/surface/mesh_cleaning.h"

namespace graspmap_test {

// Options for repairs only, without steps that depend on lengths in meters.
libmap::MeshCleaningOptions repairs();
libmap::MeshCleaningOptions holes_up_to(double diameter_m);

libmap::TriangleMesh mesh_of(std::vector<Eigen::Vector3d> vertices,
                             std::vector<libmap::Triangle> triangles);

// Adds normals, colors and fields of each type.
libmap::TriangleMesh with_values(libmap::TriangleMesh mesh);

const libmap::ScalarField& field_of(const std::vector<libmap::ScalarField>& fields,
                                    const std::string& name);

// Returns the triangles for whose center `keep` is true.
libmap::TriangleMesh kept_where(const libmap::TriangleMesh& mesh,
                                const std::function<bool(const Eigen::Vector3d&)>& keep);

testing::AssertionResult same_geometry(const libmap::TriangleMesh& a,
                                       const libmap::TriangleMesh& b);
testing::AssertionResult same_mesh(const libmap::TriangleMesh& a, const libmap::TriangleMesh& b);

// Expects a report without defects, confirmed by independent counts, and arrays of consistent
// sizes.
void expect_clean(const libmap::TriangleMesh& mesh);

// Cleans the mesh. Expects a clean result that a second cleaning does not change.
libmap::MeshCleaningResult cleaned(const libmap::TriangleMesh& mesh,
                                   const libmap::MeshCleaningOptions& options);

}  // namespace graspmap_test
