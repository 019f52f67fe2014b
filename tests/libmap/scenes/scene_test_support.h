// Scenes that several tests of libmap/simulate share.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/file_output.h"
#include "libmap/core/point_cloud.h"
#include "libmap/scenes/primitive_scene.h"
#include "libmap/simulate/rock_site.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline constexpr double pi = std::numbers::pi;

// Files of data/scenes and data/sites.
inline libmap::PrimitiveScene shipped_scene(const std::string& name) {
  const std::filesystem::path path = source_folder() / "data/scenes" / name;
  return libmap::parse_scene(libmap::read_whole_file(path), path.string());
}
inline libmap::RockSite shipped_site(const std::string& name,
                                     std::optional<std::uint64_t> seed = std::nullopt) {
  const std::filesystem::path path = source_folder() / "data/sites" / name;
  return libmap::parse_site(libmap::read_whole_file(path), path.string(), seed);
}

inline libmap::PrimitiveScene scene_of(std::vector<libmap::SceneShape> shapes) {
  return {std::move(shapes)};
}

inline libmap::SceneShape ground_plane(double size_m = 3.0) {
  return {libmap::Plane{size_m, size_m}, {}, {}};
}

inline const std::vector<double>& values_of(const libmap::PointCloud& cloud,
                                            std::string_view name) {
  return cloud.find_field(name)->values;
}

// One shape of each kind at arbitrary angles, overlapping each other and the ground.
inline libmap::PrimitiveScene mixed_scene() {
  using namespace libmap;
  return scene_of({
      {Plane{2.0, 2.0}, {.z_m = 0.1, .roll_deg = 7.0, .pitch_deg = -4.0, .yaw_deg = 20.0}, {}},
      {Sphere{0.2}, {.x_m = -0.4, .y_m = -0.3, .z_m = 0.15}, {}},
      {Capsule{0.1, 0.5}, {.x_m = 0.3, .y_m = -0.4, .z_m = 0.2, .pitch_deg = 35.0}, {}},
      {Cone{0.2, 0.3}, {.x_m = 0.4, .y_m = 0.4, .z_m = 0.1, .roll_deg = 15.0}, {}},
      {Cylinder{0.15, 0.3}, {.x_m = -0.4, .y_m = 0.4, .pitch_deg = 10.0, .yaw_deg = 30.0}, {}},
      {Box{0.3, 0.2, 0.4}, {.x_m = -0.3, .y_m = -0.2, .roll_deg = 10.0, .yaw_deg = 50.0}, {}},
      {Bump{0.1, 0.4, BumpProfile::cosine}, {.x_m = 0.1, .y_m = 0.1}, {}},
      {Bump{-0.15, 0.9, BumpProfile::gaussian}, {.x_m = -0.6, .y_m = 0.5}, {}},
  });
}

// Any shapes anywhere on and over the edge of a plane of 2 x 2 m.
inline libmap::PrimitiveScene random_scene() {
  using namespace libmap;
  PrimitiveScene scene = scene_of({ground_plane(2.0)});
  const int count = static_cast<int>(uniform(3.0, 12.0));
  for (int i = 0; i < count; ++i) {
    const double a = uniform(0.05, 0.3);
    const double b = uniform(0.05, 0.3);
    const std::vector<ShapeGeometry> choices = {
        Sphere{a},
        Capsule{a, 2.0 * a + b},
        Cone{a, b},
        Cylinder{a, b},
        Box{a, b, uniform(0.05, 0.4)},
        Bump{uniform(-0.3, 0.3), 2.0 * a, BumpProfile::cosine},
        Bump{uniform(-0.3, 0.3), 3.0 * a, BumpProfile::gaussian}};
    const Placement placement{.x_m = uniform(-1.1, 1.1),
                              .y_m = uniform(-1.1, 1.1),
                              .z_m = uniform(-0.3, 0.3),
                              .roll_deg = uniform(-180.0, 180.0),
                              .pitch_deg = uniform(-180.0, 180.0),
                              .yaw_deg = uniform(-180.0, 180.0)};
    scene.shapes.push_back({choices[static_cast<std::size_t>(uniform(0.0, 6.999))], placement, {}});
  }
  return scene;
}

}  // namespace graspmap_test
