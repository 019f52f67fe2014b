#include "libmap/view/canvas.h"

#include <cairo-ft.h>
#include <cairo-svg.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "libmap/core/error.h"

namespace libmap {
namespace {

// Files of Debian's fonts-dejavu-core. Fonts are loaded by file, not by name: fontconfig would
// substitute a missing font, and images would depend on the machine.
constexpr const char* plain_font = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr const char* bold_font = "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf";

// The font is never freed because Cairo's font cache refers to it.
cairo_font_face_t* load_font(const char* file) {
  FT_Library library = nullptr;
  FT_Face face = nullptr;
  if (FT_Init_FreeType(&library) != 0 || FT_New_Face(library, file, 0, &face) != 0) {
    FT_Done_FreeType(library);
    throw Error("font not found: install the Debian package fonts-dejavu-core", {.file = file},
                ErrorKind::failed);
  }
  return cairo_ft_font_face_create_for_ft_face(face, FT_LOAD_NO_HINTING);
}

using ScaledFont = std::unique_ptr<cairo_scaled_font_t, void (*)(cairo_scaled_font_t*)>;

// A font without hinting, so that widths are proportional to the size.
ScaledFont font_of(const TextStyle& style) {
  static cairo_font_face_t* const plain = load_font(plain_font);
  static cairo_font_face_t* const bold = load_font(bold_font);
  cairo_matrix_t size;
  cairo_matrix_t page;
  cairo_matrix_init_scale(&size, style.size_px, style.size_px);
  cairo_matrix_init_identity(&page);
  cairo_font_options_t* options = cairo_font_options_create();
  cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
  ScaledFont font(cairo_scaled_font_create(style.bold ? bold : plain, &size, &page, options),
                  cairo_scaled_font_destroy);
  cairo_font_options_destroy(options);
  return font;
}

// One line of text. Control characters become blanks; text that is not UTF-8 is shown as ASCII.
struct TextLine {
  std::string text;
  std::vector<cairo_glyph_t> glyphs;  // one per character, from x = 0
  double width_px = 0.0;
};

TextLine lay_out(const std::string& text, cairo_scaled_font_t* font) {
  TextLine line{.text = text, .glyphs = {}};
  for (char& c : line.text)
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  cairo_glyph_t* glyphs = nullptr;
  int count = 0;
  const auto convert = [&] {
    return cairo_scaled_font_text_to_glyphs(font, 0.0, 0.0, line.text.data(),
                                            static_cast<int>(line.text.size()), &glyphs, &count,
                                            nullptr, nullptr, nullptr);
  };
  if (convert() == CAIRO_STATUS_INVALID_STRING) {
    for (char& c : line.text)
      if (static_cast<unsigned char>(c) > 0x7E) c = '?';
    convert();
  }
  line.glyphs.assign(glyphs, glyphs + count);
  cairo_glyph_free(glyphs);
  cairo_text_extents_t extents;
  cairo_scaled_font_glyph_extents(font, line.glyphs.data(), count, &extents);
  line.width_px = extents.x_advance;
  return line;
}

// Number of bytes of the first `count` characters of UTF-8 text.
std::size_t bytes_of(const std::string& text, std::size_t count) {
  const auto is_first = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; };
  std::size_t bytes = 0;
  for (; bytes < text.size(); ++bytes)
    if (is_first(text[bytes]) && count-- == 0) break;
  return bytes;
}

// Escapes text for an XML element.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) result += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  return result;
}

cairo_status_t append_to(void* target, const unsigned char* bytes, unsigned count) {
  static_cast<std::string*>(target)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

// Cairo stores pixels as 32-bit numbers 0x00RRGGBB.
std::uint32_t* pixel_row(cairo_surface_t* surface, int row) {
  return reinterpret_cast<std::uint32_t*>(cairo_image_surface_get_data(surface) +
                                          static_cast<std::ptrdiff_t>(row) *
                                              cairo_image_surface_get_stride(surface));
}

}  // namespace

Eigen::Vector2d text_size(const std::string& text, const TextStyle& style) {
  if (text.empty()) return Eigen::Vector2d::Zero();
  return {lay_out(text, font_of(style).get()).width_px, 1.3 * style.size_px};
}

std::string shortened_text(const std::string& text, const TextStyle& style, double width_px) {
  const TextLine line = lay_out(text, font_of(style).get());
  if (line.width_px <= width_px) return line.text;
  constexpr const char* dots = "...";
  const double room = width_px - text_size(dots, style).x();
  if (room < 0.0) return {};
  // Glyph n begins where the first n characters end.
  std::size_t count = line.glyphs.size();
  while (count > 0 && (count == line.glyphs.size() || line.glyphs[count].x > room)) --count;
  std::string kept = line.text.substr(0, bytes_of(line.text, count));
  while (!kept.empty() && kept.back() == ' ') kept.pop_back();
  return kept + dots;
}

Canvas::Canvas(int width, int height, CanvasFormat format) : width_(width), height_(height) {
  cairo_surface_t* surface = nullptr;
  if (format == CanvasFormat::svg) {
    surface = cairo_svg_surface_create_for_stream(append_to, &svg_, width, height);
    cairo_svg_surface_set_document_unit(surface, CAIRO_SVG_UNIT_PX);
  } else {
    surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height);
  }
  context_ = std::shared_ptr<cairo_t>(cairo_create(surface), cairo_destroy);
  cairo_surface_destroy(surface);
  cairo_set_source_rgb(context_.get(), 1.0, 1.0, 1.0);
  cairo_paint(context_.get());
}

void Canvas::set_color(const Color& color, double opacity) {
  cairo_set_source_rgba(context_.get(), color[0] / 255.0, color[1] / 255.0, color[2] / 255.0,
                        opacity);
}

void Canvas::add_path(const std::vector<Eigen::Vector2d>& points) {
  for (const Eigen::Vector2d& point : points) cairo_line_to(context_.get(), point.x(), point.y());
}

void Canvas::rectangle(const PixelRect& rect, const Color& color) {
  set_color(color);
  cairo_rectangle(context_.get(), rect.left, rect.top, rect.width, rect.height);
  cairo_fill(context_.get());
}

void Canvas::disc(const Eigen::Vector2d& center, double radius_px, const Color& color) {
  set_color(color);
  cairo_arc(context_.get(), center.x(), center.y(), radius_px, 0.0, 2.0 * std::numbers::pi);
  cairo_fill(context_.get());
}

void Canvas::polyline(const std::vector<Eigen::Vector2d>& points, double width_px,
                      const Color& color, bool dashed) {
  set_color(color);
  cairo_set_line_width(context_.get(), width_px);
  const std::array<double, 2> dashes{4.0 * width_px, 3.0 * width_px};
  cairo_set_dash(context_.get(), dashes.data(), dashed ? 2 : 0, 0.0);
  cairo_set_line_join(context_.get(), CAIRO_LINE_JOIN_ROUND);
  add_path(points);
  cairo_stroke(context_.get());
}

void Canvas::polygon(const std::vector<Eigen::Vector2d>& corners, const Color& color,
                     double opacity) {
  set_color(color, opacity);
  add_path(corners);
  cairo_fill(context_.get());
}

void Canvas::text(const Eigen::Vector2d& position, const std::string& text,
                  const TextStyle& style) {
  const ScaledFont font = font_of(style);
  const TextLine line = lay_out(text, font.get());
  const double fraction = style.align == TextAlign::left     ? 0.0
                          : style.align == TextAlign::center ? 0.5
                                                             : 1.0;
  constexpr double half_capital = 0.365;  // half height of capital letters, in font sizes
  cairo_t* context = context_.get();
  cairo_save(context);
  cairo_translate(context, position.x(), position.y());
  if (style.upward) cairo_rotate(context, -std::numbers::pi / 2.0);
  cairo_translate(context, -fraction * line.width_px, half_capital * style.size_px);
  set_color(style.color);
  cairo_set_scaled_font(context, font.get());
  const int count = static_cast<int>(line.glyphs.size());
  // Glyphs keep SVG files small. For pixels, outlines have subpixel accuracy.
  if (cairo_surface_get_type(cairo_get_target(context)) == CAIRO_SURFACE_TYPE_SVG) {
    cairo_show_glyphs(context, line.glyphs.data(), count);
  } else {
    cairo_glyph_path(context, line.glyphs.data(), count);
    cairo_fill(context);
  }
  cairo_restore(context);
}

void Canvas::image(const ColorImage& image, const PixelRect& rect) {
  if (image.empty()) return;
  cairo_surface_t* surface =
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, image.width, image.height);
  cairo_surface_flush(surface);
  for (int y = 0; y < image.height && cairo_image_surface_get_data(surface) != nullptr; ++y) {
    std::uint32_t* row = pixel_row(surface, y);
    for (int x = 0; x < image.width; ++x) {
      const Color& color = image.at(x, y);
      row[x] = std::uint32_t{color[0]} << 16U | std::uint32_t{color[1]} << 8U | color[2];
    }
  }
  cairo_surface_mark_dirty(surface);
  cairo_t* context = context_.get();
  cairo_save(context);
  cairo_translate(context, rect.left, rect.top);
  cairo_scale(context, rect.width / image.width, rect.height / image.height);
  cairo_set_source_surface(context, surface, 0.0, 0.0);
  cairo_pattern_set_extend(cairo_get_source(context), CAIRO_EXTEND_PAD);
  cairo_rectangle(context, 0.0, 0.0, image.width, image.height);
  cairo_fill(context);
  cairo_restore(context);
  cairo_surface_destroy(surface);
}

void Canvas::begin_clip(const PixelRect& rect) {
  cairo_save(context_.get());
  cairo_rectangle(context_.get(), rect.left, rect.top, rect.width, rect.height);
  cairo_clip(context_.get());
}

void Canvas::end_clip() { cairo_restore(context_.get()); }

void Canvas::check() const {
  const cairo_status_t status = cairo_status(context_.get());
  if (status != CAIRO_STATUS_SUCCESS)
    throw Error(std::string("Cairo failed to draw the image: ") + cairo_status_to_string(status),
                {}, ErrorKind::failed);
}

ColorImage Canvas::pixels() const {
  check();
  cairo_surface_t* surface = cairo_get_target(context_.get());
  cairo_surface_flush(surface);
  ColorImage image(width_, height_);
  for (int y = 0; y < height_; ++y) {
    const std::uint32_t* row = pixel_row(surface, y);
    for (int x = 0; x < width_; ++x)
      image.at(x, y) = {static_cast<std::uint8_t>(row[x] >> 16U),
                        static_cast<std::uint8_t>(row[x] >> 8U), static_cast<std::uint8_t>(row[x])};
  }
  return image;
}

std::string Canvas::svg(const std::string& title, const std::string& description) {
  check();
  cairo_surface_finish(cairo_get_target(context_.get()));
  // The surface's id depends on earlier surfaces of the process, so it is removed.
  const std::string id = " id=\"surface";
  const std::size_t begin = svg_.find(id);
  if (begin != std::string::npos) svg_.erase(begin, svg_.find('"', begin + id.size()) + 1 - begin);
  const std::size_t head = svg_.find('>', svg_.find("<svg"));
  ScaledFont font = font_of({});
  svg_.insert(head + 1, "\n<title>" + escaped(lay_out(title, font.get()).text) +
                            "</title>\n<desc>" + escaped(lay_out(description, font.get()).text) +
                            "</desc>");
  return std::move(svg_);
}

}  // namespace libmap
