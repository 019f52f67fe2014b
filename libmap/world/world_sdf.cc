#include <cmath>

#include "libmap/core/text.h"
#include "libmap/world/world_scene.h"
#include "libmap/world/xml_writer.h"

namespace libmap {

namespace {

// Clip distances of a camera without limits: simulators need both.
constexpr double default_near_m = 0.01;
constexpr double default_far_m = 100.0;
constexpr double camera_rate_hz = 15.0;

void add_visual_sdf(const std::string& name, const WorldVisual& visual, XmlWriter& xml) {
  xml.element("visual", {{"name", name}}, [&] {
    xml.element("geometry", {},
                [&] { xml.element("mesh", {}, [&] { xml.text("uri", mesh_path(visual.file)); }); });
    if (!visual.texture.empty()) return;
    xml.element("material", {}, [&] {
      for (const char* kind : {"ambient", "diffuse"}) xml.text(kind, color_text(visual.color));
    });
  });
}

void add_surface_sdf(const WorldOptions& options, XmlWriter& xml) {
  const std::string friction = to_text(options.friction);
  xml.element("surface", {}, [&] {
    xml.element("friction", {}, [&] {
      xml.element("ode", {}, [&] {
        for (const char* axis : {"mu", "mu2"}) xml.text(axis, friction);
      });
      xml.element("bullet", {}, [&] {
        for (const char* axis : {"friction", "friction2"}) xml.text(axis, friction);
      });
    });
    xml.element("bounce", {},
                [&] { xml.text("restitution_coefficient", to_text(options.restitution)); });
  });
}

void add_model_sdf(const WorldModel& model, const WorldOptions& options, XmlWriter& xml) {
  xml.element("model", {{"name", model.name}}, [&] {
    xml.text("static", "true");
    xml.element("link", {{"name", "ground"}}, [&] {
      xml.element("collision", {{"name", "collision"}}, [&] {
        xml.element("geometry", {}, [&] {
          xml.element("mesh", {}, [&] { xml.text("uri", mesh_path(model.collision)); });
        });
        add_surface_sdf(options, xml);
      });
      for (std::size_t n = 0; n < model.visuals.size(); ++n)
        add_visual_sdf(numbered("visual", n), model.visuals[n], xml);
      for (std::size_t n = 0; n < model.graspability.size(); ++n)
        add_visual_sdf(numbered("graspability", n), model.graspability[n], xml);
    });
  });
}

// SDF's cameras look along x, with z up.
void add_camera_sdf(const RigCamera& camera, double noise_m, XmlWriter& xml) {
  const Camera& lens = camera.camera;
  xml.element("sensor", {{"name", camera.name}, {"type", "depth_camera"}}, [&] {
    xml.text("pose", pose_text(lens.base_from_camera * optical_to_body_rotation().inverse()));
    xml.text("update_rate", to_text(camera_rate_hz));
    xml.element("camera", {{"name", camera.name}}, [&] {
      xml.text("horizontal_fov", to_text(2 * std::atan(0.5 * lens.width / lens.fx)));
      xml.element("image", {}, [&] {
        xml.text("width", std::to_string(lens.width));
        xml.text("height", std::to_string(lens.height));
        xml.text("format", "R_FLOAT32");
      });
      xml.element("clip", {}, [&] {
        xml.text("near", to_text(camera.near_m > 0 ? camera.near_m : default_near_m));
        xml.text("far", to_text(std::isfinite(camera.far_m) ? camera.far_m : default_far_m));
      });
      if (noise_m > 0)
        xml.element("noise", {}, [&] {
          xml.text("type", "gaussian");
          xml.text("mean", "0");
          xml.text("stddev", to_text(noise_m));
        });
      xml.element("lens", {}, [&] {
        xml.element("intrinsics", {}, [&] {
          xml.text("fx", to_text(lens.fx));
          xml.text("fy", to_text(lens.fy));
          // SDF counts from the corner of the first pixel.
          xml.text("cx", to_text(lens.cx + 0.5));
          xml.text("cy", to_text(lens.cy + 0.5));
          xml.text("s", "0");
        });
      });
    });
  });
}

void add_rig_sdf(const WorldRig& rig, double noise_m, XmlWriter& xml) {
  xml.element("model", {{"name", "rig"}}, [&] {
    xml.text("static", "true");
    xml.text("pose", pose_text(rig.world_from_robot));
    xml.element("link", {{"name", "base"}}, [&] {
      for (const RigCamera& camera : rig.rig.cameras) add_camera_sdf(camera, noise_m, xml);
    });
  });
}

void add_footholds_sdf(const std::vector<WorldFoothold>& footholds, XmlWriter& xml) {
  xml.element("model", {{"name", "footholds"}}, [&] {
    xml.text("static", "true");
    xml.element("link", {{"name", "markers"}}, [&] {
      for (std::size_t n = 0; n < footholds.size(); ++n)
        xml.element("visual", {{"name", numbered("foothold", n + 1)}}, [&] {
          Pose pose = Pose::Identity();
          pose.translation() = footholds[n].position;
          pose.linear() = shortest_rotation(Eigen::Vector3d::UnitZ(), footholds[n].approach);
          xml.text("pose", pose_text(pose));
          xml.element("geometry", {}, [&] {
            xml.element("sphere", {}, [&] { xml.text("radius", to_text(foothold_radius_m)); });
          });
          xml.element("material", {}, [&] {
            for (const char* kind : {"ambient", "diffuse"})
              xml.text(kind, color_text(footholds[n].color));
          });
        });
    });
  });
}

}  // namespace

std::string to_sdf(const WorldScene& scene) {
  XmlWriter xml(scene.notes);
  xml.element("sdf", {{"version", "1.7"}}, [&] {
    xml.element("world", {{"name", scene.name}}, [&] {
      xml.text("gravity", gravity_text(scene.options));
      xml.element("light", {{"name", "sun"}, {"type", "directional"}}, [&] {
        xml.text("cast_shadows", "true");
        xml.text("pose", "0 0 10 0 0 0");
        xml.text("diffuse", "0.8 0.8 0.8 1");
        xml.text("direction", "-0.5 0.1 -0.9");
      });
      for (const WorldModel& model : scene.models) add_model_sdf(model, scene.options, xml);
      if (scene.rig) add_rig_sdf(*scene.rig, scene.options.sensor_noise_m, xml);
      if (!scene.footholds.empty()) add_footholds_sdf(scene.footholds, xml);
    });
  });
  return xml.str();
}

}  // namespace libmap
