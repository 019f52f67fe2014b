#include "libmap/view/overlay.h"

#include <vtkActor2D.h>
#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper2D.h>
#include <vtkRenderer.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>
#include <vtkUnsignedCharArray.h>

#include <array>
#include <cmath>
#include <numbers>

namespace libmap {
namespace {

// At 72 dots an inch a point is a pixel.
constexpr int dots_per_inch = 72;

void apply(const TextStyle& style, vtkTextProperty& property) {
  property.SetFontFamilyToArial();
  property.SetFontSize(style.size_px);
  property.SetBold(style.bold ? 1 : 0);
  property.SetColor(style.color[0] / 255.0, style.color[1] / 255.0, style.color[2] / 255.0);
  property.SetVerticalJustificationToCentered();
  switch (style.align) {
    case TextAlign::left:
      property.SetJustificationToLeft();
      break;
    case TextAlign::center:
      property.SetJustificationToCentered();
      break;
    case TextAlign::right:
      property.SetJustificationToRight();
      break;
  }
}

// Removes the last character of UTF-8 text.
void drop_last(std::string& text) {
  while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xC0U) == 0x80U)
    text.pop_back();
  if (!text.empty()) text.pop_back();
}

}  // namespace

Eigen::Vector2d text_size(const std::string& text, const TextStyle& style) {
  if (text.empty()) return Eigen::Vector2d::Zero();
  vtkNew<vtkTextProperty> property;
  apply(style, *property);
  property->SetJustificationToLeft();
  std::array<int, 4> box{};
  vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
  if (renderer == nullptr || !renderer->GetBoundingBox(property, text, box.data(), dots_per_inch))
    return Eigen::Vector2d::Zero();
  return {box[1] - box[0] + 1, 1.3 * style.size_px};
}

std::string shortened_text(const std::string& text, const TextStyle& style, double width_px) {
  if (text_size(text, style).x() <= width_px) return text;
  std::string kept = text;
  while (!kept.empty()) {
    drop_last(kept);
    while (!kept.empty() && kept.back() == ' ') kept.pop_back();
    std::string candidate = kept + "...";
    if (text_size(candidate, style).x() <= width_px) return candidate;
  }
  return {};
}

void Overlay::rectangle(const PixelRect& rect, const Color& color) {
  polygon({{rect.left, rect.top},
           {rect.right(), rect.top},
           {rect.right(), rect.bottom()},
           {rect.left, rect.bottom()}},
          color);
}

void Overlay::disc(const Eigen::Vector2d& center, double radius_px, const Color& color) {
  constexpr int corners = 40;
  std::vector<Eigen::Vector2d> circle;
  for (int k = 0; k < corners; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / corners;
    circle.emplace_back(center + radius_px * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  polygon(circle, color);
}

void Overlay::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width_px,
                   const Color& color) {
  if (!((to - from).norm() > 0.0)) return;
  const Eigen::Vector2d along = (to - from).normalized();
  const Eigen::Vector2d half(-along.y() * width_px / 2.0, along.x() * width_px / 2.0);
  polygon({from + half, to + half, to - half, from - half}, color);
}

void Overlay::polygon(const std::vector<Eigen::Vector2d>& corners, const Color& color) {
  polygons_.push_back({corners, color});
}

void Overlay::text(const Eigen::Vector2d& middle_left, const std::string& text,
                   const TextStyle& style) {
  if (!text.empty()) texts_.push_back({middle_left, text, style});
}

void Overlay::add_to(vtkRenderer& renderer, int picture_height) const {
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> cells;
  vtkNew<vtkUnsignedCharArray> colors;
  colors->SetNumberOfComponents(4);
  for (const Polygon& polygon : polygons_) {
    cells->InsertNextCell(static_cast<int>(polygon.corners.size()));
    for (const Eigen::Vector2d& corner : polygon.corners) {
      cells->InsertCellPoint(points->InsertNextPoint(corner.x(), picture_height - corner.y(), 0.0));
      const std::array<unsigned char, 4> color{polygon.color[0], polygon.color[1], polygon.color[2],
                                               255};
      colors->InsertNextTypedTuple(color.data());
    }
  }
  vtkNew<vtkPolyData> shapes;
  shapes->SetPoints(points);
  shapes->SetPolys(cells);
  shapes->GetPointData()->SetScalars(colors);
  vtkNew<vtkPolyDataMapper2D> mapper;
  mapper->SetInputData(shapes);
  vtkNew<vtkActor2D> actor;
  actor->SetMapper(mapper);
  renderer.AddActor2D(actor);

  for (const Text& text : texts_) {
    vtkNew<vtkTextActor> text_actor;
    text_actor->SetTextScaleModeToNone();
    text_actor->SetInput(text.text.c_str());
    apply(text.style, *text_actor->GetTextProperty());
    text_actor->SetPosition(std::round(text.place.x()),
                            std::round(picture_height - text.place.y()));
    renderer.AddActor2D(text_actor);
  }
}

}  // namespace libmap
