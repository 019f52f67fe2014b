#include "libmap/texture/texture_model.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "libmap/core/error.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/texture/mesh_subdivision.h"
#include "libmap/texture/texture_painting.h"
#include "libmap/texture/texture_photos.h"

namespace libmap {

namespace {

// Views of a triangle among which one is chosen.
constexpr std::size_t views_a_triangle = 12;
// Triangles that all photographs show smaller are not cut; nor are any where more would come out.
constexpr double min_cut_px = 16.0;
constexpr std::uint64_t max_cut_triangles = 2'500'000;

// Whether any photograph may show the triangle, or a part of it, so large that cutting it matters.
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

class Texturing {
 public:
  Texturing(const TextureOptions& options, Progress& progress)
      : options_(options), progress_(progress) {}

  TextureResult run(const TriangleMesh& input, const ScanSource& scan,
                    const Trajectory& world_from_base);

 private:
  template <typename Step>
  auto timed(const char* name, const Step& step) {
    return libmap::timed(result_.timings_s, name, step);
  }
  TriangleMesh cut_finely(const TriangleMesh& input, const TexturePhotos& photos);
  void count_seen(const TriangleMesh& mesh, const std::vector<std::uint32_t>& label);
  void count_charts(const TextureAtlas& atlas, const TriangleMesh& mesh,
                    const TexturePhotos& photos);

  const TextureOptions& options_;
  Progress& progress_;
  TextureResult result_;
};

TriangleMesh Texturing::cut_finely(const TriangleMesh& input, const TexturePhotos& photos) {
  if (!(options_.max_side_m > 0.0)) return input;
  SubdivisionResult fine = split_long_sides(
      input, options_.max_side_m, max_cut_triangles,
      [&photos](const TriangleMesh& mesh, const Triangle& t) { return is_shown(mesh, t, photos); });
  result_.cut_triangles = fine.mesh.triangles.size() - input.triangles.size();
  return std::move(fine.mesh);
}

void Texturing::count_seen(const TriangleMesh& mesh, const std::vector<std::uint32_t>& label) {
  for (std::size_t t = 0; t < label.size(); ++t) {
    const double area = 0.5 * area_normal(mesh, mesh.triangles[t]).norm();
    (label[t] == no_photo ? result_.unseen_m2 : result_.seen_m2) += area;
    ++(label[t] == no_photo ? result_.unseen_triangles : result_.seen_triangles);
  }
  if (result_.seen_triangles == 0)
    throw Error("none of its triangles is seen by any of " + std::to_string(result_.photos) +
                " photographs: mesh and poses may lie in different frames");
}

void Texturing::count_charts(const TextureAtlas& atlas, const TriangleMesh& mesh,
                             const TexturePhotos& photos) {
  result_.charts = atlas.charts.size();
  result_.split_charts = atlas.split_charts;
  result_.shrunk_charts = atlas.shrunk_charts;
  result_.atlas_scale = atlas.scale;
  double texels = 0.0;
  for (const TextureChart& chart : atlas.charts)
    for (const std::uint32_t t : chart.triangles) {
      const PhotoProjector& projector = photos[chart.photo].projector;
      const Triangle& corners = mesh.triangles[t];
      const Eigen::Vector2d a = place_on_page(chart, projector, mesh.vertices[corners[0]]);
      const Eigen::Vector2d ab = place_on_page(chart, projector, mesh.vertices[corners[1]]) - a;
      const Eigen::Vector2d ac = place_on_page(chart, projector, mesh.vertices[corners[2]]) - a;
      texels += 0.5 * std::abs(ab.x() * ac.y() - ab.y() * ac.x());
    }
  result_.texel_size_m = texels > 0.0 ? std::sqrt(result_.seen_m2 / texels) : 0.0;
}

TextureResult Texturing::run(const TriangleMesh& input, const ScanSource& scan,
                             const Trajectory& world_from_base) {
  check_parameters(options_);
  input.check();
  if (input.triangles.empty()) throw Error("the mesh has no triangles");
  const auto photos = timed("photographs", [&] {
    return std::make_unique<TexturePhotos>(scan, world_from_base, options_.strict, progress_);
  });
  result_.photos = photos->size();
  result_.skipped = photos->skipped();
  const TriangleMesh mesh = timed("cutting", [&] { return cut_finely(input, *photos); });
  const TextureViews views = timed("views", [&] {
    return find_texture_views(mesh, *photos, options_.views, views_a_triangle,
                              static_cast<std::size_t>(options_.blend_views) + 1, progress_);
  });
  const auto opposite = timed("edges", [&] { return opposites_of(mesh); });
  const TextureLabels labels = timed("labeling", [&] {
    return label_triangles(mesh, opposite, views.of_triangles, options_.labeling);
  });
  result_.seams_before_m = labels.seams_before_m;
  result_.seams_m = labels.seams_m;
  count_seen(mesh, labels.photos);
  result_.exposure = timed("exposure", [&] {
    return even_out_exposure(views.observations, photos->size(), options_.exposure);
  });
  const TextureAtlas atlas = timed("atlas", [&] {
    return make_texture_atlas(mesh, opposite, labels.photos, *photos, options_.atlas);
  });
  count_charts(atlas, mesh, *photos);
  result_.model = timed("painting", [&] {
    TexturedMesh model = atlas.make_model(mesh, *photos);
    const BlendingShares shares =
        share_views(views.of_vertices, options_.blend_views, options_.blend_exponent);
    paint_texture(atlas, {*photos, result_.exposure, shares, options_.unseen_color}, model,
                  progress_);
    return model;
  });
  return std::move(result_);
}

}  // namespace

void bind(ParameterTable& table, TextureOptions& options) {
  table.add("texture_size_px", options.atlas.texture_size, {64, 16384},
            "no page of the texture is wider or higher, pixels");
  table.add("texel_size_m", options.atlas.texel_size_m, not_negative,
            "side of a texel on the surface, m; 0: by the photographs' own pixels");
  table.add("texels_per_pixel", options.atlas.texels_per_pixel, {0.05, 8.0},
            "with texel_size_m 0: texels along a side of the photographs' pixels");
  table.add("max_pages", options.atlas.max_pages, not_negative,
            "texels are made larger where more pages would be needed; 0: any number of pages");
  table.add("padding_px", options.atlas.padding_px, {1, 64},
            "texels around each chart that continue its colors");
  table.add("max_incidence_deg", options.views.max_incidence_deg, {0, 90, true, true},
            "views that are more aslant are not used");
  table.add("occlusion_tolerance_m", options.views.occlusion_tolerance_m, not_negative,
            "a surface is hidden that lies further behind another, m");
  table.add("occlusion_margin_px", options.views.occlusion_margin_px, not_negative,
            "so near to what stands before it a surface is better shown by another view, pixels");
  table.add("border_px", options.views.border_px, not_negative,
            "border of each photograph that is not used, pixels");
  table.add("seam_cost_m", options.labeling.seam_cost_m, not_negative,
            "larger: fewer seams and larger charts, of views that are not the best");
  table.add("blend_views", options.blend_views, {1, 16},
            "photographs that are blended at a place; 1: one a triangle");
  table.add("blend_exponent", options.blend_exponent, not_negative,
            "how much the better of them count for more");
  table.add("exposure", options.exposure.gains, "even out the brightness of the photographs");
  table.add("vignetting", options.exposure.vignetting, "even out darkening towards their corners");
  table.add("max_side_m", options.max_side_m, not_negative,
            "triangles with longer sides are cut where a photograph may show them, m; 0: none");
  table.add("strict", options.strict, "a frame that cannot be used is an error");
}

TextureResult texture_mesh(const TriangleMesh& mesh, const ScanSource& scan,
                           const Trajectory& world_from_base, const TextureOptions& options,
                           Progress& progress) {
  return Texturing(options, progress).run(mesh, scan, world_from_base);
}

}  // namespace libmap
