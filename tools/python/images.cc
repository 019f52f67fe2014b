#include "libmap/core/error.h"
#include "libmap/view/scene_view.h"
#include "tools/python/values.h"

namespace graspmap_python {

namespace {

struct ImageOptions {
  libmap::SceneViewOptions view;
  libmap::SceneLayer layer;
};

void bind(libmap::ParameterTable& table, ImageOptions& options) {
  libmap::bind(table, options.view);
  libmap::bind(table, options.layer);
  libmap::bind_single(table, options.view);
}

using Shown =
    std::variant<std::shared_ptr<libmap::PointCloud>, std::shared_ptr<libmap::TriangleMesh>>;

std::vector<libmap::Marker> markers_of(const std::optional<std::vector<Eigen::Vector3d>>& positions,
                                       const std::vector<std::string>& labels) {
  std::vector<libmap::Marker> markers;
  if (!positions) return markers;
  for (const Eigen::Vector3d& position : *positions) markers.push_back({.position = position});
  if (!labels.empty() && labels.size() != markers.size())
    throw libmap::Error("not one label per marker", {.field = "labels",
                                                     .value = std::to_string(labels.size()),
                                                     .bound = std::to_string(markers.size())});
  for (std::size_t n = 0; n < labels.size(); ++n) markers[n].label = labels[n];
  return markers;
}

py::array render(const Shown& shown, const std::optional<std::vector<Eigen::Vector3d>>& markers,
                 const std::vector<std::string>& labels, std::optional<double> zero_plane_m,
                 const std::optional<libmap::Pose>& terrain_from_scene,
                 const std::optional<Eigen::Vector3d>& camera_position,
                 const std::optional<Eigen::Vector3d>& camera_target, const py::dict& values) {
  auto options = options_from<ImageOptions>(values);
  std::visit([&](const auto& shape) { options.layer.shape = *shape; }, shown);
  if (zero_plane_m) options.layer.coloring.zero_plane_m = *zero_plane_m;
  if (camera_position) options.view.camera.position = *camera_position;
  if (camera_target) options.view.camera.focal_point = *camera_target;
  libmap::Scene scene;
  scene.markers = markers_of(markers, labels);
  if (terrain_from_scene) scene.terrain_from_scene = *terrain_from_scene;
  scene.layers.push_back(std::move(options.layer));
  auto image = std::make_unique<libmap::ColorImage>(
      without_lock([&] { return libmap::render_scene(std::move(scene), options.view); }));
  const std::uint8_t* const pixels = image->pixels.front().data();
  const Shape shape = {image->height, image->width, 3};
  const py::capsule owner(image.release(),
                          [](void* held) { delete static_cast<libmap::ColorImage*>(held); });
  return view(pixels, shape, owner);
}

py::bytes to_png(const py::object& pixels) {
  const auto array = array_from<std::uint8_t>(
      pixels, "image", byte_numbers, {any_length, any_length, 3}, "uint8 of shape (H, W, 3)");
  libmap::ColorImage image(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)));
  std::copy_n(array.data(), array.size(),
              image.pixels.empty() ? nullptr : image.pixels.front().data());
  return libmap::to_png(image);
}

}  // namespace

// Converts a cloud or a mesh; two arrays of two dimensions are vertices and triangles of a mesh.
template <>
struct Argument<Shown> {
  static Shown from(const py::object& given, const std::string& name) {
    if (py::isinstance<libmap::TriangleMesh>(given) || is_pair_of_tables(given))
      return Argument<libmap::TriangleMesh>::from(given, name).object;
    return cloud_from(given, name,
                      "a Cloud, a Mesh, numbers of shape (N, 3), or vertices and triangles");
  }
};

void add_images(py::module_& module) {
  define(module, "render", &render,
         {"shown", "markers", "labels", "zero_plane_m", "terrain_from_scene", "camera_position",
          "camera_target", "options"});
  define(module, "to_png", &to_png, {"image"});
  add_stage<ImageOptions>("render");
}

}  // namespace graspmap_python
