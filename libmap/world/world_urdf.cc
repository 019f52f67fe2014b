#include "libmap/core/text.h"
#include "libmap/world/world_scene.h"
#include "libmap/world/xml_writer.h"

namespace libmap {

namespace {

void add_mesh_urdf(const char* kind, const std::string& name, const WorldVisual& visual,
                   XmlWriter& xml) {
  xml.element(kind, {{"name", name}}, [&] {
    xml.element("geometry", {}, [&] {
      xml.element("mesh", {{"filename", mesh_path(visual.file)}});
    });
    xml.element("material", {{"name", name}}, [&] {
      if (visual.texture.empty())
        xml.element("color", {{"rgba", color_text(visual.color)}});
      else
        xml.element("texture", {{"filename", mesh_path(visual.texture)}});
    });
  });
}

void add_model_urdf(const WorldModel& model, const WorldOptions& options, XmlWriter& xml) {
  xml.element("link", {{"name", model.name}}, [&] {
    xml.element("contact", {}, [&] {
      xml.element("lateral_friction", {{"value", to_text(options.friction)}});
      xml.element("restitution", {{"value", to_text(options.restitution)}});
    });
    xml.element("inertial", {}, [&] {
      xml.element("mass", {{"value", "0"}});
      xml.element(
          "inertia",
          {{"ixx", "0"}, {"ixy", "0"}, {"ixz", "0"}, {"iyy", "0"}, {"iyz", "0"}, {"izz", "0"}});
    });
    for (std::size_t n = 0; n < model.visuals.size(); ++n)
      add_mesh_urdf("visual", numbered(model.name + "_visual", n), model.visuals[n], xml);
    for (std::size_t n = 0; n < model.graspability.size(); ++n)
      add_mesh_urdf("visual", numbered(model.name + "_graspability", n), model.graspability[n],
                    xml);
    // Bullet takes the triangles as they are, not their convex hull.
    xml.element("collision", {{"name", "collision"}, {"concave", "yes"}}, [&] {
      xml.element("geometry", {}, [&] {
        xml.element("mesh", {{"filename", mesh_path(model.collision)}});
      });
    });
  });
  xml.element("joint", {{"name", model.name + "_joint"}, {"type", "fixed"}}, [&] {
    xml.element("parent", {{"link", "world"}});
    xml.element("child", {{"link", model.name}});
  });
}

}  // namespace

std::string to_urdf(const WorldScene& scene) {
  XmlWriter xml(scene.notes);
  xml.element("robot", {{"name", scene.name}}, [&] {
    xml.element("link", {{"name", "world"}});
    for (const WorldModel& model : scene.models) add_model_urdf(model, scene.options, xml);
  });
  return xml.str();
}

}  // namespace libmap
