// Levels, rotates and crops a map to the test site.
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
#include "libmap/site/site_rectangle.h"
#include "libmap/site/xy_polygon.h"

namespace libmap {

// Part of the map that is kept. whole: everything, only leveled. box, polygon: a given area. size:
// the best-centered rectangle of a given size (site_rectangle). border: the area inside a white
// band (border_band).
enum class CropRegion { whole, box, polygon, size, border };

// Frame of a box or polygon. level: ground at z = 0, x and y near the axes of the map, rotated by
// yaw_deg. map: the frame of the input.
enum class CropFrame { level, map };

struct CropOptions {
  bool level = true;  // false: the map's z axis is up, and the heights are kept
  std::optional<Eigen::Vector3d> up = std::nullopt;  // in the map; nullopt: from the normals
  GroundPlaneOptions ground{};                       // GroundPlaneOptions::up is ignored
  CropRegion region = CropRegion::whole;
  CropFrame frame = CropFrame::level;
  Bounds3d box{};                                    // region box, in `frame`; z may be infinite
  std::vector<Eigen::Vector2d> polygon{};            // region polygon: corners in `frame`
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();  // region size: sides of the rectangle
  SiteRectangleOptions rectangle{};                  // margin_m also applies to region border
  BorderBandOptions band{};                          // region border
  // True size of the area inside the band, without the margin, to estimate the scale; optional.
  std::optional<Eigen::Vector2d> border_size_m = std::nullopt;
  // Counter-clockwise rotation about z. nullopt: for regions size and border, the smallest rotation
  // that makes the sides parallel to x and y; no rotation otherwise.
  std::optional<double> yaw_deg = std::nullopt;
  // true: centers the outline's box on x = y = 0 (for region whole or frame map: the result's box).
  bool center = false;
};
// Binds ground, rectangle, band and center.
void bind(ParameterTable& table, CropOptions& options);

struct CropReport {
  Pose site_from_map = Pose::Identity();          // site frame: frame of the result
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // in the map, used to find the ground
  std::optional<UpOfNormals> up_of_normals{};     // set if `up` comes from normals
  std::optional<GroundPlane> ground{};            // in the map; none without leveling
  std::vector<Eigen::Vector2d> outline{};         // site frame, counter-clockwise; empty for whole
  std::optional<SiteRectangle> rectangle{};       // in the level frame
  std::optional<BorderBand> band{};               // in the level frame
  std::optional<BorderScale> border_scale{};      // scale of the map, not applied to the result
};

struct CropCloudResult {
  PointCloud cloud;
  CropReport report;
};
struct CropMeshResult {
  TriangleMesh mesh;
  CropReport report;
};

// Keeps the points inside and on the border. The ground is found among the points. Throws Error if
// an option is out of range, no ground or site is found, or nothing is inside.
CropCloudResult crop_cloud(const PointCloud& cloud, const CropOptions& options);
// Cuts the mesh along the outline (mesh_cutting.h). The ground is found among even samples of the
// mesh. Throws Error as crop_cloud does.
CropMeshResult crop_mesh(const TriangleMesh& mesh, const CropOptions& options);

// Crops a mesh that is stored in tiles. each(f) must call f(tile) for every tile, in the same order
// on every call. `use` receives the cropped tiles in this order, also empty tiles. Throws Error as
// crop_mesh does.
using UseMesh = std::function<void(const TriangleMesh& mesh)>;
using EachMesh = std::function<void(const UseMesh& use)>;
CropReport crop_mesh_tiles(const EachMesh& each, const CropOptions& options,
                           const std::function<void(TriangleMesh)>& use);

}  // namespace libmap
