// Draws shapes, text and images with Cairo, as pixels or SVG. Coordinates: px from the top left.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/view/scene_camera.h"

struct _cairo;

namespace libmap {

enum class TextAlign { left, center, right };  // part of the text that is at the given position

struct TextStyle {
  int size_px = 12;
  bool bold = false;
  Color color{25, 28, 32};
  TextAlign align = TextAlign::left;
  bool upward = false;  // true: the text is rotated and reads from bottom to top
};

// Returns width and line height of `text`, px. Throws Error (failed) if the font is not installed.
Eigen::Vector2d text_size(const std::string& text, const TextStyle& style);

// Returns `text` if at most `width_px` wide, else a prefix and "..."; empty if "..." is wider.
std::string shortened_text(const std::string& text, const TextStyle& style, double width_px);

// Output of a canvas: an image or an SVG document.
enum class CanvasFormat { pixels, svg };

// A drawing surface. Later calls draw over earlier ones.
class Canvas {
 public:
  // Creates a white page; sizes are in pixels.
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
  // Draws an image scaled to `rect`; unchanged if `rect` has integer edges and the image's size.
  void image(const ColorImage& image, const PixelRect& rect);
  // Restricts drawing by `body` to `rect`.
  template <typename Body>
  void clipped(const PixelRect& rect, const Body& body) {
    begin_clip(rect);
    body();
    end_clip();
  }

  // Returns the image, for CanvasFormat::pixels. Throws Error (failed) if Cairo reports an error.
  ColorImage pixels() const;
  // Returns the SVG document, for CanvasFormat::svg; may be called once. Text is stored as
  // outlines; <title> and <desc> contain the arguments. Throws Error (failed) as pixels() does.
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
