// Flat shapes and texts over a picture, in its pixels.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/view/scene_camera.h"

class vtkRenderer;

namespace libmap {

enum class TextAlign { left, center, right };  // on which side of its point a text stands

struct TextStyle {
  int size_px = 12;
  bool bold = false;
  Color color{25, 28, 32};
  TextAlign align = TextAlign::left;
};

// Pixels that `text` takes, wide and high (a line's full height). Needs no display.
Eigen::Vector2d text_size(const std::string& text, const TextStyle& style);

// The longest beginning of `text`, with "..." behind it if it is not the whole, that is at most
// `width_px` wide; empty if not even the dots are.
std::string shortened_text(const std::string& text, const TextStyle& style, double width_px);

// Shapes cover what was added before them; texts lie over all shapes. Pixels count from the top
// left corner of the picture.
class Overlay {
 public:
  // Filled shapes and a line, in pixels; later ones lie over earlier ones.
  void rectangle(const PixelRect& rect, const Color& color);
  void disc(const Eigen::Vector2d& center, double radius_px, const Color& color);
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width_px,
            const Color& color);
  void polygon(const std::vector<Eigen::Vector2d>& corners, const Color& color);
  // `middle_left` is the place of the text's left end (or center, or right end: as aligned), half
  // way up.
  void text(const Eigen::Vector2d& middle_left, const std::string& text, const TextStyle& style);

  // Everything into a renderer that covers the whole picture of that height.
  void add_to(vtkRenderer& renderer, int picture_height) const;

 private:
  struct Polygon {
    std::vector<Eigen::Vector2d> corners;
    Color color{};
  };
  struct Text {
    Eigen::Vector2d place;
    std::string text;
    TextStyle style;
  };
  std::vector<Polygon> polygons_;
  std::vector<Text> texts_;
};

}  // namespace libmap
