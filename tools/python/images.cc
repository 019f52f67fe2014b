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

std::vector<libmap::Marker> markers_of(const py::object& given,
                                       const std::vector<std::string>& labels) {
  std::vector<libmap::Marker> markers;
  if (given.is_none()) return markers;
  for (const Eigen::Vector3d& position : positions_from(given, "markers"))
    markers.push_back({.position = position});
  if (!labels.empty() && labels.size() != markers.size())
    throw libmap::Error("wrong length", {.field = "labels",
                                         .value = std::to_string(labels.size()),
                                         .bound = std::to_string(markers.size())});
  for (std::size_t n = 0; n < labels.size(); ++n) markers[n].label = labels[n];
  return markers;
}

py::array render(const Shown& shown, const py::object& markers,
                 const std::vector<std::string>& labels, std::optional<double> zero_plane_m,
                 const py::object& terrain_from_scene, const py::object& camera_position,
                 const py::object& camera_target, const py::dict& values) {
  auto options = options_from<ImageOptions>(values);
  std::visit([&](const auto& shape) { options.layer.shape = *shape; }, shown);
  if (zero_plane_m) options.layer.coloring.zero_plane_m = *zero_plane_m;
  if (!camera_position.is_none())
    options.view.camera.position = vector_from(camera_position, "camera_position");
  if (!camera_target.is_none())
    options.view.camera.focal_point = vector_from(camera_target, "camera_target");
  libmap::Scene scene;
  scene.markers = markers_of(markers, labels);
  if (!terrain_from_scene.is_none())
    scene.terrain_from_scene = pose_from(terrain_from_scene, "terrain_from_scene");
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
  const py::array array =
      py::array_t<std::uint8_t, py::array::c_style>::ensure(py::array::ensure(pixels));
  if (!array || array.ndim() != 3 || array.shape(2) != 3) {
    PyErr_Clear();
    throw libmap::Error("is no picture",
                        {.field = "image", .value = {}, .bound = "uint8 of shape (H, W, 3)"});
  }
  libmap::ColorImage image(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)));
  std::copy_n(static_cast<const std::uint8_t*>(array.data()), array.size(),
              image.pixels.empty() ? nullptr : image.pixels.front().data());
  return libmap::to_png(image);
}

}  // namespace

void add_images(py::module_& module) {
  module.def("render", &render);
  module.def("to_png", &to_png);
  add_stage<ImageOptions>("render");
}

}  // namespace graspmap_python
