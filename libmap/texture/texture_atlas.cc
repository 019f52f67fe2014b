#include "libmap/texture/texture_atlas.h"

#include <stb_rect_pack.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/texture/texture_steps.h"

namespace libmap {

namespace {

constexpr double min_scale = 1.0 / 64.0;
constexpr double max_scale = 16.0;
constexpr int max_rounds = 12;
// Cropped page sides are multiples of this number of pixels.
constexpr int page_step = 4;

Eigen::Vector2d pixel_of(const PhotoProjector& projector, const Eigen::Vector3d& point) {
  return projector.project(point).head<2>();
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

struct Extent {
  Eigen::Vector2d min = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d max = Eigen::Vector2d::Constant(-std::numeric_limits<double>::infinity());
  void include(const Eigen::Vector2d& point) {
    min = min.cwiseMin(point);
    max = max.cwiseMax(point);
  }
};

class AtlasMaker {
 public:
  AtlasMaker(const TriangleMesh& mesh, const TexturePhotos& photos,
             const TextureAtlasOptions& options)
      : mesh_(mesh),
        photos_(photos),
        options_(options),
        padding_(std::min(options.padding_px, options.texture_size / 8)) {}

  TextureAtlas run(const std::vector<HalfEdge>& opposite, const std::vector<std::uint32_t>& label) {
    find_charts(opposite, label);
    any_neutral_ = std::find(label.begin(), label.end(), no_photo) != label.end();
    TextureAtlas atlas;
    for (int round = 0; round < max_rounds; ++round) {
      atlas = lay_out(scale_);
      const auto pages = static_cast<int>(atlas.pages.size());
      if (options_.max_pages == 0 || pages <= options_.max_pages || scale_ <= min_scale) break;
      scale_ *= 0.95 * std::sqrt(static_cast<double>(options_.max_pages) / pages);
    }
    return atlas;
  }

 private:
  void find_charts(const std::vector<HalfEdge>& opposite, const std::vector<std::uint32_t>& label);
  std::array<Eigen::Vector2d, 3> corners_px(const TextureChart& chart, std::uint32_t t) const;
  double own_scale(const TextureChart& chart) const;
  void fit(TextureChart chart, TextureAtlas& atlas) const;
  TextureAtlas lay_out(double scale) const;
  void pack(TextureAtlas& atlas) const;

  const TriangleMesh& mesh_;
  const TexturePhotos& photos_;
  const TextureAtlasOptions& options_;
  int padding_;
  bool any_neutral_ = false;
  double scale_ = 1.0;
  std::vector<TextureChart> whole_charts_;  // before splitting
};

// Collects connected triangles of one photograph, ordered by their first triangle.
void AtlasMaker::find_charts(const std::vector<HalfEdge>& opposite,
                             const std::vector<std::uint32_t>& label) {
  std::vector<bool> taken(label.size(), false);
  for (std::uint32_t seed = 0; seed < label.size(); ++seed) {
    if (taken[seed] || label[seed] == no_photo) continue;
    TextureChart chart;
    chart.photo = label[seed];
    chart.triangles.push_back(seed);
    taken[seed] = true;
    for (std::size_t i = 0; i < chart.triangles.size(); ++i)
      for (HalfEdge h = 3 * chart.triangles[i]; h < 3 * chart.triangles[i] + 3; ++h) {
        if (!is_joined(opposite[h])) continue;
        const std::uint32_t neighbor = opposite[h] / 3;
        if (taken[neighbor] || label[neighbor] != chart.photo) continue;
        taken[neighbor] = true;
        chart.triangles.push_back(neighbor);
      }
    std::sort(chart.triangles.begin(), chart.triangles.end());
    whole_charts_.push_back(std::move(chart));
  }
  parallel_each(whole_charts_.size(), 16,
                [&](std::size_t i) { whole_charts_[i].scale = own_scale(whole_charts_[i]); });
}

std::array<Eigen::Vector2d, 3> AtlasMaker::corners_px(const TextureChart& chart,
                                                      std::uint32_t t) const {
  const PhotoProjector& projector = photos_[chart.photo].projector;
  const Triangle& triangle = mesh_.triangles[t];
  return {pixel_of(projector, mesh_.vertices[triangle[0]]),
          pixel_of(projector, mesh_.vertices[triangle[1]]),
          pixel_of(projector, mesh_.vertices[triangle[2]])};
}

// Texels per pixel for a mean texel size of texel_size_m.
double AtlasMaker::own_scale(const TextureChart& chart) const {
  if (!(options_.texel_size_m > 0.0)) return options_.texels_per_pixel;
  double area_m2 = 0.0;
  double area_px = 0.0;
  for (const std::uint32_t t : chart.triangles) {
    const auto corners = corners_px(chart, t);
    area_m2 += 0.5 * area_normal(mesh_, mesh_.triangles[t]).norm();
    area_px += 0.5 * std::abs(cross(corners[1] - corners[0], corners[2] - corners[0]));
  }
  if (!(area_px > 0.0)) return 1.0;
  return std::clamp(std::sqrt(area_m2 / area_px) / options_.texel_size_m, min_scale, max_scale);
}

// Appends the chart with its size, or its parts if it does not fit on a page.
void AtlasMaker::fit(TextureChart chart, TextureAtlas& atlas) const {
  Extent extent;
  for (const std::uint32_t t : chart.triangles)
    for (const Eigen::Vector2d& corner : corners_px(chart, t)) extent.include(corner);
  chart.origin = extent.min.array().floor();
  const Eigen::Vector2d size = extent.max - chart.origin;
  const int room = options_.texture_size - 2 * padding_ - 1;
  const double larger = size.maxCoeff() * chart.scale;
  if (larger > room && chart.triangles.size() > 1) {
    const Eigen::Index axis = size.x() >= size.y() ? 0 : 1;
    const double middle = (extent.min[axis] + extent.max[axis]) / 2.0;
    TextureChart parts[2] = {chart, chart};
    for (TextureChart& part : parts) part.triangles.clear();
    for (const std::uint32_t t : chart.triangles) {
      const auto corners = corners_px(chart, t);
      const double center = (corners[0] + corners[1] + corners[2])[axis] / 3.0;
      parts[center < middle ? 0 : 1].triangles.push_back(t);
    }
    // All centers may be on one side: split by index then.
    for (std::size_t k = 0; k < 2; ++k) {
      if (!parts[k].triangles.empty()) continue;
      std::vector<std::uint32_t>& all = parts[1 - k].triangles;
      const auto half = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
      parts[k].triangles.assign(half, all.end());
      all.erase(half, all.end());
    }
    ++atlas.split_charts;
    fit(std::move(parts[0]), atlas);
    fit(std::move(parts[1]), atlas);
    return;
  }
  if (larger > room) {
    chart.scale *= room / larger;
    ++atlas.shrunk_charts;
  }
  // Rounding must not make a scaled-down chart larger than the page.
  const auto texels = [&](double size_px) {
    return std::min(room, static_cast<int>(std::ceil(size_px * chart.scale))) + 1 + 2 * padding_;
  };
  chart.width = texels(size.x());
  chart.height = texels(size.y());
  atlas.charts.push_back(std::move(chart));
}

TextureAtlas AtlasMaker::lay_out(double scale) const {
  TextureAtlas atlas;
  atlas.scale = scale;
  for (TextureChart chart : whole_charts_) {
    chart.scale *= scale;
    fit(std::move(chart), atlas);
  }
  pack(atlas);
  return atlas;
}

int rounded_up(int size) { return (size + page_step - 1) / page_step * page_step; }

void AtlasMaker::pack(TextureAtlas& atlas) const {
  std::vector<PackedRectangle> rectangles;
  double area = 0.0;
  int largest = 1;
  const auto add = [&](int width, int height) {
    rectangles.push_back({width, height, 0, 0, 0});
    area += static_cast<double>(width) * height;
    largest = std::max({largest, width, height});
  };
  for (const TextureChart& chart : atlas.charts) add(chart.width, chart.height);
  atlas.neutral_size = any_neutral_ ? 2 * padding_ + 2 : 0;
  if (any_neutral_) add(atlas.neutral_size, atlas.neutral_size);

  // Begins with a page smaller than texture_size that may contain all charts.
  int size = std::min(options_.texture_size,
                      rounded_up(std::max(largest, static_cast<int>(std::sqrt(area) * 1.02))));
  std::size_t pages = pack_rectangles(rectangles, size);
  while (pages > 1 && size < options_.texture_size) {
    size = std::min(options_.texture_size, rounded_up(size + size / 24 + 1));
    pages = pack_rectangles(rectangles, size);
  }
  atlas.pages.assign(pages, {});
  for (const PackedRectangle& rectangle : rectangles) {
    PageSize& page = atlas.pages[rectangle.page];
    page.width = std::max(page.width, rectangle.column + rectangle.width);
    page.height = std::max(page.height, rectangle.row + rectangle.height);
  }
  for (PageSize& page : atlas.pages) {
    page.width = std::min(options_.texture_size, rounded_up(page.width));
    page.height = std::min(options_.texture_size, rounded_up(page.height));
  }
  for (std::size_t i = 0; i < atlas.charts.size(); ++i) {
    atlas.charts[i].page = static_cast<std::int32_t>(rectangles[i].page);
    atlas.charts[i].column = rectangles[i].column;
    atlas.charts[i].row = rectangles[i].row;
    // The padding comes before the chart's first texel.
    atlas.charts[i].origin.array() -= padding_ / atlas.charts[i].scale;
  }
  if (any_neutral_) {
    atlas.neutral_page = static_cast<std::int32_t>(rectangles.back().page);
    atlas.neutral_corner = {rectangles.back().column, rectangles.back().row};
  }
}

}  // namespace

Eigen::Vector2d texel_of(const TextureChart& chart, const PhotoProjector& projector,
                         const Eigen::Vector3d& point) {
  return Eigen::Vector2d(chart.column, chart.row) +
         chart.scale * (pixel_of(projector, point) - chart.origin);
}

TexturedMesh TextureAtlas::make_model(const TriangleMesh& mesh, const TexturePhotos& photos) const {
  TexturedMesh model;
  model.mesh = mesh;
  for (const PageSize& page : pages) model.pages.emplace_back(page.width, page.height);
  const auto coordinate = [&](std::int32_t page, const Eigen::Vector2d& texel) {
    const PageSize& size = pages[static_cast<std::size_t>(page)];
    return Eigen::Vector2f(static_cast<float>((texel.x() + 0.5) / size.width),
                           static_cast<float>((texel.y() + 0.5) / size.height));
  };
  TextureCorners neutral;
  if (neutral_size > 0)
    neutral.fill(
        coordinate(neutral_page, neutral_corner.cast<double>().array() + (neutral_size - 1) / 2.0));
  else
    neutral.fill(Eigen::Vector2f::Zero());
  model.texture_coordinates.assign(mesh.triangles.size(), neutral);
  model.page_of_triangle.assign(mesh.triangles.size(), neutral_size > 0 ? neutral_page : no_page);
  parallel_each(charts.size(), 16, [&](std::size_t i) {
    const TextureChart& chart = charts[i];
    for (const std::uint32_t t : chart.triangles) {
      model.page_of_triangle[t] = chart.page;
      for (std::size_t k = 0; k < 3; ++k)
        model.texture_coordinates[t][k] = coordinate(
            chart.page,
            texel_of(chart, photos[chart.photo].projector, mesh.vertices[mesh.triangles[t][k]]));
    }
  });
  return model;
}

std::size_t pack_rectangles(std::vector<PackedRectangle>& rectangles, int page_size) {
  std::vector<stbrp_rect> left;
  for (std::size_t i = 0; i < rectangles.size(); ++i) {
    stbrp_rect rectangle{};
    rectangle.id = static_cast<int>(i);
    rectangle.w = rectangles[i].width;
    rectangle.h = rectangles[i].height;
    left.push_back(rectangle);
  }
  // One node per column: stb_rect_pack then does not quantize widths.
  std::vector<stbrp_node> nodes(static_cast<std::size_t>(page_size));
  std::size_t pages = 0;
  for (; !left.empty(); ++pages) {
    stbrp_context page{};
    stbrp_init_target(&page, page_size, page_size, nodes.data(), page_size);
    stbrp_pack_rects(&page, left.data(), static_cast<int>(left.size()));
    const auto packed = std::stable_partition(
        left.begin(), left.end(), [](const stbrp_rect& r) { return r.was_packed == 0; });
    if (packed == left.end()) throw Error("a part of the texture is larger than a page");
    for (auto r = packed; r != left.end(); ++r) {
      PackedRectangle& rectangle = rectangles[static_cast<std::size_t>(r->id)];
      rectangle.page = pages;
      rectangle.column = r->x;
      rectangle.row = r->y;
    }
    left.erase(packed, left.end());
  }
  return pages;
}

TextureAtlas make_texture_atlas(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                                const std::vector<std::uint32_t>& label,
                                const TexturePhotos& photos, const TextureAtlasOptions& options) {
  return AtlasMaker(mesh, photos, options).run(opposite, label);
}

}  // namespace libmap
