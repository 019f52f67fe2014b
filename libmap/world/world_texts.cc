#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/core/angle.h"
#include "libmap/core/markup.h"
#include "libmap/core/text.h"
#include "libmap/world/world.h"

namespace libmap {

namespace {

using namespace fmt::literals;

// Clip distances of a camera without limits: simulators need both.
constexpr double default_near_m = 0.01;
constexpr double default_far_m = 100.0;

// Templates of the elements of a world. Empty: the format does not have the element.
struct Dialect {
  const char* file = "";
  const char* world = "";
  const char* model = "";
  const char* model_asset = "";
  const char* visual = "";  // with `color` or `texture` as its material
  const char* visual_asset = "";
  const char* color = "";
  const char* texture = "";
  const char* texture_asset = "";
  const char* ball = "";
  const char* rig = "";
  const char* camera = "";
  const char* noise = "";
  const char* footholds = "";
  const char* foothold = "";
};

constexpr Dialect sdf{
    .file = "world.sdf",
    .world = R"(<?xml version="1.0"?>
{notes}<sdf version="1.7">
<world name="{name}">
<gravity>0 0 {gravity}</gravity>
<light name="sun" type="directional">
<cast_shadows>true</cast_shadows>
<pose>0 0 10 0 0 0</pose>
<diffuse>0.8 0.8 0.8 1</diffuse>
<direction>-0.5 0.1 -0.9</direction>
</light>
{models}{rig}{footholds}</world>
</sdf>
)",
    .model = R"(<model name="{model}">
<static>true</static>
<link name="ground">
<collision name="collision">
<geometry><mesh><uri>meshes/{model}_collision.obj</uri></mesh></geometry>
<surface>
<friction>
<ode><mu>{friction}</mu><mu2>{friction}</mu2></ode>
<bullet><friction>{friction}</friction><friction2>{friction}</friction2></bullet>
</friction>
<bounce><restitution_coefficient>{restitution}</restitution_coefficient></bounce>
</surface>
</collision>
{visuals}</link>
</model>
)",
    .visual = R"(<visual name="visual_{number}">
<geometry><mesh><uri>meshes/{file}</uri></mesh></geometry>{material}
</visual>
)",
    .color = R"(
<material><ambient>{color}</ambient><diffuse>{color}</diffuse></material>)",
    .rig = R"(<model name="rig">
<static>true</static>
<pose>{pose}</pose>
<link name="base">
{cameras}</link>
</model>
)",
    // Cameras look along x, with z up. Image coordinates begin at the first pixel's corner.
    .camera = R"(<sensor name="{name}" type="depth_camera">
<pose>{pose}</pose>
<update_rate>15</update_rate>
<camera name="{name}">
<horizontal_fov>{horizontal_fov}</horizontal_fov>
<image><width>{width}</width><height>{height}</height><format>R_FLOAT32</format></image>
<clip><near>{near}</near><far>{far}</far></clip>{noise}
<lens><intrinsics><fx>{fx}</fx><fy>{fy}</fy><cx>{cx}</cx><cy>{cy}</cy><s>0</s></intrinsics></lens>
</camera>
</sensor>
)",
    .noise = R"(
<noise><type>gaussian</type><mean>0</mean><stddev>{noise}</stddev></noise>)",
    .footholds = R"(<model name="footholds">
<static>true</static>
<link name="markers">
{footholds}</link>
</model>
)",
    .foothold = R"(<visual name="foothold_{number}">
<pose>{pose}</pose>
<geometry><sphere><radius>0.01</radius></sphere></geometry>
<material><ambient>{color}</ambient><diffuse>{color}</diffuse></material>
</visual>
)",
};

constexpr Dialect mjcf{
    .file = "world.xml",
    .world = R"(<?xml version="1.0"?>
{notes}<mujoco model="{name}">
<compiler angle="degree" balanceinertia="true" meshdir="meshes" texturedir="meshes"/>
<option gravity="0 0 {gravity}" cone="elliptic" impratio="10"/>
<default>
<default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
<default class="ground"><geom group="3" friction="{friction} 0.005 0.0001" solref="0.02 {damping}"/></default>
</default>
<asset>
{assets}</asset>
<worldbody>
<light directional="true" pos="0 0 10" dir="-0.5 0.1 -0.9"/>
{models}{rig}{footholds}</worldbody>
</mujoco>
)",
    .model = R"(<body name="{model}" childclass="ground">
<geom type="hfield" hfield="{model}" pos="{field_center}"/>
{visuals}{balls}</body>
)",
    .model_asset = R"(<hfield name="{model}" file="{model}_field.bin" size="{field_size}"/>
)",
    .visual = R"(<geom class="visual" mesh="{file}" {material}/>
)",
    .visual_asset = R"(<mesh name="{file}" file="{file}"/>
)",
    .color = R"(rgba="{color}")",
    .texture = R"(material="{texture}")",
    .texture_asset = R"(<texture name="{texture}" type="2d" file="{texture}"/>
<material name="{texture}" texture="{texture}"/>
)",
    .ball = R"(<geom pos="{position}" size="{radius}"/>
)",
    .rig = R"(<body name="rig" pos="{position}" quat="{quaternion}">
{cameras}</body>
)",
    // Cameras look along -z, with y up. Pixels are square and the principal point is central.
    .camera = R"(<camera name="{name}" pos="{position}" quat="{quaternion}" fovy="{fovy_deg}"/>
)",
    .footholds = "{footholds}",
    .foothold =
        R"(<site name="foothold_{number}" pos="{position}" zaxis="{approach}" size="0.01" rgba="{color}"/>
)",
};

constexpr Dialect urdf{
    .file = "world.urdf",
    .world = R"(<?xml version="1.0"?>
{notes}<robot name="{name}">
<link name="world"/>
{models}</robot>
)",
    // Bullet takes the triangles of a concave mesh as they are, not their convex hull.
    .model = R"(<link name="{model}">
<contact><lateral_friction value="{friction}"/><restitution value="{restitution}"/></contact>
<inertial>
<mass value="0"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
</inertial>
<collision name="collision" concave="yes">
<geometry><mesh filename="meshes/{model}_collision.obj"/></geometry>
</collision>
{visuals}</link>
<joint name="{model}_joint" type="fixed"><parent link="world"/><child link="{model}"/></joint>
)",
    .visual = R"(<visual name="{model}_visual_{number}">
<geometry><mesh filename="meshes/{file}"/></geometry>
<material name="{model}_visual_{number}">{material}</material>
</visual>
)",
    .color = R"(<color rgba="{color}"/>)",
    .texture = R"(<texture filename="meshes/{texture}"/>)",
};

template <typename... Values>
std::string fill(const char* text, const Values&... values) {
  return fmt::format(fmt::runtime(text), values...);
}

std::string number_text(const Eigen::Ref<const Eigen::VectorXd>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : " ") + to_text(number + 0.0);
  return text;
}

// "x y z roll pitch yaw", m and rad.
std::string pose_text(const Pose& pose) {
  return number_text(pose.translation()) + " " +
         number_text(radians_per_degree * roll_pitch_yaw_deg(pose));
}

std::string quaternion_text(const Pose& pose) {
  const Eigen::Quaterniond turn(pose.linear());
  return number_text(Eigen::Vector4d(turn.w(), turn.x(), turn.y(), turn.z()));
}

std::string color_text(const Color& color) {
  return number_text(Eigen::Vector4d(color[0], color[1], color[2], 255.0) / 255.0);
}

// Relative damping of MuJoCo's contacts for a restitution, by the decay of a damped oscillation
// over half a period.
double damping_of(double restitution) {
  if (!(restitution > 0)) return 1.0;
  const double decay = -std::log(restitution) / std::numbers::pi;
  return std::max(1e-3, decay / std::sqrt(1 + decay * decay));
}

std::string notes_text(const std::vector<std::string>& notes) {
  std::string text;
  for (std::string note : notes) {
    // XML forbids two hyphens in a comment, and one at its end.
    for (std::size_t at; (at = note.find("--")) != std::string::npos;) note.replace(at, 2, "- -");
    text += "<!-- " + note + " -->\n";
  }
  return text;
}

struct ModelText {
  std::string body;
  std::string assets;
};

ModelText model_text(const Dialect& dialect, const WorldModel& model, const WorldOptions& options) {
  const std::string name = escape_html(model.name);
  ModelText text;
  std::string visuals;
  for (std::size_t n = 0; n < model.visuals.size(); ++n) {
    const WorldVisual& visual = model.visuals[n];
    const auto add = [&](const char* element, const std::string& material) {
      return fill(element, "model"_a = name, "number"_a = n, "file"_a = escape_html(visual.file),
                  "texture"_a = escape_html(visual.texture), "color"_a = color_text(visual.color),
                  "material"_a = material);
    };
    const bool plain = visual.texture.empty();
    visuals += add(dialect.visual, add(plain ? dialect.color : dialect.texture, ""));
    text.assets += add(dialect.visual_asset, "");
    if (!plain) text.assets += add(dialect.texture_asset, "");
  }
  std::string balls;
  for (const CollisionBall& ball : model.balls)
    balls +=
        fill(dialect.ball, "position"_a = number_text(ball.center), "radius"_a = ball.radius_m);
  const HeightField& field = model.field;
  constexpr double base_m = 0.1;  // thickness of solid ground below height 0
  const Eigen::Vector2d half_m =
      0.5 * field.cell_size_m *
      Eigen::Vector2d(static_cast<double>(field.columns) - 1, static_cast<double>(field.rows) - 1);
  const double height_m = *std::max_element(field.heights_m.begin(), field.heights_m.end());
  const Eigen::Vector2d middle = field.corner_m + half_m;
  const auto add = [&](const char* element) {
    return fill(
        element, "model"_a = name, "friction"_a = options.friction,
        "restitution"_a = options.restitution, "visuals"_a = visuals, "balls"_a = balls,
        "field_center"_a = number_text(Eigen::Vector3d(middle.x(), middle.y(), field.base_m)),
        "field_size"_a = number_text(Eigen::Vector4d(half_m.x(), half_m.y(), height_m, base_m)));
  };
  text.body = add(dialect.model);
  text.assets += add(dialect.model_asset);
  return text;
}

std::string camera_text(const Dialect& dialect, const RigCamera& camera, double noise_m) {
  const Camera& lens = camera.camera;
  const Pose& optical = lens.base_from_camera;
  const Pose backward = optical * make_pose_from_rpy(Eigen::Vector3d::Zero(), {180.0, 0.0, 0.0});
  return fill(dialect.camera, "name"_a = escape_html(camera.name),
              "pose"_a = pose_text(optical * optical_to_body_rotation().inverse()),
              "position"_a = number_text(optical.translation()),
              "quaternion"_a = quaternion_text(backward),
              "horizontal_fov"_a = 2 * std::atan(0.5 * lens.width / lens.fx),
              "fovy_deg"_a = 2 * std::atan(0.5 * lens.height / lens.fy) / radians_per_degree,
              "width"_a = lens.width, "height"_a = lens.height, "fx"_a = lens.fx, "fy"_a = lens.fy,
              "cx"_a = lens.cx + 0.5, "cy"_a = lens.cy + 0.5,
              "near"_a = camera.near_m > 0 ? camera.near_m : default_near_m,
              "far"_a = std::isfinite(camera.far_m) ? camera.far_m : default_far_m,
              "noise"_a = noise_m > 0 ? fill(dialect.noise, "noise"_a = noise_m) : "");
}

std::string world_text(const Dialect& dialect, const WorldScene& scene) {
  std::string models;
  std::string assets;
  for (const WorldModel& model : scene.models) {
    const ModelText text = model_text(dialect, model, scene.options);
    models += text.body;
    assets += text.assets;
  }
  std::string rig;
  if (scene.rig) {
    for (const RigCamera& camera : scene.rig->rig.cameras)
      rig += camera_text(dialect, camera, scene.options.sensor_noise_m);
    const Pose& pose = scene.rig->world_from_robot;
    rig = fill(dialect.rig, "pose"_a = pose_text(pose), "cameras"_a = rig,
               "position"_a = number_text(pose.translation()),
               "quaternion"_a = quaternion_text(pose));
  }
  std::string footholds;
  for (std::size_t n = 0; n < scene.footholds.size(); ++n) {
    const WorldFoothold& foothold = scene.footholds[n];
    Pose pose(shortest_rotation(Eigen::Vector3d::UnitZ(), foothold.approach));
    pose.pretranslate(foothold.position);
    footholds +=
        fill(dialect.foothold, "number"_a = n + 1, "pose"_a = pose_text(pose),
             "position"_a = number_text(foothold.position),
             "approach"_a = number_text(foothold.approach), "color"_a = color_text(foothold.color));
  }
  if (!footholds.empty()) footholds = fill(dialect.footholds, "footholds"_a = footholds);
  return fill(
      dialect.world, "notes"_a = notes_text(scene.notes), "name"_a = escape_html(scene.name),
      "gravity"_a = 0.0 - gravity_of(scene.options.gravity), "friction"_a = scene.options.friction,
      "damping"_a = damping_of(scene.options.restitution), "assets"_a = assets, "models"_a = models,
      "rig"_a = rig, "footholds"_a = footholds);
}

}  // namespace

std::map<std::string, std::string> world_texts(const WorldScene& scene) {
  std::map<std::string, std::string> texts;
  for (const Dialect& dialect : {sdf, mjcf, urdf}) texts[dialect.file] = world_text(dialect, scene);
  return texts;
}

}  // namespace libmap
