#include "libmap/simulate/field_points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <tuple>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr double hard_slope_deg = 60.0;
// Thresholds of the eigenvalues of the normals' mean outer product, whose sum is 1.
constexpr double arc_fraction = 0.05;  // an edge of 26 degrees
constexpr double tip_fraction = 0.04;
constexpr double hollow_fraction = 0.06;  // mean depth below the neighbors' planes, in radii

// Triangles connected to the vertex within a ball around it.
std::vector<std::uint32_t> triangles_within(const TriangleMesh& mesh, const VertexTriangles& around,
                                            std::uint32_t vertex, double radius_m) {
  std::vector<std::uint32_t> found;
  std::vector<std::uint32_t> open = {vertex};
  std::vector<std::uint32_t> seen = {vertex};
  while (!open.empty()) {
    const std::uint32_t at = open.back();
    open.pop_back();
    for (const std::uint32_t triangle : around.of(at)) {
      found.push_back(triangle);
      for (const std::uint32_t next : mesh.triangles[triangle]) {
        if ((mesh.vertices[next] - mesh.vertices[vertex]).norm() > radius_m) continue;
        if (std::find(seen.begin(), seen.end(), next) != seen.end()) continue;
        seen.push_back(next);
        open.push_back(next);
      }
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

// Sets kind and mean normal of the vertex's neighborhood.
void look_around(const TriangleMesh& mesh, const VertexTriangles& around, std::uint32_t vertex,
                 double radius_m, FieldPoint& point) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double area = 0.0;
  double hollow = 0.0;
  for (const std::uint32_t number : triangles_within(mesh, around, vertex, radius_m)) {
    const Triangle& triangle = mesh.triangles[number];
    const Eigen::Vector3d vector = 0.5 * area_normal(mesh, triangle);  // its length is the area
    const Eigen::Vector3d center = center_of(mesh, triangle);
    const double own = vector.norm();
    if (own <= 0.0) continue;
    spread += vector * vector.transpose() / own;
    sum += vector;
    area += own;
    hollow += std::max(0.0, (mesh.vertices[vertex] - center).dot(vector)) -
              0.5 * std::max(0.0, (center - mesh.vertices[vertex]).dot(vector));
  }
  if (area <= 0.0) return;
  point.normal = sum.normalized();
  const Eigen::Vector3d eigenvalues = symmetric_eigen(Eigen::Matrix3d(spread / area)).values;
  if (hollow / area > hollow_fraction * radius_m)
    point.kind = LocationKind::irregular;
  else if (eigenvalues[0] > tip_fraction)
    point.kind = LocationKind::corner;
  else if (eigenvalues[1] > arc_fraction)
    point.kind = LocationKind::edge;
  else
    point.kind = LocationKind::flat;
}

const ScalarField& rock_field(const TriangleMesh& mesh) {
  if (const ScalarField* field = find_field(mesh.face_fields, "rock")) return *field;
  throw Error("no such face field; use a mesh of graspmap simulate site", {.field = "rock"});
}

// Rock of each vertex; 0 unless all of its triangles belong to one rock.
std::vector<int> vertex_rocks(const TriangleMesh& mesh) {
  const ScalarField& field = rock_field(mesh);
  constexpr int unseen = -1;
  std::vector<int> rocks(mesh.vertices.size(), unseen);
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
    const int rock = static_cast<int>(field.values[n]);
    for (const std::uint32_t vertex : mesh.triangles[n])
      rocks[vertex] = rocks[vertex] == unseen || rocks[vertex] == rock ? rock : 0;
  }
  return rocks;
}

struct Candidate {
  std::uint32_t vertex = 0;
  FieldPoint point;
};

// The first rock vertex in each cubic cell with a side of half the radius, if it is high enough.
std::vector<Candidate> candidates_of(const RockSite& site, const TriangleMesh& mesh) {
  const FieldPointOptions& options = site.field_points;
  const GroundRelief relief(site);
  const Pose ground_from_site = site.site_from_ground().inverse();
  const std::vector<int> rocks = vertex_rocks(mesh);
  std::map<std::array<std::int64_t, 3>, std::uint32_t> cells;
  for (std::uint32_t vertex = 0; vertex < mesh.vertices.size(); ++vertex) {
    if (rocks[vertex] <= 0) continue;
    const Eigen::Vector3d cell = mesh.vertices[vertex] / (0.5 * options.radius_m);
    cells.emplace(std::array<std::int64_t, 3>{static_cast<std::int64_t>(std::floor(cell.x())),
                                              static_cast<std::int64_t>(std::floor(cell.y())),
                                              static_cast<std::int64_t>(std::floor(cell.z()))},
                  vertex);
  }
  std::vector<Candidate> candidates;
  for (const auto& [cell, vertex] : cells) {
    const Eigen::Vector3d local = ground_from_site * mesh.vertices[vertex];
    Candidate candidate;
    candidate.vertex = vertex;
    candidate.point.position = mesh.vertices[vertex];
    candidate.point.rock = rocks[vertex] - 1;
    candidate.point.height_m = local.z() - relief.height(local.x(), local.y());
    if (candidate.point.height_m >= options.min_height_m) candidates.push_back(candidate);
  }
  const VertexTriangles around = triangles_at_vertices(mesh.triangles, mesh.vertices.size());
  parallel_each(candidates.size(), 64, [&](std::size_t n) {
    FieldPoint& point = candidates[n].point;
    look_around(mesh, around, candidates[n].vertex, options.radius_m, point);
    const double up = (ground_from_site.linear() * point.normal).z();
    point.slope_deg = std::acos(std::clamp(up, -1.0, 1.0)) * 180.0 / M_PI;
    point.is_hard = point.slope_deg > hard_slope_deg;
  });
  return candidates;
}

class Chooser {
 public:
  Chooser(const RockSite& site, std::vector<Candidate> candidates)
      : candidates_(std::move(candidates)),
        distances_(candidates_.size(), std::numeric_limits<double>::infinity()),
        by_rock_(site.rocks.size(), 0),
        spacing_m_(site.field_points.radius_m) {}

  // Returns false if no candidate is left.
  bool choose_next() {
    const std::optional<int> rock = min_used_rock();
    if (!rock) return false;
    const auto is_open = [&](std::size_t n) {
      return candidates_[n].point.rock == *rock && distances_[n] >= spacing_m_;
    };
    // Prefers the rarest kind on the rock, then on the site, then the rarer difficulty.
    std::optional<std::size_t> best;
    for (std::size_t n = 0; n < candidates_.size(); ++n)
      if (is_open(n) && (!best || is_better(n, *best))) best = n;
    take(*best);
    return true;
  }

  std::vector<FieldPoint> chosen() && { return std::move(chosen_); }

 private:
  std::optional<int> min_used_rock() const {
    std::optional<int> rock;
    for (std::size_t n = 0; n < candidates_.size(); ++n) {
      if (distances_[n] < spacing_m_) continue;
      const int own = candidates_[n].point.rock;
      if (!rock || std::pair(uses(own), own) < std::pair(uses(*rock), *rock)) rock = own;
    }
    return rock;
  }

  int uses(int rock) const { return by_rock_[static_cast<std::size_t>(rock)]; }
  int uses(const FieldPoint& point) const { return by_kind_[static_cast<std::size_t>(point.kind)]; }
  int uses_on_rock(const FieldPoint& point) const {
    return static_cast<int>(
        std::count_if(chosen_.begin(), chosen_.end(), [&](const FieldPoint& other) {
          return other.rock == point.rock && other.kind == point.kind;
        }));
  }

  bool is_better(std::size_t a, std::size_t b) const {
    const auto rank = [this](std::size_t n) {
      const FieldPoint& point = candidates_[n].point;
      return std::tuple(uses_on_rock(point), uses(point), point.kind,
                        by_difficulty_[point.is_hard ? 1 : 0], -distances_[n], -point.height_m);
    };
    return rank(a) < rank(b);
  }

  void take(std::size_t index) {
    const FieldPoint& point = candidates_[index].point;
    ++by_rock_[static_cast<std::size_t>(point.rock)];
    ++by_kind_[static_cast<std::size_t>(point.kind)];
    ++by_difficulty_[point.is_hard ? 1 : 0];
    for (std::size_t n = 0; n < candidates_.size(); ++n)
      distances_[n] =
          std::min(distances_[n], (candidates_[n].point.position - point.position).norm());
    chosen_.push_back(point);
  }

  std::vector<Candidate> candidates_;
  std::vector<double> distances_;  // to the nearest chosen point
  std::vector<int> by_rock_;
  std::array<int, 4> by_kind_{};
  std::array<int, 2> by_difficulty_{};
  double spacing_m_;
  std::vector<FieldPoint> chosen_;
};

}  // namespace

const std::string& location_kind_name(LocationKind kind) {
  static const std::array<std::string, 4> names = {"flat", "edge", "corner", "irregular"};
  return names[static_cast<std::size_t>(kind)];
}

std::vector<FieldPoint> choose_field_points(const RockSite& site, const TriangleMesh& mesh) {
  Chooser chooser(site, candidates_of(site, mesh));
  for (int n = 0; n < site.field_points.count; ++n) {
    if (!chooser.choose_next())
      throw Error("too few suitable locations on the rocks",
                  {.field = "field_points.count",
                   .value = std::to_string(site.field_points.count),
                   .bound = "<= " + std::to_string(n) + " for this site"});
  }
  return std::move(chooser).chosen();
}

Table field_point_table(const RockSite& site, const std::vector<FieldPoint>& points) {
  Table table;
  table.columns = {"place", "x", "y", "z", "kind", "difficulty", "rock", "height_m", "slope_deg"};
  const std::size_t digits = std::max<std::size_t>(2, std::to_string(points.size()).size());
  for (std::size_t n = 0; n < points.size(); ++n) {
    const FieldPoint& point = points[n];
    std::string number = std::to_string(n + 1);
    number.insert(0, digits - std::min(digits, number.size()), '0');
    const SiteRock& rock = site.rocks[static_cast<std::size_t>(point.rock)];
    table.rows.push_back({"P" + number, to_fixed_text(point.position.x(), 4),
                          to_fixed_text(point.position.y(), 4),
                          to_fixed_text(point.position.z(), 4), location_kind_name(point.kind),
                          point.is_hard ? "hard" : "easy",
                          rock.name.empty() ? std::to_string(point.rock + 1) : rock.name,
                          to_fixed_text(point.height_m, 3), to_fixed_text(point.slope_deg, 0)});
  }
  return table;
}

}  // namespace libmap
