#include "libgtd/grasp/trial_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>

#include "libgtd/grasp/finger_closing.h"
#include "libgtd/grasp/holding_force.h"

namespace libgtd {

namespace {

constexpr const char* part_field = "scene_part";
constexpr int round_sides = 12;
constexpr int thin_sides = 3;
constexpr double most_loads = 3.0;

// Point in the frame of the patch.
struct ScenePoint {
  Eigen::Vector3d position;
  Eigen::Vector3d color;
};
using ScenePolygon = std::vector<ScenePoint>;

// Clips a polygon to `height` >= 0 (Sutherland and Hodgman 1974). Both triangles of a cut edge get
// the same point.
template <typename Height>
ScenePolygon clipped(const ScenePolygon& polygon, const Height& height) {
  ScenePolygon kept;
  for (std::size_t n = 0; n < polygon.size(); ++n) {
    ScenePoint a = polygon[n];
    ScenePoint b = polygon[(n + 1) % polygon.size()];
    if (height(a.position) >= 0.0) kept.push_back(a);
    if ((height(a.position) >= 0.0) == (height(b.position) >= 0.0)) continue;
    if (std::lexicographical_compare(b.position.begin(), b.position.end(), a.position.begin(),
                                     a.position.end()))
      std::swap(a, b);
    const double fraction = height(a.position) / (height(a.position) - height(b.position));
    kept.push_back({a.position + fraction * (b.position - a.position),
                    a.color + fraction * (b.color - a.color)});
  }
  return kept;
}

class SceneBuilder {
 public:
  explicit SceneBuilder(const Trial& trial) : trial_(trial) {
    scene_.vertex_fields.push_back({part_field, libmap::ScalarType::uint8, {}});
  }

  void add_ground(const libmap::TriangleMesh& mesh, const Eigen::AlignedBox3d& box) {
    const Eigen::Isometry3d patch_from_mesh = trial_.mesh_from_patch.inverse();
    std::vector<Eigen::Vector3d> positions;
    positions.reserve(mesh.vertices.size());
    for (const Eigen::Vector3d& vertex : mesh.vertices)
      positions.push_back(patch_from_mesh * vertex);
    for (const libmap::Triangle& triangle : mesh.triangles) {
      Eigen::AlignedBox3d around;
      for (const std::uint32_t corner : triangle) around.extend(positions[corner]);
      if (!box.intersects(around)) continue;
      ScenePolygon polygon;
      for (const std::uint32_t corner : triangle)
        polygon.push_back({positions[corner], ground_color(mesh, corner)});
      for (Eigen::Index axis = 0; axis < 3 && !box.contains(around); ++axis) {
        polygon = clipped(polygon, [&](const auto& p) { return p[axis] - box.min()[axis]; });
        polygon = clipped(polygon, [&](const auto& p) { return box.max()[axis] - p[axis]; });
      }
      for (std::size_t n = 2; n < polygon.size(); ++n)
        scene_.triangles.push_back(
            {ground_vertex(polygon[0]), ground_vertex(polygon[n - 1]), ground_vertex(polygon[n])});
    }
  }

  // Rings around an axis, {distance from `origin`, radius} each, and the surface between adjacent
  // rings; its front faces away from the axis if the distance increases. Edges at rings are sharp
  // unless `round`.
  using Rings = std::vector<std::array<double, 2>>;
  void add_rings(ScenePart part, const Eigen::Vector3d& origin, const Eigen::Vector3d& axis,
                 const Rings& rings, int sides = round_sides, bool round = false) {
    const Eigen::Vector3d u = axis.unitOrthogonal();
    const Eigen::Vector3d v = axis.cross(u);
    const auto count = static_cast<std::uint32_t>(sides);
    const auto add_ring = [&](const std::array<double, 2>& ring) {
      for (int n = 0; n < sides; ++n) {
        const double angle = n * 2.0 * std::numbers::pi / sides;
        add_vertex(part,
                   origin + ring[0] * axis + ring[1] * (std::cos(angle) * u + std::sin(angle) * v));
      }
    };
    if (round) add_ring(rings.front());
    for (std::size_t n = 1; n < rings.size(); ++n) {
      if (!round) add_ring(rings[n - 1]);
      add_ring(rings[n]);
      const auto upper = static_cast<std::uint32_t>(scene_.vertices.size()) - count;
      const std::uint32_t lower = upper - count;
      for (std::uint32_t side = 0; side < count; ++side) {
        const std::uint32_t next = (side + 1) % count;
        if (rings[n - 1][1] > 0.0)
          scene_.triangles.push_back({lower + side, lower + next, upper + next});
        if (rings[n][1] > 0.0)
          scene_.triangles.push_back({lower + side, upper + next, upper + side});
      }
    }
  }

  // Adds a rod with open ends.
  void add_rod(ScenePart part, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
               double from_radius, double to_radius, int sides = round_sides) {
    const double length = (to - from).norm();
    if (length > 0.0)
      add_rings(part, from, (to - from) / length, {{0.0, from_radius}, {length, to_radius}}, sides);
  }

  void add_sphere(ScenePart part, const Eigen::Vector3d& center, double radius) {
    constexpr int rings = scene_sphere_vertices / round_sides;
    Rings profile;
    for (int n = 0; n < rings; ++n) {
      const double angle = n * std::numbers::pi / (rings - 1);
      const bool is_pole = n == 0 || n == rings - 1;
      profile.push_back({-radius * std::cos(angle), is_pole ? 0.0 : radius * std::sin(angle)});
    }
    add_rings(part, center, Eigen::Vector3d::UnitZ(), profile, round_sides, true);
  }

  libmap::TriangleMesh take() { return std::move(scene_); }

 private:
  static Eigen::Vector3d ground_color(const libmap::TriangleMesh& mesh, std::uint32_t vertex) {
    const libmap::Color& color =
        mesh.vertex_colors.empty() ? scene_parts()[0].color : mesh.vertex_colors[vertex];
    return {static_cast<double>(color[0]), static_cast<double>(color[1]),
            static_cast<double>(color[2])};
  }

  std::uint32_t add_vertex(ScenePart part, const Eigen::Vector3d& position) {
    scene_.vertices.push_back(trial_.mesh_from_patch * position);
    scene_.vertex_colors.push_back(scene_parts()[static_cast<std::size_t>(part)].color);
    scene_.vertex_fields[0].values.push_back(static_cast<double>(part));
    return static_cast<std::uint32_t>(scene_.vertices.size() - 1);
  }

  std::uint32_t ground_vertex(const ScenePoint& point) {
    const auto [entry, is_new] =
        ground_.try_emplace({point.position.x(), point.position.y(), point.position.z()}, 0);
    if (is_new) {
      entry->second = add_vertex(ScenePart::ground, point.position);
      for (Eigen::Index n = 0; n < 3; ++n)
        scene_.vertex_colors.back()[static_cast<std::size_t>(n)] =
            static_cast<std::uint8_t>(std::lround(point.color[n]));
    }
    return entry->second;
  }

  const Trial& trial_;
  libmap::TriangleMesh scene_;
  std::map<std::array<double, 3>, std::uint32_t> ground_;  // vertices by position
};

// Dimensions of a scene, m.
struct SceneMeasures {
  explicit SceneMeasures(const Gripper& gripper)
      : finger(finger_geometry(gripper)),
        reach(finger.joint_radius_m + finger.proximal_m + finger.distal_m),
        palm(0.0005 * gripper.palm_diameter_mm),
        link(0.035 * (finger.proximal_m + finger.distal_m)) {}

  FingerGeometry finger;
  double reach;
  double palm;  // radius
  double link;  // radius
};

void add_gripper(const SceneMeasures& measures, const Trial& trial, SceneBuilder& builder) {
  const Eigen::Isometry3d& pose = trial.gripper.patch_from_gripper;
  const double height = 1.5 * measures.link;
  // A ring, so that the ground below the palm is visible.
  const double inner = 0.7 * measures.palm;
  builder.add_rings(
      ScenePart::gripper, pose.translation(), pose.linear().col(2),
      {{0.0, inner}, {0.0, measures.palm}, {height, measures.palm}, {height, inner}, {0.0, inner}},
      3 * round_sides);
  std::vector<bool> bears(trial.gripper.fingers.size(), false);
  for (const BearingContact& contact : trial.bearing) bears[contact.finger()] = true;
  for (std::size_t n = 0; n < trial.gripper.fingers.size(); ++n) {
    const ClosedFinger& finger = trial.gripper.fingers[n];
    const auto at = [&](const Eigen::Vector2d& in_plane) {
      return pose * Eigen::Vector3d(in_plane.x() * std::cos(finger.azimuth_rad),
                                    in_plane.x() * std::sin(finger.azimuth_rad), in_plane.y());
    };
    const double angle = finger.closing.proximal_rad;
    const Eigen::Vector3d joint = at(measures.finger.joint());
    const Eigen::Vector3d knuckle = at(measures.finger.knuckle(angle));
    const Eigen::Vector3d tip = at(measures.finger.tip(angle, finger.closing.curl_rad));
    const double thin = 0.25 * measures.link;
    builder.add_rod(ScenePart::gripper, at({inner, 0.5 * height}), joint, measures.link,
                    measures.link);
    builder.add_rod(ScenePart::gripper, joint, knuckle, measures.link, measures.link);
    builder.add_rod(ScenePart::gripper, knuckle, tip, measures.link, thin);
    builder.add_sphere(ScenePart::gripper, joint, 1.3 * measures.link);
    builder.add_sphere(ScenePart::gripper, knuckle, 1.3 * measures.link);
    if (!bears[n]) builder.add_sphere(ScenePart::idle, tip, 1.5 * measures.link);
  }
}

void add_contacts(const SceneMeasures& measures, const Trial& trial, SceneBuilder& builder) {
  const double length = 10.0 * measures.link;
  const double thin = 0.2 * measures.link;
  for (const BearingContact& contact : trial.bearing) {
    builder.add_sphere(contact.is_link() ? ScenePart::link : ScenePart::engaged, contact.point(),
                       1.5 * measures.link);
    const std::vector<Eigen::Vector3d> edges = contact.cone();
    for (std::size_t n = 0; n < edges.size(); ++n) {
      const Eigen::Vector3d end = contact.point() + length * edges[n];
      const Eigen::Vector3d next = contact.point() + length * edges[(n + 1) % edges.size()];
      builder.add_rod(ScenePart::cone, contact.point(), end, thin, thin, thin_sides);
      builder.add_rod(ScenePart::cone, end, next, thin, thin, thin_sides);
    }
  }
}

void add_pull(const SceneMeasures& measures, const Trial& trial, double load_n,
              SceneBuilder& builder) {
  const Eigen::Vector3d& origin = trial.gripper.patch_from_gripper.translation();
  const Eigen::Vector3d& direction = pull_directions()[trial.direction].vector;
  const double load = 2.0 * measures.palm;  // length of an arrow of the load
  const double radius = 0.8 * measures.link;
  const double disc = 3.0 * measures.link;
  builder.add_rod(ScenePart::load, origin, origin + load * direction, 0.3 * radius, 0.3 * radius,
                  thin_sides);
  const double thick = 0.4 * radius;
  builder.add_rings(ScenePart::load, origin + load * direction, direction,
                    {{0.0, 0.0}, {0.0, disc}, {thick, disc}, {thick, 0.0}});
  const double length = load * std::min(most_loads, trial.force_n / load_n);
  const double head = std::min(length, 5.0 * radius);
  if (length > 0.0)
    builder.add_rings(ScenePart::pull, origin, direction,
                      {{0.0, 0.0},
                       {0.0, radius},
                       {length - head, radius},
                       {length - head, 2.2 * radius},
                       {length, 0.0}});
}

}  // namespace

const std::vector<ScenePartStyle>& scene_parts() {
  static const std::vector<ScenePartStyle> parts = {
      {ScenePart::ground, {176, 170, 160}, ""},
      {ScenePart::gripper, {50, 80, 130}, "gripper"},
      {ScenePart::engaged, {30, 160, 70}, "contact by spines"},
      {ScenePart::link, {250, 200, 30}, "contact by a link"},
      {ScenePart::idle, {215, 40, 40}, "bears nothing"},
      {ScenePart::cone, {60, 165, 245}, "forces of the steepest facet"},
      {ScenePart::pull, {150, 50, 180}, "largest pull in the weakest direction"},
      {ScenePart::load, {20, 20, 20}, "the load"}};
  return parts;
}

std::vector<ScenePartStyle> shown_parts(const libmap::TriangleMesh& scene) {
  std::vector<bool> occurs(scene_parts().size(), false);
  for (const libmap::ScalarField& field : scene.vertex_fields) {
    if (field.name != part_field) continue;
    for (const double value : field.values) {
      if (!(value >= 0.0 && value < static_cast<double>(occurs.size()))) return {};
      occurs[static_cast<std::size_t>(value)] = true;
    }
  }
  std::vector<ScenePartStyle> parts;
  for (std::size_t n = 0; n < occurs.size(); ++n)
    if (occurs[n] && !scene_parts()[n].text.empty()) parts.push_back(scene_parts()[n]);
  return parts;
}

libmap::TriangleMesh trial_scene(const libmap::TriangleMesh& mesh, const Gripper& gripper,
                                 const Trial& trial, double load_n) {
  const SceneMeasures measures(gripper);
  SceneBuilder builder(trial);
  // Down to slightly below the lowest position of a finger.
  const double half = 1.15 * measures.reach;
  const double low = trial.gripper.patch_from_gripper.translation().z() - measures.reach;
  builder.add_ground(mesh, Eigen::AlignedBox3d(Eigen::Vector3d(-half, -half, low),
                                               Eigen::Vector3d::Constant(half)));
  if (trial.gripper.approach != ApproachOutcome::on_ground) {
    builder.add_sphere(ScenePart::idle, Eigen::Vector3d::Zero(), 1.5 * measures.link);
    return builder.take();
  }
  add_gripper(measures, trial, builder);
  add_contacts(measures, trial, builder);
  add_pull(measures, trial, load_n, builder);
  return builder.take();
}

}  // namespace libgtd
