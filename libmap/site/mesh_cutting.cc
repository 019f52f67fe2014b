#include "libmap/site/mesh_cutting.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double snap_m = 1e-7;  // vertices within this distance of a cut are moved onto it
constexpr double reach_m = 4.0 * snap_m;  // margin of bounding boxes
constexpr std::uint32_t none = 0xffffffff;

// Part of the triangle `source` of the original mesh.
struct Piece {
  Triangle corners{};
  std::uint32_t source = 0;
};

// Vertical plane through an edge of the polygon, or horizontal plane.
class Cut {
 public:
  static Cut along(const Vector2d& from, const Vector2d& to) {
    Cut cut;
    cut.from_ = from;
    cut.to_ = to;
    cut.length_ = (to - from).norm();
    cut.direction_ = (to - from) / cut.length_;
    return cut;
  }
  static Cut at_height(double z) {
    Cut cut;
    cut.level_ = true;
    cut.z_ = z;
    return cut;
  }

  double distance(const Vector3d& p) const {
    if (level_) return p.z() - z_;
    const Vector2d offset = p.head<2>() - from_;
    return direction_.x() * offset.y() - direction_.y() * offset.x();
  }
  // True if a point on the line through the edge is on the edge.
  bool reaches(const Vector3d& p) const {
    if (level_) return true;
    const double along = direction_.dot(p.head<2>() - from_);
    return along >= -snap_m && along <= length_ + snap_m;
  }
  // Moves a point onto the cut, exactly if the cut is parallel to an axis.
  void place(Vector3d& p) const {
    if (level_) {
      p.z() = z_;
    } else if (from_.x() == to_.x()) {
      p.x() = from_.x();
    } else if (from_.y() == to_.y()) {
      p.y() = from_.y();
    } else {
      const double off = distance(p);
      p.x() += off * direction_.y();
      p.y() -= off * direction_.x();
    }
  }
  bool is_level() const { return level_; }
  bool may_touch(const Vector3d& low, const Vector3d& high) const {
    if (level_) return low.z() <= z_ + reach_m && high.z() >= z_ - reach_m;
    return (from_.cwiseMin(to_).array() <= high.head<2>().array() + reach_m).all() &&
           (from_.cwiseMax(to_).array() >= low.head<2>().array() - reach_m).all();
  }

 private:
  Vector2d from_ = Vector2d::Zero();
  Vector2d to_ = Vector2d::Zero();
  Vector2d direction_ = Vector2d::UnitX();
  double length_ = 0.0;
  bool level_ = false;
  double z_ = 0.0;
};

class MeshCutter {
 public:
  MeshCutter(TriangleMesh& mesh, std::vector<Piece> pieces)
      : mesh_(mesh), fixed_(mesh.vertices.size(), 0), pieces_(std::move(pieces)) {}

  void cut(const Cut& cut);
  // Inserts a vertex at the corner's x and y into every piece above or below it.
  void insert_corner(const Vector2d& corner);
  const std::vector<Piece>& pieces() const { return pieces_; }

 private:
  // Vertices on edges, by the end vertices of the edge.
  using EdgeVertices = std::unordered_map<std::uint64_t, std::uint32_t>;

  static std::uint64_t key(std::uint32_t a, std::uint32_t b) {
    return (static_cast<std::uint64_t>(std::min(a, b)) << 32U) | std::max(a, b);
  }
  const Vector3d& at(std::uint32_t vertex) const { return mesh_.vertices[vertex]; }
  std::array<Vector3d, 2> box_of(const Piece& piece) const;
  std::vector<std::size_t> pieces_where(
      const std::function<bool(const Vector3d&, const Vector3d&)>& near) const;
  std::uint32_t vertex_on(EdgeVertices& vertices, std::uint32_t a, std::uint32_t b, double t,
                          const std::function<void(Vector3d&)>& place);
  void cut_edge(const Cut& cut, std::uint32_t a, std::uint32_t b, EdgeVertices& vertices);
  void corner_on_edge(const Vector2d& corner, std::uint32_t a, std::uint32_t b,
                      EdgeVertices& vertices);
  void split_at(std::size_t piece, const EdgeVertices& vertices);
  bool insert_inside(std::size_t piece, const Vector2d& corner);

  TriangleMesh& mesh_;
  std::vector<char> fixed_;  // vertices on the border
  std::vector<Piece> pieces_;
};

std::array<Vector3d, 2> MeshCutter::box_of(const Piece& piece) const {
  const Vector3d& a = at(piece.corners[0]);
  const Vector3d& b = at(piece.corners[1]);
  const Vector3d& c = at(piece.corners[2]);
  return {a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)};
}

std::vector<std::size_t> MeshCutter::pieces_where(
    const std::function<bool(const Vector3d&, const Vector3d&)>& near) const {
  std::vector<std::size_t> found;
  for (std::size_t n = 0; n < pieces_.size(); ++n) {
    const auto [low, high] = box_of(pieces_[n]);
    if (near(low, high)) found.push_back(n);
  }
  return found;
}

std::uint32_t MeshCutter::vertex_on(EdgeVertices& vertices, std::uint32_t a, std::uint32_t b,
                                    double t, const std::function<void(Vector3d&)>& place) {
  const auto [entry, is_new] = vertices.try_emplace(key(a, b), none);
  if (is_new) {
    entry->second = append_vertex_between(mesh_, a, b, t);
    fixed_.push_back(0);
    Vector3d& p = mesh_.vertices.back();
    // Between two vertices of an earlier cut, the vertex is exactly on that cut.
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      if (at(a)[axis] == at(b)[axis]) p[axis] = at(a)[axis];
    place(p);
  }
  return entry->second;
}

void MeshCutter::cut_edge(const Cut& cut, std::uint32_t a, std::uint32_t b,
                          EdgeVertices& vertices) {
  // The order of the ends is fixed, so that both triangles at the edge get the same vertex.
  if (a > b) std::swap(a, b);
  const double from = cut.distance(at(a));
  const double to = cut.distance(at(b));
  if (std::abs(from) <= snap_m || std::abs(to) <= snap_m || (from > 0.0) == (to > 0.0)) return;
  const double t = from / (from - to);
  if (cut.reaches(at(a) + t * (at(b) - at(a))))
    fixed_[vertex_on(vertices, a, b, t, [&](Vector3d& p) { cut.place(p); })] =
        cut.is_level() ? 0 : 1;
}

// Splits a piece at the vertices on its edges.
void MeshCutter::split_at(std::size_t piece, const EdgeVertices& vertices) {
  const std::uint32_t source = pieces_[piece].source;
  const Triangle corners = pieces_[piece].corners;
  std::array<std::uint32_t, 3> on{};  // on the edge from corner k to the next
  std::size_t count = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto found = vertices.find(key(corners[k], corners[(k + 1) % 3]));
    on[k] = found == vertices.end() ? none : found->second;
    count += on[k] != none ? 1U : 0U;
  }
  if (count == 0) return;
  const auto replace = [&](const Triangle& first, std::initializer_list<Triangle> others) {
    pieces_[piece].corners = first;
    for (const Triangle& other : others) pieces_.push_back({other, source});
  };
  // Rotated so that the only cut or the only uncut edge is the last.
  std::size_t last = 0;
  while (count < 3 && (on[last] != none) != (count == 1)) ++last;
  const std::uint32_t a = corners[(last + 1) % 3];
  const std::uint32_t b = corners[(last + 2) % 3];
  const std::uint32_t c = corners[last];
  const std::uint32_t ab = on[(last + 1) % 3];
  const std::uint32_t bc = on[(last + 2) % 3];
  const std::uint32_t ca = on[last];
  if (count == 1) {
    // Here the last edge is that from c to a.
    replace({c, ca, b}, {{ca, a, b}});
  } else if (count == 3) {
    replace({a, ab, ca}, {{ab, b, bc}, {bc, c, ca}, {ab, bc, ca}});
  } else if ((at(a) - at(bc)).squaredNorm() <= (at(ab) - at(c)).squaredNorm()) {
    replace({ab, b, bc}, {{a, ab, bc}, {a, bc, c}});
  } else {
    replace({ab, b, bc}, {{a, ab, c}, {ab, bc, c}});
  }
}

void MeshCutter::cut(const Cut& cut) {
  const std::vector<std::size_t> touched = pieces_where(
      [&](const Vector3d& low, const Vector3d& high) { return cut.may_touch(low, high); });
  for (const std::size_t n : touched)
    for (const std::uint32_t v : pieces_[n].corners) {
      Vector3d& p = mesh_.vertices[v];
      if (fixed_[v] != 0 || std::abs(cut.distance(p)) > snap_m || !cut.reaches(p)) continue;
      cut.place(p);
      fixed_[v] = cut.is_level() ? 0 : 1;
    }
  EdgeVertices vertices;
  for (const std::size_t n : touched) {
    const Triangle corners = pieces_[n].corners;
    for (std::size_t k = 0; k < 3; ++k) cut_edge(cut, corners[k], corners[(k + 1) % 3], vertices);
  }
  for (const std::size_t n : touched) split_at(n, vertices);
}

void MeshCutter::corner_on_edge(const Vector2d& corner, std::uint32_t a, std::uint32_t b,
                                EdgeVertices& vertices) {
  if (a > b) std::swap(a, b);
  const Vector2d from = at(a).head<2>();
  const Vector2d along = at(b).head<2>() - from;
  if ((corner - from).norm() <= snap_m || (corner - from - along).norm() <= snap_m) return;
  const double t = (corner - from).dot(along) / along.squaredNorm();
  if (!(t > 0.0 && t < 1.0) || (corner - from - t * along).norm() > snap_m) return;
  fixed_[vertex_on(vertices, a, b, t, [&](Vector3d& p) { p.head<2>() = corner; })] = 1;
}

bool MeshCutter::insert_inside(std::size_t piece, const Vector2d& corner) {
  const Triangle corners = pieces_[piece].corners;
  std::array<double, 3> weights{};
  const Vector2d a = at(corners[0]).head<2>();
  const Vector2d b = at(corners[1]).head<2>();
  const Vector2d c = at(corners[2]).head<2>();
  const auto twice_area = [](const Vector2d& p, const Vector2d& q, const Vector2d& r) {
    return (q - p).x() * (r - p).y() - (q - p).y() * (r - p).x();
  };
  const double whole = twice_area(a, b, c);
  weights = {twice_area(corner, b, c) / whole, twice_area(a, corner, c) / whole,
             twice_area(a, b, corner) / whole};
  for (const double weight : weights)
    if (!(weight > 0.0)) return false;
  const std::uint32_t on_ab =
      append_vertex_between(mesh_, corners[0], corners[1], weights[1] / (weights[0] + weights[1]));
  const std::uint32_t inside = append_vertex_between(mesh_, on_ab, corners[2], weights[2]);
  mesh_.vertices[inside].head<2>() = corner;
  fixed_.push_back(0);
  fixed_.push_back(1);
  const std::uint32_t source = pieces_[piece].source;
  pieces_[piece].corners = {corners[0], corners[1], inside};
  pieces_.push_back({{corners[1], corners[2], inside}, source});
  pieces_.push_back({{corners[2], corners[0], inside}, source});
  return true;
}

void MeshCutter::insert_corner(const Vector2d& corner) {
  const std::vector<std::size_t> over =
      pieces_where([&](const Vector3d& low, const Vector3d& high) {
        return (corner.array() >= low.head<2>().array() - reach_m).all() &&
               (corner.array() <= high.head<2>().array() + reach_m).all();
      });
  const auto stands_on = [&](std::uint32_t v) { return at(v).head<2>() == corner; };
  for (const std::size_t n : over)
    for (const std::uint32_t v : pieces_[n].corners)
      if (fixed_[v] == 0 && (at(v).head<2>() - corner).norm() <= snap_m) {
        mesh_.vertices[v].head<2>() = corner;
        fixed_[v] = 1;
      }
  EdgeVertices vertices;
  for (const std::size_t n : over) {
    const Triangle corners = pieces_[n].corners;
    for (std::size_t k = 0; k < 3; ++k)
      corner_on_edge(corner, corners[k], corners[(k + 1) % 3], vertices);
  }
  for (const std::size_t n : over) {
    const Triangle& corners = pieces_[n].corners;
    const bool on_edge = vertices.contains(key(corners[0], corners[1])) ||
                         vertices.contains(key(corners[1], corners[2])) ||
                         vertices.contains(key(corners[2], corners[0]));
    if (on_edge)
      split_at(n, vertices);
    else if (std::none_of(corners.begin(), corners.end(), stands_on))
      insert_inside(n, corner);
  }
}

void require_finite(const TriangleMesh& mesh) {
  mesh.check();
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t v : triangle)
      if (!mesh.vertices[v].allFinite())
        throw Error("a coordinate is not finite", {.field = "vertex " + std::to_string(v)});
}

enum class Location : char { outside, inside, on_border };

Location location_of(const TriangleMesh& mesh, const Triangle& corners,
                     const ExtrudedPolygon& prism) {
  const Vector3d& a = mesh.vertices[corners[0]];
  const Vector3d& b = mesh.vertices[corners[1]];
  const Vector3d& c = mesh.vertices[corners[2]];
  const Vector3d low = (a.cwiseMin(b).cwiseMin(c).array() - reach_m).matrix();
  const Vector3d high = (a.cwiseMax(b).cwiseMax(c).array() + reach_m).matrix();
  if (high.z() < prism.min_z || low.z() > prism.max_z) return Location::outside;
  const bool across = low.z() < prism.min_z || high.z() > prism.max_z;
  if (prism.polygon) {
    if (!prism.polygon->edges_near(low.head<2>(), high.head<2>()).empty())
      return Location::on_border;
    if (!prism.polygon->contains(a.head<2>())) return Location::outside;
  }
  return across ? Location::on_border : Location::inside;
}

// Mesh of the kept pieces, with the face fields of their sources.
TriangleMesh mesh_of(TriangleMesh mesh, std::vector<Piece> kept) {
  std::stable_sort(kept.begin(), kept.end(),
                   [](const Piece& a, const Piece& b) { return a.source < b.source; });
  mesh.triangles.clear();
  for (const Piece& piece : kept) mesh.triangles.push_back(piece.corners);
  for (ScalarField& field : mesh.face_fields) {
    std::vector<double> values;
    values.reserve(kept.size());
    for (const Piece& piece : kept) values.push_back(field.values[piece.source]);
    field.values = std::move(values);
  }
  return select_triangles(mesh, std::vector<bool>(mesh.triangles.size(), true));
}

}  // namespace

TriangleMesh cut_mesh(TriangleMesh mesh, const ExtrudedPolygon& prism) {
  require_finite(mesh);
  std::vector<Location> locations(mesh.triangles.size());
  parallel_each(locations.size(), 4096,
                [&](std::size_t n) { locations[n] = location_of(mesh, mesh.triangles[n], prism); });
  std::vector<Piece> kept;
  std::vector<Piece> on_border;
  for (std::uint32_t n = 0; n < locations.size(); ++n)
    if (locations[n] != Location::outside)
      (locations[n] == Location::inside ? kept : on_border).push_back({mesh.triangles[n], n});
  MeshCutter cutter(mesh, std::move(on_border));
  for (const double z : {prism.min_z, prism.max_z})
    if (std::isfinite(z)) cutter.cut(Cut::at_height(z));
  if (prism.polygon) {
    const std::vector<Vector2d>& corners = prism.polygon->corners();
    for (const Vector2d& corner : corners) cutter.insert_corner(corner);
    for (std::size_t n = 0; n < corners.size(); ++n)
      cutter.cut(Cut::along(corners[n], corners[(n + 1) % corners.size()]));
  }
  // No piece crosses the border any more, so an inner point decides.
  ExtrudedPolygon widened = prism;
  widened.min_z -= snap_m;
  widened.max_z += snap_m;
  for (const Piece& piece : cutter.pieces())
    if (widened.contains(center_of(mesh, piece.corners))) kept.push_back(piece);
  return mesh_of(std::move(mesh), std::move(kept));
}

}  // namespace libmap
