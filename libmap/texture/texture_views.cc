#include "libmap/texture/texture_views.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>

#include "libmap/core/parallel.h"
#include "libmap/geometry/voxel_key.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/ray_caster.h"

namespace libmap {

namespace {

// Side of the cubes that are skipped as a whole if a photograph does not show them.
constexpr double block_m = 0.5;
// Width of the band at the border in which quality decreases, relative to the smaller image side.
constexpr double border_band = 0.15;
constexpr double min_border_fraction = 0.05;
// Triangles larger than this in the photograph are also tested at their center.
constexpr float center_test_px = 6.0F;

// Minimum height of an occluder above a triangle's plane, in occlusion tolerances.
constexpr double occluder_tolerances = 3.0;
// Factor on the quality of a view beside an occluder.
constexpr float beside_occluder = 0.02F;

// A vertex in the current photograph.
struct SeenVertex {
  float x = 0.0F;
  float y = 0.0F;
  float z = 0.0F;  // m; 0 if the point cannot be projected
  bool in_image = false;
  bool visible = false;
};

double smooth_step(double t) {
  const double s = std::clamp(t, 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

class ViewFinder {
 public:
  ViewFinder(const TriangleMesh& mesh, const TexturePhotos& photos,
             const TextureViewOptions& options, const TextureViewRequest& request,
             TextureViews& views)
      : mesh_(mesh),
        photos_(photos),
        options_(options),
        request_(request),
        views_(views),
        caster_(mesh),
        around_(triangles_at_vertices(mesh.triangles, mesh.vertices.size())),
        min_cos_(std::cos(options.max_incidence_deg * std::numbers::pi / 180.0)),
        max_depth_m_(options.max_depth_m > 0.0 ? options.max_depth_m
                                               : std::numeric_limits<double>::infinity()),
        vertices_(mesh.vertices.size()),
        qualities_(mesh.triangles.size()),
        cells_(options.occlusion_margin_px) {
    choose_vertices();
    make_blocks();
  }

  void look_from(std::size_t photo) {
    projector_ = &photos_[photo].projector;
    if (!may_show(center_, radius_m_)) return;
    find_blocks_in_view();
    project();
    if (std::none_of(in_view_.begin(), in_view_.end(),
                     [](const Block* block) { return block->any_asked_in_image; }))
      return;
    rate_triangles(photos_[photo].sharpness);
    cast_to_vertices();
    test_triangles();
    if (wants_views()) {
      reduce_quality_at_occluders();
      keep(static_cast<std::uint32_t>(photo));
    }
    observe(static_cast<std::uint32_t>(photo));
  }

 private:
  // Vertices in a cube, and the rated triangles whose first corner is one of them.
  struct Block {
    Eigen::AlignedBox3d box{};  // of the vertices
    std::span<const std::uint32_t> vertices{};
    std::span<const std::uint32_t> rated{};
    bool any_asked_in_image = false;  // in the current photograph
  };

  bool wants_views() const {
    return request_.views_per_vertex > 0 || request_.views_per_triangle > 0;
  }
  // Returns true if the current photograph may show a part of the ball within max_depth_m.
  bool may_show(const Eigen::Vector3d& center, double radius_m) const {
    const double z =
        projector_->to_world(Eigen::Vector3d::UnitZ()).dot(center - projector_->position());
    return z <= max_depth_m_ + longest_side_m_ + radius_m &&
           projector_->max_pixels(center, radius_m, 1.0) > 0.0;
  }
  void choose_vertices();
  void make_blocks();
  void find_blocks_in_view();
  void project();
  bool is_beside_occluder(std::size_t triangle) const;
  void reduce_quality_at_occluders();
  // Visits the blocks in view in parallel.
  template <typename Use>
  void each_block(const Use& use) const {
    parallel_each(in_view_.size(), [&](std::size_t n) { use(*in_view_[n]); });
  }
  template <typename Use>
  void each_rated(const Use& use) const {
    each_block([&](const Block& block) {
      for (const std::uint32_t t : block.rated) use(t);
    });
  }
  void rate_triangles(double sharpness);
  void cast_to_vertices();
  void test_triangles();
  void keep(std::uint32_t photo);
  void observe(std::uint32_t photo);
  std::vector<bool> hidden(const std::vector<Eigen::Vector3d>& points) const;
  Eigen::Vector3d side_of(const Triangle& t, std::size_t k) const {
    return mesh_.vertices[t[(k + 1) % 3]] - mesh_.vertices[t[k]];
  }
  const Eigen::Vector3d& normal_of(std::size_t rated) const {
    return normals_[index_of_rated_[rated]];
  }
  float rate(std::size_t triangle, double sharpness) const;
  float quality_at(std::uint32_t vertex) const;
  float longest_side_px(const Triangle& triangle) const;

  const TriangleMesh& mesh_;
  const TexturePhotos& photos_;
  const TextureViewOptions& options_;
  const TextureViewRequest& request_;
  TextureViews& views_;
  RayCaster caster_;
  VertexTriangles around_;
  double min_cos_;
  double max_depth_m_;
  double longest_side_m_ = 0.0;  // of the rated triangles
  // Requested vertices, a ball around them, and the triangles that determine their quality.
  std::vector<bool> is_asked_;
  std::vector<std::uint32_t> observed_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double radius_m_ = 0.0;
  std::vector<std::uint32_t> rated_;
  std::vector<Eigen::Vector3d> normals_;       // one per rated triangle
  std::vector<std::uint32_t> index_of_rated_;  // per triangle: its index in rated_
  std::vector<std::uint32_t> order_;           // vertices, by blocks
  std::vector<Block> blocks_;
  // State of the current photograph. Blocks that are not in view are outside the image.
  const PhotoProjector* projector_ = nullptr;
  std::vector<Block*> in_view_;
  std::vector<SeenVertex> vertices_;
  std::vector<float> qualities_;  // 0: not seen
  OccluderCells cells_;
};

void ViewFinder::choose_vertices() {
  is_asked_.assign(mesh_.vertices.size(), false);
  for (std::size_t t = 0; t < request_.triangles; ++t)
    for (const std::uint32_t v : mesh_.triangles[t]) is_asked_[v] = true;
  if (request_.observed_vertices > 0) {
    const std::size_t step =
        std::max<std::size_t>(1, count_of(is_asked_) / request_.observed_vertices);
    std::size_t number = 0;
    for (std::uint32_t v = 0; v < is_asked_.size(); ++v)
      if (is_asked_[v] && number++ % step == 0) observed_.push_back(v);
    views_.observed_vertices = observed_.size();
  }
  if (!wants_views()) {
    is_asked_.assign(mesh_.vertices.size(), false);
    for (const std::uint32_t v : observed_) is_asked_[v] = true;
  }
  Eigen::AlignedBox3d box;
  std::vector<bool> is_rated(mesh_.triangles.size(), false);
  for (std::uint32_t v = 0; v < is_asked_.size(); ++v) {
    if (!is_asked_[v]) continue;
    box.extend(mesh_.vertices[v]);
    for (const std::uint32_t t : around_.of(v)) is_rated[t] = true;
  }
  for (std::uint32_t t = 0; t < is_rated.size(); ++t)
    if (is_rated[t]) rated_.push_back(t);
  for (const std::uint32_t t : rated_)
    for (std::size_t k = 0; k < 3; ++k)
      longest_side_m_ = std::max(longest_side_m_, side_of(mesh_.triangles[t], k).norm());
  if (box.isEmpty()) return;
  center_ = box.center();
  radius_m_ = box.diagonal().norm() / 2.0;
}

void ViewFinder::make_blocks() {
  VoxelIndex cubes;
  std::vector<std::uint32_t> block_of(mesh_.vertices.size());
  for (std::size_t v = 0; v < block_of.size(); ++v) {
    VoxelSide cube;
    for (int axis = 0; axis < 3; ++axis)
      cube.cell[axis] = static_cast<int>(std::llround(mesh_.vertices[v][axis] / block_m));
    block_of[v] = cubes.find_or_add(pack(cube));
  }
  blocks_.resize(cubes.size());
  // Stable sort of indices by block.
  const auto sort = [&](std::vector<std::uint32_t>& numbers, const auto& vertex_of, auto member) {
    std::vector<std::size_t> first(blocks_.size() + 1, 0);
    for (const std::uint32_t n : numbers) ++first[block_of[vertex_of(n)] + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<std::uint32_t> sorted(numbers.size());
    std::vector<std::size_t> next(first.begin(), first.end() - 1);
    for (const std::uint32_t n : numbers) sorted[next[block_of[vertex_of(n)]]++] = n;
    numbers.swap(sorted);
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      blocks_[b].*member = std::span(numbers).subspan(first[b], first[b + 1] - first[b]);
  };
  // Views need all possible occluders; observations alone need only the corners of the triangles.
  std::vector<bool> is_needed(mesh_.vertices.size(), wants_views());
  for (const std::uint32_t t : rated_)
    for (const std::uint32_t v : mesh_.triangles[t]) is_needed[v] = true;
  for (std::uint32_t v = 0; v < is_needed.size(); ++v)
    if (is_needed[v]) order_.push_back(v);
  sort(
      order_, [](std::uint32_t v) { return v; }, &Block::vertices);
  sort(
      rated_, [this](std::uint32_t t) { return mesh_.triangles[t][0]; }, &Block::rated);
  for (Block& block : blocks_)
    for (const std::uint32_t v : block.vertices) block.box.extend(mesh_.vertices[v]);
  std::erase_if(blocks_, [](const Block& block) { return block.vertices.empty(); });
  index_of_rated_.resize(mesh_.triangles.size());
  normals_.reserve(rated_.size());
  for (const std::uint32_t t : rated_) {
    index_of_rated_[t] = static_cast<std::uint32_t>(normals_.size());
    normals_.push_back(area_normal(mesh_, mesh_.triangles[t]).normalized());
  }
}

void ViewFinder::find_blocks_in_view() {
  for (const Block* block : in_view_) {
    for (const std::uint32_t v : block->vertices) vertices_[v] = {};
    for (const std::uint32_t t : block->rated) qualities_[t] = 0.0F;
  }
  in_view_.clear();
  for (Block& block : blocks_)
    if (may_show(block.box.center(), block.box.diagonal().norm() / 2.0)) in_view_.push_back(&block);
}

void ViewFinder::project() {
  const Camera& camera = projector_->camera();
  const double border = options_.border_px;
  each_block([&](Block& block) {
    block.any_asked_in_image = false;
    for (const std::uint32_t v : block.vertices) {
      const Eigen::Vector3d seen = projector_->project(mesh_.vertices[v]);
      SeenVertex& vertex = vertices_[v];
      vertex = {static_cast<float>(seen.x()), static_cast<float>(seen.y()),
                static_cast<float>(seen.z()), false, false};
      vertex.in_image = seen.z() > 0.0 && seen.x() >= border && seen.y() >= border &&
                        seen.x() <= camera.width - 1 - border &&
                        seen.y() <= camera.height - 1 - border;
      if (vertex.in_image && is_asked_[v]) block.any_asked_in_image = true;
    }
  });
}

// Returns true if an occluder in the cells around the triangle is in front of its plane.
bool ViewFinder::is_beside_occluder(std::size_t t) const {
  const SeenVertex& corner = vertices_[mesh_.triangles[t][0]];
  const Eigen::Vector3d& normal = normal_of(t);
  const double height_m =
      normal.dot(mesh_.vertices[mesh_.triangles[t][0]] - projector_->position());
  return cells_.has_any_above(corner.x, corner.y, normal, height_m,
                              occluder_tolerances * options_.occlusion_tolerance_m);
}

void ViewFinder::reduce_quality_at_occluders() {
  if (options_.occlusion_margin_px == 0) return;
  cells_.begin(*projector_);
  for (const Block* block : in_view_)
    for (const std::uint32_t v : block->vertices)
      cells_.add(vertices_[v].x, vertices_[v].y, vertices_[v].z);
  each_rated([this](std::uint32_t t) {
    if (qualities_[t] > 0.0F && is_beside_occluder(t)) qualities_[t] *= beside_occluder;
  });
}

// Quality of the triangle's view, without occlusion; 0 if it is not in view.
float ViewFinder::rate(std::size_t t, double sharpness) const {
  const Triangle& triangle = mesh_.triangles[t];
  double sum_z = 0.0;
  for (const std::uint32_t corner : triangle) {
    if (!vertices_[corner].in_image) return 0.0F;
    sum_z += static_cast<double>(vertices_[corner].z);
  }
  if (sum_z > 3.0 * max_depth_m_) return 0.0F;
  const Eigen::Vector3d center = center_of(mesh_, triangle);
  const Eigen::Vector3d toward = projector_->position() - center;
  const double distance2 = toward.squaredNorm();
  const double cosine = normal_of(t).dot(toward) / std::sqrt(distance2);
  if (!(cosine > min_cos_)) return 0.0F;
  const Camera& camera = projector_->camera();
  const SeenVertex& a = vertices_[triangle[0]];
  const double from_border = std::min({static_cast<double>(a.x), static_cast<double>(a.y),
                                       camera.width - 1.0 - static_cast<double>(a.x),
                                       camera.height - 1.0 - static_cast<double>(a.y)});
  const double inside = smooth_step((from_border - options_.border_px) /
                                    (border_band * std::min(camera.width, camera.height)));
  const double incidence_factor = (cosine - min_cos_) / (1.0 - min_cos_);
  const double resolution = camera.fx * camera.fy / distance2 * cosine;
  return static_cast<float>(resolution * incidence_factor * std::clamp(sharpness, 0.1, 2.0) *
                            (min_border_fraction + (1.0 - min_border_fraction) * inside));
}

void ViewFinder::rate_triangles(double sharpness) {
  each_rated([&](std::uint32_t t) { qualities_[t] = rate(t, sharpness); });
}

// Occlusion of each point.
std::vector<bool> ViewFinder::hidden(const std::vector<Eigen::Vector3d>& points) const {
  const Eigen::Vector3d& origin = projector_->position();
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(points.size());
  // Rays end before the surface itself.
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d way = point - origin;
    directions.push_back(way * std::max(0.0, 1.0 - options_.occlusion_tolerance_m / way.norm()));
  }
  std::vector<RayHit> hits(directions.size());
  caster_.cast_bundle(origin, directions, hits, 0.0, 1.0);
  std::vector<bool> flags(hits.size());
  for (std::size_t i = 0; i < hits.size(); ++i) flags[i] = hits[i].triangle != RayHit::no_triangle;
  return flags;
}

void ViewFinder::cast_to_vertices() {
  each_block([this](const Block& block) {
    std::vector<std::uint32_t> wanted;
    std::vector<Eigen::Vector3d> points;
    for (const std::uint32_t v : block.vertices) {
      if (!vertices_[v].in_image) continue;
      const auto around = around_.of(v);
      if (std::none_of(around.begin(), around.end(),
                       [this](std::uint32_t t) { return qualities_[t] > 0.0F; }))
        continue;
      wanted.push_back(v);
      points.push_back(mesh_.vertices[v]);
    }
    const std::vector<bool> blocked = hidden(points);
    for (std::size_t i = 0; i < wanted.size(); ++i) vertices_[wanted[i]].visible = !blocked[i];
  });
}

float ViewFinder::longest_side_px(const Triangle& triangle) const {
  float longest = 0.0F;
  for (std::size_t k = 0; k < 3; ++k) {
    const SeenVertex& a = vertices_[triangle[k]];
    const SeenVertex& b = vertices_[triangle[(k + 1) % 3]];
    longest = std::max(longest, (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y));
  }
  return std::sqrt(longest);
}

void ViewFinder::test_triangles() {
  each_block([this](const Block& block) {
    std::vector<std::uint32_t> wanted;
    std::vector<Eigen::Vector3d> centers;
    for (const std::uint32_t t : block.rated) {
      if (!(qualities_[t] > 0.0F)) continue;
      const Triangle& triangle = mesh_.triangles[t];
      if (!vertices_[triangle[0]].visible || !vertices_[triangle[1]].visible ||
          !vertices_[triangle[2]].visible) {
        qualities_[t] = 0.0F;
      } else if (longest_side_px(triangle) > center_test_px) {
        wanted.push_back(t);
        centers.push_back(center_of(mesh_, triangle));
      }
    }
    const std::vector<bool> blocked = hidden(centers);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      if (blocked[i]) qualities_[wanted[i]] = 0.0F;
  });
}

// Minimum quality of a vertex's triangles; 0 if one is not seen. Ignores triangles without area.
float ViewFinder::quality_at(std::uint32_t v) const {
  if (!vertices_[v].visible) return 0.0F;
  float least = std::numeric_limits<float>::infinity();
  for (const std::uint32_t t : around_.of(v))
    if (!normal_of(t).isZero()) least = std::min(least, qualities_[t]);
  return std::isfinite(least) ? least : 0.0F;
}

void ViewFinder::keep(std::uint32_t photo) {
  if (request_.views_per_triangle > 0)
    each_rated([&](std::uint32_t t) {
      if (t < request_.triangles && qualities_[t] > 0.0F)
        views_.of_triangles.insert(t, {photo, qualities_[t]});
    });
  if (request_.views_per_vertex > 0)
    each_block([&](const Block& block) {
      for (const std::uint32_t v : block.vertices) {
        const float quality = is_asked_[v] ? quality_at(v) : 0.0F;
        if (quality > 0.0F) views_.of_vertices.insert(v, {photo, quality});
      }
    });
}

void ViewFinder::observe(std::uint32_t photo) {
  for (std::uint32_t i = 0; i < observed_.size(); ++i) {
    const SeenVertex& vertex = vertices_[observed_[i]];
    if (quality_at(observed_[i]) > 0.0F)
      views_.observations.push_back({.vertex = i, .photo = photo, .x = vertex.x, .y = vertex.y});
  }
}

}  // namespace

ViewTable::ViewTable(std::size_t rows, std::size_t capacity)
    : capacity_(capacity), entries_(rows * capacity), counts_(rows, 0) {}

void ViewTable::insert(std::size_t row, ViewQuality view) {
  ViewQuality* const first = entries_.data() + row * capacity_;
  std::size_t slot = counts_[row];
  const auto before = [](const ViewQuality& a, const ViewQuality& b) {
    return a.quality != b.quality ? a.quality > b.quality : a.photo < b.photo;
  };
  if (slot == capacity_ && !before(view, first[capacity_ - 1])) return;
  if (slot < capacity_) ++counts_[row];
  slot = std::min(slot, capacity_ - 1);
  for (; slot > 0 && before(view, first[slot - 1]); --slot) first[slot] = first[slot - 1];
  first[slot] = view;
}

void look_up_colors(const TexturePhotos& photos, std::vector<ColorObservation>& observations) {
  std::vector<std::vector<std::size_t>> of_photo(photos.size());
  for (std::size_t n = 0; n < observations.size(); ++n)
    of_photo[observations[n].photo].push_back(n);
  parallel_each(photos.size(), [&](std::size_t photo) {
    if (of_photo[photo].empty()) return;
    const Camera& camera = photos[photo].projector.camera();
    const Eigen::Vector2d middle((camera.width - 1) / 2.0, (camera.height - 1) / 2.0);
    const std::shared_ptr<const ColorImage> image = photos.image(photo);
    for (const std::size_t n : of_photo[photo]) {
      ColorObservation& seen = observations[n];
      const Eigen::Vector2d pixel(static_cast<double>(seen.x), static_cast<double>(seen.y));
      seen.radius2 = static_cast<float>((pixel - middle).squaredNorm() / middle.squaredNorm());
      seen.color = bilinear_color(*image, pixel.x(), pixel.y());
    }
  });
}

TextureViews find_texture_views(const TriangleMesh& mesh, const TexturePhotos& photos,
                                const TextureViewOptions& options,
                                const TextureViewRequest& request, Progress& progress) {
  TextureViews views;
  views.of_triangles = ViewTable(request.triangles, request.views_per_triangle);
  std::size_t vertices = 0;
  for (std::size_t t = 0; t < request.triangles; ++t)
    for (const std::uint32_t v : mesh.triangles[t])
      vertices = std::max<std::size_t>(vertices, v + 1);
  views.of_vertices = ViewTable(vertices, request.views_per_vertex);
  ViewFinder finder(mesh, photos, options, request, views);
  progress.begin("views", photos.size());
  for (std::size_t photo = 0; photo < photos.size(); ++photo) {
    finder.look_from(photo);
    progress.advance(1);
  }
  progress.end();
  return views;
}

}  // namespace libmap
