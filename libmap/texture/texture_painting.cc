#include "libmap/texture/texture_steps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

constexpr std::int32_t nobody = -1;
// Tolerance for a texel center outside of a triangle, texels.
constexpr double edge_slack = 1e-9;
constexpr int max_samples = 8;  // along the side of a texel

Color to_color(const Eigen::Vector3f& color) {
  Color result{};
  for (std::size_t c = 0; c < 3; ++c)
    result[c] = static_cast<std::uint8_t>(
        std::lround(std::clamp(color[static_cast<Eigen::Index>(c)], 0.0F, 255.0F)));
  return result;
}

// Barycentric coordinates in a triangle on a page.
class PlaneTriangle {
 public:
  explicit PlaneTriangle(const std::array<Eigen::Vector2d, 3>& corners) : corners_(corners) {
    const Eigen::Vector2d ab = corners[1] - corners[0];
    const Eigen::Vector2d ac = corners[2] - corners[0];
    const double area = ab.x() * ac.y() - ab.y() * ac.x();
    flat_ = !(std::abs(area) > 1e-12);
    if (flat_) return;
    inverse_ << ac.y(), -ac.x(), -ab.y(), ab.x();
    inverse_ /= area;
  }
  bool flat() const { return flat_; }
  Eigen::Vector3d weights(const Eigen::Vector2d& texel_position) const {
    if (flat_) return Eigen::Vector3d::Constant(1.0 / 3.0);
    const Eigen::Vector2d uv = inverse_ * (texel_position - corners_[0]);
    return {1.0 - uv.x() - uv.y(), uv.x(), uv.y()};
  }
  const std::array<Eigen::Vector2d, 3>& corners() const { return corners_; }

 private:
  std::array<Eigen::Vector2d, 3> corners_;
  Eigen::Matrix2d inverse_ = Eigen::Matrix2d::Zero();
  bool flat_ = false;
};

// A photograph of a triangle and its blending weights at the corners.
struct CornerWeights {
  std::uint32_t photo = 0;
  Eigen::Vector3d at_corners = Eigen::Vector3d::Zero();
};

// The charts of one task, painted one after another.
class ChartPainter {
 public:
  ChartPainter(const TexturePaint& paint, TexturedMesh& model)
      : paint_(paint), model_(model), images_(paint.photos.size()) {}

  void paint(const TextureChart& chart);

 private:
  void find_owners();
  void own(int column, int row, std::int32_t triangle) {
    std::int32_t& owner = owners_[index(column, row)];
    if (owner == nobody) owner = triangle;
  }
  void spread_owners();
  void sort_texels();
  void paint_triangle(std::int32_t local, std::span<const std::uint32_t> texels);
  void gather_weights(std::uint32_t triangle);
  Eigen::Vector3f color_at(std::uint32_t triangle, const Eigen::Vector3d& weights);
  PlaneTriangle on_chart(std::uint32_t triangle) const;
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(chart_->width) +
           static_cast<std::size_t>(column);
  }
  const ColorImage& image(std::uint32_t photo) {
    if (!images_[photo]) images_[photo] = paint_.photos.image(photo);
    return *images_[photo];
  }

  const TexturePaint& paint_;
  TexturedMesh& model_;
  std::vector<std::shared_ptr<const ColorImage>> images_;
  // State of the current chart.
  const TextureChart* chart_ = nullptr;
  std::vector<std::int32_t> owners_;        // per texel: index in chart_->triangles, or nobody
  std::vector<std::uint32_t> first_texel_;  // per triangle: index in texels_
  std::vector<std::uint32_t> texels_;
  std::vector<CornerWeights> corner_weights_;  // of the current triangle
};

void ChartPainter::paint(const TextureChart& chart) {
  chart_ = &chart;
  owners_.assign(static_cast<std::size_t>(chart.width) * static_cast<std::size_t>(chart.height),
                 nobody);
  find_owners();
  spread_owners();
  sort_texels();
  for (std::size_t i = 0; i < chart.triangles.size(); ++i)
    paint_triangle(static_cast<std::int32_t>(i),
                   {texels_.data() + first_texel_[i],
                    static_cast<std::size_t>(first_texel_[i + 1] - first_texel_[i])});
}

// The triangle in texels of the chart.
PlaneTriangle ChartPainter::on_chart(std::uint32_t triangle) const {
  std::array<Eigen::Vector2d, 3> corners;
  const Eigen::Vector2d corner_of_chart(chart_->column, chart_->row);
  for (std::size_t k = 0; k < 3; ++k)
    corners[k] = texel_of(*chart_, paint_.photos[chart_->photo].projector,
                          model_.mesh.vertices[model_.mesh.triangles[triangle][k]]) -
                 corner_of_chart;
  return PlaneTriangle(corners);
}

// Assigns texels to the triangle that contains their center; each triangle gets at least one.
void ChartPainter::find_owners() {
  for (std::size_t i = 0; i < chart_->triangles.size(); ++i) {
    const PlaneTriangle triangle = on_chart(chart_->triangles[i]);
    if (triangle.flat()) continue;
    const auto& c = triangle.corners();
    const Eigen::Vector2d low = c[0].cwiseMin(c[1]).cwiseMin(c[2]);
    const Eigen::Vector2d high = c[0].cwiseMax(c[1]).cwiseMax(c[2]);
    for (int row = std::max(0, static_cast<int>(std::ceil(low.y() - edge_slack)));
         row < chart_->height && row <= high.y() + edge_slack; ++row)
      for (int column = std::max(0, static_cast<int>(std::ceil(low.x() - edge_slack)));
           column < chart_->width && column <= high.x() + edge_slack; ++column)
        if (triangle.weights(Eigen::Vector2d(column, row)).minCoeff() >= -edge_slack)
          own(column, row, static_cast<std::int32_t>(i));
  }
  for (std::size_t i = 0; i < chart_->triangles.size(); ++i) {
    const auto corners = on_chart(chart_->triangles[i]).corners();
    const Eigen::Vector2d center = (corners[0] + corners[1] + corners[2]) / 3.0;
    own(std::clamp(static_cast<int>(std::lround(center.x())), 0, chart_->width - 1),
        std::clamp(static_cast<int>(std::lround(center.y())), 0, chart_->height - 1),
        static_cast<std::int32_t>(i));
  }
}

// Assigns the remaining texels to the owner of a neighbor, ring by ring.
void ChartPainter::spread_owners() {
  std::vector<std::array<int, 2>> ring;
  for (int row = 0; row < chart_->height; ++row)
    for (int column = 0; column < chart_->width; ++column)
      if (owners_[index(column, row)] != nobody) ring.push_back({column, row});
  std::vector<std::array<int, 2>> next;
  while (!ring.empty()) {
    next.clear();
    for (const auto& [column, row] : ring)
      for (const auto& [right, down] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const int x = column + right;
        const int y = row + down;
        if (x < 0 || y < 0 || x >= chart_->width || y >= chart_->height) continue;
        if (owners_[index(x, y)] != nobody) continue;
        owners_[index(x, y)] = owners_[index(column, row)];
        next.push_back({x, y});
      }
    ring.swap(next);
  }
}

void ChartPainter::sort_texels() {
  first_texel_.assign(chart_->triangles.size() + 1, 0);
  for (const std::int32_t owner : owners_) ++first_texel_[static_cast<std::size_t>(owner) + 1];
  std::partial_sum(first_texel_.begin(), first_texel_.end(), first_texel_.begin());
  std::vector<std::uint32_t> next(first_texel_.begin(), first_texel_.end() - 1);
  texels_.resize(owners_.size());
  for (std::uint32_t i = 0; i < owners_.size(); ++i)
    texels_[next[static_cast<std::size_t>(owners_[i])]++] = i;
}

void ChartPainter::gather_weights(std::uint32_t triangle) {
  corner_weights_.clear();
  const auto add = [this](std::uint32_t photo, int corner, double weight) {
    auto found = std::find_if(corner_weights_.begin(), corner_weights_.end(),
                              [photo](const CornerWeights& s) { return s.photo == photo; });
    if (found == corner_weights_.end()) {
      corner_weights_.push_back({photo, Eigen::Vector3d::Zero()});
      found = corner_weights_.end() - 1;
    }
    found->at_corners[corner] += weight;
  };
  const BlendingWeights& all = paint_.weights;
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t vertex = model_.mesh.triangles[triangle][static_cast<std::size_t>(k)];
    const std::uint32_t first = all.first[vertex];
    const std::uint32_t last = all.first[vertex + 1];
    if (first == last) add(chart_->photo, k, 1.0);
    for (std::uint32_t i = first; i < last; ++i)
      add(all.weights[i].photo, k, static_cast<double>(all.weights[i].weight));
  }
}

Eigen::Vector3f ChartPainter::color_at(std::uint32_t triangle, const Eigen::Vector3d& weights) {
  const Triangle& corners = model_.mesh.triangles[triangle];
  const Eigen::Vector3d point = weights[0] * model_.mesh.vertices[corners[0]] +
                                weights[1] * model_.mesh.vertices[corners[1]] +
                                weights[2] * model_.mesh.vertices[corners[2]];
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float total = 0.0F;
  for (const CornerWeights& view : corner_weights_) {
    const auto weight = static_cast<float>(view.at_corners.dot(weights));
    if (weight < 1e-3F) continue;
    const PhotoProjector& projector = paint_.photos[view.photo].projector;
    const Eigen::Vector3d seen = projector.project(point);
    const Eigen::Vector2d middle((projector.camera().width - 1) / 2.0,
                                 (projector.camera().height - 1) / 2.0);
    const double radius2 = (seen.head<2>() - middle).squaredNorm() / middle.squaredNorm();
    const Eigen::Vector3f color = sample_bicubic(image(view.photo), seen.x(), seen.y());
    sum += weight * color.cwiseQuotient(paint_.exposure.factor(view.photo, radius2));
    total += weight;
  }
  return sum / total;
}

void ChartPainter::paint_triangle(std::int32_t local, std::span<const std::uint32_t> texels) {
  if (texels.empty()) return;
  const std::uint32_t triangle = chart_->triangles[static_cast<std::size_t>(local)];
  const PlaneTriangle plane = on_chart(triangle);
  gather_weights(triangle);
  ColorImage& page = model_.pages[static_cast<std::size_t>(chart_->page)];
  const int samples =
      std::clamp(static_cast<int>(std::ceil(1.0 / chart_->scale - 1e-6)), 1, max_samples);
  for (const std::uint32_t texel : texels) {
    const int column = static_cast<int>(texel) % chart_->width;
    const int row = static_cast<int>(texel) / chart_->width;
    Eigen::Vector3f color = Eigen::Vector3f::Zero();
    for (int s = 0; s < samples * samples; ++s) {
      const int sample_column = s % samples;
      const int sample_row = s / samples;
      const Eigen::Vector2d texel_position(column + (sample_column + 0.5) / samples - 0.5,
                                           row + (sample_row + 0.5) / samples - 0.5);
      Eigen::Vector3d weights = plane.weights(texel_position).cwiseMax(0.0);
      weights /= weights.sum();
      color += color_at(triangle, weights);
    }
    page.at(chart_->column + column, chart_->row + row) =
        to_color(color / static_cast<float>(samples * samples));
  }
}

void paint_neutral(const TextureAtlas& atlas, const Color& color, TexturedMesh& model) {
  for (int row = 0; row < atlas.neutral_size; ++row)
    for (int column = 0; column < atlas.neutral_size; ++column)
      model.pages[static_cast<std::size_t>(atlas.neutral_page)].at(
          atlas.neutral_corner.x() + column, atlas.neutral_corner.y() + row) = color;
}

}  // namespace

BlendingWeights blending_weights(const ViewTable& of_vertices, int views, double exponent) {
  BlendingWeights result;
  result.first.push_back(0);
  for (std::size_t v = 0; v < of_vertices.rows(); ++v) {
    const auto all = of_vertices[v];
    const auto relative_quality = [&](std::size_t i) {
      return std::pow(static_cast<double>(all[i].quality / all[0].quality), exponent);
    };
    const std::size_t count = std::min<std::size_t>(all.size(), static_cast<std::size_t>(views));
    if (views > 1 && count > 0) {
      const double excluded_quality = all.size() > count ? relative_quality(count) : 0.0;
      double total = 0.0;
      for (std::size_t i = 0; i < count; ++i) total += relative_quality(i) - excluded_quality;
      for (std::size_t i = 0; i < count; ++i) {
        const double weight = total > 0.0 ? (relative_quality(i) - excluded_quality) / total
                                          : 1.0 / static_cast<double>(count);
        if (weight > 0.0) result.weights.push_back({all[i].photo, static_cast<float>(weight)});
      }
    }
    result.first.push_back(static_cast<std::uint32_t>(result.weights.size()));
  }
  return result;
}

void paint_texture(const TextureAtlas& atlas, const TexturePaint& paint, TexturedMesh& model,
                   Progress& progress) {
  // Charts of one photograph are painted together because they need nearly the same images.
  std::vector<std::size_t> order(atlas.charts.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return atlas.charts[a].photo < atlas.charts[b].photo;
  });
  constexpr std::size_t charts_per_task = 8;
  progress.begin("texture", order.size());
  parallel_for(order.size(), charts_per_task, [&](std::size_t begin, std::size_t end) {
    ChartPainter painter(paint, model);
    for (std::size_t i = begin; i < end; ++i) painter.paint(atlas.charts[order[i]]);
    progress.advance(end - begin);
  });
  progress.end();
  paint_neutral(atlas, paint.neutral, model);
}

}  // namespace libmap
