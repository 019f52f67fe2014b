#include "libmap/simulate/rock_site.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"
#include "libmap/scenes/solid_noise.h"

namespace libmap {

namespace {

constexpr Range rock_size_range{0.01, 10.0};
constexpr Range ground_size_range{0.1, 100.0};

// Rounds to a multiple of 1 / steps.
double rounded(double value, double steps) { return std::round(value * steps) / steps; }

// A rectangle on the ground.
struct Footprint {
  Eigen::Vector2d center;
  Eigen::Vector2d axis_x;
  Eigen::Vector2d axis_y;
  Eigen::Vector2d half;

  double reach(const Eigen::Vector2d& direction) const {
    return std::abs(axis_x.dot(direction)) * half.x() + std::abs(axis_y.dot(direction)) * half.y();
  }
  // Separating axis test: true if the two are at least `gap` apart along one axis.
  bool is_apart(const Footprint& other, double gap) const {
    const std::array<Eigen::Vector2d, 4> axes = {axis_x, axis_y, other.axis_x, other.axis_y};
    return std::any_of(axes.begin(), axes.end(), [&](const Eigen::Vector2d& axis) {
      return std::abs(axis.dot(other.center - center)) >= reach(axis) + other.reach(axis) + gap;
    });
  }
};

Footprint footprint_of(const SiteRock& rock) {
  const double yaw = rock.yaw_deg * M_PI / 180.0;
  return {{rock.x_m, rock.y_m},
          {std::cos(yaw), std::sin(yaw)},
          {-std::sin(yaw), std::cos(yaw)},
          {0.5 * rock.width_m, 0.5 * rock.depth_m}};
}

Footprint square(double size) {
  return {Eigen::Vector2d::Zero(), Eigen::Vector2d::UnitX(), Eigen::Vector2d::UnitY(),
          Eigen::Vector2d::Constant(0.5 * size)};
}

bool is_within(const Footprint& footprint, double half_x, double half_y) {
  return std::abs(footprint.center.x()) + footprint.reach(Eigen::Vector2d::UnitX()) <= half_x &&
         std::abs(footprint.center.y()) + footprint.reach(Eigen::Vector2d::UnitY()) <= half_y;
}

std::string rock_name(std::size_t n, const SiteRock& rock) {
  return "rocks[" + std::to_string(n) + "]" + (rock.name.empty() ? "" : " (" + rock.name + ")");
}

}  // namespace

std::vector<std::pair<std::string, RockShape>> rock_shape_names() {
  return {{"block", RockShape::block}, {"dome", RockShape::dome},     {"cobble", RockShape::cobble},
          {"jug", RockShape::jug},     {"sloper", RockShape::sloper}, {"crimp", RockShape::crimp},
          {"pinch", RockShape::pinch}};
}

bool is_hold(RockShape shape) {
  return shape == RockShape::jug || shape == RockShape::sloper || shape == RockShape::crimp ||
         shape == RockShape::pinch;
}

ParameterTable rock_parameters(SiteRock& rock) {
  ParameterTable table;
  table.add("name", rock.name, "name of the rock");
  table.add("shape", rock.shape, rock_shape_names(),
            "shape: block; cobble: rounded stone; dome: hump; jug, sloper, crimp, pinch: "
            "climbing holds");
  table.add("x_m", rock.x_m, Range{-100.0, 100.0}, "x of the rock's center on the ground, m");
  table.add("y_m", rock.y_m, Range{-100.0, 100.0}, "y of the rock's center on the ground, m");
  table.add("height_m", rock.height_m, rock_size_range, "height of the top above the ground, m");
  table.add("width_m", rock.width_m, rock_size_range, "size along the rock's x axis, m");
  table.add("depth_m", rock.depth_m, rock_size_range, "size along the rock's y axis, m");
  table.add("yaw_deg", rock.yaw_deg, Range{-360.0, 360.0}, "rotation of the rock about z, degrees");
  table.add("sides", rock.sides, Range{4.0, 12.0}, "number of walls of a block");
  table.add("ledges", rock.ledges, Range{0.0, 3.0},
            "number of smaller, lower blocks attached to the sides of a block");
  table.add("overhang_deg", rock.overhang_deg, Range{0.0, 35.0},
            "outward tilt of a third of the walls, degrees");
  table.add("cleft_m", rock.cleft_m, Range{0.0, 10.0},
            "depth of a wedge cut into the top, m; 0: none");
  table.add("roughness", rock.roughness, Range{0.0, 1.5},
            "factor of the rock's default surface relief; 0: smooth");
  table.add("seed", rock.seed, not_negative, "random seed of shape and colors");
  return table;
}

ParameterTable ground_parameters(SiteGround& ground) {
  ParameterTable table;
  table.add("size_x_m", ground.size_x_m, ground_size_range, "length of the ground along x, m");
  table.add("size_y_m", ground.size_y_m, ground_size_range, "length of the ground along y, m");
  table.add_former_key("unevenness_m", "relief_m");
  table.add("relief_m", ground.relief_m, Range{0.0, 1.0}, "maximum height of random relief, m");
  table.add("tilt_deg", ground.tilt_deg, Range{0.0, 135.0},
            "tilt of the ground, degrees; 90: a wall");
  table.add("texture", ground.texture,
            {{"soil", GroundTexture::soil},
             {"rock", GroundTexture::rock},
             {"panel", GroundTexture::panel}},
            "colors of the ground; soil; rock; panel: climbing wall");
  return table;
}

ParameterTable layout_parameters(SiteLayout& layout) {
  ParameterTable table;
  table.add("site_size_m", layout.site_size_m, ground_size_range,
            "side of the square around the origin that contains the rocks, m");
  table.add("free_square_m", layout.free_square_m, Range{0.0, 100.0},
            "side of the square around the origin without rocks, m");
  table.add("gap_m", layout.gap_m, Range{0.0, 10.0}, "minimum distance between two rocks, m");
  return table;
}

ParameterTable field_point_parameters(FieldPointOptions& options) {
  ParameterTable table;
  table.add("count", options.count, Range{1.0, 10'000.0}, "number of locations for the field test");
  table.add("min_height_m", options.min_height_m, not_negative,
            "minimum height of locations for the field test above the ground, m");
  table.add("radius_m", options.radius_m, Range{0.005, 1.0},
            "radius of the surface by whose normals a location is classified (flat, edge, ...), m");
  return table;
}

void RockSite::check() const {
  for (std::size_t n = 0; n < rocks.size(); ++n) {
    SiteRock copy = rocks[n];
    try {
      rock_parameters(copy).check();
    } catch (const Error& error) {
      throw error.in_field(rock_name(n, copy), ".");
    }
    // Rocks must not interrupt the outline of the ground.
    constexpr double margin_m = 0.05;
    if (!is_within(footprint_of(rocks[n]), 0.5 * ground.size_x_m - margin_m,
                   0.5 * ground.size_y_m - margin_m))
      throw Error("the rock extends beyond the ground",
                  {.field = rock_name(n, rocks[n]) + ".x_m, y_m",
                   .value = to_text(rocks[n].x_m) + ", " + to_text(rocks[n].y_m),
                   .bound = "at least 5 cm inside the ground of " + to_text(ground.size_x_m) +
                            " x " + to_text(ground.size_y_m) + " m"});
  }
}

Pose RockSite::site_from_ground() const {
  const double tilt = ground.tilt_deg * M_PI / 180.0;
  return make_pose_from_rpy({0.0, 0.0, 0.5 * ground.size_y_m * std::sin(tilt)},
                            {ground.tilt_deg, 0.0, 0.0});
}

SiteRock draw_rock(RockShape shape, double height_m, std::uint64_t seed) {
  RandomStream draw(seed, 1);
  SiteRock rock;
  rock.shape = shape;
  rock.height_m = height_m;
  rock.seed = seed;
  // High rocks are slender, low rocks are flat.
  double width = height_m * std::clamp(1.75 - 1.25 * height_m, 0.85, 1.5) * draw.uniform(0.9, 1.1);
  double depth = width * draw.uniform(0.75, 1.0);
  if (shape == RockShape::cobble) width = height_m * draw.uniform(1.35, 1.7);
  if (shape == RockShape::cobble) depth = width * draw.uniform(0.7, 0.95);
  if (shape == RockShape::dome) width = height_m * draw.uniform(1.8, 2.6);
  if (shape == RockShape::dome) depth = width * draw.uniform(0.75, 1.0);
  if (shape == RockShape::sloper) width = height_m * draw.uniform(2.2, 3.4);
  if (shape == RockShape::sloper) depth = width * draw.uniform(0.65, 1.0);
  if (shape == RockShape::jug) width = height_m * draw.uniform(1.8, 2.6);
  if (shape == RockShape::jug) depth = height_m * draw.uniform(1.2, 1.6);
  if (shape == RockShape::crimp) width = height_m * draw.uniform(2.5, 4.0);
  if (shape == RockShape::crimp) depth = height_m * draw.uniform(1.0, 1.4);
  if (shape == RockShape::pinch) width = height_m * draw.uniform(0.8, 1.1);
  if (shape == RockShape::pinch) depth = height_m * draw.uniform(1.8, 2.6);
  rock.width_m = std::max(0.02, rounded(width, 200.0));
  rock.depth_m = std::max(0.02, rounded(depth, 200.0));
  rock.yaw_deg = std::floor(draw.uniform(0.0, 360.0));
  rock.sides = 5 + static_cast<int>(draw.uniform(0.0, 4.0));
  rock.ledges = draw.uniform() < 0.4 ? 1 + static_cast<int>(draw.uniform(0.0, 2.0)) : 0;
  rock.overhang_deg = draw.uniform() < 0.4 ? std::floor(draw.uniform(8.0, 20.0)) : 0.0;
  rock.cleft_m = draw.uniform() < 0.3 ? rounded(draw.uniform(0.25, 0.5) * height_m, 100.0) : 0.0;
  rock.roughness = 1.0;
  return rock;
}

void place_rocks(RockSite& site, std::vector<RockToPlace> rocks) {
  std::vector<Footprint> taken;
  if (site.layout.free_square_m > 0.0) taken.push_back(square(site.layout.free_square_m));
  for (std::size_t n = 0; n < site.rocks.size(); ++n)
    if (std::none_of(rocks.begin(), rocks.end(), [n](const auto& one) { return one.rock == n; }))
      taken.push_back(footprint_of(site.rocks[n]));
  const auto area = [&](const RockToPlace& one) {
    return site.rocks[one.rock].width_m * site.rocks[one.rock].depth_m;
  };
  std::stable_sort(rocks.begin(), rocks.end(),
                   [&](const auto& a, const auto& b) { return area(a) > area(b); });
  RandomStream draw(site.seed, 2);
  const double half = 0.5 * site.layout.site_size_m;
  for (const RockToPlace& one : rocks) {
    SiteRock& rock = site.rocks[one.rock];
    const double turn = is_hold(rock.shape) ? 25.0 : 180.0;
    bool is_placed = false;
    for (int attempt = 0; attempt < 20'000 && !is_placed; ++attempt) {
      rock.x_m = rounded(draw.uniform(-half, half), 100.0);
      rock.y_m = rounded(draw.uniform(-half, half), 100.0);
      const double yaw = std::round(draw.uniform(-turn, turn));
      if (!one.keeps_yaw) rock.yaw_deg = yaw;
      const Footprint footprint = footprint_of(rock);
      is_placed = is_within(footprint, half, half) &&
                  std::all_of(taken.begin(), taken.end(), [&](const Footprint& other) {
                    return footprint.is_apart(other, site.layout.gap_m);
                  });
    }
    if (!is_placed)
      throw Error("no free position for this rock; increase site_size_m or reduce free_square_m",
                  {.field = rock_name(one.rock, rock),
                   .value = to_text(rock.width_m) + " x " + to_text(rock.depth_m) + " m"});
    taken.push_back(footprint_of(rock));
  }
}

GroundRelief::GroundRelief(const RockSite& site)
    : relief_m_(site.ground.relief_m), seed_(mix_bits(site.seed, 3)) {
  if (site.bumps.empty()) return;
  PrimitiveScene scene;
  scene.shapes.push_back({Plane{site.ground.size_x_m, site.ground.size_y_m}, {}, "ground"});
  scene.shapes.insert(scene.shapes.end(), site.bumps.begin(), site.bumps.end());
  bumps_.emplace(scene);
}

double GroundRelief::height(double x_m, double y_m) const {
  const Eigen::Vector3d at(x_m, y_m, 0.37);
  const double relief = 0.6 * gradient_noise(at / 0.8, seed_) +
                        0.25 * gradient_noise(at / 0.25, seed_ + 1) +
                        0.15 * gradient_noise(at / 0.07, seed_ + 2);
  const double bumps = bumps_ ? bumps_->ground_height(x_m, y_m).value : 0.0;
  return bumps + relief_m_ * relief;
}

namespace {

constexpr std::size_t max_entries = 10'000;

// Sets the table from the node and returns the keys that were set.
std::vector<std::string> set_from_node(const ParameterTable& table, const YAML::Node& node) {
  if (!node.IsMap()) throw Error("not a YAML mapping");
  return set_from_yaml(table, YAML::Dump(node), {});
}

bool is_given(const std::vector<std::string>& keys, const std::string& key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

void require(const std::vector<std::string>& keys, const std::string& key) {
  if (!is_given(keys, key)) throw Error("is missing", {.field = key});
}

SceneShape parse_bump(const YAML::Node& node) {
  SceneShape shape;
  shape.geometry = Bump{};
  const std::vector<std::string> keys = set_from_node(shape_parameters(shape), node);
  require(keys, "height_m");
  require(keys, "radius_m");
  return shape;
}

struct ParsedRock {
  SiteRock rock;
  bool has_place = false;
  bool has_yaw = false;
};

ParsedRock parse_rock(const YAML::Node& node, std::uint64_t default_seed) {
  SiteRock given;
  given.seed = default_seed;
  const std::vector<std::string> keys = set_from_node(rock_parameters(given), node);
  require(keys, "height_m");
  if (is_given(keys, "x_m") || is_given(keys, "y_m")) {
    require(keys, "x_m");
    require(keys, "y_m");
  }
  SiteRock rock = draw_rock(given.shape, given.height_m, given.seed);
  set_from_node(rock_parameters(rock), node);
  return {std::move(rock), is_given(keys, "x_m"), is_given(keys, "yaw_deg")};
}

void parse_list(const YAML::Node& root, const std::string& key,
                const std::function<void(const YAML::Node&)>& parse) {
  const YAML::Node list = root[key];
  if (!list || list.IsNull()) return;
  if (!list.IsSequence()) throw Error("not a list", {.field = key});
  if (list.size() > max_entries)
    throw Error("too many entries", {.field = key,
                                     .value = std::to_string(list.size()),
                                     .bound = "at most " + std::to_string(max_entries)});
  for (std::size_t n = 0; n < list.size(); ++n) {
    try {
      parse(list[n]);
    } catch (const Error& error) {
      throw at_node(error, key + "[" + std::to_string(n) + "]", list[n]);
    }
  }
}

void parse_part(const YAML::Node& root, const std::string& key, const ParameterTable& table) {
  const YAML::Node node = root[key];
  if (!node || node.IsNull()) return;
  try {
    set_from_node(table, node);
  } catch (const Error& error) {
    throw at_node(error, key, node);
  }
}

RockSite parse_root(const YAML::Node& root, std::optional<std::uint64_t> seed) {
  if (!root.IsMap()) throw Error("not a YAML mapping; a site file has keys such as 'rocks'");
  check_keys(root, {"seed", "ground", "layout", "field_points", "bumps", "rocks"});
  RockSite site;
  ParameterTable own;
  own.add("seed", site.seed, not_negative, "random seed");
  if (const YAML::Node node = root["seed"]) {
    if (!node.IsScalar()) throw Error("not a single number", {.field = "seed"});
    own.set("seed", node.Scalar());
  }
  if (seed) site.seed = *seed;
  parse_part(root, "ground", ground_parameters(site.ground));
  parse_part(root, "layout", layout_parameters(site.layout));
  parse_part(root, "field_points", field_point_parameters(site.field_points));
  parse_list(root, "bumps",
             [&](const YAML::Node& node) { site.bumps.push_back(parse_bump(node)); });
  std::vector<RockToPlace> to_place;
  parse_list(root, "rocks", [&](const YAML::Node& node) {
    // At most six digits, to be readable in a file.
    const std::uint64_t rock_seed = mix_bits(site.seed, 1000 + site.rocks.size()) % 1'000'000;
    ParsedRock parsed = parse_rock(node, rock_seed);
    if (!parsed.has_place) to_place.push_back({site.rocks.size(), parsed.has_yaw});
    site.rocks.push_back(std::move(parsed.rock));
  });
  place_rocks(site, to_place);
  site.check();
  return site;
}

void emit(YAML::Emitter& yaml, const ParameterTable& table) {
  yaml << YAML::Flow << YAML::BeginMap;
  for (const Parameter& parameter : table.parameters()) {
    if (parameter.key == "name" && parameter.get().empty()) continue;
    yaml << YAML::Key << parameter.key << YAML::Value;
    if (parameter.key == "name") yaml << YAML::DoubleQuoted;
    yaml << parameter.get();
  }
  yaml << YAML::EndMap;
}

}  // namespace

RockSite parse_site(const std::string& text, const std::string& file,
                    std::optional<std::uint64_t> seed) {
  RockSite site;
  read_yaml(text, file, [&](const YAML::Node& root) { site = parse_root(root, seed); });
  return site;
}

std::string to_yaml(const RockSite& site) {
  RockSite copy = site;
  YAML::Emitter yaml;
  yaml << YAML::BeginMap;
  yaml << YAML::Key << "seed" << YAML::Value << std::to_string(site.seed);
  yaml << YAML::Key << "ground" << YAML::Value;
  emit(yaml, ground_parameters(copy.ground));
  yaml << YAML::Key << "layout" << YAML::Value;
  emit(yaml, layout_parameters(copy.layout));
  yaml << YAML::Key << "field_points" << YAML::Value;
  emit(yaml, field_point_parameters(copy.field_points));
  yaml << YAML::Key << "bumps" << YAML::Value << YAML::BeginSeq;
  for (SceneShape& bump : copy.bumps) emit(yaml, shape_parameters(bump));
  yaml << YAML::EndSeq;
  yaml << YAML::Key << "rocks" << YAML::Value << YAML::BeginSeq;
  for (SiteRock& rock : copy.rocks) emit(yaml, rock_parameters(rock));
  yaml << YAML::EndSeq << YAML::EndMap;
  return std::string(yaml.c_str()) + "\n";
}

}  // namespace libmap
