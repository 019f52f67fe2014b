// Test sites: uneven ground, or a wall, that bears rocks or climbing holds.
//
// The ground is a rectangle centered on the origin of its own frame, z out of it. Rocks stand on it
// in that frame. `tilt_deg` turns all of it about the x axis into the site's frame: 0 is level
// ground, 90 a wall that faces -y, more a wall that leans over whoever stands before it; its lower
// edge stays at z = 0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/scenes/primitive_scene.h"
#include "libmap/scenes/scene_geometry.h"

namespace libmap {

// block: a broken rock with a flat top, facets and chipped edges. cobble: a rounded stone. dome: a
// rounded hump that is wider the lower. Climbing holds, +y up: jug (a bowl behind a lip), sloper (a
// flat dome), crimp (a small edge), pinch (narrow, undercut).
enum class RockShape { block, cobble, dome, jug, sloper, crimp, pinch };
std::vector<std::pair<std::string, RockShape>> rock_shape_names();
bool is_hold(RockShape shape);

struct SiteRock {
  std::string name;
  RockShape shape = RockShape::block;
  double x_m = 0.0;
  double y_m = 0.0;
  double height_m = 0.3;  // of its top over the ground at (x, y)
  double width_m = 0.3;   // along its own x, above the ground
  double depth_m = 0.3;   // along its own y
  double yaw_deg = 0.0;
  int sides = 6;              // walls of a block
  int ledges = 0;             // lower blocks that have grown together with it
  double overhang_deg = 0.0;  // how far a third of a block's walls lean outward
  double cleft_m = 0.0;       // depth of a wedge cut into a block's top; 0: none
  double roughness = 1.0;     // of the surface; 0: smooth
  std::uint64_t seed = 0;     // of its form and colors
};

enum class GroundTexture { soil, rock, panel };  // the colors of the ground

struct SiteGround {
  double size_x_m = 4.0;
  double size_y_m = 4.0;
  double unevenness_m = 0.02;  // largest height of its random relief
  double tilt_deg = 0.0;
  GroundTexture texture = GroundTexture::soil;
};

// What of a site is drawn anew by its seed: where rocks without a place go.
struct SiteLayout {
  double site_size_m = 3.0;    // rocks stand within this square
  double free_square_m = 1.5;  // and outside this one; both about the origin
  double gap_m = 0.01;         // between the footprints of two rocks
};

struct FieldPointOptions {
  int count = 30;
  double min_height_m = 0.1;  // above the ground
  double radius_m = 0.04;     // of the surroundings that tell flat from edge, corner and irregular
};

struct RockSite {
  std::uint64_t seed = 1;
  SiteGround ground;
  SiteLayout layout;
  FieldPointOptions field_points;
  std::vector<SceneShape> bumps;  // of kind Bump
  std::vector<SiteRock> rocks;

  // Throws Error naming the entry, the value and the bound.
  void check() const;
  Pose site_from_ground() const;
};

// The tables refer to their argument.
ParameterTable rock_parameters(SiteRock& rock);
ParameterTable ground_parameters(SiteGround& ground);
ParameterTable layout_parameters(SiteLayout& layout);
ParameterTable field_point_parameters(FieldPointOptions& options);

// A rock of this shape and height whose other measures are drawn from `seed`.
SiteRock draw_rock(RockShape shape, double height_m, std::uint64_t seed);

// Gives places, and yaw where it is not kept, to these rocks, the widest first, so that footprints
// keep to the layout; holds turn by no more than 25 degrees. Throws Error naming the first rock for
// which no room is found.
struct RockToPlace {
  std::size_t rock = 0;  // index in the site
  bool keeps_yaw = false;
};
void place_rocks(RockSite& site, std::vector<RockToPlace> rocks);

// Height of the ground at a point of its own frame: bumps and random relief.
class GroundRelief {
 public:
  explicit GroundRelief(const RockSite& site);  // of the site's ground, drawn from its seed
  double height(double x_m, double y_m) const;  // meters above the ground's plane

 private:
  std::optional<SceneGeometry> bumps_;
  double unevenness_m_;
  std::uint64_t seed_;
};

// Sites as YAML:
//
//   seed: 1
//   ground: {size_x_m: 4, size_y_m: 4, unevenness_m: 0.02}
//   layout: {site_size_m: 3, free_square_m: 1.5}
//   field_points: {count: 30}
//   bumps:
//     - {height_m: -0.5, radius_m: 1.5, x_m: 0.2}
//   rocks:
//     - {name: R01, height_m: 0.67, overhang_deg: 15}
//     - {name: C01, shape: cobble, height_m: 0.15, x_m: 1, y_m: 0.2}
//
// Every part may be missing. A rock needs its height; what else is not given is drawn from its
// seed, and its seed from the site's; rocks without x_m and y_m are placed within the layout. With
// a `seed`, that one in place of the file's. Throws Error naming `file`, the entry, the key, the
// value and the bound, and for unknown keys the nearest known one.
RockSite parse_site(const std::string& text, const std::string& file,
                    std::optional<std::uint64_t> seed = std::nullopt);

// Text with nothing left to draw: parse_site reads back an equal site.
std::string to_yaml(const RockSite& site);

}  // namespace libmap
