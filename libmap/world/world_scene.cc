#include "libmap/world/world_scene.h"

#include <algorithm>
#include <array>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/world/xml_writer.h"

namespace libmap {

namespace {

// Accelerations at the surface, m/s2.
constexpr std::array<std::pair<const char*, double>, 3> bodies{
    {{"earth", 9.81}, {"moon", 1.62}, {"mars", 3.71}}};

}  // namespace

void bind(ParameterTable& table, WorldOptions& options) {
  table.add("collision_error_m", options.collision_error_m, positive,
            "maximum distance between the collision mesh and the visual mesh, m");
  table.add("cell_size_m", options.field.cell_size_m, positive,
            "cell size of MuJoCo's height field, m");
  table.add("field_error_m", options.field.max_deviation_m, positive,
            "maximum distance between MuJoCo's height field and the surface, m; convex pieces "
            "replace cells with a larger distance");
  table.add("piece_depth_m", options.piece_depth_m, positive,
            "maximum depth to which the convex collision pieces extend behind the surface, m");
  table.add("gravity", options.gravity, "gravity in m/s2, or earth, moon or mars");
  table.add("friction", options.friction, not_negative, "coefficient of friction of the ground");
  table.add("restitution", options.restitution, zero_to_one,
            "coefficient of restitution of the ground");
  table.add("sensor_noise_m", options.sensor_noise_m, not_negative,
            "standard deviation of the depth noise of the rig's simulated cameras, m");
}

double gravity_of(const std::string& text) {
  for (const auto& [name, gravity] : bodies)
    if (text == name) return gravity;
  const std::optional<double> gravity = parse_double(text);
  if (gravity && *gravity >= 0 && *gravity < 1e6) return *gravity;
  throw Error("unknown gravity" + did_you_mean(text, {"earth", "moon", "mars"}),
              {.field = "--gravity", .value = text, .bound = "m/s2 >= 0, earth, moon or mars"});
}

void require_world_name(const std::string& name, const std::string& field) {
  const bool reserved =
      name == "world" || (name.size() >= 4 && name.starts_with("__") && name.ends_with("__"));
  const bool control =
      std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (name.empty() || reserved || control || name.find("::") != std::string::npos)
    throw Error("SDF forbids this name",
                {.field = field,
                 .value = name,
                 .bound = "not empty, not 'world' or '__X__', without '::' or control characters"});
}

std::string mesh_path(const std::string& file) {
  return std::string(world_mesh_folder) + "/" + file;
}

std::string gravity_text(const WorldOptions& options) {
  return number_text(Eigen::Vector3d(0.0, 0.0, -gravity_of(options.gravity)));
}

}  // namespace libmap
