// Measurement errors of the ground mesh, for the virtual field test: reads standard deviations of
// the surface, and draws random surfaces with these errors.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libgtd/grasp/ground.h"
#include "libmap/core/parameters.h"
#include "libmap/core/triangle_mesh.h"

namespace libgtd {

struct SurfaceErrorOptions {
  // Correlation length of the displacement: along an axis, the correlation is 0.285 at this
  // distance and 0 from twice this distance.
  double correlation_m = 0.025;
  // Maximum standard deviation; ground with a larger error counts as unseen and gets this value.
  double max_error_m = 0.005;
};
void bind(libmap::ParameterTable& table, SurfaceErrorOptions& options);

// Reads the vertex field `expected_error` of a mesh as written by `graspmap fuse` and `mesh` (m,
// one standard deviation along the normal). A triangle counts as unseen if the error of a vertex
// exceeds max_error_m or is not finite, or if the face field `filled` marks the triangle as closing
// a hole of the scan. Throws Error if the field is missing or an error is negative.
GroundErrors errors_of(const libmap::TriangleMesh& mesh, const SurfaceErrorOptions& options);
// Returns the same standard deviation `error_m` for all vertices; no errors if it is 0.
GroundErrors constant_error(const libmap::TriangleMesh& mesh, double error_m,
                            const SurfaceErrorOptions& options);

// Continuous random field: normally distributed with mean 0 and standard deviation 1, truncated to
// -4..4. Random numbers at the nodes of a randomly shifted lattice of edge `length_m` are weighted
// by nearness (trilinear) and divided by the root of the sum of the squared weights.
class RandomField {
 public:
  // `seed` and `key` select the field. Nodes in `box` are cached for speed, without other effect.
  RandomField(double length_m, std::uint64_t seed, std::uint64_t key,
              const Eigen::AlignedBox3d& box);
  double at(const Eigen::Vector3d& position);  // value of the field

 private:
  double node(const Eigen::Array3i& number);

  double length_m_;
  std::uint64_t key_;
  Eigen::Array3d shift_;
  Eigen::Array3i low_;
  Eigen::Array3i sides_;
  std::vector<double> nodes_;  // nodes in the box; NaN: not drawn yet
};

// Returns the patch with vertices displaced along the vertex normals by the vertex errors times a
// random field. A patch without errors is returned unchanged.
GroundPatch displace_vertices(const GroundPatch& patch, double correlation_m, std::uint64_t seed,
                              std::uint64_t key);

}  // namespace libgtd
