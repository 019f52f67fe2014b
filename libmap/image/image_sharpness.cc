#include "libmap/image/image_sharpness.h"

namespace libmap {

namespace {

// Luminance (ITU-R BT.601) after a binomial blur of 3 x 3 pixels.
Image<float> blurred_luminance(const ColorImage& image) {
  Image<float> gray(image.width, image.height);
  for (std::size_t n = 0; n < image.pixels.size(); ++n) {
    const Color& color = image.pixels[n];
    gray.pixels[n] = 0.299F * static_cast<float>(color[0]) + 0.587F * static_cast<float>(color[1]) +
                     0.114F * static_cast<float>(color[2]);
  }
  Image<float> along_rows = gray;
  for (int y = 0; y < gray.height; ++y)
    for (int x = 1; x + 1 < gray.width; ++x)
      along_rows.at(x, y) = 0.5F * gray.at(x, y) + 0.25F * (gray.at(x - 1, y) + gray.at(x + 1, y));
  for (int y = 1; y + 1 < gray.height; ++y)
    for (int x = 0; x < gray.width; ++x)
      gray.at(x, y) =
          0.5F * along_rows.at(x, y) + 0.25F * (along_rows.at(x, y - 1) + along_rows.at(x, y + 1));
  return gray;
}

}  // namespace

double image_sharpness(const ColorImage& image) {
  if (image.width < 5 || image.height < 5) return 0.0;
  const Image<float> gray = blurred_luminance(image);
  double bends = 0.0;
  double slopes = 0.0;
  for (int y = 1; y + 1 < gray.height; ++y)
    for (int x = 1; x + 1 < gray.width; ++x) {
      const float across = gray.at(x + 1, y) - gray.at(x - 1, y);
      const float down = gray.at(x, y + 1) - gray.at(x, y - 1);
      const float bend = gray.at(x + 1, y) + gray.at(x - 1, y) + gray.at(x, y + 1) +
                         gray.at(x, y - 1) - 4.0F * gray.at(x, y);
      bends += static_cast<double>(bend * bend);
      slopes += static_cast<double>(across * across + down * down);
    }
  return slopes > 0.0 ? bends / slopes : 0.0;
}

}  // namespace libmap
