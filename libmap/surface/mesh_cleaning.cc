#include "libmap/surface/mesh_cleaning.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/mesh_repair.h"
#include "libmap/surface/mesh_report.h"
#include "libmap/surface/self_intersections.h"

namespace libmap {

namespace {

// Default merge distance relative to the mesh's size.
constexpr double merge_fraction = 1e-7;

std::vector<bool> inverse(std::vector<bool> marks) {
  marks.flip();
  return marks;
}

constexpr int closing_rounds = 4;
constexpr int max_rounds = 30;

// Temporary fields, with names that do not occur in files.
constexpr std::string_view boundary_field = "\x01on a boundary before";
constexpr std::string_view component_field = "\x01component";

// Temporary value of `filled` that distinguishes earlier from new triangles.
constexpr double filled_before = 2.0;

void erase_field(std::vector<ScalarField>& fields, std::string_view name) {
  std::erase_if(fields, [&](const ScalarField& field) { return field.name == name; });
}

std::vector<BoundaryLoop> loops_of(const TriangleMesh& mesh) {
  return boundary_loops(mesh.triangles, opposites_of(mesh));
}

// Intersecting and degenerate triangles.
std::vector<bool> bad_faces(const TriangleMesh& mesh) {
  std::vector<bool> marks = degenerate_triangles(mesh);
  for (const TrianglePair& pair : find_self_intersections(mesh))
    marks[pair.first] = marks[pair.second] = true;
  return marks;
}

// Drops fragments that the removal of triangles of area `removed_m2` cut off: pieces that are
// smaller and not the largest piece of a former component, which component_field contains.
void drop_fragments(TriangleMesh& mesh, std::size_t components_before, double removed_m2) {
  const ScalarField& former = *find_field(mesh.face_fields, component_field);
  const MeshComponents pieces = connected_components(mesh);
  std::vector<std::size_t> former_of(pieces.areas_m2.size());
  std::vector<double> largest(components_before, 0.0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t piece = pieces.of_triangle[t];
    former_of[piece] = static_cast<std::size_t>(former.values[t]);
    double& area = largest[former_of[piece]];
    area = std::max(area, pieces.areas_m2[piece]);
  }
  std::vector<bool> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) {
    const std::uint32_t piece = pieces.of_triangle[t];
    const double area = pieces.areas_m2[piece];
    keep[t] = area > removed_m2 || area >= largest[former_of[piece]];
  }
  if (count_of(keep) < keep.size()) mesh = select_triangles(mesh, keep);
}

// Boundary loops without vertices of an earlier boundary.
std::vector<BoundaryLoop> new_loops(const TriangleMesh& mesh) {
  const std::vector<double>& before = find_field(mesh.vertex_fields, boundary_field)->values;
  std::vector<BoundaryLoop> loops = loops_of(mesh);
  std::erase_if(loops, [&](const BoundaryLoop& loop) {
    return std::any_of(loop.begin(), loop.end(),
                       [&](HalfEdge h) { return before[source_of(mesh.triangles, h)] != 0.0; });
  });
  return loops;
}

void mark_boundary(TriangleMesh& mesh) {
  ScalarField marks{std::string(boundary_field), ScalarType::uint8,
                    std::vector<double>(mesh.vertices.size(), 0.0)};
  for (const BoundaryLoop& loop : loops_of(mesh))
    for (const HalfEdge h : loop) marks.values[source_of(mesh.triangles, h)] = 1.0;
  mesh.vertex_fields.push_back(std::move(marks));
}

void remove_triangles(TriangleMesh& mesh, std::vector<bool> marks, int rings, double min_gap_m) {
  dilate_mask(mesh, rings, marks);
  const MeshComponents components = connected_components(mesh);
  mesh.face_fields.push_back(
      {std::string(component_field), ScalarType::float64,
       std::vector<double>(components.of_triangle.begin(), components.of_triangle.end())});
  double removed_m2 = 0.0;
  for (std::size_t t = 0; t < marks.size(); ++t)
    if (marks[t]) removed_m2 += area_normal(mesh, mesh.triangles[t]).norm() / 2.0;
  marks.flip();
  mesh = select_triangles(mesh, marks);
  drop_fragments(mesh, components.areas_m2.size(), removed_m2);
  make_manifold(mesh, min_gap_m);
  erase_field(mesh.face_fields, component_field);
}

// Removes intersecting (self_intersections) and degenerate triangles in rounds, with the rings of
// triangles around them and the fragments that are cut off. Resulting holes that do not touch an
// earlier boundary are closed (hole_filling) and marked `filled`. Each round removes one more ring.
// Triangles that still intersect after four rounds are removed without a ring, and their holes stay
// open. Separated vertices are `min_gap_m` apart. The mesh must be, and stays, an oriented
// manifold.
void repair_intersections(double min_gap_m, MeshCleaningResult& result) {
  TriangleMesh& mesh = result.mesh;
  result.remaining_intersecting_triangles = 0;
  std::vector<bool> faces = bad_faces(mesh);
  if (count_of(faces) == 0) return;
  mark_boundary(mesh);
  for (double& mark : filled_marks(mesh).values)
    if (mark != 0.0) mark = filled_before;
  for (int round = 0; round < max_rounds && count_of(faces) > 0; ++round) {
    result.intersecting_triangles += count_of(faces);
    const bool closes = round < closing_rounds;
    remove_triangles(mesh, faces, closes ? round + 1 : 0, min_gap_m);
    if (closes) fill_holes(mesh, new_loops(mesh), PatchCheck::manifold);
    faces = bad_faces(mesh);
  }
  result.remaining_intersecting_triangles = count_of(faces);
  result.unclosed_holes += new_loops(mesh).size();
  for (double& mark : filled_marks(mesh).values) {
    if (mark == 1.0) ++result.closing_triangles;
    if (mark != 0.0) mark = 1.0;
  }
  erase_field(mesh.vertex_fields, boundary_field);
}

constexpr double inward = 0.5;                                // lambda
constexpr double pass_band = 0.02;                            // k_PB = 1 / lambda + 1 / mu
constexpr double outward = 1.0 / (pass_band - 1.0 / inward);  // mu
constexpr std::size_t vertices_grain = 4096;

// Neighbors of each vertex; none for fixed vertices.
struct Neighbors {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> vertices;
};

Neighbors neighbors_of(const TriangleMesh& mesh) {
  const MeshEdges edges = edges_of(mesh.triangles, mesh.vertices.size());
  const auto ends = [&](std::size_t e) {
    const HalfEdge h = edges.half_edges[edges.first[e]];
    return std::array<std::uint32_t, 2>{source_of(mesh.triangles, h), target_of(mesh.triangles, h)};
  };
  std::vector<bool> stays(mesh.vertices.size(), false);
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges.count(e) != 2)
      for (const std::uint32_t v : ends(e)) stays[v] = true;
  Neighbors result;
  result.first.assign(mesh.vertices.size() + 1, 0);
  for (std::size_t e = 0; e < edges.size(); ++e)
    for (const std::uint32_t v : ends(e))
      if (!stays[v]) ++result.first[v + 1];
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) result.first[v + 1] += result.first[v];
  result.vertices.resize(result.first.back());
  std::vector<std::uint32_t> next(result.first.begin(), result.first.end() - 1);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto [a, b] = ends(e);
    if (!stays[a]) result.vertices[next[a]++] = b;
    if (!stays[b]) result.vertices[next[b]++] = a;
  }
  return result;
}

void smoothing_step(const Neighbors& neighbors, double fraction,
                    const std::vector<Eigen::Vector3d>& from, std::vector<Eigen::Vector3d>& to) {
  parallel_each(from.size(), vertices_grain, [&](std::size_t v) {
    Eigen::Vector3d towards = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (std::uint32_t n = neighbors.first[v]; n < neighbors.first[v + 1]; ++n) {
      const Eigen::Vector3d edge = from[neighbors.vertices[n]] - from[v];
      const double length = edge.norm();
      if (length == 0.0) continue;
      towards += edge / length;
      weights += 1.0 / length;
    }
    to[v] = weights > 0.0 ? Eigen::Vector3d(from[v] + fraction / weights * towards) : from[v];
  });
}

// Taubin 1995, "A signal processing approach to fair surface design": each iteration moves every
// vertex by 0.5 of the way to the mean of its neighbors, weighted by the inverse edge length
// (Fujiwara), then by -0.505 of it, which preserves waves much longer than the edges. Vertices of
// boundaries and non-manifold edges are fixed. Only positions change.
void smooth_mesh(TriangleMesh& mesh, int iterations) {
  if (iterations <= 0 || mesh.triangles.empty()) return;
  const Neighbors neighbors = neighbors_of(mesh);
  std::vector<Eigen::Vector3d> moved(mesh.vertices.size());
  for (int n = 0; n < iterations; ++n) {
    smoothing_step(neighbors, inward, mesh.vertices, moved);
    smoothing_step(neighbors, outward, moved, mesh.vertices);
  }
}

// True if each edge has at most two triangles, in opposite directions, and each vertex one fan.
bool is_oriented_manifold(const TriangleMesh& mesh) {
  const MeshReport report = report_mesh(mesh, {.self_intersections = false});
  return report.is_manifold() && report.is_oriented() &&
         std::none_of(mesh.triangles.begin(), mesh.triangles.end(), has_repeated_vertex);
}

class Cleaning {
 public:
  Cleaning(const TriangleMesh& mesh, const MeshCleaningOptions& options, Progress& progress)
      : options_(options), progress_(progress) {
    result_.mesh = mesh;
    mesh_().vertex_normals.clear();  // estimated at the end
    filled_marks(mesh_());
  }

  MeshCleaningResult run() {
    if (options_.repair) {
      step("triangles", [&] { repair_triangles(); });
      step("manifold", [&] { repair_manifold(); });
    } else if ((options_.max_hole_m > 0.0 || options_.decimation_error_m > 0.0) &&
               !is_oriented_manifold(mesh_())) {
      throw Error(
          "the mesh is not an oriented manifold; hole filling and decimation require repair",
          {.field = "repair", .value = "false", .bound = "true"});
    }
    step("islands", [&] { drop_islands(); });
    if (options_.repair) step("intersections", [&] { remove_intersections(); });
    if (options_.max_hole_m > 0.0) step("holes", [&] { fill_small_holes(); });
    if (options_.smoothing_iterations > 0)
      step("smoothing", [&] { smooth_mesh(mesh_(), options_.smoothing_iterations); });
    if (options_.decimation_error_m > 0.0)
      step("decimation", [&] {
        result_.decimation = decimate_mesh(mesh_(), options_.decimation_error_m, progress_);
      });
    if (options_.repair && (options_.smoothing_iterations > 0 || options_.decimation_error_m > 0.0))
      step("intersections after smoothing or decimation", [&] { remove_intersections(); });
    step("islands at the end", [&] { drop_islands(); });
    step("normals", [&] { mesh_().vertex_normals = estimate_vertex_normals(mesh_()); });
    return std::move(result_);
  }

 private:
  TriangleMesh& mesh_() { return result_.mesh; }

  void step(const std::string& name, const std::function<void()>& body) {
    progress_.begin("cleaning: " + name, 0);
    timed(result_.timings_s, name.c_str(), body);
    progress_.end();
  }

  // `cause` describes the removed triangles.
  void require_triangles(const TriangleMesh& mesh, const ErrorContext& cause) {
    if (mesh.triangles.empty() && !options_.known)
      throw Error("no triangle of the mesh would remain", cause);
  }

  double merge_distance() {
    return options_.merge_distance_m > 0.0 ? options_.merge_distance_m
                                           : merge_fraction * size_of(mesh_());
  }

  void repair_triangles() {
    TriangleMesh& mesh = mesh_();
    std::vector<bool> used(mesh.vertices.size(), false);
    for (const Triangle& t : mesh.triangles)
      for (const std::uint32_t v : t) used[v] = true;
    result_.unused_vertices = used.size() - count_of(used);
    if (result_.unused_vertices > 0)
      mesh = select_triangles(mesh, std::vector<bool>(mesh.triangles.size(), true));
    result_.merged_vertices = weld_vertices(mesh, merge_distance());
    std::vector<bool> drop(mesh.triangles.size());
    for (std::size_t t = 0; t < drop.size(); ++t) drop[t] = has_repeated_vertex(mesh.triangles[t]);
    result_.degenerate_triangles += count_of(drop);
    const std::vector<bool> repeated = repeated_triangles(mesh.triangles);
    for (std::size_t t = 0; t < drop.size(); ++t)
      if (repeated[t] && !drop[t]) {
        ++result_.duplicate_triangles;
        drop[t] = true;
      }
    if (count_of(drop) > 0 || result_.merged_vertices > 0)
      mesh = select_triangles(mesh, inverse(drop));
    require_triangles(mesh, {.field = "number of triangles without area",
                             .value = std::to_string(result_.degenerate_triangles)});
  }

  void repair_manifold() {
    add(make_manifold(mesh_(), 2.0 * merge_distance()));
    const std::size_t caps = flip_caps(mesh_());
    result_.degenerate_triangles += caps;
    // Dropping caps at a boundary may leave fans that share only a vertex.
    if (caps > 0) add(make_manifold(mesh_(), 2.0 * merge_distance()));
    require_triangles(mesh_(), {.field = "number of triangles without area",
                                .value = std::to_string(result_.degenerate_triangles)});
  }

  void add(const ManifoldCuts& cuts) {
    result_.cut_edges += cuts.edges;
    result_.split_vertices += cuts.vertices;
    result_.turned_triangles += cuts.turned;
    result_.duplicate_triangles += cuts.dropped;
  }

  void drop_islands() {
    const MeshComponents components = connected_components(mesh_(), opposites_of(mesh_()));
    double largest = 0.0;
    for (const double area : components.areas_m2) largest = std::max(largest, area);
    const double smallest =
        std::max(options_.min_island_area_m2, options_.min_island_fraction * largest);
    std::vector<bool> are_kept = components_beyond(mesh_(), components, options_.known);
    std::size_t islands = 0;
    for (std::size_t c = 0; c < are_kept.size(); ++c) {
      if (are_kept[c]) continue;
      are_kept[c] = components.areas_m2[c] >= smallest;
      if (are_kept[c]) continue;
      ++islands;
      result_.island_area_m2 += components.areas_m2[c];
    }
    if (islands == 0) return;
    result_.islands += islands;
    std::vector<bool> keep(mesh_().triangles.size());
    for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = are_kept[components.of_triangle[t]];
    TriangleMesh kept = select_triangles(mesh_(), keep);
    require_triangles(kept, {.field = "min_island_area_m2",
                             .value = to_text(options_.min_island_area_m2),
                             .bound = "<= " + to_text(largest)});
    mesh_() = std::move(kept);
  }

  void remove_intersections() {
    repair_intersections(2.0 * merge_distance(), result_);
    require_triangles(mesh_(), {.field = "number of intersecting triangles",
                                .value = std::to_string(result_.intersecting_triangles)});
  }

  void fill_small_holes() {
    result_.filling = fill_holes(mesh_(), find_holes(mesh_(), options_.max_hole_m, options_.known),
                                 PatchCheck::intersection, progress_);
  }

  MeshCleaningResult result_;
  const MeshCleaningOptions& options_;
  Progress& progress_;
};

}  // namespace

void bind(ParameterTable& table, MeshCleaningOptions& options) {
  table.add("repair", options.repair,
            "merge coincident vertices, drop degenerate and duplicate triangles, cut non-manifold "
            "edges, and remove intersecting triangles");
  table.add("merge_distance_m", options.merge_distance_m, not_negative,
            "maximum distance of vertices to be merged, m; 0: 1e-7 of the bounding box's diagonal");
  table.add(
      "min_island_area_m2", options.min_island_area_m2, not_negative,
      "minimum area of a connected component of the mesh, m2; smaller components are dropped");
  table.add_former_key("min_island_share", "min_island_fraction");
  table.add("min_island_fraction", options.min_island_fraction, zero_to_one,
            "minimum area of a connected component relative to the largest; others are dropped");
  table.add("max_hole_m", options.max_hole_m, not_negative,
            "maximum diameter of holes that are filled, m; 0: none; outer boundaries stay open");
  table.add("smoothing_iterations", options.smoothing_iterations, not_negative,
            "number of iterations of Taubin smoothing, which avoids shrinkage");
  table.add("decimation_error_m", options.decimation_error_m, not_negative,
            "maximum distance between the decimated and the original surface, m; 0: no decimation");
}

MeshCleaningResult clean_mesh(const TriangleMesh& mesh, const MeshCleaningOptions& options,
                              Progress& progress) {
  check_parameters(options);
  require_sound(mesh);
  if (mesh.triangles.empty()) throw no_elements("triangles of the mesh");
  return Cleaning(mesh, options, progress).run();
}

void describe(ResultTable& table, const MeshCleaningResult& result) {
  table.add("cut_edges", result.cut_edges,
            "number of edges that were cut because they were non-manifold or not orientable");
  table.add("split_vertices", result.split_vertices,
            "number of new copies of vertices with several fans of triangles");
  table.add("degenerate_triangles", result.degenerate_triangles,
            "number of removed triangles without area");
  table.add("islands", result.islands, "number of removed small components");
  table.add("island_area_m2", result.island_area_m2, "area of the small components removed, m2");
  table.add("intersecting_triangles", result.intersecting_triangles,
            "number of triangles removed because they intersected others");
  table.add("remaining_intersecting_triangles", result.remaining_intersecting_triangles,
            "number of triangles that still intersect others");
  table.add("filled_holes", result.filling.holes, "number of filled holes");
  table.add("filled_triangles", result.filling.triangles, "number of triangles that fill holes");
  table.add("filled_area_m2", result.filling.area_m2, "area of the holes filled, m2");
  table.add("unfilled_holes", result.filling.unfilled, "number of holes that could not be filled");
  table.add("decimated_triangles", result.decimation.removed_triangles,
            "number of triangles removed by decimation");
  table.add("vertices", result.mesh.vertices.size(), "number of vertices of the mesh");
  table.add("triangles", result.mesh.triangles.size(), "number of triangles of the mesh");
  table.add("area_m2", surface_area(result.mesh), "area of the mesh, m2");
}

}  // namespace libmap
