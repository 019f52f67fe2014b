#include "libmap/site/crop.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/site/mesh_cutting.h"

namespace libmap {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double ground_samples = 100000.0;  // of a mesh
constexpr double max_view_samples = 4e6;
constexpr double max_side_samples = 2e6;  // of few triangles

Pose turn_about(const Vector2d& pivot_m, double yaw_deg) {
  const Vector3d pivot(pivot_m.x(), pivot_m.y(), 0.0);
  Pose turn = make_pose_from_rpy(Vector3d::Zero(), {0.0, 0.0, yaw_deg});
  turn.translation() = pivot - turn.linear() * pivot;
  return turn;
}

bool is_identity(const Pose& pose) { return pose.matrix().isIdentity(0.0); }

std::vector<Vector2d> seen_from_above(const std::vector<Vector3d>& points) {
  std::vector<Vector2d> plan_points;
  plan_points.reserve(points.size());
  for (const Vector3d& point : points) plan_points.emplace_back(point.head<2>());
  return plan_points;
}

// Motion of the map and the shape of the cut.
struct Plan {
  Pose cut_from_map = Pose::Identity();   // the cut is made in the frame `cut`
  Pose site_from_cut = Pose::Identity();  // identity unless a box or polygon is in the map frame
  ExtrudedPolygon prism;
  CropReport report;
};

// Input of the plan, from a cloud or a mesh.
struct Source {
  std::vector<Vector3d> ground_points;
  std::vector<Eigen::Vector3f> normals;
  Vector2d middle = Vector2d::Zero();  // center of rotation for a given yaw
  // Points of the map in the level frame; for a mesh, samples with a spacing of about `cell`.
  std::function<PointCloud(const Pose& level_from_map, double cell)> view;
};

// Mean direction of the sides modulo 90 degrees, weighted by their lengths.
double yaw_of(const std::vector<Vector2d>& corners) {
  double sine = 0.0;
  double cosine = 0.0;
  for (std::size_t n = 0; n < corners.size(); ++n) {
    const Vector2d side = corners[(n + 1) % corners.size()] - corners[n];
    const double angle = 4.0 * std::atan2(side.y(), side.x());
    sine += side.norm() * std::sin(angle);
    cosine += side.norm() * std::cos(angle);
  }
  return std::atan2(sine, cosine) / 4.0 * 180.0 / std::numbers::pi;
}

std::vector<Vector2d> moved(const std::vector<Vector2d>& corners, const Pose& pose) {
  std::vector<Vector2d> result;
  result.reserve(corners.size());
  for (const Vector2d& corner : corners)
    result.emplace_back((pose * Vector3d(corner.x(), corner.y(), 0.0)).head<2>());
  return result;
}

Pose level_frame(const Source& source, const CropOptions& options, CropReport& report) {
  if (!options.level) return Pose::Identity();
  if (options.up) {
    report.up = *options.up;
  } else {
    report.up_of_normals = up_of_normals(source.ground_points, source.normals);
    report.up = report.up_of_normals->direction;
  }
  GroundPlaneOptions ground = options.ground;
  ground.up = report.up;
  report.ground = find_ground_plane(source.ground_points, ground);
  return level_from_map(*report.ground);
}

// Plans the cut along a rectangle of a given size, parallel to the axes unless a yaw is given.
void lay_rectangle(const Source& source, const CropOptions& options, const Pose& level,
                   Plan& plan) {
  const PointCloud view = source.view(level, options.rectangle.cell_m);
  const SiteRectangle rectangle =
      find_site_rectangle(seen_from_above(view.positions), options.size_m, options.rectangle);
  plan.report.rectangle = rectangle;
  const Vector2d half = options.size_m / 2.0;
  if (!options.yaw_deg) {
    plan.cut_from_map = turn_about(rectangle.center, -rectangle.yaw_deg) * level;
    plan.prism.polygon = make_rectangle(rectangle.center - half, rectangle.center + half);
    return;
  }
  const Pose turn = turn_about(source.middle, *options.yaw_deg);
  const Pose from_rectangle = turn_about(rectangle.center, rectangle.yaw_deg);
  const XyPolygon straight = make_rectangle(rectangle.center - half, rectangle.center + half);
  plan.cut_from_map = turn * level;
  plan.prism.polygon = XyPolygon(moved(straight.corners(), turn * from_rectangle));
}

void lay_border(const Source& source, const CropOptions& options, const Pose& level, Plan& plan) {
  const PointCloud view = source.view(level, options.band.cell_m);
  plan.report.band = find_border_band(view, options.rectangle.margin_m, options.band);
  if (options.border_size_m)
    plan.report.border_scale = scale_by_border(*plan.report.band, *options.border_size_m);
  const std::vector<Vector2d>& corners = plan.report.band->corners;
  Vector2d center = Vector2d::Zero();
  for (const Vector2d& corner : corners) center += corner / static_cast<double>(corners.size());
  const Pose turn = options.yaw_deg ? turn_about(source.middle, *options.yaw_deg)
                                    : turn_about(center, -yaw_of(corners));
  plan.cut_from_map = turn * level;
  plan.prism.polygon = XyPolygon(moved(corners, turn));
}

// Plans the cut along the given box or polygon.
void lay_given(const Source& source, const CropOptions& options, const Pose& level, Plan& plan) {
  const Pose turned = options.yaw_deg ? turn_about(source.middle, *options.yaw_deg) * level : level;
  if (options.frame == CropFrame::map)
    plan.site_from_cut = turned;
  else
    plan.cut_from_map = turned;
  if (options.region == CropRegion::polygon) plan.prism.polygon = XyPolygon(options.polygon);
  if (options.region != CropRegion::box) return;
  plan.prism.polygon = make_rectangle(options.box.min.head<2>(), options.box.max.head<2>());
  plan.prism.min_z = options.box.min.z();
  plan.prism.max_z = options.box.max.z();
}

// Moves the center of the outline's bounding box to x = y = 0.
void center_outline(const CropOptions& options, Plan& plan) {
  const XyPolygon& outline = *plan.prism.polygon;
  const Vector2d middle = (outline.min() + outline.max()) / 2.0;
  Pose shift = Pose::Identity();
  shift.translation().head<2>() = -middle;
  plan.cut_from_map = shift * plan.cut_from_map;
  if (options.region == CropRegion::size && !options.yaw_deg) {
    const Vector2d half = options.size_m / 2.0;
    plan.prism.polygon = make_rectangle(-half, half);
    return;
  }
  std::vector<Vector2d> corners = outline.corners();
  for (Vector2d& corner : corners) corner -= middle;
  plan.prism.polygon = XyPolygon(std::move(corners));
}

void require_sound(const CropOptions& options) {
  const bool found = options.region == CropRegion::size || options.region == CropRegion::border;
  if (options.rectangle.margin_m > 0.0 && !found)
    throw Error("a margin requires a size or a border",
                {.field = "margin_m", .value = to_text(options.rectangle.margin_m)});
  if (options.frame == CropFrame::map && found)
    throw Error("--size and --border require the frame 'level'",
                {.field = "frame", .value = "map", .bound = "level"});
  if (options.yaw_deg && !std::isfinite(*options.yaw_deg))
    throw Error("not a finite angle", {.field = "yaw", .value = to_text(*options.yaw_deg)});
  if (options.region == CropRegion::box &&
      !(options.box.min.array() < options.box.max.array()).all())
    throw Error("the minimum must be below the maximum on each axis", {.field = "box"});
}

Plan make_plan(const Source& source, const CropOptions& options) {
  require_sound(options);
  Plan plan;
  const Pose level = level_frame(source, options, plan.report);
  if (options.region == CropRegion::size)
    lay_rectangle(source, options, level, plan);
  else if (options.region == CropRegion::border)
    lay_border(source, options, level, plan);
  else
    lay_given(source, options, level, plan);
  const bool cut_in_site = options.frame == CropFrame::level || !plan.prism.polygon;
  if (options.center && plan.prism.polygon && cut_in_site) center_outline(options, plan);
  if (plan.prism.polygon) plan.report.outline = plan.prism.polygon->corners();
  return plan;
}

// Moves a cut cloud or mesh to the site frame, and centers it if the outline was not centered.
// bounds_moved(pose) returns the bounds of the cut data moved by `pose`.
template <typename Bounds, typename Move>
void finish(Plan& plan, const CropOptions& options, const Bounds& bounds_moved, const Move& move) {
  CropReport& report = plan.report;
  Pose site_from_cut = plan.site_from_cut;
  const bool to_center = options.center && (!plan.prism.polygon || options.frame == CropFrame::map);
  if (to_center) {
    const Eigen::AlignedBox3d bounds = bounds_moved(site_from_cut);
    Pose shift = Pose::Identity();
    if (!bounds.isEmpty())
      shift.translation().head<2>() = -(bounds.min() + bounds.max()).head<2>() / 2.0;
    site_from_cut = shift * site_from_cut;
  }
  if (!is_identity(site_from_cut)) move(site_from_cut);
  report.outline = moved(report.outline, site_from_cut);
  report.site_from_map = site_from_cut * plan.cut_from_map;
}

Error nothing_inside(const Eigen::AlignedBox3d& bounds, const char* what) {
  const auto text = [](const Vector3d& p) {
    return to_fixed_text(p.x(), 2) + ", " + to_fixed_text(p.y(), 2) + ", " +
           to_fixed_text(p.z(), 2);
  };
  return Error("no part is inside the crop region; the points extend from " + text(bounds.min()) +
                   " to " + text(bounds.max()),
               {.field = what});
}

// Projection of a triangle to the x-y plane: its first corner and the two sides from it.
struct FlatTriangle {
  Vector2d a, ab, ac;

  double length() const { return ab.norm() + ac.norm() + (ac - ab).norm(); }
  // Range of x of the triangle at `y`, both relative to the first corner.
  std::array<double, 2> reach_at(double y) const {
    std::array<double, 2> reach = {HUGE_VAL, -HUGE_VAL};
    const std::array<Vector2d, 3> corners = {Vector2d::Zero(), ab, ac};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector2d& p = corners[k];
      const Vector2d& q = corners[(k + 1) % 3];
      if (y < std::min(p.y(), q.y()) || y > std::max(p.y(), q.y())) continue;
      const double fraction = p.y() == q.y() ? 0.0 : (y - p.y()) / (q.y() - p.y());
      const double x = p.x() + fraction * (q.x() - p.x());
      reach = {std::min(reach[0], x), std::max(reach[1], x)};
    }
    return reach;
  }
};

FlatTriangle flat(const TriangleMesh& mesh, const Triangle& corners) {
  const Vector2d a = mesh.vertices[corners[0]].head<2>();
  return {a, mesh.vertices[corners[1]].head<2>() - a, mesh.vertices[corners[2]].head<2>() - a};
}

void view_sides(const FlatTriangle& triangle, std::uint32_t n, double cell,
                std::vector<TrianglePoint>& samples) {
  const auto sides = [&](double length) { return std::clamp(std::ceil(length / cell), 1.0, 1e6); };
  const double on_ab = sides(triangle.ab.norm());
  const double on_ac = sides(triangle.ac.norm());
  const double on_bc = sides((triangle.ac - triangle.ab).norm());
  for (double k = 0.0; k < on_ab; ++k) samples.push_back({n, k / on_ab, 0.0});
  for (double k = 0.0; k < on_bc; ++k) samples.push_back({n, 1.0 - k / on_bc, k / on_bc});
  for (double k = 0.0; k < on_ac; ++k) samples.push_back({n, 0.0, 1.0 - k / on_ac});
}

// Samples each row within the triangle only, because an oblique triangle covers little of its
// bounding box. Steps are relative to the corner, because of rounding far from the origin.
void view_inside(const FlatTriangle& triangle, std::uint32_t n, double cell,
                 std::vector<TrianglePoint>& samples) {
  const auto& [a, ab, ac] = triangle;
  const double twice = ab.x() * ac.y() - ab.y() * ac.x();
  if (!(std::abs(twice) > cell * cell)) return;
  const double low = std::floor((a.y() + std::min({ab.y(), ac.y(), 0.0})) / cell);
  const double high = (a.y() + std::max({ab.y(), ac.y(), 0.0})) / cell;
  for (double row = 0.0; row <= high - low; ++row) {
    const double y = cell * (row + 0.5) + (cell * low - a.y());
    const std::array<double, 2> reach = triangle.reach_at(y);
    const double first = std::floor((a.x() + reach[0]) / cell) - 1.0;
    const double last = (a.x() + reach[1]) / cell + 1.0;
    for (double column = 0.0; column <= last - first; ++column) {
      const double x = cell * (column + 0.5) + (cell * first - a.x());
      const double u = (x * ac.y() - y * ac.x()) / twice;
      const double v = (ab.x() * y - ab.y() * x) / twice;
      if (u >= 0.0 && v >= 0.0 && u + v <= 1.0) samples.push_back({n, u, v});
    }
  }
}

// Samples of the surface from above: one in each cell that a triangle covers, and samples along its
// sides, for vertical triangles. The cell size is increased to limit the number of samples.
PointCloud view_of(const EachMesh& each, const Pose& level_from_map, double cell) {
  double area = 0.0;
  double length = 0.0;
  double triangles = 0.0;
  each([&](const TriangleMesh& given) {
    const TriangleMesh mesh = transform_mesh(given, level_from_map);
    for (const Triangle& triangle : mesh.triangles) {
      area += std::abs(area_normal(mesh, triangle).z());
      length += flat(mesh, triangle).length();
    }
    triangles += static_cast<double>(mesh.triangles.size());
  });
  const double max_on_sides = max_side_samples + 3.0 * triangles;
  cell = std::max({cell, std::sqrt(area / 2.0 / max_view_samples), length / max_on_sides});
  PointCloud view;
  each([&](const TriangleMesh& given) {
    const TriangleMesh mesh = transform_mesh(given, level_from_map);
    std::vector<TrianglePoint> samples;
    for (std::uint32_t n = 0; n < mesh.triangles.size(); ++n) {
      const FlatTriangle triangle = flat(mesh, mesh.triangles[n]);
      view_sides(triangle, n, cell, samples);
      view_inside(triangle, n, cell, samples);
    }
    PointCloud more = points_on_surface(mesh, samples);
    if (view.empty()) {
      view = std::move(more);
      view.fields.clear();
      return;
    }
    view.positions.insert(view.positions.end(), more.positions.begin(), more.positions.end());
    view.colors.insert(view.colors.end(), more.colors.begin(), more.colors.end());
    view.normals.insert(view.normals.end(), more.normals.begin(), more.normals.end());
  });
  return view;
}

Eigen::AlignedBox3d box_of(const std::vector<Vector3d>& positions, const Pose& pose) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& position : positions) box.extend(pose * position);
  return box;
}

Vector2d middle_of(const std::vector<Vector3d>& positions) {
  const Bounds3d bounds = bounds_of(positions);
  return (bounds.min + bounds.max).head<2>() / 2.0;
}

PointCloud finite_part(const PointCloud& cloud) {
  std::vector<std::size_t> finite;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (cloud.positions[n].allFinite()) finite.push_back(n);
  return finite.size() == cloud.size() ? cloud : select_points(cloud, finite);
}

}  // namespace

void bind(ParameterTable& table, CropOptions& options) {
  bind(table, options.ground);
  table.add("center", options.center, "move the center of the kept area to x = y = 0");
  bind(table, options.rectangle);
  bind(table, options.band);
}

CropCloudResult crop_cloud(const PointCloud& cloud, const CropOptions& options) {
  cloud.check();
  PointCloud kept = finite_part(cloud);
  if (kept.empty()) throw Error("none is finite", {.field = "points of the cloud"});
  Source source{kept.positions, kept.normals, middle_of(kept.positions), {}};
  source.view = [&](const Pose& level_from_map, double) {
    return transform_cloud(kept, level_from_map);
  };
  Plan plan = make_plan(source, options);
  if (!is_identity(plan.cut_from_map)) kept = transform_cloud(kept, plan.cut_from_map);
  PointCloud inside = clip_cloud(kept, plan.prism);
  if (inside.empty()) throw nothing_inside(box_of(kept.positions, Pose::Identity()), "cloud");
  finish(
      plan, options, [&](const Pose& pose) { return box_of(inside.positions, pose); },
      [&](const Pose& pose) { inside = transform_cloud(inside, pose); });
  return {std::move(inside), std::move(plan.report)};
}

CropReport crop_mesh_tiles(const EachMesh& each, const CropOptions& options,
                           const std::function<void(TriangleMesh)>& use) {
  double area = 0.0;
  Eigen::AlignedBox3d box;
  each([&](const TriangleMesh& mesh) {
    mesh.check();
    area += surface_area(mesh);
    for (const Vector3d& vertex : mesh.vertices) box.extend(vertex);
  });
  if (!std::isfinite(area)) throw Error("one is not finite", {.field = "corners of triangles"});
  if (!(area > 0.0))
    throw Error("the mesh has no surface to crop",
                {.field = "area", .value = to_text(area) + " m2", .bound = "> 0"});
  Source source;
  source.middle = (box.min() + box.max()).head<2>() / 2.0;
  if (options.level)
    each([&](const TriangleMesh& mesh) {
      if (!(surface_area(mesh) > 0.0)) return;
      for (const SurfacePoint& sample :
           sample_surface(mesh, ground_samples / area, options.ground.seed)) {
        source.ground_points.push_back(sample.position);
        source.normals.push_back(
            area_normal(mesh, mesh.triangles[sample.triangle]).normalized().cast<float>());
      }
    });
  source.view = [&](const Pose& level_from_map, double cell) {
    return view_of(each, level_from_map, cell);
  };
  Plan plan = make_plan(source, options);
  const auto each_cut = [&](const std::function<void(TriangleMesh)>& use_cut) {
    each([&](const TriangleMesh& mesh) {
      use_cut(
          cut_mesh(is_identity(plan.cut_from_map) ? mesh : transform_mesh(mesh, plan.cut_from_map),
                   plan.prism));
    });
  };
  Pose site_from_cut = Pose::Identity();
  finish(
      plan, options,
      [&](const Pose& pose) {
        Eigen::AlignedBox3d inside;
        each_cut([&](const TriangleMesh& mesh) {
          for (const Vector3d& vertex : mesh.vertices) inside.extend(pose * vertex);
        });
        return inside;
      },
      [&](const Pose& pose) { site_from_cut = pose; });
  bool is_empty = true;
  each_cut([&](TriangleMesh mesh) {
    is_empty = is_empty && mesh.triangles.empty();
    use(is_identity(site_from_cut) ? std::move(mesh) : transform_mesh(mesh, site_from_cut));
  });
  if (is_empty) {
    Eigen::AlignedBox3d all;
    each([&](const TriangleMesh& mesh) { all.extend(box_of(mesh.vertices, plan.cut_from_map)); });
    throw nothing_inside(all, "mesh");
  }
  return std::move(plan.report);
}

CropMeshResult crop_mesh(const TriangleMesh& mesh, const CropOptions& options) {
  CropMeshResult result;
  result.report = crop_mesh_tiles([&](const UseMesh& use) { use(mesh); }, options,
                                  [&](TriangleMesh cut) { result.mesh = std::move(cut); });
  return result;
}

}  // namespace libmap
