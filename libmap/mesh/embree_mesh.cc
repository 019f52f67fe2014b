#include "libmap/mesh/embree_mesh.h"

#include <embree3/rtcore.h>

#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

void require_success(RTCDevice device) {
  if (const RTCError code = rtcGetDeviceError(device); code != RTC_ERROR_NONE)
    throw Error(
        "Embree cannot build the scene (error " + std::to_string(static_cast<int>(code)) + ")", {},
        ErrorKind::failed);
}

}  // namespace

EmbreeMesh::EmbreeMesh(const TriangleMesh& mesh, bool robust) : triangles_(mesh.triangles) {
  if (mesh.triangles.empty()) throw no_elements("triangles of the mesh");
  mesh.check();
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (!vertex.allFinite()) throw Error("one is not finite", {.field = "vertices of the mesh"});
  const Bounds3d bounds = bounds_of(mesh.vertices);
  center_ = 0.5 * (bounds.min + bounds.max);
  size_ = bounds.max - bounds.min;
  vertices_.reserve(mesh.vertices.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices) vertices_.push_back(vertex - center_);

  RTCDevice device = rtcNewDevice(nullptr);
  if (device == nullptr) throw Error("Embree cannot start", {}, ErrorKind::failed);
  device_.reset(device, rtcReleaseDevice);
  scene_.reset(rtcNewScene(device), rtcReleaseScene);
  // Compact: saves 28 bytes per triangle at the same speed.
  if (robust)
    rtcSetSceneFlags(scene(),
                     static_cast<RTCSceneFlags>(static_cast<unsigned>(RTC_SCENE_FLAG_ROBUST) |
                                                static_cast<unsigned>(RTC_SCENE_FLAG_COMPACT)));
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* corners = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices_.size()));
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             triangles_.data(), 0, sizeof(Triangle), triangles_.size());
  require_success(device);
  for (const Eigen::Vector3d& vertex : vertices_)
    for (int axis = 0; axis < 3; ++axis) *corners++ = static_cast<float>(vertex[axis]);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene());
  require_success(device);
}

}  // namespace libmap
