#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModHausdorffT.hh>
#include <OpenMesh/Tools/Decimater/ModNormalFlippingT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>
#include <OpenMesh/Tools/Decimater/ModRoundnessT.hh>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"

namespace libmap {

namespace {

// In the second half of the attempts, the tolerance is reduced as well.
constexpr int max_attempts = 12;
// Tolerance for removed vertices relative to the maximum error, because the distance between
// vertices can be larger, and its factor per later attempt.
constexpr double tolerance_fraction = 0.7;
constexpr double next_fraction = 0.7;
constexpr double max_turn_deg = 30.0;
constexpr float min_roundness = 0.2F;
// Parts smaller than this share of the maximum error are not divided but regarded as above it.
constexpr double smallest_part = 0.05;
constexpr std::size_t triangles_grain = 1024;

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status | OpenMesh::Attributes::Normal);
  EdgeAttributes(OpenMesh::Attributes::Status);
  HalfedgeAttributes(OpenMesh::Attributes::Status | OpenMesh::Attributes::PrevHalfedge);
};

class Mesh : public OpenMesh::TriMesh_ArrayKernelT<Traits> {
 public:
  // The result of TriConnectivity's function, which takes half of the time of a decimation because
  // Debian's library checks each handle.
  bool is_collapse_ok(HalfedgeHandle edge) {
    const VertexHandle from = from_vertex_handle(edge);
    const VertexHandle to = to_vertex_handle(edge);
    if (status(edge_handle(edge)).deleted() || status(from).deleted() || status(to).deleted())
      return false;
    const bool on_border = is_boundary(edge_handle(edge));
    if (is_boundary(from) && is_boundary(to) && !on_border) return false;
    int sides = 0;
    for (const HalfedgeHandle side : {edge, opposite_halfedge_handle(edge)}) {
      if (is_boundary(side)) continue;
      ++sides;
      const HalfedgeHandle next = opposite_halfedge_handle(next_halfedge_handle(side));
      const HalfedgeHandle previous = opposite_halfedge_handle(prev_halfedge_handle(side));
      if (is_boundary(next) && is_boundary(previous)) return false;
    }
    // No other vertices than those of the triangles at the edge may be adjacent to both ends.
    for (const VertexHandle v : vv_range(from)) status(v).set_tagged(false);
    for (const VertexHandle v : vv_range(to)) status(v).set_tagged(true);
    int common = 0;
    for (const VertexHandle v : vv_range(from)) common += status(v).tagged() ? 1 : 0;
    return sides > 0 && common == sides;
  }
};

// Relative to the first vertex, because some of OpenMesh's modules use single precision.
bool enter(const TriangleMesh& from, const std::vector<bool>& locked, Mesh& mesh) {
  for (const Eigen::Vector3d& vertex : from.vertices) {
    const Eigen::Vector3d v = vertex - from.vertices.front();
    mesh.add_vertex({v.x(), v.y(), v.z()});
  }
  for (const Triangle& t : from.triangles) {
    const std::array<Mesh::VertexHandle, 3> corners = {
        mesh.vertex_handle(t[0]), mesh.vertex_handle(t[1]), mesh.vertex_handle(t[2])};
    if (!mesh.add_face(corners[0], corners[1], corners[2]).is_valid()) return false;
  }
  mesh.update_face_normals();
  for (std::uint32_t v = 0; v < locked.size(); ++v)
    if (locked[v]) mesh.status(mesh.vertex_handle(v)).set_locked(true);
  return true;
}

void collapse_edges(Mesh& mesh, double tolerance_m) {
  OpenMesh::Decimater::DecimaterT<Mesh> decimater(mesh);
  OpenMesh::Decimater::ModQuadricT<Mesh>::Handle quadric;
  OpenMesh::Decimater::ModHausdorffT<Mesh>::Handle distance;
  OpenMesh::Decimater::ModNormalFlippingT<Mesh>::Handle turn;
  OpenMesh::Decimater::ModRoundnessT<Mesh>::Handle roundness;
  decimater.add(quadric);
  decimater.module(quadric).unset_max_err();
  decimater.add(turn);
  decimater.module(turn).set_max_normal_deviation(max_turn_deg);
  decimater.add(roundness);
  decimater.module(roundness).set_min_roundness(min_roundness, true);
  decimater.add(distance);
  decimater.module(distance).set_tolerance(tolerance_m);
  decimater.initialize();
  decimater.decimate();
}

TriangleMesh collapsed(const TriangleMesh& original, const std::vector<bool>& locked,
                       double tolerance_m) {
  Mesh mesh;
  if (!enter(original, locked, mesh)) return original;
  collapse_edges(mesh, tolerance_m);
  TriangleMesh result = original;
  std::vector<bool> keep(original.triangles.size());
  for (std::uint32_t t = 0; t < keep.size(); ++t) {
    const Mesh::FaceHandle face(static_cast<int>(t));
    keep[t] = !mesh.status(face).deleted();
    if (!keep[t]) continue;
    auto corner = mesh.cfv_iter(face);
    for (std::uint32_t& v : result.triangles[t]) v = static_cast<std::uint32_t>((corner++)->idx());
  }
  return select_triangles(result, keep);
}

constexpr std::uint32_t none = 0xffffffff;

struct Deviation {
  double bound_m = 0.0;                // infinite if the distance exceeds the allowed one
  std::uint32_t nearest_there = none;  // then the triangle of the other mesh nearest to the point
};

class DeviationBound {
 public:
  DeviationBound(const TriangleMesh& to, double allowed_m)
      : to_(to), surface_(to), allowed_(allowed_m) {}

  // `near`: a guess, which the nearest triangle replaces unless the guess is within the bound.
  Deviation of(const TriangleCorners& part, std::uint32_t& near) const {
    const double known = near == none ? HUGE_VAL : farthest_from(near, part);
    if (known <= allowed_) return {.bound_m = known};
    const Eigen::Vector3d middle = (part[0] + part[1] + part[2]) / 3.0;
    const SurfacePoint nearest = surface_.nearest(middle);
    near = nearest.triangle;
    double radius = 0.0;
    for (const Eigen::Vector3d& corner : part) radius = std::max(radius, (corner - middle).norm());
    const double largest = std::min(farthest_from(near, part), nearest.distance_m + radius);
    if (largest <= allowed_) return {.bound_m = largest};
    if (nearest.distance_m > allowed_ || radius < smallest_part * allowed_)
      return {.bound_m = HUGE_VAL, .nearest_there = near};
    return of_quarters(part, near);
  }

 private:
  Deviation of_quarters(const TriangleCorners& part, std::uint32_t& near) const {
    Deviation largest;
    for (const TriangleCorners& quarter : quarters_of(part)) {
      const Deviation here = of(quarter, near);
      if (here.bound_m > largest.bound_m) largest = here;
      if (here.nearest_there != none) break;
    }
    return largest;
  }

  double farthest_from(std::uint32_t triangle, const TriangleCorners& part) const {
    double largest = 0.0;
    for (const Eigen::Vector3d& corner : part)
      largest = std::max(largest, distance_from(triangle, corner));
    return largest;
  }

  double distance_from(std::uint32_t triangle, const Eigen::Vector3d& point) const {
    const Triangle& t = to_.triangles[triangle];
    return (nearest_on_triangle(point, to_.vertices[t[0]], to_.vertices[t[1]], to_.vertices[t[2]]) -
            point)
        .norm();
  }

  const TriangleMesh& to_;
  SurfaceDistance surface_;
  double allowed_;
};

std::vector<Deviation> deviations(const TriangleMesh& from, const TriangleMesh& to,
                                  double allowed_m) {
  const DeviationBound bound(to, allowed_m);
  std::vector<Deviation> result(from.triangles.size());
  parallel_for(result.size(), triangles_grain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t near = none;
    for (std::size_t n = begin; n < end; ++n)
      result[n] = bound.of(corners_of(from, from.triangles[n]), near);
  });
  return result;
}

double largest_of(const std::vector<Deviation>& deviations) {
  double largest = 0.0;
  for (const Deviation& one : deviations) largest = std::max(largest, one.bound_m);
  return largest;
}

// Bound of the distance between both surfaces. Locks the vertices of the original where it exceeds
// the allowed distance, with `rings` rings of triangles around them.
double deviation(const TriangleMesh& original, const TriangleMesh& smaller, double allowed_m,
                 int rings, std::vector<bool>& locked) {
  const std::vector<Deviation> there = deviations(smaller, original, allowed_m);
  const std::vector<Deviation> back = deviations(original, smaller, allowed_m);
  std::vector<bool> marks(original.triangles.size(), false);
  for (const Deviation& one : there)
    if (one.nearest_there != none) marks[one.nearest_there] = true;
  for (std::size_t t = 0; t < back.size(); ++t)
    if (back[t].nearest_there != none) marks[t] = true;
  dilate_mask(original, rings, marks);
  for (std::size_t t = 0; t < marks.size(); ++t)
    if (marks[t])
      for (const std::uint32_t v : original.triangles[t]) locked[v] = true;
  return std::max(largest_of(there), largest_of(back));
}

}  // namespace

MeshDecimation decimate_mesh(TriangleMesh& mesh, double max_error_m, Progress& progress) {
  MeshDecimation result;
  if (max_error_m <= 0.0 || mesh.triangles.empty()) return result;
  double tolerance = tolerance_fraction * max_error_m;
  std::vector<bool> locked(mesh.vertices.size(), false);
  progress.begin("decimating", 0);
  for (int attempt = 0; attempt < max_attempts; ++attempt) {
    if (attempt >= max_attempts / 2) tolerance *= next_fraction;
    TriangleMesh smaller = collapsed(mesh, locked, tolerance);
    if (smaller.triangles.empty() || smaller.triangles.size() == mesh.triangles.size()) break;
    const double proved = deviation(mesh, smaller, max_error_m, attempt, locked);
    if (proved > max_error_m) continue;
    result.deviation_m = proved;
    result.removed_triangles = mesh.triangles.size() - smaller.triangles.size();
    mesh = std::move(smaller);
    break;
  }
  progress.end();
  return result;
}

MeshDecimation decimate_triangles(TriangleMesh& mesh, double max_error_m) {
  MeshDecimation result;
  if (max_error_m <= 0.0 || mesh.triangles.empty()) return result;
  TriangleMesh smaller = collapsed(mesh, std::vector<bool>(mesh.vertices.size(), false),
                                   tolerance_fraction * max_error_m);
  const std::vector<Deviation> there = deviations(smaller, mesh, max_error_m);
  std::vector<bool> keep(there.size());
  for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = there[t].nearest_there == none;
  if (count_of(keep) == 0) return result;
  smaller = select_triangles(smaller, keep);
  const std::vector<Deviation> back = deviations(mesh, smaller, max_error_m);
  std::vector<bool> restore(back.size());
  for (std::size_t t = 0; t < restore.size(); ++t) restore[t] = back[t].nearest_there != none;
  for (const std::vector<Deviation>* way : {&there, &back})
    for (const Deviation& one : *way)
      if (one.nearest_there == none) result.deviation_m = std::max(result.deviation_m, one.bound_m);
  // So that the restored triangles overlap the others.
  dilate_mask(mesh, 1, restore);
  append_mesh(select_triangles(mesh, restore), smaller);
  if (smaller.triangles.size() >= mesh.triangles.size()) return {};
  result.removed_triangles = mesh.triangles.size() - smaller.triangles.size();
  mesh = std::move(smaller);
  return result;
}

}  // namespace libmap
