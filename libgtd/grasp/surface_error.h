// Ground that is known with an error: how far it may lie off, and draws of what it may be.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libgtd/grasp/ground.h"
#include "libmap/core/parameters.h"
#include "libmap/core/triangle_mesh.h"

namespace libgtd {

struct SurfaceErrorOptions {
  // Of the ground's displacement: along an axis 0.285 at this distance and 0 from twice it on.
  double correlation_m = 0.025;
  // Ground whose error is larger counts as unseen, and is displaced as with this error.
  double max_error_m = 0.005;
};
void bind(libmap::ParameterTable& table, SurfaceErrorOptions& options);

// The vertex field `expected_error` of a mesh, as `graspmap fuse` and `mesh` write it (m, one
// standard deviation along the normal). Unsure are triangles with a vertex whose error is larger
// than the bound or not finite, and those that the face field `filled` marks: they close holes of
// the scan. Throws Error: the mesh has no such field, or a negative error.
GroundErrors errors_of(const libmap::TriangleMesh& mesh, const SurfaceErrorOptions& options);
// The same error everywhere.
GroundErrors constant_error(const libmap::TriangleMesh& mesh, double error_m,
                            const SurfaceErrorOptions& options);

// A random number at each place: normally distributed with mean 0 and standard deviation 1, cut off
// at 4, continuous. Numbers at the nodes of a lattice of this length, which lies at random, are
// weighted by nearness (trilinear) and divided by the root of the sum of the squared weights.
class RandomField {
 public:
  // Places in the box are quick.
  RandomField(double length_m, std::uint64_t seed, std::uint64_t key,
              const Eigen::AlignedBox3d& box);
  double at(const Eigen::Vector3d& place);

 private:
  double node(const Eigen::Array3i& number);

  double length_m_;
  std::uint64_t key_;
  Eigen::Array3d shift_;
  Eigen::Array3i low_;
  Eigen::Array3i sides_;
  std::vector<double> nodes_;  // of the box; NaN: not drawn yet
};

// The patch with its vertices moved along their normals by their errors times a random field. A
// patch without errors as it is.
GroundPatch displaced(const GroundPatch& patch, double correlation_m, std::uint64_t seed,
                      std::uint64_t key);

}  // namespace libgtd
