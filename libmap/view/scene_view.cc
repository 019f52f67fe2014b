#include "libmap/view/scene_view.h"

#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkTexture.h>
#include <vtkTypeInt32Array.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <variant>

#include "libmap/core/error.h"
#include "libmap/view/layer_geometry.h"
#include "libmap/view/offscreen.h"
#include "libmap/view/scene_page.h"

namespace libmap {
namespace {

void check(const SceneViewOptions& options) {
  const auto check_side = [](const char* name, int value) {
    if (value < 1 || value > max_side_px)
      throw Error("invalid image size", {.field = name,
                                         .value = std::to_string(value),
                                         .bound = ">= 1 and <= " + std::to_string(max_side_px)});
  };
  check_side("width", options.width);
  check_side("height", options.height);
  parse_color(options.background, "background");
  if (options.extent && !((options.extent->max - options.extent->min).minCoeff() >= 0.0))
    throw Error("not a box", {.field = "extent", .bound = "minimum <= maximum on each axis"});
}

// A scene ready to be drawn, in the terrain frame.
struct Setup {
  std::vector<PreparedLayer> layers;
  std::vector<Marker> markers;
  std::vector<DimensionLine> dimension_lines;
  std::vector<Legend> legends;
  std::vector<Eigen::Vector3d> in_view;  // all finite
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius_m = 0.0;  // radius of the largest point
  ScenePage page;
  SceneCamera camera;
};

Setup gather(const Scene& scene) {
  Setup setup;
  std::vector<Eigen::Vector3d>& positions = setup.in_view;
  for (const SceneLayer& layer : scene.layers) {
    for (PreparedLayer& prepared : prepare_layers(layer, scene.terrain_from_scene)) {
      positions.insert(positions.end(), prepared.positions.begin(), prepared.positions.end());
      if (!prepared.positions.empty())
        setup.radius_m = std::max(setup.radius_m, prepared.point_size_m / 2.0);
      add_legend(prepared.legend, setup.legends);
      setup.layers.push_back(std::move(prepared));
    }
  }
  if (positions.empty()) throw Error("none has finite coordinates", {.field = "points to draw"});
  for (Marker marker : scene.markers) {
    marker.position = scene.terrain_from_scene * marker.position;
    setup.markers.push_back(marker);
    if (marker.position.allFinite()) positions.push_back(marker.position);
  }
  for (DimensionLine line : scene.dimension_lines) {
    line.from = scene.terrain_from_scene * line.from;
    line.to = scene.terrain_from_scene * line.to;
    if (!line.from.allFinite() || !line.to.allFinite()) continue;
    positions.insert(positions.end(), {line.from, line.to});
    setup.dimension_lines.push_back(line);
  }
  const Bounds3d bounds = bounds_of(positions);
  setup.center = bounds.min + (bounds.max - bounds.min) / 2.0;
  return setup;
}

std::vector<Eigen::Vector3d> corners_of(const Bounds3d& box) {
  std::vector<Eigen::Vector3d> corners;
  corners.reserve(8);
  for (int corner = 0; corner < 8; ++corner)
    corners.emplace_back((corner & 1) != 0 ? box.max.x() : box.min.x(),
                         (corner & 2) != 0 ? box.max.y() : box.min.y(),
                         (corner & 4) != 0 ? box.max.z() : box.min.z());
  return corners;
}

SceneCamera camera_for(const Setup& setup, const SceneViewOptions& options,
                       const Pose& terrain_from_scene) {
  CameraPlacement placement = options.camera;
  placement.position = terrain_from_scene * placement.position;
  placement.focal_point = terrain_from_scene * placement.focal_point;
  placement.up = terrain_from_scene.linear() * placement.up;
  if (options.extent)
    return fit_camera(options.view, placement, corners_of(*options.extent), 0.0, setup.page.plot);
  const Bounds3d bounds = bounds_of(setup.in_view);
  const bool lone = (bounds.max - bounds.min).norm() < 4.0 * setup.radius_m;
  return fit_camera(options.view, placement, setup.in_view,
                    lone ? 5.0 * setup.radius_m : setup.radius_m, setup.page.plot);
}

Setup set_up(const Scene& scene, const SceneViewOptions& options) {
  check(options);
  Setup setup = gather(scene);
  setup.page = plan_page(options, setup.legends);
  setup.camera = camera_for(setup, options, scene.terrain_from_scene);
  return setup;
}

// VTK measures rows and coordinates from the bottom. Both are passed from the top, so they match.
vtkSmartPointer<vtkFloatArray> coordinates_of(const ColoredTriangles& triangles) {
  auto array = vtkSmartPointer<vtkFloatArray>::New();
  array->SetNumberOfComponents(2);
  array->SetNumberOfTuples(static_cast<vtkIdType>(triangles.coordinates.size()));
  float* value = array->GetPointer(0);
  for (const Eigen::Vector2f& coordinate : triangles.coordinates) {
    *value++ = coordinate.x();
    *value++ = coordinate.y();
  }
  return array;
}

vtkSmartPointer<vtkTexture> texture_of(const ColorImage& page) {
  vtkNew<vtkImageData> image;
  image->SetDimensions(page.width, page.height, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  std::memcpy(image->GetScalarPointer(), page.pixels.data(), page.pixels.size() * sizeof(Color));
  auto texture = vtkSmartPointer<vtkTexture>::New();
  texture->SetInputData(image);
  texture->InterpolateOn();
  texture->RepeatOff();
  texture->EdgeClampOn();
  texture->MipmapOn();
  return texture;
}

vtkSmartPointer<vtkActor> actor_of(const ColoredTriangles& triangles) {
  vtkNew<vtkFloatArray> coordinates;
  coordinates->SetNumberOfComponents(3);
  coordinates->SetNumberOfTuples(static_cast<vtkIdType>(triangles.vertices.size()));
  vtkNew<vtkUnsignedCharArray> colors;
  colors->SetNumberOfComponents(3);
  colors->SetNumberOfTuples(static_cast<vtkIdType>(triangles.colors.size()));
  float* coordinate = coordinates->GetPointer(0);
  unsigned char* color = colors->GetPointer(0);
  for (std::size_t i = 0; i < triangles.vertices.size(); ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) *coordinate++ = triangles.vertices[i][axis];
    for (const std::uint8_t channel : triangles.colors[i]) *color++ = channel;
  }
  vtkNew<vtkTypeInt32Array> offsets;
  vtkNew<vtkTypeInt32Array> corners;
  const auto count = static_cast<vtkIdType>(triangles.triangles.size());
  offsets->SetNumberOfValues(count + 1);
  corners->SetNumberOfValues(3 * count);
  for (vtkIdType t = 0; t <= count; ++t) offsets->SetValue(t, static_cast<vtkTypeInt32>(3 * t));
  vtkTypeInt32* corner = corners->GetPointer(0);
  for (const Triangle& triangle : triangles.triangles)
    for (const std::uint32_t index : triangle) *corner++ = static_cast<vtkTypeInt32>(index);

  vtkNew<vtkPoints> points;
  points->SetData(coordinates);
  vtkNew<vtkCellArray> cells;
  cells->SetData(offsets, corners);
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  data->GetPointData()->SetScalars(colors);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(data);
  mapper->SetColorModeToDirectScalars();
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  if (triangles.texture != nullptr) {
    data->GetPointData()->SetTCoords(coordinates_of(triangles));
    actor->SetTexture(texture_of(*triangles.texture));
  }
  // Colors already include shading.
  actor->GetProperty()->LightingOff();
  return actor;
}

void aim(const Setup& setup, vtkCamera& target) {
  const SceneCamera& camera = setup.camera;
  const Eigen::Vector3d position = camera.position - setup.center;
  double nearest = std::numeric_limits<double>::infinity();
  double farthest = 0.0;
  for (const PreparedLayer& layer : setup.layers) {
    for (const Eigen::Vector3d& point : layer.positions) {
      const double depth = camera.depth_of(point);
      nearest = std::min(nearest, depth);
      farthest = std::max(farthest, depth);
    }
  }
  // Fillers may extend the depth range behind the last point by its length.
  farthest += farthest - nearest + 8.0 * setup.radius_m + 0.01 * std::abs(farthest) + 1e-6;
  nearest = std::max(nearest - 3.0 * setup.radius_m - 0.01 * farthest, 1e-3 * farthest);
  const double distance = std::max(camera.depth_of(setup.center), nearest);
  const Eigen::Vector3d focal_point = position + distance * camera.forward;
  target.SetPosition(position.x(), position.y(), position.z());
  target.SetFocalPoint(focal_point.x(), focal_point.y(), focal_point.z());
  target.SetViewUp(camera.up.x(), camera.up.y(), camera.up.z());
  target.SetParallelProjection(camera.perspective ? 0 : 1);
  const double half_height = camera.plot.height / 2.0 / camera.scale_px;
  if (camera.perspective)
    target.SetViewAngle(2.0 * std::atan(half_height) * 180.0 / std::numbers::pi);
  else
    target.SetParallelScale(half_height);
  target.SetClippingRange(nearest, farthest);
}

// Renders the scene at the size of the page's plot.
ColorImage draw_plot(const Setup& setup, const Color& background) {
  const PixelRect& plot = setup.page.plot;
  return draw_offscreen(
      static_cast<int>(plot.width), static_cast<int>(plot.height), [&](vtkRenderWindow& window) {
        vtkNew<vtkRenderer> renderer;
        renderer->SetBackground(background[0] / 255.0, background[1] / 255.0,
                                background[2] / 255.0);
        for (const PreparedLayer& layer : setup.layers)
          renderer->AddActor(actor_of(triangles_of(layer, setup.camera, setup.center)));
        aim(setup, *renderer->GetActiveCamera());
        window.AddRenderer(renderer);
      });
}

}  // namespace

void bind(ParameterTable& table, SceneLayer& layer) {
  Coloring& coloring = layer.coloring;
  table.add(
      "color", coloring.mode,
      {{"automatic", ColorMode::automatic},
       {"own", ColorMode::own},
       {"score", ColorMode::score},
       {"field", ColorMode::field},
       {"flags", ColorMode::flags},
       {"height", ColorMode::height},
       {"single", ColorMode::single},
       {"texture", ColorMode::texture}},
      "quantity shown by colors; own: stored colors; field: a scalar field; flags: convex, "
      "graspable and obstacle points; single: one color; automatic: by the content of the file");
  table.add("field", coloring.field,
            "name of the scalar field shown by the color modes field, score and automatic");
  table.add("load_n", coloring.load_n, positive,
            "load shown in the legend of hold_probability, N; auto: the load stored with the map");
  table.add("color_scale", coloring.scale,
            {{"viridis", ColorScale::viridis}, {"diverging", ColorScale::diverging}},
            "color scale; viridis: dark to bright; diverging: blue below and red above 0");
  table.add("range_min", coloring.range_min, any_number,
            "value at the lower end of the color scale");
  table.add(
      "range_max", coloring.range_max, any_number,
      "value at the upper end of the color scale; if equal to range_min, both are from the data");
  table.add("single_color", coloring.color, "color for color mode single, #rrggbb or a name");
  table.add("point_shape", layer.point_shape,
            {{"automatic", PointShape::automatic},
             {"cube", PointShape::cube},
             {"square", PointShape::square}},
            "shape of points; automatic: cubes for points on a lattice, else squares");
  table.add("point_size_m", layer.point_size_m, not_negative,
            "side length of the squares or cubes that show points, m; 0: from the point spacing");
  table.add("shading", layer.shading,
            {{"automatic", Shading::automatic}, {"none", Shading::none}, {"full", Shading::full}},
            "shading; none: exact colors; automatic: meshes, cubes, and clouds of one color with "
            "normals; full: also other clouds with normals and textured meshes");
}

void bind(ParameterTable& table, SceneViewOptions& options) {
  table.add("view", options.view, viewpoint_names(),
            "viewpoint; top, front, side: orthographic along -z, +y, -x; oblique: perspective "
            "from the front, left and above; camera: perspective from a given position");
  table.add("title", options.title, "title above the scene");
  table.add("scale_bar", options.scale_bar, "show the scale bar");
  table.add("background", options.background, "background color, #rrggbb or a name");
}

void bind_single(ParameterTable& table, SceneViewOptions& options) {
  const Range pixels{1.0, max_side_px};
  table.add("width_px", options.width, pixels, "width of the image, pixels");
  table.add("height_px", options.height, pixels, "height of the image, pixels");
  table.add("legend", options.legend, "show the legend");
  table.add("axes", options.axes, "show the axes");
}

ColorImage render_scene(Scene scene, const SceneViewOptions& options) {
  const Setup setup = set_up(scene, options);
  // Frees memory for rendering, which takes hundreds of bytes per point. Setup copies all but
  // texture pages.
  for (SceneLayer& layer : scene.layers)
    if (!std::holds_alternative<TexturedMesh>(layer.shape)) layer.shape = PointCloud();
  Canvas canvas(options.width, options.height);
  canvas.image(draw_plot(setup, parse_color(options.background, "background")), setup.page.plot);
  draw_title(setup.page, options.title, canvas);
  draw_legends(setup.page, setup.legends, canvas);
  draw_axes(setup.page, setup.camera, canvas);
  draw_scale_bar(setup.page, setup.camera, setup.center, canvas);
  draw_dimension_lines(setup.page, setup.camera, setup.dimension_lines, canvas);
  draw_markers(setup.page, setup.camera, setup.markers, canvas);
  return canvas.pixels();
}

SceneContents contents_of(const Scene& scene) {
  const Setup setup = gather(scene);
  Bounds3d extent = bounds_of(setup.in_view);
  extent.min.array() -= setup.radius_m;
  extent.max.array() += setup.radius_m;
  return {extent, setup.legends};
}

SceneCamera camera_of(const Scene& scene, const SceneViewOptions& options) {
  return set_up(scene, options).camera;
}

}  // namespace libmap
