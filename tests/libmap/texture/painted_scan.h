// Scans in memory: photographs of a painted surface by cameras that are known exactly.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/scan/scan_source.h"

namespace graspmap_test {

// Color at a point of a triangle, 0 to 255 per channel.
using Paint = std::function<Eigen::Vector3d(std::uint32_t triangle, const Eigen::Vector3d& point)>;

class PaintedScan : public libmap::ScanSource {
 public:
  // A photograph of `mesh` from each pose of the camera's optical frame, 3 x 3 rays a pixel; black
  // where there is no surface. Nodes count from 1.
  PaintedScan(const libmap::TriangleMesh& mesh, const Paint& paint, const libmap::Camera& camera,
              const std::vector<libmap::Pose>& world_from_camera);

  const std::filesystem::path& path() const override { return path_; }
  const libmap::PoseGraph& graph() const override { return graph_; }
  libmap::RgbdFrame read_frame(int node, libmap::FrameParts parts = {}) const override;

  libmap::Trajectory poses() const { return poses_; }
  libmap::ColorImage& photo(std::size_t index) { return photos_[index]; }
  std::size_t size() const { return photos_.size(); }

 private:
  std::filesystem::path path_ = "painted";
  libmap::PoseGraph graph_;
  libmap::Camera camera_;
  libmap::Trajectory poses_;
  std::vector<libmap::ColorImage> photos_;
};

// Each photograph brighter or darker, of another tint (`gains` gets them), and dark towards its
// corners.
void spoil(PaintedScan& scan, std::vector<Eigen::Vector3d>& gains);

// 220 x 180 pixels.
libmap::Camera small_camera();

// The optical frame of a camera at `position` that looks at `target`, its x level.
libmap::Pose looking_at(const Eigen::Vector3d& position, const Eigen::Vector3d& target);

// `count` cameras on a circle about the z axis that look at its middle.
std::vector<libmap::Pose> circle_of_cameras(int count, double radius_m, double height_m);

// A level square about the z axis, its normal up, of cells x cells pairs of triangles.
libmap::TriangleMesh grid_mesh(int cells, double size_m, double z);

// Soft marks of 10 to 30 cm, between 60 and 200.
Eigen::Vector3d soft_marks(const Eigen::Vector3d& point);

}  // namespace graspmap_test
