#include "libgtd/grasp/surface_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr double most_deviations = 4.0;

const libmap::ScalarField* field_of(const std::vector<libmap::ScalarField>& fields,
                                    const char* name) {
  const auto found = std::find_if(fields.begin(), fields.end(),
                                  [&](const auto& field) { return field.name == name; });
  return found == fields.end() ? nullptr : &*found;
}

GroundErrors bounded(const libmap::TriangleMesh& mesh, std::vector<double> errors_m,
                     double max_error_m) {
  GroundErrors errors;
  for (const libmap::Triangle& triangle : mesh.triangles)
    errors.is_unscanned.push_back(
        std::all_of(triangle.begin(), triangle.end(),
                    [&](std::uint32_t corner) { return errors_m[corner] <= max_error_m; })
            ? 0
            : 1);
  errors.vertex_errors_m = std::move(errors_m);
  for (double& error : errors.vertex_errors_m)
    if (!(error <= max_error_m)) error = max_error_m;
  return errors;
}

}  // namespace

void bind(libmap::ParameterTable& table, SurfaceErrorOptions& options) {
  table.add("surface_correlation_m", options.correlation_m, {1e-4, 10.0},
            "distance at which the correlation of simulated mesh errors is 0.29, m");
  table.add("max_surface_error_m", options.max_error_m, {0.0, 0.1, true, false},
            "standard deviation of the mesh error above which ground counts as unmeasured, m");
}

GroundErrors errors_of(const libmap::TriangleMesh& mesh, const SurfaceErrorOptions& options) {
  mesh.check();
  const libmap::ScalarField* expected = field_of(mesh.vertex_fields, "expected_error");
  if (expected == nullptr)
    throw libmap::Error(
        "the mesh has no such vertex field; set surface_error to a number, or mesh a cloud of "
        "`graspmap fuse` with `graspmap mesh`",
        {.field = "expected_error"});
  for (std::size_t n = 0; n < expected->values.size(); ++n)
    if (expected->values[n] < 0.0)
      throw libmap::Error("a standard deviation cannot be negative",
                          {.field = "expected_error of vertex " + std::to_string(n),
                           .value = libmap::to_text(expected->values[n]),
                           .bound = ">= 0"});
  GroundErrors errors = bounded(mesh, expected->values, options.max_error_m);
  if (const libmap::ScalarField* filled = field_of(mesh.face_fields, "filled"))
    for (std::size_t n = 0; n < errors.is_unscanned.size(); ++n)
      if (filled->values[n] != 0.0) errors.is_unscanned[n] = 1;
  return errors;
}

GroundErrors constant_error(const libmap::TriangleMesh& mesh, double error_m,
                            const SurfaceErrorOptions& options) {
  if (error_m == 0.0) return {};
  return bounded(mesh, std::vector<double>(mesh.vertices.size(), error_m), options.max_error_m);
}

RandomField::RandomField(double length_m, std::uint64_t seed, std::uint64_t key,
                         const Eigen::AlignedBox3d& box)
    : length_m_(length_m), key_(libmap::mix_bits(seed, key)) {
  libmap::RandomStream random(seed, key);
  for (double& shift : shift_) shift = random.uniform();
  const Eigen::Array3d low = (box.min().array() / length_m + shift_).floor();
  const Eigen::Array3d sides = (box.max().array() / length_m + shift_).floor() - low + 2.0;
  constexpr double most_nodes = 1e6;
  const bool is_small = !box.isEmpty() && sides.prod() <= most_nodes && low.abs().maxCoeff() < 1e9;
  low_ = is_small ? low.cast<int>().eval() : Eigen::Array3i::Zero();
  sides_ = is_small ? sides.cast<int>().eval() : Eigen::Array3i::Zero();
  nodes_.assign(static_cast<std::size_t>(sides_.prod()), std::numeric_limits<double>::quiet_NaN());
}

double RandomField::node(const Eigen::Array3i& number) {
  const auto draw = [&] {
    std::uint64_t key = key_;
    for (const int index : number)
      key = libmap::mix_bits(key, static_cast<std::uint64_t>(static_cast<std::int64_t>(index)));
    return libmap::RandomStream(key_, key).normal();
  };
  const Eigen::Array3i at = number - low_;
  if ((at < 0).any() || (at >= sides_).any()) return draw();
  const int number_in_box = (at[0] * sides_[1] + at[1]) * sides_[2] + at[2];
  double& known = nodes_[static_cast<std::size_t>(number_in_box)];
  if (std::isnan(known)) known = draw();
  return known;
}

double RandomField::at(const Eigen::Vector3d& position) {
  const Eigen::Array3d cell = position.array() / length_m_ + shift_;
  const Eigen::Array3d low = cell.floor();
  const Eigen::Array3d fraction = cell - low;
  const Eigen::Array3i first = low.max(-1e9).min(1e9).cast<int>();
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Array3i side(corner & 1, (corner >> 1) & 1, corner >> 2);
    double weight = 1.0;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      weight *= side[axis] == 0 ? 1.0 - fraction[axis] : fraction[axis];
    sum += weight * node(first + side);
  }
  const double squares = (fraction.square() + (1.0 - fraction).square()).prod();
  return std::clamp(sum / std::sqrt(squares), -most_deviations, most_deviations);
}

GroundPatch displace_vertices(const GroundPatch& patch, double correlation_m, std::uint64_t seed,
                              std::uint64_t key) {
  GroundPatch drawn = patch;
  if (patch.vertex_errors_m.empty()) return drawn;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : patch.vertices) box.extend(vertex);
  RandomField field(correlation_m, seed, key, box);
  for (std::size_t n = 0; n < patch.vertices.size(); ++n)
    drawn.vertices[n] +=
        patch.vertex_errors_m[n] * field.at(patch.vertices[n]) * patch.vertex_normals[n];
  drawn.measure_triangles();
  return drawn;
}

}  // namespace libgtd
