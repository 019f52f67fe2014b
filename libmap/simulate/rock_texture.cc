#include "libmap/simulate/rock_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "libmap/scenes/solid_noise.h"

namespace libmap {

namespace {

using Tone = Eigen::Vector3d;  // red, green, blue, 0 to 255

Color to_color(const Tone& tone) {
  Color color{};
  for (std::size_t n = 0; n < 3; ++n)
    color[n] = static_cast<std::uint8_t>(
        std::lround(std::clamp(tone[static_cast<Eigen::Index>(n)], 0.0, 255.0)));
  return color;
}

double smooth_step(double low, double high, double value) {
  const double t = std::clamp((value - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

Tone blend(const Tone& a, const Tone& b, double fraction) { return a + fraction * (b - a); }

// Displaces the point by noise of wavelength `length_m`, up to a share of it, and rotates it off
// the lattice axes, so that marks have ragged outlines.
Eigen::Vector3d ragged(const Eigen::Vector3d& point, std::uint64_t seed, double length_m,
                       double fraction) {
  const Eigen::Vector3d at = point / length_m;
  const Eigen::Vector3d shift(gradient_noise(at, seed), gradient_noise(at, seed + 1),
                              gradient_noise(at, seed + 2));
  const Eigen::Vector3d moved = point + fraction * length_m * shift;
  return {0.8 * moved.x() + 0.36 * moved.y() + 0.48 * moved.z(),
          -0.6 * moved.x() + 0.48 * moved.y() + 0.64 * moved.z(),
          -0.8 * moved.y() + 0.6 * moved.z()};
}

// 1 on thin sheets where noise changes sign, 0 elsewhere.
double cracks(const Eigen::Vector3d& point, std::uint64_t seed, double width) {
  return 1.0 - smooth_step(0.35 * width, width, std::abs(gradient_noise(point, seed)));
}

// Round marks: at most one per cell, in a given share of the cells.
struct Mark {
  double strength = 0.0;
  std::uint64_t kind = 0;
};
Mark marks(const Eigen::Vector3d& point, std::uint64_t seed, double fraction, double radius) {
  const CellNoise cell = cell_noise(point, seed);
  if (unit_noise(cell.cell, 1) >= fraction) return {};
  const double size = radius * (0.5 + 0.5 * unit_noise(cell.cell, 2));
  return {1.0 - smooth_step(0.7 * size, size, cell.distance), mix_bits(cell.cell, 3)};
}

}  // namespace

Color rock_color(const Eigen::Vector3d& point, std::uint64_t seed) {
  const auto own = [seed](std::uint64_t n) { return mix_bits(seed, n); };
  // Base tone of the stone, then patches.
  const double warmth = unit_noise(seed, 100);
  const double light = 0.9 + 0.3 * unit_noise(seed, 101);
  const Tone pale = light * blend(Tone(172, 168, 162), Tone(188, 164, 136), warmth);
  const Tone dark = light * blend(Tone(98, 98, 102), Tone(118, 96, 80), warmth);
  const Eigen::Vector3d coarse = ragged(point, own(8), 0.09, 0.35);
  const Eigen::Vector3d fine = ragged(point, own(9), 0.025, 0.4);
  Tone tone = blend(dark, pale, smooth_step(-0.45, 0.45, fractal_noise(coarse / 0.18, own(0), 3)));
  tone *=
      1.0 + 0.4 * gradient_noise(fine / 0.035, own(1)) + 0.4 * gradient_noise(fine / 0.017, own(2));
  // Iron stains, lichen, crystals, cracks.
  tone = blend(tone, Tone(146, 92, 54),
               0.55 * smooth_step(0.25, 0.6, gradient_noise(coarse / 0.12, own(3))));
  const Mark lichen = marks(fine / 0.07, own(4), 0.4, 0.45);
  const Tone lichen_tone = (lichen.kind & 1U) == 0 ? Tone(208, 206, 188) : Tone(150, 154, 104);
  tone = blend(tone, lichen_tone, 0.8 * lichen.strength);
  const Mark crystal = marks(fine / 0.03, own(5), 0.45, 0.45);
  tone = blend(tone, (crystal.kind & 1U) == 0 ? Tone(236, 232, 226) : Tone(44, 42, 42),
               0.8 * crystal.strength);
  const double where = smooth_step(-0.1, 0.3, gradient_noise(point / 0.3, own(6)));
  const double crack = where * cracks(coarse / 0.22, own(7), 0.035);
  return to_color(blend(tone, Tone(36, 32, 30), 0.8 * crack));
}

Color soil_color(const Eigen::Vector3d& point, std::uint64_t seed) {
  const auto own = [seed](std::uint64_t n) { return mix_bits(seed, 200 + n); };
  const double patches = fractal_noise(point / 0.3, own(0), 3);
  Tone tone = blend(Tone(112, 90, 68), Tone(168, 144, 112), smooth_step(-0.4, 0.4, patches));
  tone *= 1.0 + 0.35 * gradient_noise(point / 0.04, own(1)) +
          0.35 * gradient_noise(point / 0.017, own(2));
  const Eigen::Vector3d moved = ragged(point, own(7), 0.03, 0.5);
  const Mark gravel = marks(moved / 0.045, own(3), 0.5, 0.45);
  const double gray = 60.0 + 150.0 * unit_noise(gravel.kind, 4);
  tone = blend(tone, Tone(gray, 0.97 * gray, 0.92 * gray), 0.85 * gravel.strength);
  const Mark pebble = marks(moved / 0.12, own(5), 0.25, 0.35);
  const double shade = 60.0 + 120.0 * unit_noise(pebble.kind, 6);
  tone = blend(tone, Tone(shade, 0.95 * shade, 0.88 * shade), 0.8 * pebble.strength);
  return to_color(tone);
}

Color panel_color(const Eigen::Vector3d& point, std::uint64_t seed) {
  const auto own = [seed](std::uint64_t n) { return mix_bits(seed, 300 + n); };
  Tone tone = blend(Tone(168, 170, 172), Tone(196, 190, 178),
                    smooth_step(-0.4, 0.4, fractal_noise(point / 0.4, own(0), 3)));
  tone *= 1.0 + 0.12 * gradient_noise(point / 0.02, own(1)) +
          0.1 * gradient_noise(point / 0.05, own(2));
  // Chalk and rubber.
  tone = blend(tone, Tone(232, 230, 224),
               0.7 * smooth_step(0.25, 0.55, gradient_noise(point / 0.14, own(3))));
  const Eigen::Vector3d stretched(point.x() / 0.03, point.y() / 0.09, point.z() / 0.05);
  tone = blend(tone, Tone(52, 50, 50),
               0.8 * smooth_step(0.45, 0.6, gradient_noise(stretched, own(4))));
  // Bolt holes, a square grid of 20 cm.
  const double x = point.x() / 0.2 - std::round(point.x() / 0.2);
  const double y = point.y() / 0.2 - std::round(point.y() / 0.2);
  tone = blend(Tone(24, 24, 26), tone, smooth_step(0.05, 0.07, std::hypot(x, y)));
  return to_color(tone);
}

Color hold_color(const Eigen::Vector3d& point, std::uint64_t seed) {
  static const std::array<Tone, 8> resins = {
      Tone(196, 44, 40),  Tone(36, 92, 176),  Tone(232, 188, 40), Tone(44, 140, 72),
      Tone(226, 116, 36), Tone(124, 62, 150), Tone(60, 60, 66),   Tone(214, 120, 150)};
  Tone tone = resins[mix_bits(seed, 400) % resins.size()];
  tone *= 1.0 + 0.2 * gradient_noise(point / 0.03, mix_bits(seed, 401)) +
          0.15 * gradient_noise(point / 0.012, mix_bits(seed, 402));
  const Mark speckle = marks(point / 0.02, mix_bits(seed, 403), 0.35, 0.4);
  tone = blend(tone, (speckle.kind & 1U) == 0 ? Tone(244, 244, 240) : Tone(28, 28, 30),
               0.7 * speckle.strength);
  return to_color(tone);
}

}  // namespace libmap
