// Describes test sites: uneven ground with rocks, or a wall with climbing holds.
//
// The ground is a rectangle centered on the origin of the ground frame, whose z axis is the
// ground's normal. Rocks are defined in the ground frame. `tilt_deg` is the rotation about x from
// the ground frame to the site frame. 0: level ground; 90: a wall that faces -y; above 90: an
// overhanging wall. The lower edge of the ground stays at z = 0.
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

// Shapes of rocks. block: broken, with a flat top, facets and chipped edges; cobble: rounded; dome:
// a rounded hump, widest at its base. Shapes of climbing holds, in which +y is up: jug (a bowl
// behind a lip), sloper (a flat dome), crimp (a small edge), pinch (narrow, undercut).
enum class RockShape { block, cobble, dome, jug, sloper, crimp, pinch };
std::vector<std::pair<std::string, RockShape>> rock_shape_names();
bool is_hold(RockShape shape);  // true for the shapes of climbing holds

struct SiteRock {
  std::string name;
  RockShape shape = RockShape::block;
  double x_m = 0.0;  // center of the rock in the ground frame
  double y_m = 0.0;
  double height_m = 0.3;      // height of the top above the ground at (x, y)
  double width_m = 0.3;       // extent along the rock's x axis
  double depth_m = 0.3;       // extent along the rock's y axis
  double yaw_deg = 0.0;       // rotation of the rock's axes about z, counter-clockwise
  int sides = 6;              // number of walls of a block
  int ledges = 0;             // number of lower blocks that are merged with a block
  double overhang_deg = 0.0;  // outward tilt of a third of a block's walls
  double cleft_m = 0.0;       // depth of a wedge cut into a block's top; 0: none
  double roughness = 1.0;     // factor of the default surface relief; 0: smooth
  std::uint64_t seed = 0;     // random seed of shape and colors
};

enum class GroundTexture { soil, rock, panel };  // colors of the ground

struct SiteGround {
  double size_x_m = 4.0;   // extent of the ground in x
  double size_y_m = 4.0;   // extent of the ground in y
  double relief_m = 0.02;  // maximum height of the random relief
  double tilt_deg = 0.0;   // 0: level; 90: a wall
  GroundTexture texture = GroundTexture::soil;
};

// Area in which rocks without a given position are placed at random.
struct SiteLayout {
  double site_size_m = 3.0;    // side of the square that contains the rocks, around the origin
  double free_square_m = 1.5;  // side of the square without rocks, around the origin
  double gap_m = 0.01;         // minimum distance between the footprints of two rocks
};

// Choice of locations for a field test on the rocks (field_points.h).
struct FieldPointOptions {
  int count = 30;             // number of locations
  double min_height_m = 0.1;  // minimum height of a location above the ground
  double radius_m = 0.04;     // radius of the surface that determines a location's kind
};

struct RockSite {
  std::uint64_t seed = 1;  // random seed of missing rock values, positions, relief and colors
  SiteGround ground;
  SiteLayout layout;
  FieldPointOptions field_points;
  std::vector<SceneShape> bumps;  // shapes of type Bump only
  std::vector<SiteRock> rocks;

  // Throws Error if a rock has a value out of range or is not at least 5 cm inside the ground.
  void check() const;
  Pose site_from_ground() const;  // rotation by tilt_deg
};

// Return tables of the parameters by key, as in YAML. A table refers to its argument.
ParameterTable rock_parameters(SiteRock& rock);
ParameterTable ground_parameters(SiteGround& ground);
ParameterTable layout_parameters(SiteLayout& layout);
ParameterTable field_point_parameters(FieldPointOptions& options);

// Returns a rock of given shape and height; all other dimensions are drawn from `seed`.
SiteRock draw_rock(RockShape shape, double height_m, std::uint64_t seed);

struct RockToPlace {
  std::size_t rock = 0;    // index in RockSite::rocks
  bool keeps_yaw = false;  // true: the rock keeps its yaw; false: yaw is drawn too
};
// Draws the positions of these rocks, those with the largest footprints first, such that all
// footprints satisfy the layout. A drawn yaw of a hold is at most 25 degrees. Throws Error naming
// the first rock that cannot be placed.
void place_rocks(RockSite& site, std::vector<RockToPlace> rocks);

// Height of the ground above z = 0 of the ground frame: bumps and random relief.
class GroundRelief {
 public:
  explicit GroundRelief(const RockSite& site);  // relief is drawn from RockSite::seed
  double height(double x_m, double y_m) const;  // m

 private:
  std::optional<SceneGeometry> bumps_;
  double relief_m_;
  std::uint64_t seed_;
};

// Sites as YAML:
//
//   seed: 1
//   ground: {size_x_m: 4, size_y_m: 4, relief_m: 0.02}
//   layout: {site_size_m: 3, free_square_m: 1.5}
//   field_points: {count: 30}
//   bumps:
//     - {height_m: -0.5, radius_m: 1.5, x_m: 0.2}
//   rocks:
//     - {name: R01, height_m: 0.67, overhang_deg: 15}
//     - {name: C01, shape: cobble, height_m: 0.15, x_m: 1, y_m: 0.2}
//
// Required are only height_m of a rock, and height_m and radius_m of a bump. Missing values of a
// rock are drawn from its seed, a missing seed from the site's seed. Rocks without x_m and y_m are
// placed within the layout. `seed` replaces the file's seed. Throws Error naming `file`, entry,
// key, value and bound; for an unknown key, also the nearest known key.
RockSite parse_site(const std::string& text, const std::string& file,
                    std::optional<std::uint64_t> seed = std::nullopt);

// Returns complete YAML of a site, with all drawn values. parse_site returns an equal site.
std::string to_yaml(const RockSite& site);

}  // namespace libmap
