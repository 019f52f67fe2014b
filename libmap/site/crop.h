// From a map to the test site: levelled, turned and cut.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/geometry/normal_sides.h"
#include "libmap/site/border_band.h"
#include "libmap/site/ground_plane.h"
#include "libmap/site/plan_polygon.h"
#include "libmap/site/site_rectangle.h"

namespace libmap {

// What is kept. whole: all of it, levelled only. size: the rectangle of a given size that lies best
// centered in the data (site_rectangle). border: what a white band frames (border_band).
enum class CropRegion { whole, box, polygon, size, border };

// Frame of a box or polygon. level: ground at z = 0, x and y near the map's, turned by yaw_deg.
// map: as the map came.
enum class CropFrame { level, map };

struct CropOptions {
  bool level = true;  // false: the map's z is up and its ground stays where it is
  std::optional<Eigen::Vector3d> up = std::nullopt;  // none: by the normals (up_of_normals)
  GroundPlaneOptions ground{};                       // its `up` is overwritten
  CropRegion region = CropRegion::whole;
  CropFrame frame = CropFrame::level;
  Bounds3d box{};  // z may be infinite
  std::vector<Eigen::Vector2d> polygon{};
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();
  SiteRectangleOptions rectangle{};  // its margin_m counts for the border too
  BorderBandOptions band{};
  // Not bound. True size of the area inside the band, without the margin: determines the scale.
  std::optional<Eigen::Vector2d> border_size_m = std::nullopt;
  // Turn about z. None: with size and border, that which lays the rectangle's sides along x and y
  // by the least turn, else none.
  std::optional<double> yaw_deg = std::nullopt;
  bool center = false;  // x = y = 0 in the middle of the outline's box, else where the map has it
};
// ground, rectangle, band and center.
void bind(ParameterTable& table, CropOptions& options);

struct CropReport {
  Pose site_from_map = Pose::Identity();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // in the map, for finding the ground
  std::optional<UpOfNormals> up_of_normals{};     // if that determined `up`
  std::optional<GroundPlane> ground{};            // in the map; none if it was not levelled
  std::vector<Eigen::Vector2d> outline{};         // in the site, counter-clockwise; may be empty
  std::optional<SiteRectangle> rectangle{};       // in the level frame
  std::optional<BorderBand> band{};               // in the level frame
  std::optional<BorderScale> border_scale{};      // of the map; it is not applied
};

struct CropCloudResult {
  PointCloud cloud;
  CropReport report;
};
struct CropMeshResult {
  TriangleMesh mesh;
  CropReport report;
};

// The ground is found among the points, for a mesh among samples spread evenly over its surface.
// Meshes are cut along the outline (mesh_cutting.h), of clouds the points inside and on the border
// are kept. Throws Error: options out of their ranges, nothing to crop, no ground, no site, nothing
// inside.
CropCloudResult crop_cloud(const PointCloud& cloud, const CropOptions& options);
CropMeshResult crop_mesh(const TriangleMesh& mesh, const CropOptions& options);

// The same of a mesh in pieces: each(use) calls use(piece) for all of them, in one order, whenever
// it is called. `use` takes what is left of each, in that order; nothing is an empty mesh.
using UseMesh = std::function<void(const TriangleMesh& mesh)>;
using EachMesh = std::function<void(const UseMesh& use)>;
CropReport crop_mesh_pieces(const EachMesh& each, const CropOptions& options,
                            const std::function<void(TriangleMesh)>& use);

}  // namespace libmap
