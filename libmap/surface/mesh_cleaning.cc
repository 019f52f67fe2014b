#include "libmap/surface/mesh_cleaning.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/intersection_repair.h"
#include "libmap/surface/mesh_manifold.h"
#include "libmap/surface/mesh_smoothing.h"
#include "libmap/surface/triangle_repair.h"

namespace libmap {

namespace {

// Of the mesh's size: the tolerance for vertices that are one.
constexpr double merge_share = 1e-7;

std::vector<bool> inverse(std::vector<bool> marks) {
  marks.flip();
  return marks;
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
      throw Error("the mesh is no oriented manifold: holes and decimation need it repaired",
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

  // `cause` says what has taken all that there was.
  void require_triangles(const TriangleMesh& mesh, const ErrorContext& cause) {
    if (mesh.triangles.empty() && !options_.known)
      throw Error("nothing is left of the mesh", cause);
  }

  double merge_distance() {
    return options_.merge_distance_m > 0.0 ? options_.merge_distance_m
                                           : merge_share * size_of(mesh_());
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
    for (std::size_t t = 0; t < drop.size(); ++t) drop[t] = names_a_vertex_twice(mesh.triangles[t]);
    result_.degenerate_triangles += count_of(drop);
    const std::vector<bool> repeated = repeated_triangles(mesh.triangles);
    for (std::size_t t = 0; t < drop.size(); ++t)
      if (repeated[t] && !drop[t]) {
        ++result_.duplicate_triangles;
        drop[t] = true;
      }
    if (count_of(drop) > 0 || result_.merged_vertices > 0)
      mesh = select_triangles(mesh, inverse(drop));
    require_triangles(mesh, {.field = "triangles without area",
                             .value = std::to_string(result_.degenerate_triangles)});
  }

  void repair_manifold() {
    add(make_manifold(mesh_(), 2.0 * merge_distance()));
    const std::size_t caps = flip_caps(mesh_());
    result_.degenerate_triangles += caps;
    // Caps dropped at a boundary may have left fans that touch in a vertex.
    if (caps > 0) add(make_manifold(mesh_(), 2.0 * merge_distance()));
    require_triangles(mesh_(), {.field = "triangles without area",
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
        std::max(options_.min_island_area_m2, options_.min_island_share * largest);
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
    const IntersectionRepair repair = repair_intersections(mesh_(), 2.0 * merge_distance());
    result_.intersecting_triangles += repair.faulty_triangles;
    result_.closing_triangles += repair.closing_triangles;
    result_.open_places += repair.open_places;
    result_.remaining_intersecting_triangles = repair.remaining_triangles;
    require_triangles(mesh_(), {.field = "intersecting triangles",
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
            "join vertices, drop bad triangles, cut what is no manifold, remove intersections");
  table.add("merge_distance_m", options.merge_distance_m, not_negative,
            "vertices this near are one; 0: 1e-7 of the mesh's size");
  table.add("min_island_area_m2", options.min_island_area_m2, not_negative,
            "components with a smaller area are dropped");
  table.add("min_island_share", options.min_island_share, zero_to_one,
            "components smaller than this share of the largest are dropped");
  table.add("max_hole_m", options.max_hole_m, not_negative,
            "holes up to this diameter are filled, the outer boundary never");
  table.add("smoothing_iterations", options.smoothing_iterations, not_negative,
            "of Taubin's smoothing, which does not shrink");
  table.add("decimation_error_m", options.decimation_error_m, not_negative,
            "fewer triangles, nowhere farther than this from the surface before; 0: none");
}

MeshCleaningResult clean_mesh(const TriangleMesh& mesh, const MeshCleaningOptions& options,
                              Progress& progress) {
  check_parameters(options);
  require_sound(mesh);
  if (mesh.triangles.empty()) throw Error("the mesh has no triangle");
  return Cleaning(mesh, options, progress).run();
}

void describe(ResultTable& table, const MeshCleaningResult& result) {
  table.add("cut_edges", result.cut_edges, "edges that were cut: non-manifold or not orientable");
  table.add("split_vertices", result.split_vertices, "copies of vertices of several fans");
  table.add("degenerate_triangles", result.degenerate_triangles, "triangles removed without area");
  table.add("islands", result.islands, "small components removed");
  table.add("island_area_m2", result.island_area_m2, "area of the small components removed");
  table.add("intersecting_triangles", result.intersecting_triangles,
            "triangles removed because they intersected others");
  table.add("remaining_intersecting_triangles", result.remaining_intersecting_triangles,
            "triangles that still intersect others");
  table.add("filled_holes", result.filling.holes, "holes filled");
  table.add("filled_triangles", result.filling.triangles, "triangles that close holes");
  table.add("filled_area_m2", result.filling.area_m2, "area of the holes filled");
  table.add("unfilled_holes", result.filling.unfilled, "holes that could not be filled");
  table.add("decimated_triangles", result.decimation.removed_triangles,
            "triangles removed by decimation");
  table.add("vertices", result.mesh.vertices.size(), "vertices of the mesh");
  table.add("triangles", result.mesh.triangles.size(), "triangles of the mesh");
  table.add("area_m2", surface_area(result.mesh), "area of the mesh");
}

}  // namespace libmap
