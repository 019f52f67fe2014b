#include "libmap/mesh/ray_caster.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr double largest_float = std::numeric_limits<float>::max();
constexpr std::size_t packet_size = 8;

// Ray for Embree: relative to the mesh's center, with unit direction, starting just outside the
// mesh's box for accuracy in single precision.
struct LocalRay {
  Eigen::Vector3f origin;
  Eigen::Vector3f direction;
  float near = 0.0F;
  float far = -1.0F;     // less than near: no intersection with the box
  double length = 1.0;   // length of the given direction
  double skipped = 0.0;  // distance from the given origin to `origin`
};

LocalRay localize(const EmbreeMesh& mesh, const Eigen::AlignedBox3d& box,
                  const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double near,
                  double far) {
  LocalRay ray;
  ray.length = direction.stableNorm();
  if (!(ray.length > 0.0) || !std::isfinite(ray.length) || !origin.allFinite()) return ray;
  const Eigen::Vector3d unit = direction / ray.length;
  const Eigen::Vector3d start = origin - mesh.center();
  double enter = 0.0;
  double leave = largest_float;
  for (int axis = 0; axis < 3; ++axis) {
    if (unit[axis] == 0.0) {
      if (start[axis] < box.min()[axis] || start[axis] > box.max()[axis]) return ray;
      continue;
    }
    const double a = (box.min()[axis] - start[axis]) / unit[axis];
    const double b = (box.max()[axis] - start[axis]) / unit[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  if (enter > leave) return ray;
  ray.skipped = enter;
  ray.origin = (start + enter * unit).cast<float>();
  ray.direction = unit.cast<float>();
  ray.near = static_cast<float>(std::clamp(near * ray.length - enter, 0.0, largest_float));
  ray.far = static_cast<float>(std::clamp(far * ray.length - enter, -1.0, largest_float));
  return ray;
}

RayHit refine(const EmbreeMesh& mesh, const Eigen::Vector3d& origin,
              const Eigen::Vector3d& direction, const LocalRay& ray, float found, unsigned triangle,
              float u, float v) {
  RayHit hit;
  hit.triangle = triangle;
  const double unit_distance = ray.skipped + static_cast<double>(found);
  hit.distance = unit_distance / ray.length;
  hit.u = static_cast<double>(u);
  hit.v = static_cast<double>(v);
  const Eigen::Vector3d& a = mesh.corner(triangle, 0);
  const Eigen::Vector3d ab = mesh.corner(triangle, 1) - a;
  const Eigen::Vector3d ac = mesh.corner(triangle, 2) - a;
  const Eigen::Vector3d normal = ab.cross(ac);
  const Eigen::Vector3d start = origin - mesh.center();
  const double exact = normal.dot(a - start) / normal.dot(direction);
  // For a grazing ray, the intersection with the plane is less accurate than Embree's.
  if (!(std::abs(exact - hit.distance) * ray.length <= 1e-5 * (1e-3 + std::abs(unit_distance))))
    return hit;
  hit.distance = exact;
  const Eigen::Vector3d arm = start + exact * direction - a;
  const double square = normal.squaredNorm();
  hit.u = std::clamp(arm.cross(ac).dot(normal) / square, 0.0, 1.0);
  hit.v = std::clamp(ab.cross(arm).dot(normal) / square, 0.0, 1.0 - hit.u);
  return hit;
}

RTCRay embree_ray(const LocalRay& local) {
  RTCRay ray{};
  ray.org_x = local.origin.x();
  ray.org_y = local.origin.y();
  ray.org_z = local.origin.z();
  ray.dir_x = local.direction.x();
  ray.dir_y = local.direction.y();
  ray.dir_z = local.direction.z();
  ray.tnear = local.near;
  ray.tfar = local.far;
  ray.mask = ~0U;
  return ray;
}

}  // namespace

RayCaster::RayCaster(const TriangleMesh& mesh) : mesh_(mesh, true) {
  const Eigen::Vector3d half =
      0.5 * mesh_.size() + Eigen::Vector3d::Constant(1e-3 * mesh_.size().norm() + 1e-6);
  box_ = Eigen::AlignedBox3d(-half, half);
}

std::optional<RayHit> RayCaster::cast(const Eigen::Vector3d& origin,
                                      const Eigen::Vector3d& direction, double near,
                                      double far) const {
  const LocalRay local = localize(mesh_, box_, origin, direction, near, far);
  if (local.far < local.near) return std::nullopt;
  RTCRayHit ray{};
  ray.ray = embree_ray(local);
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(mesh_.scene(), &context, &ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return refine(mesh_, origin, direction, local, ray.ray.tfar, ray.hit.primID, ray.hit.u,
                ray.hit.v);
}

void RayCaster::cast_bundle(const Eigen::Vector3d& origin,
                            std::span<const Eigen::Vector3d> directions, std::span<RayHit> hits,
                            double near, double far) const {
  if (hits.size() != directions.size())
    throw Error("number of hits differs from number of rays",
                {.field = "hits",
                 .value = std::to_string(hits.size()),
                 .bound = std::to_string(directions.size())});
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  std::array<LocalRay, packet_size> local;
  for (std::size_t first = 0; first < directions.size(); first += packet_size) {
    const std::size_t count = std::min(packet_size, directions.size() - first);
    RTCRayHit8 packet{};
    alignas(32) std::array<int, packet_size> valid{};
    for (std::size_t i = 0; i < count; ++i) {
      LocalRay& ray = local[i];
      ray = localize(mesh_, box_, origin, directions[first + i], near, far);
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      if (ray.far < ray.near) continue;
      valid[i] = -1;
      packet.ray.org_x[i] = ray.origin.x();
      packet.ray.org_y[i] = ray.origin.y();
      packet.ray.org_z[i] = ray.origin.z();
      packet.ray.dir_x[i] = ray.direction.x();
      packet.ray.dir_y[i] = ray.direction.y();
      packet.ray.dir_z[i] = ray.direction.z();
      packet.ray.tnear[i] = ray.near;
      packet.ray.tfar[i] = ray.far;
      packet.ray.mask[i] = ~0U;
    }
    rtcIntersect8(valid.data(), mesh_.scene(), &context, &packet);
    for (std::size_t i = 0; i < count; ++i) {
      RayHit& hit = hits[first + i];
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
        hit = RayHit{.triangle = RayHit::no_triangle};
        continue;
      }
      hit = refine(mesh_, origin, directions[first + i], local[i], packet.ray.tfar[i],
                   packet.hit.primID[i], packet.hit.u[i], packet.hit.v[i]);
    }
  }
}

}  // namespace libmap
