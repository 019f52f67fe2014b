#include "libmap/view/scene_view.h"

#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkTexture.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <numbers>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/view/overlay.h"
#include "libmap/view/scene_geometry.h"
#include "libmap/view/scene_page.h"
#include "libmap/view/virtual_display.h"

namespace libmap {
namespace {

constexpr int largest_side_px = 16384;
// Above it the multisampled buffers would take gigabytes.
constexpr double most_multisampled_pixels = 1.7e7;
constexpr int multisamples = 4;

void check(const SceneViewOptions& options) {
  const auto check_side = [](const char* name, int value) {
    if (value < 1 || value > largest_side_px)
      throw Error("no picture can have this size",
                  {.file = {},
                   .field = name,
                   .value = std::to_string(value),
                   .bound = ">= 1 and <= " + std::to_string(largest_side_px)});
  };
  check_side("width", options.width);
  check_side("height", options.height);
  parse_color(options.background, "background");
}

// A scene ready to be drawn, in the terrain frame.
struct Setup {
  std::vector<PreparedLayer> layers;
  std::vector<Marker> markers;
  std::vector<Legend> legends;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius_m = 0.0;  // of the largest point
  ScenePage page;
  SceneCamera camera;
};

void add_legend(const Legend& legend, std::vector<Legend>& legends) {
  if (legend.empty()) return;
  const auto same = [&legend](const Legend& other) {
    return other.title == legend.title && other.continuous == legend.continuous &&
           other.min == legend.min && other.max == legend.max &&
           std::equal(other.entries.begin(), other.entries.end(), legend.entries.begin(),
                      legend.entries.end(), [](const LegendEntry& a, const LegendEntry& b) {
                        return a.text == b.text && a.color == b.color;
                      });
  };
  if (std::none_of(legends.begin(), legends.end(), same)) legends.push_back(legend);
}

Setup set_up(const Scene& scene, const SceneViewOptions& options) {
  check(options);
  Setup setup;
  std::vector<Eigen::Vector3d> positions;
  for (const SceneLayer& layer : scene.layers) {
    for (PreparedLayer& prepared : prepare_layers(layer, scene.terrain_from_scene)) {
      positions.insert(positions.end(), prepared.positions.begin(), prepared.positions.end());
      if (!prepared.positions.empty())
        setup.radius_m = std::max(setup.radius_m, prepared.point_size_m / 2.0);
      add_legend(prepared.legend, setup.legends);
      setup.layers.push_back(std::move(prepared));
    }
  }
  if (positions.empty()) throw Error("there is nothing to draw: no point with finite coordinates");
  for (Marker marker : scene.markers) {
    marker.position = scene.terrain_from_scene * marker.position;
    setup.markers.push_back(marker);
    if (marker.position.allFinite()) positions.push_back(marker.position);
  }
  const Bounds3d bounds = bounds_of(positions);
  setup.center = bounds.min + (bounds.max - bounds.min) / 2.0;
  const bool lone = (bounds.max - bounds.min).norm() < 4.0 * setup.radius_m;
  setup.page = plan_page(options, setup.legends);
  CameraPlacement placement = options.camera;
  placement.position = scene.terrain_from_scene * placement.position;
  placement.focal_point = scene.terrain_from_scene * placement.focal_point;
  placement.up = scene.terrain_from_scene.linear() * placement.up;
  setup.camera = fit_camera(options.view, placement, positions,
                            lone ? 5.0 * setup.radius_m : setup.radius_m, setup.page.plot);
  return setup;
}

// Takes VTK's messages off the console while it lives; the first error is kept.
class QuietOutput : public vtkOutputWindow {
 public:
  static QuietOutput* New();
  vtkTypeMacro(QuietOutput, vtkOutputWindow);
  void DisplayText(const char*) override {}
  void DisplayErrorText(const char* text) override {
    if (first_error_.empty() && text != nullptr) first_error_ = text;
  }
  void DisplayWarningText(const char*) override {}
  void DisplayGenericWarningText(const char*) override {}
  void DisplayDebugText(const char*) override {}
  const std::string& first_error() const { return first_error_; }

 private:
  std::string first_error_;
};
vtkStandardNewMacro(QuietOutput);

class QuietScope {
 public:
  QuietScope() : former_(vtkOutputWindow::GetInstance()) { vtkOutputWindow::SetInstance(quiet_); }
  ~QuietScope() { vtkOutputWindow::SetInstance(former_); }
  QuietScope(const QuietScope&) = delete;
  QuietScope& operator=(const QuietScope&) = delete;
  const std::string& first_error() const { return quiet_->first_error(); }

 private:
  vtkSmartPointer<vtkOutputWindow> former_;
  vtkNew<QuietOutput> quiet_;
};

// VTK counts rows and coordinates from the bottom: given from the top, both fit together.
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
  vtkNew<vtkTypeInt64Array> offsets;
  vtkNew<vtkTypeInt64Array> corners;
  offsets->SetNumberOfValues(static_cast<vtkIdType>(triangles.triangles.size() + 1));
  corners->SetNumberOfValues(static_cast<vtkIdType>(3 * triangles.triangles.size()));
  for (std::size_t t = 0; t <= triangles.triangles.size(); ++t)
    offsets->SetValue(static_cast<vtkIdType>(t), static_cast<vtkTypeInt64>(3 * t));
  vtkTypeInt64* corner = corners->GetPointer(0);
  for (const Triangle& triangle : triangles.triangles)
    for (const std::uint32_t index : triangle) *corner++ = index;

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
  // Shades are in the colours already.
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
  // Fillers may lie as far behind the last point as that behind the first.
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

Overlay overlay_of(const Setup& setup, const SceneViewOptions& options) {
  Overlay overlay;
  draw_title(setup.page, options.title, overlay);
  draw_legends(setup.page, setup.legends, overlay);
  draw_axes(setup.page, setup.camera, overlay);
  draw_scale_bar(setup.page, setup.camera, setup.center, overlay);
  draw_markers(setup.page, setup.camera, setup.markers, overlay);
  return overlay;
}

ColorImage pixels_of(vtkRenderWindow& window, int width, int height) {
  ColorImage image(width, height);
  vtkNew<vtkUnsignedCharArray> pixels;
  window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels);
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(width);
  const std::size_t bytes = row_bytes * static_cast<std::size_t>(height);
  if (static_cast<std::size_t>(pixels->GetNumberOfValues()) != bytes)
    throw Error("the picture could not be read back from OpenGL", {}, ErrorKind::failed);
  // OpenGL's rows begin at the bottom.
  for (std::size_t row = 0; row < static_cast<std::size_t>(height); ++row)
    std::memcpy(image.pixels.data() + row * static_cast<std::size_t>(width),
                pixels->GetPointer(0) + (static_cast<std::size_t>(height) - 1 - row) * row_bytes,
                row_bytes);
  return image;
}

ColorImage draw(const Setup& setup, const SceneViewOptions& options) {
  vtkNew<vtkRenderWindow> window;
  window->OffScreenRenderingOn();
  window->ShowWindowOff();
  window->SetSize(options.width, options.height);
  window->SetDPI(72);
  const bool small = double{1} * options.width * options.height <= most_multisampled_pixels;
  window->SetMultiSamples(small ? multisamples : 0);
  window->SetNumberOfLayers(3);

  vtkNew<vtkRenderer> page;
  page->SetBackground(1.0, 1.0, 1.0);
  window->AddRenderer(page);

  vtkNew<vtkRenderer> plot;
  const PixelRect& rect = setup.page.plot;
  plot->SetLayer(1);
  plot->SetViewport(rect.left / options.width, 1.0 - rect.bottom() / options.height,
                    rect.right() / options.width, 1.0 - rect.top / options.height);
  for (const PreparedLayer& layer : setup.layers)
    plot->AddActor(actor_of(triangles_of(layer, setup.camera, setup.center)));
  aim(setup, *plot->GetActiveCamera());
  window->AddRenderer(plot);

  vtkNew<vtkRenderer> front;
  front->SetLayer(2);
  overlay_of(setup, options).add_to(*front, options.height);
  window->AddRenderer(front);

  // Behind the scene, on the page.
  Overlay behind;
  behind.rectangle(rect, parse_color(options.background, "background"));
  behind.add_to(*page, options.height);

  window->Render();
  return pixels_of(*window, options.width, options.height);
}

}  // namespace

std::vector<std::pair<std::string, PointShape>> point_shape_names() {
  return {{"automatic", PointShape::automatic},
          {"cube", PointShape::cube},
          {"square", PointShape::square}};
}

std::vector<std::pair<std::string, Shading>> shading_names() {
  return {{"automatic", Shading::automatic}, {"none", Shading::none}, {"full", Shading::full}};
}

ColorImage render_scene(const Scene& scene, const SceneViewOptions& options) {
  const Setup setup = set_up(scene, options);
  // VTK's rendering and the environment are for one thread at a time.
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  const VirtualDisplay display;
  const QuietScope quiet;
  ColorImage image = draw(setup, options);
  if (!quiet.first_error().empty()) {
    std::string reason = quiet.first_error();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    throw Error("VTK could not draw the picture: " + std::string(trim(reason)), {},
                ErrorKind::failed);
  }
  return image;
}

SceneCamera camera_of(const Scene& scene, const SceneViewOptions& options) {
  return set_up(scene, options).camera;
}

}  // namespace libmap
