#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "libmap/core/angle.h"
#include "libmap/core/text.h"
#include "libmap/world/world_scene.h"
#include "libmap/world/xml_writer.h"

namespace libmap {

namespace {

// Unit of the pieces' corners, and of their centers.
constexpr double piece_unit_m = 1e-5;

std::string piece_name(const WorldModel& model, std::size_t n) { return numbered(model.name, n); }

// A spring and damper whose contacts bounce with this restitution: the decay of a damped
// oscillation over half a period.
std::string solref_of(double restitution) {
  constexpr double time_constant_s = 0.02;
  if (!(restitution > 0)) return number_text(Eigen::Vector2d(time_constant_s, 1.0));
  const double decay = -std::log(restitution) / std::numbers::pi;
  return number_text(
      Eigen::Vector2d(time_constant_s, std::max(1e-3, decay / std::sqrt(1 + decay * decay))));
}

void add_visual_assets(const std::vector<WorldVisual>& visuals, XmlWriter& xml) {
  for (const WorldVisual& visual : visuals) {
    xml.element("mesh", {{"class", "visual"}, {"name", visual.file}, {"file", visual.file}});
    if (visual.texture.empty()) continue;
    xml.element("texture", {{"name", visual.texture}, {"type", "2d"}, {"file", visual.texture}});
    xml.element("material", {{"name", visual.texture}, {"texture", visual.texture}});
  }
}

void add_assets(const WorldModel& model, XmlWriter& xml) {
  add_visual_assets(model.visuals, xml);
  add_visual_assets(model.graspability, xml);
  const HeightField& field = model.field;
  constexpr double base_m = 0.1;  // of solid ground below the lowest node
  const double cells_x = static_cast<double>(field.columns - 1);
  const double cells_y = static_cast<double>(field.rows - 1);
  const Eigen::Vector4d size(0.5 * cells_x * field.cell_size_m, 0.5 * cells_y * field.cell_size_m,
                             static_cast<double>(field.max_m() - field.min_m()), base_m);
  xml.element("hfield",
              {{"name", model.name}, {"file", model.field_file}, {"size", number_text(size)}});
  for (std::size_t n = 0; n < model.pieces.size(); ++n) {
    std::string corners;
    for (const Eigen::Vector3d& corner : model.pieces[n].corners_m)
      for (const double x : corner)
        corners +=
            (corners.empty() ? "" : " ") + to_text(std::int64_t{std::llround(x / piece_unit_m)});
    xml.element("mesh", {{"name", piece_name(model, n)}, {"vertex", corners}});
  }
}

void add_model_mjcf(const WorldModel& model, XmlWriter& xml) {
  xml.element("body", {{"name", model.name}, {"childclass", "piece"}}, [&] {
    for (const auto* visuals : {&model.visuals, &model.graspability})
      for (const WorldVisual& visual : *visuals)
        xml.element("geom", {{"class", "visual"},
                             {"mesh", visual.file},
                             {"material", visual.texture},
                             {"rgba", visual.texture.empty() ? color_text(visual.color) : ""}});
    const HeightField& field = model.field;
    const Eigen::Vector3d center(
        field.corner_m.x() + 0.5 * static_cast<double>(field.columns - 1) * field.cell_size_m,
        field.corner_m.y() + 0.5 * static_cast<double>(field.rows - 1) * field.cell_size_m,
        field.base_m + static_cast<double>(field.min_m()));
    xml.element("geom", {{"class", "field"}, {"hfield", model.name}, {"pos", number_text(center)}});
    for (std::size_t n = 0; n < model.pieces.size(); ++n)
      xml.element("geom",
                  {{"mesh", piece_name(model, n)}, {"pos", number_text(model.pieces[n].center)}});
  });
}

// MuJoCo's cameras look along -z, with y up, and have square pixels and a central principal point.
void add_rig_mjcf(const WorldRig& rig, XmlWriter& xml) {
  const auto pose_attributes = [](const Pose& pose) {
    const Eigen::Quaterniond turn(pose.linear());
    return std::pair(number_text(pose.translation()),
                     number_text(Eigen::Vector4d(turn.w(), turn.x(), turn.y(), turn.z())));
  };
  const auto [robot_pos, robot_quat] = pose_attributes(rig.world_from_robot);
  xml.element("body", {{"name", "rig"}, {"pos", robot_pos}, {"quat", robot_quat}}, [&] {
    for (const RigCamera& camera : rig.rig.cameras) {
      const Pose pose = camera.camera.base_from_camera *
                        make_pose_from_rpy(Eigen::Vector3d::Zero(), {180.0, 0.0, 0.0});
      const auto [pos, quat] = pose_attributes(pose);
      const double fovy_deg =
          2 * std::atan(0.5 * camera.camera.height / camera.camera.fy) / radians_per_degree;
      xml.element(
          "camera",
          {{"name", camera.name}, {"pos", pos}, {"quat", quat}, {"fovy", to_text(fovy_deg)}});
    }
  });
}

void add_world_mjcf(const WorldScene& scene, XmlWriter& xml) {
  xml.element("worldbody", {}, [&] {
    xml.element("light", {{"directional", "true"}, {"pos", "0 0 10"}, {"dir", "-0.5 0.1 -0.9"}});
    for (const WorldModel& model : scene.models) add_model_mjcf(model, xml);
    if (scene.rig) add_rig_mjcf(*scene.rig, xml);
    for (std::size_t n = 0; n < scene.footholds.size(); ++n)
      xml.element("site", {{"name", numbered("foothold", n + 1)},
                           {"pos", number_text(scene.footholds[n].position)},
                           {"zaxis", number_text(scene.footholds[n].approach)},
                           {"size", to_text(foothold_radius_m)},
                           {"rgba", color_text(scene.footholds[n].color)}});
  });
}

}  // namespace

std::string to_mjcf(const WorldScene& scene) {
  XmlWriter xml(scene.notes);
  xml.element("mujoco", {{"model", scene.name}}, [&] {
    xml.element("compiler", {{"angle", "degree"},
                             {"balanceinertia", "true"},
                             {"meshdir", world_mesh_folder},
                             {"texturedir", world_mesh_folder}});
    xml.element("option", {{"gravity", gravity_text(scene.options)}});
    xml.element("default", {}, [&] {
      xml.element("mesh", {{"scale", number_text(Eigen::Vector3d::Constant(piece_unit_m))}});
      xml.element("default", {{"class", "visual"}}, [&] {
        xml.element("mesh", {{"scale", "1 1 1"}});
        xml.element("geom",
                    {{"type", "mesh"}, {"contype", "0"}, {"conaffinity", "0"}, {"group", "2"}});
      });
      const std::string friction =
          number_text(Eigen::Vector3d(scene.options.friction, 0.005, 0.0001));
      const std::string solref = solref_of(scene.options.restitution);
      for (const char* name : {"field", "piece"})
        xml.element("default", {{"class", name}}, [&] {
          xml.element("geom", {{"type", name == std::string("field") ? "hfield" : "mesh"},
                               {"group", "3"},
                               {"friction", friction},
                               {"solref", solref}});
        });
    });
    xml.element("asset", {}, [&] {
      for (const WorldModel& model : scene.models) add_assets(model, xml);
    });
    add_world_mjcf(scene, xml);
  });
  return xml.str();
}

}  // namespace libmap
