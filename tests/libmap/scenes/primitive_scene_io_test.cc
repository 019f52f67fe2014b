// Round trip of YAML, and all errors of scene files.
#include "libmap/scenes/primitive_scene.h"

#include <gtest/gtest.h>

#include "libmap/scenes/scene_geometry.h"
#include "scene_test_support.h"
#include "tests/libmap/scenes/scene_query.h"
#include "tests/support/test_support.h"
#include "tests/support/thesis_scene.h"

namespace libmap {
namespace primitive_scene_io_test {

using graspmap_test::error_of;
using graspmap_test::from_above;
using graspmap_test::is_error;
using graspmap_test::shipped_scene;
using graspmap_test::thesis_primitive_scene;

libmap::Error message_of(const std::string& text) {
  return error_of([&] { parse_scene(text, "scene.yaml"); });
}

TEST(SceneYaml, the_primitive_shapes_file_is_the_thesis_scene) {
  EXPECT_EQ(shipped_scene("primitive_shapes.yaml"), thesis_primitive_scene());
}

TEST(SceneYaml, the_slopes_file_is_a_hollow_with_bumps) {
  const PrimitiveScene scene = shipped_scene("slopes_and_bumps.yaml");
  const SceneGeometry geometry(scene);
  EXPECT_LT(from_above(geometry, 0.25, -0.2)->height, -0.5);
  EXPECT_GT(from_above(geometry, 1.4, 1.4)->height, 0.1);
  EXPECT_GT(from_above(geometry, -1.4, 1.4)->height, -0.05);
  EXPECT_GT(from_above(geometry, 0.4, 0.75)->curvature_min, 1.0);
}

TEST(SceneYaml, reads_flow_and_block_style_and_defaults) {
  const PrimitiveScene scene = parse_scene(
      "shapes:\n"
      "  - shape: sphere\n"
      "    radius_m: 0.5\n"
      "  - {shape: plane, size_x_m: 1, size_y_m: 2e0, yaw_deg: 45}\n"
      "  - {height_m: -0.1, shape: bump, radius_m: 0.2, profile: gaussian}\n",
      "scene.yaml");
  ASSERT_EQ(scene.shapes.size(), 3U);
  EXPECT_EQ(scene.shapes[0], (SceneShape{Sphere{0.5}, {}, {}}));
  EXPECT_EQ(scene.shapes[1], (SceneShape{Plane{1.0, 2.0}, {.yaw_deg = 45.0}, {}}));
  EXPECT_EQ(scene.shapes[2], (SceneShape{Bump{-0.1, 0.2, BumpProfile::gaussian}, {}, {}}));
}

TEST(SceneYaml, unknown_names_are_errors_that_name_the_nearest_known) {
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: spere, radius_m: 1}]"),
                       {.file = "scene.yaml",
                        .field = "shapes[0].shape (line 1)",
                        .value = "spere",
                        .about = "'sphere'"}));
  EXPECT_TRUE(is_error(
      message_of("shapes: [{shape: sphere, radius: 1}]"),
      {.file = "scene.yaml", .field = "shapes[0].radius (line 1)", .about = "'radius_m'"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: 1, height_m: 1}]"),
                       {.file = "scene.yaml", .field = "shapes[0].height_m (line 1)"}));
  EXPECT_TRUE(is_error(message_of("shape: []"),
                       {.file = "scene.yaml", .field = "shape", .about = "'shapes'"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: plane, size_x_m: 1, size_y_m: 1},"
                                  "{shape: bump, radius_m: 1, height_m: 1, profile: cosin}]"),
                       {.file = "scene.yaml",
                        .field = "shapes[1].profile (line 1)",
                        .value = "cosin",
                        .bound = "one of cosine gaussian",
                        .about = "'cosine'"}));
}

TEST(SceneYaml, wrong_values_are_errors_that_name_key_value_and_bound) {
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: -0.5}]"),
                       {.file = "scene.yaml",
                        .field = "shapes[0].radius_m (line 1)",
                        .value = "-0.5",
                        .bound = "> 0 and <= 10000"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: .nan}]"),
                       {.file = "scene.yaml",
                        .field = "shapes[0].radius_m (line 1)",
                        .value = ".nan",
                        .bound = "> 0 and <= 10000"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: 1, x_m: .inf}]"),
                       {.file = "scene.yaml",
                        .field = "shapes[0].x_m (line 1)",
                        .value = ".inf",
                        .bound = ">= -1e+06 and <= 1e+06"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: big}]"),
                       {.file = "scene.yaml",
                        .field = "shapes[0].radius_m (line 1)",
                        .value = "big",
                        .bound = "> 0 and <= 10000"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: [1]}]"),
                       {.file = "scene.yaml", .field = "shapes[0].radius_m (line 1)"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: }]"),
                       {.file = "scene.yaml", .field = "shapes[0].radius_m (line 1)"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: sphere, radius_m: 1, radius_m: 2}]"),
                       {.file = "scene.yaml", .field = "shapes[0].radius_m (line 1)"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{shape: cone, radius_m: 1}]"),
                       {.file = "scene.yaml", .field = "shapes[0].height_m (line 1)"}));
  EXPECT_TRUE(is_error(message_of("shapes: [{radius_m: 1}]"),
                       {.file = "scene.yaml", .field = "shapes[0].shape (line 1)"}));
  EXPECT_TRUE(is_error(
      message_of("shapes: [{shape: capsule, radius_m: 1, length_m: 1}]"),
      {.file = "scene.yaml", .field = "shapes[0].length_m", .value = "1", .bound = ">= 2"}));
}

TEST(SceneYaml, documents_of_another_form_are_errors) {
  for (const auto& [text, field] : {std::pair{"shapes: []", "shapes"},
                                    {"shapes:", "shapes"},
                                    {"shapes: 3", "shapes"},
                                    {"shapes: {a: 1}", "shapes"},
                                    {"shapes: [3]", "shapes[0] (line 1)"},
                                    {"shapes: [[1]]", "shapes[0] (line 1)"},
                                    {"shapes: [~]", "shapes[0] (line 1)"},
                                    {"{}", "shapes"},
                                    {"shapes: [", "line 1"},
                                    {"shapes: [{? [1] : 2}]", "shapes[0].shape (line 1)"},
                                    {"shapes: []\nshapes: []", "shapes"},
                                    {"\t- a", "line 1"},
                                    {"*x", "line 1"}})
    EXPECT_TRUE(is_error(message_of(text), {.file = "scene.yaml", .field = field})) << text;
  for (const std::string text : {"", "shapes", "[]", "\xff\xfe"})
    EXPECT_TRUE(is_error(message_of(text), {.file = "scene.yaml", .about = "'shapes'"})) << text;
  EXPECT_TRUE(is_error(message_of("shapes: &a [*a]"), {.file = "scene.yaml", .about = "500000"}));
  EXPECT_TRUE(
      is_error(message_of("? [1]\n: 2"), {.file = "scene.yaml", .field = "key of a mapping"}));
  EXPECT_TRUE(
      is_error(message_of(std::string(100'000, '[')), {.file = "scene.yaml", .field = "line 1"}));
  EXPECT_TRUE(is_error(message_of("shapes:\n  - {shape: sphere\n"),
                       {.file = "scene.yaml", .field = "line 3"}));
}

}  // namespace primitive_scene_io_test
}  // namespace libmap
