#include "libmap/texture/texture_model.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "libmap/core/error.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/texture/texture_photos.h"
#include "libmap/texture/texture_steps.h"

namespace libmap {

namespace {

// Maximum number of candidate views per triangle.
constexpr std::size_t views_per_triangle = 12;
// Number of vertices whose colors are compared between photographs, and its minimum per tile.
constexpr std::size_t observed_vertices = 20000;
constexpr std::size_t min_observed_vertices = 200;
// Cache size of decoded photographs. A tile needs only photographs close to the tile.
constexpr std::size_t max_image_bytes = std::size_t{400} << 20;
constexpr std::size_t max_image_bytes_in_pieces = std::size_t{64} << 20;
// Triangles whose sides are shorter in all photographs are not subdivided.
constexpr double min_cut_px = 16.0;
constexpr std::uint64_t max_cut_triangles = 2'500'000;

// Returns true if a side of the triangle may be longer than min_cut_px in any photograph.
bool is_shown(const TriangleMesh& mesh, const Triangle& t, const TexturePhotos& photos) {
  const Eigen::Vector3d center = center_of(mesh, t);
  double radius = 0.0;
  double longest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    radius = std::max(radius, (mesh.vertices[t[k]] - center).norm());
    longest = std::max(longest, (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm());
  }
  for (std::size_t i = 0; i < photos.size(); ++i)
    if (photos[i].projector.max_pixels(center, radius, longest) > min_cut_px) return true;
  return false;
}

bool has_longer_side(const TriangleMesh& mesh, double side_m) {
  return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
    return (mesh.vertices[t[0]] - mesh.vertices[t[1]]).squaredNorm() > side_m * side_m ||
           (mesh.vertices[t[1]] - mesh.vertices[t[2]]).squaredNorm() > side_m * side_m ||
           (mesh.vertices[t[2]] - mesh.vertices[t[0]]).squaredNorm() > side_m * side_m;
  });
}

class Texturing {
 public:
  Texturing(const ScanSource& scan, const Trajectory& world_from_base,
            const TextureOptions& options, Progress& progress, std::size_t max_kept_bytes);

  TextureResult whole(const TriangleMesh& mesh);
  std::vector<ColorObservation> observe(MeshTileIndex& index, double margin_m);
  void even_out(std::vector<ColorObservation> observations);
  TileTexturing::Tile tile(MeshWithMargin part);
  TextureReport& report() { return report_; }

 private:
  template <typename Step>
  auto timed(const char* name, const Step& step) {
    return libmap::timed(report_.timings_s, name, step);
  }
  MeshWithMargin cut_finely(MeshWithMargin part) const;
  TextureViewRequest views_of(const MeshWithMargin& part) const {
    return {part.triangles, views_per_triangle, static_cast<std::size_t>(options_.blend_views) + 1,
            0};
  }
  // The model keeps the vertices of the margin, which no triangle uses.
  TexturedMesh paint(MeshWithMargin part, TextureViews views, Progress& progress);
  void count_seen(const TriangleMesh& mesh, const std::vector<std::uint32_t>& label);
  void count_charts(const TextureAtlas& atlas, const TriangleMesh& mesh);

  TextureOptions options_;
  Progress& progress_;
  std::unique_ptr<TexturePhotos> photos_;
  TextureReport report_;
};

Texturing::Texturing(const ScanSource& scan, const Trajectory& world_from_base,
                     const TextureOptions& options, Progress& progress, std::size_t max_kept_bytes)
    : options_(options), progress_(progress) {
  check_parameters(options);
  photos_ = timed("photographs", [&] {
    return std::make_unique<TexturePhotos>(scan, world_from_base, options.strict, progress,
                                           max_kept_bytes);
  });
  report_.photos = photos_->size();
  report_.skipped = photos_->skipped();
}

MeshWithMargin Texturing::cut_finely(MeshWithMargin part) const {
  if (!(options_.max_side_m > 0.0) || !has_longer_side(part.mesh, options_.max_side_m)) return part;
  SubdivisionResult fine = split_long_sides(
      std::move(part.mesh), options_.max_side_m, max_cut_triangles,
      [this](const TriangleMesh& mesh, const Triangle& t) { return is_shown(mesh, t, *photos_); });
  // Triangles are ordered by their source, so those of the tile come first, the margin last.
  const auto own = std::lower_bound(fine.source.begin(), fine.source.end(), part.triangles);
  return {std::move(fine.mesh), static_cast<std::size_t>(own - fine.source.begin())};
}

void Texturing::even_out(std::vector<ColorObservation> observations) {
  timed("exposure", [&] {
    look_up_colors(*photos_, observations);
    report_.exposure = estimate_exposure(observations, photos_->size(), options_.exposure);
  });
}

void Texturing::count_seen(const TriangleMesh& mesh, const std::vector<std::uint32_t>& label) {
  for (std::size_t t = 0; t < label.size(); ++t) {
    const double area = 0.5 * area_normal(mesh, mesh.triangles[t]).norm();
    (label[t] == no_photo ? report_.unseen_m2 : report_.seen_m2) += area;
    ++(label[t] == no_photo ? report_.unseen_triangles : report_.seen_triangles);
  }
}

void Texturing::count_charts(const TextureAtlas& atlas, const TriangleMesh& mesh) {
  report_.charts += atlas.charts.size();
  report_.split_charts += atlas.split_charts;
  report_.shrunk_charts += atlas.shrunk_charts;
  report_.pages += atlas.pages.size();
  report_.atlas_scale = std::min(report_.atlas_scale, atlas.scale);
  for (const TextureChart& chart : atlas.charts)
    for (const std::uint32_t t : chart.triangles) {
      const PhotoProjector& projector = (*photos_)[chart.photo].projector;
      const Triangle& corners = mesh.triangles[t];
      const Eigen::Vector2d a = texel_of(chart, projector, mesh.vertices[corners[0]]);
      const Eigen::Vector2d ab = texel_of(chart, projector, mesh.vertices[corners[1]]) - a;
      const Eigen::Vector2d ac = texel_of(chart, projector, mesh.vertices[corners[2]]) - a;
      report_.texels += 0.5 * std::abs(ab.x() * ac.y() - ab.y() * ac.x());
    }
}

TexturedMesh Texturing::paint(MeshWithMargin part, TextureViews views, Progress& progress) {
  TriangleMesh& mesh = part.mesh;
  mesh.triangles.resize(part.triangles);
  for (ScalarField& field : mesh.face_fields) field.values.resize(part.triangles);
  const auto opposite = timed("edges", [&] { return opposites_of(mesh); });
  const TextureLabels labels = timed("labeling", [&] {
    return label_triangles(mesh, opposite, views.of_triangles, options_.labeling);
  });
  views.of_triangles = {};
  report_.seams_before_m += labels.seams_before_m;
  report_.seams_m += labels.seams_m;
  count_seen(mesh, labels.photos);
  const TextureAtlas atlas = timed("atlas", [&] {
    return make_texture_atlas(mesh, opposite, labels.photos, *photos_, options_.atlas);
  });
  count_charts(atlas, mesh);
  return timed("painting", [&] {
    TexturedMesh model = atlas.make_model(mesh, *photos_);
    const BlendingWeights weights =
        blending_weights(views.of_vertices, options_.blend_views, options_.blend_exponent);
    paint_texture(atlas, {*photos_, report_.exposure, weights, options_.unseen_color}, model,
                  progress);
    return model;
  });
}

TextureResult Texturing::whole(const TriangleMesh& mesh) {
  mesh.check();
  if (mesh.triangles.empty()) throw no_elements("triangles of the mesh");
  const MeshWithMargin part = timed("cutting", [&] {
    return cut_finely({mesh, mesh.triangles.size()});
  });
  report_.cut_triangles = part.triangles - mesh.triangles.size();
  TextureViewRequest request = views_of(part);
  request.observed_vertices = observed_vertices;
  TextureViews views = timed("views", [&] {
    return find_texture_views(part.mesh, *photos_, options_.views, request, progress_);
  });
  even_out(std::move(views.observations));
  TexturedMesh model = paint(std::move(part), std::move(views), progress_);
  require_seen(report_);
  return {std::move(report_), std::move(model)};
}

// Collects color observations from all tiles.
std::vector<ColorObservation> Texturing::observe(MeshTileIndex& index, double margin_m) {
  const std::size_t wanted = std::max(min_observed_vertices, observed_vertices / index.size());
  std::vector<ColorObservation> all;
  std::size_t before = 0;
  progress_.begin("exposure", index.size());
  for (std::size_t tile = 0; tile < index.size(); ++tile) {
    const MeshWithMargin part = cut_finely(index.with_margin(tile, margin_m));
    const TextureViews views = find_texture_views(part.mesh, *photos_, options_.views,
                                                  {part.triangles, 0, 0, wanted}, no_progress());
    for (ColorObservation seen : views.observations) {
      seen.vertex += static_cast<std::uint32_t>(before);
      all.push_back(seen);
    }
    before += views.observed_vertices;
    progress_.advance(1);
  }
  progress_.end();
  return all;
}

TileTexturing::Tile Texturing::tile(MeshWithMargin part) {
  static_cast<TextureCounts&>(report_) = {};
  const std::size_t uncut = part.triangles;
  part = timed("cutting", [&] { return cut_finely(std::move(part)); });
  report_.cut_triangles = part.triangles - uncut;
  TextureViews views = timed("views", [&] {
    return find_texture_views(part.mesh, *photos_, options_.views, views_of(part), no_progress());
  });
  TexturedMesh model = paint(std::move(part), std::move(views), no_progress());
  // Frees memory: the peak is reached while the model is encoded.
  photos_->evict_images();
  model.mesh = select_triangles(model.mesh, std::vector<bool>(model.mesh.triangles.size(), true));
  return {std::move(model), report_};
}

}  // namespace

void bind(ParameterTable& table, TextureOptions& options) {
  table.add("texture_size_px", options.atlas.texture_size, {64, 16384},
            "maximum width and height of a texture page, pixels");
  table.add("texel_size_m", options.atlas.texel_size_m, not_negative,
            "side of a texel (texture pixel) on the surface, m; 0: from --texels-per-pixel");
  table.add("texels_per_pixel", options.atlas.texels_per_pixel, {0.05, 8.0},
            "if --texel-size is 0: number of texels along one side of a photograph's pixel");
  table.add("max_pages", options.atlas.max_pages, not_negative,
            "maximum number of texture pages; the resolution is reduced to fit; 0: no limit");
  table.add("padding_px", options.atlas.padding_px, {1, 64},
            "width of the extrapolated border around each piece of the texture, texels");
  table.add("max_incidence_deg", options.views.max_incidence_deg, {0, 90, true, true},
            "maximum angle between viewing ray and surface normal of a used photograph, degrees");
  table.add("max_depth_m", options.views.max_depth_m, not_negative,
            "maximum depth at which a photograph is used for a surface, m; 0: no limit");
  table.add("occlusion_tolerance_m", options.views.occlusion_tolerance_m, not_negative,
            "depth behind another surface beyond which a surface counts as occluded, m");
  table.add("occlusion_margin_px", options.views.occlusion_margin_px, not_negative,
            "distance from the silhouette of an occluding surface within which other photographs "
            "are preferred, pixels");
  table.add("border_px", options.views.border_px, not_negative,
            "width of the unused border of each photograph, pixels");
  table.add("seam_cost_m", options.labeling.seam_cost_m, not_negative,
            "cost of 1 m of seam between photographs, in m2 of surface shown at half of the best "
            "view quality; larger: fewer seams");
  table.add("blend_views", options.blend_views, {1, 16},
            "maximum number of photographs blended at a point; 1: one photograph per triangle");
  table.add("blend_exponent", options.blend_exponent, not_negative,
            "blending weight of a photograph: its view quality to this power; 0: equal weights");
  table.add("exposure", options.exposure.gains, "equalize the brightness of the photographs");
  table.add("vignetting", options.exposure.vignetting, "correct the vignetting of the photographs");
  table.add("max_side_m", options.max_side_m, not_negative,
            "side length above which visible triangles are subdivided, m; 0: no subdivision");
  table.add("strict", options.strict, "treat unusable frames as errors instead of skipping them");
}

TextureResult texture_mesh(const TriangleMesh& mesh, const ScanSource& scan,
                           const Trajectory& world_from_base, const TextureOptions& options,
                           Progress& progress) {
  return Texturing(scan, world_from_base, options, progress, max_image_bytes).whole(mesh);
}

class TileTexturing::Work {
 public:
  MeshTileIndex& index;
  double margin_m;
  Texturing texturing;
};

TileTexturing::TileTexturing(MeshTileIndex& tiles, double margin_m, const ScanSource& scan,
                             const Trajectory& world_from_base, const TextureOptions& options,
                             Progress& progress)
    : work_(new Work{
          tiles, margin_m,
          Texturing(scan, world_from_base, options, progress, max_image_bytes_in_pieces)}) {}

TileTexturing::~TileTexturing() = default;

TextureExposure TileTexturing::find_exposure() {
  work_->texturing.even_out(work_->texturing.observe(work_->index, work_->margin_m));
  return work_->texturing.report().exposure;
}

TileTexturing::Tile TileTexturing::make(std::size_t tile, const TextureExposure& exposure) {
  work_->texturing.report().exposure = exposure;
  return work_->texturing.tile(work_->index.with_margin(tile, work_->margin_m));
}

TextureReport TileTexturing::report() const {
  TextureReport report = work_->texturing.report();
  static_cast<TextureCounts&>(report) = {};
  return report;
}

void describe(ResultTable& table, const TextureCounts& counts) {
  table.add("triangles", counts.seen_triangles + counts.unseen_triangles,
            "number of triangles of the textured mesh");
  table.add("triangles_by_cutting", counts.cut_triangles, Merge::sum,
            "number of triangles added by subdividing triangles with long sides");
  table.add("seen_triangles", counts.seen_triangles, Merge::sum,
            "number of triangles with a photograph");
  table.add("unseen_triangles", counts.unseen_triangles, Merge::sum,
            "number of triangles without a photograph");
  table.add("seen_m2", counts.seen_m2, Merge::sum, "area with a photograph, m2");
  table.add("unseen_m2", counts.unseen_m2, Merge::sum, "area without a photograph, m2");
  table.add("charts", counts.charts, Merge::sum, "number of charts (pieces) of the texture");
  table.add("split_charts", counts.split_charts, Merge::sum,
            "number of charts that were split to fit a page");
  table.add("shrunk_charts", counts.shrunk_charts, Merge::sum,
            "number of charts whose resolution was reduced to fit a page");
  table.add("pages", counts.pages, Merge::sum, "number of pages of the texture");
  table.add("texel_size_m", counts.texel_size_m(), "square root of the mean area of a texel, m");
  table.add("atlas_scale", counts.atlas_scale, Merge::min,
            "factor by which the charts were scaled down to fit max_pages; 1: not scaled down");
  table.add("seams_before_m", counts.seams_before_m, Merge::sum,
            "length of seams if each triangle showed its best photograph, m");
  table.add("seams_m", counts.seams_m, Merge::sum, "length of seams between photographs, m");
  table.add_hidden("texels", counts.texels, Merge::sum);
}

void describe(ResultTable& table, const TextureReport& report) {
  const TextureExposure& exposure = report.exposure;
  std::vector<double> gains;
  for (const Eigen::Vector3f& gain : exposure.gains)
    for (const float channel : gain) gains.push_back(static_cast<double>(channel));
  table.add("photographs", report.photos, "number of photographs");
  table.add("skipped_frames", report.skipped.size(), "number of frames that could not be used");
  describe(table, static_cast<const TextureCounts&>(report));
  table.add("color_spread_before", exposure.log_color_deviation_before,
            "standard deviation of ln(color) between photographs, before exposure correction");
  table.add("color_spread", exposure.log_color_deviation,
            "standard deviation of ln(color) between photographs, after exposure correction");
  table.add("exposure_gains", gains, "gain of red, green and blue of each photograph");
  table.add("vignetting", exposure.vignetting,
            "coefficients a, b, c of the vignetting: ln(brightness) = a r^2 + b r^4 + c r^6");
}

double TextureCounts::texel_size_m() const {
  return texels > 0.0 ? std::sqrt(seen_m2 / texels) : 0.0;
}

void require_seen(const TextureReport& report) {
  if (report.seen_triangles == 0)
    throw Error("no triangle is visible in any of the " + std::to_string(report.photos) +
                " photographs; check that mesh and poses are in the same frame");
}

}  // namespace libmap
