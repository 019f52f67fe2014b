#include "libgtd/grasp/ground.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "libmap/core/error.h"

namespace libgtd {

namespace {

using Corners = std::array<Eigen::Vector3d, 3>;

// Squared distance from a point to a triangle (Ericson 2005, 5.1.5, by the region of the projected
// point).
double square_distance(const Eigen::Vector3d& p, const Corners& corners) {
  const auto& [a, b, c] = corners;
  const auto to_edge = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    const Eigen::Vector3d edge = to - from;
    const double length = edge.squaredNorm();
    const double fraction =
        length > 0.0 ? std::clamp((p - from).dot(edge) / length, 0.0, 1.0) : 0.0;
    return (p - from - fraction * edge).squaredNorm();
  };
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double square = normal.squaredNorm();
  const auto inside = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return normal.dot((to - from).cross(p - from)) >= 0.0;
  };
  if (square > 0.0 && inside(a, b) && inside(b, c) && inside(c, a)) {
    const double height = normal.dot(p - a);
    return height * height / square;
  }
  return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

Corners corners_of(const std::vector<Eigen::Vector3d>& vertices, const libmap::Triangle& triangle) {
  return {vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]};
}

double radius_about(const Eigen::Vector3d& center, const Corners& corners) {
  double square = 0.0;
  for (const Eigen::Vector3d& corner : corners)
    square = std::max(square, (corner - center).squaredNorm());
  return std::sqrt(square);
}

// Maximum radius of triangles in the grid; larger ones are tested one by one.
constexpr double small_radius_m = 0.02;

}  // namespace

std::optional<Eigen::Vector3d> GroundPatch::normal_at(const Eigen::Vector3d& point,
                                                      double radius_m) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const double square_radius = radius_m * radius_m;
  for (std::size_t n = 0; n < triangles.size(); ++n) {
    const double reach = radius_m + radii[n];
    if ((point - centers[n]).squaredNorm() > reach * reach) continue;
    const Corners corners = corners_of(vertices, triangles[n]);
    const double nearness = 1.0 - square_distance(point, corners) / square_radius;
    if (nearness > 0.0) sum += nearness * area_normals[n];
  }
  const double length = sum.norm();
  if (!(length > 0.0)) return std::nullopt;
  return sum / length;
}

void GroundPatch::measure_triangles() {
  centers.resize(triangles.size());
  radii.resize(triangles.size());
  area_normals.resize(triangles.size());
  for (std::size_t n = 0; n < triangles.size(); ++n) {
    const Corners corners = corners_of(vertices, triangles[n]);
    centers[n] = (corners[0] + corners[1] + corners[2]) / 3.0;
    radii[n] = radius_about(centers[n], corners);
    area_normals[n] = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  }
}

Eigen::Isometry3d patch_frame(const Eigen::Vector3d& location, const Eigen::Vector3d& away) {
  const Eigen::Vector3d z = away.normalized();
  Eigen::Vector3d x = Eigen::Vector3d::UnitX() - z.x() * z;
  if (x.norm() < 0.1) x = Eigen::Vector3d::UnitY() - z.y() * z;
  x.normalize();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear().col(0) = x;
  frame.linear().col(1) = z.cross(x);
  frame.linear().col(2) = z;
  frame.translation() = location;
  return frame;
}

// Grid over the two longest sides of the bounding box. A search by cells needs no nearest-first
// order and no sort, which took most of the time of a patch.
struct Ground::Index {
  struct Entry {
    Eigen::Vector3d center;
    double radius;
    std::uint32_t triangle;
  };

  Index(const libmap::TriangleMesh& of, GroundErrors known) : mesh(of), errors(std::move(known)) {}

  const libmap::TriangleMesh& mesh;
  GroundErrors errors;
  std::vector<Eigen::Vector3d> vertex_normals;  // with errors
  Eigen::AlignedBox3d box;
  std::array<Eigen::Index, 2> axes{0, 1};
  double cell_m = 1.0;
  std::array<std::int64_t, 2> cells{1, 1};
  std::vector<std::size_t> first;  // first entry of each cell, and the end
  std::vector<Entry> entries;      // small triangles
  std::vector<Entry> large;

  std::int64_t cell_along(std::size_t side, double coordinate) const {
    const double cell = (coordinate - box.min()[axes[side]]) / cell_m;
    if (!(cell > 0.0)) return 0;  // also if the difference is not finite
    return static_cast<std::int64_t>(std::min(cell, static_cast<double>(cells[side] - 1)));
  }
  std::size_t cell_of(const Eigen::Vector3d& point) const {
    return static_cast<std::size_t>(cell_along(0, point[axes[0]]) * cells[1] +
                                    cell_along(1, point[axes[1]]));
  }

  // Area-weighted means of the adjacent triangles.
  void find_vertex_normals() {
    vertex_normals.assign(mesh.vertices.size(), Eigen::Vector3d::Zero());
    for (const libmap::Triangle& triangle : mesh.triangles) {
      const Corners corners = corners_of(mesh.vertices, triangle);
      const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
      for (const std::uint32_t corner : triangle) vertex_normals[corner] += normal;
    }
    for (Eigen::Vector3d& normal : vertex_normals) normal = normal.stableNormalized();
  }

  void fill() {
    const Eigen::Vector3d sides = box.sizes();
    Eigen::Index shortest = 0;
    sides.minCoeff(&shortest);
    axes = {shortest == 0 ? 1 : 0, shortest == 2 ? 1 : 2};
    // Limits the number of cells to about that of triangles.
    cell_m = std::max(
        {small_radius_m, sides.maxCoeff() * 1e-4,
         std::sqrt(sides[axes[0]] * sides[axes[1]] / static_cast<double>(mesh.triangles.size()))});
    for (std::size_t side = 0; side < 2; ++side)
      if (const double count = sides[axes[side]] / cell_m; std::isfinite(count))
        cells[side] = static_cast<std::int64_t>(count) + 1;
    std::vector<Entry> small;
    for (std::uint32_t n = 0; n < mesh.triangles.size(); ++n) {
      const Corners corners = corners_of(mesh.vertices, mesh.triangles[n]);
      const Eigen::Vector3d center = (corners[0] + corners[1] + corners[2]) / 3.0;
      const double radius = radius_about(center, corners);
      (radius > small_radius_m ? large : small).push_back({center, radius, n});
    }
    first.assign(static_cast<std::size_t>(cells[0] * cells[1]) + 1, 0);
    for (const Entry& entry : small) ++first[cell_of(entry.center) + 1];
    for (std::size_t n = 1; n < first.size(); ++n) first[n] += first[n - 1];
    entries.resize(small.size());
    std::vector<std::size_t> next = first;
    for (const Entry& entry : small) entries[next[cell_of(entry.center)]++] = entry;
  }

  // Calls use(entry) for all triangles that intersect the box, and for some other triangles.
  template <typename Use>
  void visit(const Eigen::AlignedBox3d& around, const Use& use) const {
    for (const Entry& entry : large) use(entry);
    const Eigen::Vector3d low = around.min().array() - small_radius_m;
    const Eigen::Vector3d high = around.max().array() + small_radius_m;
    const std::int64_t j_low = cell_along(1, low[axes[1]]);
    const std::int64_t j_high = cell_along(1, high[axes[1]]);
    const std::int64_t i_high = cell_along(0, high[axes[0]]);
    for (std::int64_t i = cell_along(0, low[axes[0]]); i <= i_high; ++i) {
      const std::size_t end = first[static_cast<std::size_t>(i * cells[1] + j_high) + 1];
      for (auto n = first[static_cast<std::size_t>(i * cells[1] + j_low)]; n < end; ++n)
        use(entries[n]);
    }
  }

  // Sorts by setting one bit per number if the numbers are dense.
  static void sort(std::vector<std::uint32_t>& numbers) {
    if (numbers.empty()) return;
    const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
    const std::uint32_t lowest = *low;
    const std::size_t words = (*high - lowest) / 64 + 1;
    if (words > 4 * numbers.size()) return std::sort(numbers.begin(), numbers.end());
    std::vector<std::uint64_t> bits(words, 0);
    for (const std::uint32_t number : numbers)
      bits[(number - lowest) / 64] |= std::uint64_t{1} << ((number - lowest) % 64);
    numbers.clear();
    for (std::size_t word = 0; word < words; ++word)
      for (std::uint64_t rest = bits[word]; rest != 0; rest &= rest - 1)
        numbers.push_back(
            lowest + static_cast<std::uint32_t>(64 * word +
                                                static_cast<std::size_t>(std::countr_zero(rest))));
  }
};

namespace {

// Maps vertices of the mesh to vertices of a patch: a hash table with open addressing.
class PatchVertices {
 public:
  explicit PatchVertices(std::size_t most) : slots_(std::bit_ceil(2 * most + 1)) {}

  // Returns the number in the patch; `none` if the vertex is new.
  std::uint32_t& number_of(std::uint32_t vertex) {
    std::size_t at = (vertex * std::uint64_t{0x9e3779b97f4a7c15} >> 32U) & (slots_.size() - 1);
    while (slots_[at].vertex != vertex && slots_[at].vertex != none)
      at = (at + 1) & (slots_.size() - 1);
    slots_[at].vertex = vertex;
    return slots_[at].number;
  }

  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

 private:
  struct Slot {
    std::uint32_t vertex = none;
    std::uint32_t number = none;
  };
  std::vector<Slot> slots_;
};

}  // namespace

Ground::Ground(const libmap::TriangleMesh& mesh, GroundErrors errors)
    : index_(std::make_unique<Index>(mesh, std::move(errors))) {
  mesh.check();
  if (mesh.triangles.empty()) throw libmap::no_elements("triangles of the mesh");
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (vertex.allFinite())
      index_->box.extend(vertex);
    else
      throw libmap::Error("one is not finite", {.field = "vertices of the mesh"});
  index_->fill();
  if (index_->errors.vertex_errors_m.empty()) return;
  if (index_->errors.vertex_errors_m.size() != mesh.vertices.size() ||
      index_->errors.is_unscanned.size() != mesh.triangles.size())
    throw libmap::Error("not one per vertex or triangle", {.field = "errors of the mesh"});
  index_->find_vertex_normals();
}

Ground::~Ground() = default;
Ground::Ground(Ground&&) noexcept = default;
Ground& Ground::operator=(Ground&&) noexcept = default;

GroundPatch Ground::patch(const Eigen::Vector3d& location, const Eigen::Vector3d& away,
                          double radius_m, double above_m, double widening) const {
  GroundPatch patch;
  patch.mesh_from_patch = patch_frame(location, away);
  const Eigen::Isometry3d patch_from_mesh = patch.mesh_from_patch.inverse();
  const Eigen::Vector3d axis = patch.mesh_from_patch.linear().col(2);
  const libmap::TriangleMesh& mesh = index_->mesh;
  double lowest = above_m;
  for (const auto corner :
       {Eigen::AlignedBox3d::BottomLeftFloor, Eigen::AlignedBox3d::BottomRightFloor,
        Eigen::AlignedBox3d::TopLeftFloor, Eigen::AlignedBox3d::TopRightFloor,
        Eigen::AlignedBox3d::BottomLeftCeil, Eigen::AlignedBox3d::BottomRightCeil,
        Eigen::AlignedBox3d::TopLeftCeil, Eigen::AlignedBox3d::TopRightCeil})
    lowest = std::min(lowest, axis.dot(index_->box.corner(corner) - location));
  const auto radius_at = [&](double height) {
    return radius_m + widening * std::max(above_m, -height);
  };
  Eigen::AlignedBox3d around;
  const Eigen::Vector3d beside =
      radius_at(lowest) * (1.0 - axis.array().square()).max(0.0).sqrt().matrix();
  for (const double height : {lowest, above_m})
    for (const double sign : {-1.0, 1.0}) around.extend(location + height * axis + sign * beside);
  std::vector<std::uint32_t> triangles;
  index_->visit(around, [&](const Index::Entry& entry) {
    const Eigen::Vector3d center = patch_from_mesh * entry.center;
    const double size = entry.radius + 1e-9;
    const double reach = radius_at(center.z() - size) + size;
    if (center.head<2>().squaredNorm() <= reach * reach && center.z() - size <= above_m)
      triangles.push_back(entry.triangle);
  });
  Index::sort(triangles);
  PatchVertices vertices(std::min(3 * triangles.size(), mesh.vertices.size()));
  const bool has_errors = !index_->errors.vertex_errors_m.empty();
  for (const std::uint32_t n : triangles) {
    libmap::Triangle triangle{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = mesh.triangles[n][corner];
      std::uint32_t& number = vertices.number_of(vertex);
      if (number == PatchVertices::none) {
        number = static_cast<std::uint32_t>(patch.vertices.size());
        patch.vertices.push_back(patch_from_mesh * mesh.vertices[vertex]);
        if (has_errors) {
          patch.vertex_errors_m.push_back(index_->errors.vertex_errors_m[vertex]);
          patch.vertex_normals.emplace_back(patch_from_mesh.linear() *
                                            index_->vertex_normals[vertex]);
        }
      }
      triangle[corner] = number;
    }
    patch.triangles.push_back(triangle);
    if (has_errors) patch.is_unscanned.push_back(index_->errors.is_unscanned[n]);
  }
  patch.measure_triangles();
  return patch;
}

double Ground::largest_error_m() const {
  const std::vector<double>& errors = index_->errors.vertex_errors_m;
  return errors.empty() ? 0.0 : *std::max_element(errors.begin(), errors.end());
}

std::optional<double> Ground::distance(const Eigen::Vector3d& point, double radius_m) const {
  const libmap::TriangleMesh& mesh = index_->mesh;
  double square = radius_m * radius_m;
  bool is_near = false;
  const Eigen::Vector3d side = Eigen::Vector3d::Constant(radius_m);
  index_->visit({point - side, point + side}, [&](const Index::Entry& entry) {
    const double reach = radius_m + entry.radius * (1.0 + 1e-9);
    if ((entry.center - point).squaredNorm() > reach * reach) return;
    const double here =
        square_distance(point, corners_of(mesh.vertices, mesh.triangles[entry.triangle]));
    is_near |= here <= square;
    square = std::min(square, here);
  });
  return is_near ? std::optional(std::sqrt(square)) : std::nullopt;
}

}  // namespace libgtd
