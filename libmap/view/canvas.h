// Shapes, texts and images of a picture, drawn by Cairo: as pixels or as SVG. Coordinates are in
// pixels from the top left corner.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/view/scene_camera.h"

struct _cairo;

namespace libmap {

enum class TextAlign { left, center, right };  // part of the text that is at its position

struct TextStyle {
  int size_px = 12;
  bool bold = false;
  Color color{25, 28, 32};
  TextAlign align = TextAlign::left;
  bool upward = false;  // reads from bottom to top
};

// Width and line height of `text` in pixels. Throws Error (failed) if the font is not installed.
Eigen::Vector2d text_size(const std::string& text, const TextStyle& style);

// The longest prefix of `text`, followed by "..." if it is not the whole, that is at most
// `width_px` wide; empty if not even the dots are.
std::string shortened_text(const std::string& text, const TextStyle& style, double width_px);

// Result of a canvas: an image or an SVG document.
enum class CanvasFormat { pixels, svg };

// Each call covers what earlier calls have drawn.
class Canvas {
 public:
  // A white page.
  Canvas(int width, int height, CanvasFormat format = CanvasFormat::pixels);
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  // Filled shapes, and lines of the given width.
  void rectangle(const PixelRect& rect, const Color& color);
  void disc(const Eigen::Vector2d& center, double radius_px, const Color& color);
  void polyline(const std::vector<Eigen::Vector2d>& points, double width_px, const Color& color,
                bool dashed = false);
  void polygon(const std::vector<Eigen::Vector2d>& corners, const Color& color,
               double opacity = 1.0);
  // `position` is the left end, center or right end of the text, at half of the letters' height.
  void text(const Eigen::Vector2d& position, const std::string& text, const TextStyle& style);
  // Scaled to `rect`; unchanged if its edges are whole pixels and its size is that of the image.
  void image(const ColorImage& image, const PixelRect& rect);
  // Restricts what is drawn by `body` to `rect`.
  template <typename Body>
  void clipped(const PixelRect& rect, const Body& body) {
    begin_clip(rect);
    body();
    end_clip();
  }

  // Of CanvasFormat::pixels. Throws Error (failed) if Cairo reports an error.
  ColorImage pixels() const;
  // Of CanvasFormat::svg, once: letters are outlines, <title> and <desc> contain the given texts.
  std::string svg(const std::string& title, const std::string& description);

 private:
  void begin_clip(const PixelRect& rect);
  void end_clip();
  void set_color(const Color& color, double opacity = 1.0);
  void add_path(const std::vector<Eigen::Vector2d>& points);
  void check() const;

  int width_;
  int height_;
  std::string svg_;  // written by Cairo
  std::shared_ptr<_cairo> context_;
};

}  // namespace libmap
