#include <algorithm>

#include "libmap/core/error.h"
#include "libmap/fusion/depth_fusion.h"
#include "libmap/refine/refinement.h"
#include "libmap/scan/pose_import.h"
#include "libmap/scan/scan_source.h"
#include "tools/python/values.h"

namespace graspmap_python {

namespace {

namespace fs = std::filesystem;
using libmap::PoseSource;
using libmap::RgbdFrame;
using libmap::ScanSource;

// A vector of its own type for pybind11.
struct Poses {
  libmap::Trajectory poses;
};

constexpr PoseSource sources[] = {PoseSource::optimized, PoseSource::odometry,
                                  PoseSource::ground_truth};

// Of a field of each pose.
template <typename Number, typename FieldOf>
py::array pose_view(const py::object& self, Shape row, Shape strides, const FieldOf& field_of) {
  const libmap::Trajectory& poses = self.cast<Poses&>().poses;
  row.insert(row.begin(), static_cast<py::ssize_t>(poses.size()));
  strides.insert(strides.begin(), sizeof(libmap::TrajectoryPose));
  const Number* data = poses.empty() ? nullptr : field_of(poses.front());
  return view(data, std::move(row), self, std::move(strides));
}

std::shared_ptr<Poses> make_poses(const py::object& nodes, const py::object& matrices,
                                  const py::object& stamps) {
  const auto numbers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(
      checked_array(nodes, "nodes", "iu", "whole numbers of shape (N,)", 0));
  const std::string of_length = std::to_string(numbers.size());
  Poses made;
  py::array_t<double> times;
  if (!stamps.is_none())
    times = checked_array(stamps, "stamps_s", "iuf", "numbers of shape (" + of_length + ",)", 0);
  if (py::len(matrices) != static_cast<std::size_t>(numbers.size()) ||
      (!stamps.is_none() && times.size() != numbers.size()))
    throw libmap::Error("wrong length", {.field = "world_from_base or stamps_s",
                                         .value = {},
                                         .bound = of_length + ", one for each node"});
  for (py::ssize_t n = 0; n < numbers.size(); ++n) {
    libmap::TrajectoryPose& pose = made.poses.emplace_back();
    pose.node = static_cast<int>(numbers.at(n));
    pose.stamp_s = stamps.is_none() ? 0.0 : times.at(n);
    pose.world_from_base =
        pose_from(matrices[py::int_(n)], "world_from_base, pose " + std::to_string(n));
  }
  return shared(std::move(made));
}

std::vector<std::string> sources_of(const ScanSource& scan) {
  std::vector<std::string> names;
  for (const PoseSource source : sources)
    if (!libmap::trajectory_of(scan.graph(), source).empty()) names.push_back(to_text(source));
  return names;
}

std::shared_ptr<Poses> poses_of(const ScanSource& scan, const std::string& wanted) {
  std::string found;
  for (const PoseSource source : sources) {
    found += (found.empty() ? "" : ", ") + to_text(source);
    if (wanted != "auto" && wanted != to_text(source)) continue;
    libmap::Trajectory poses = libmap::trajectory_of(scan.graph(), source);
    if (!poses.empty()) return shared(Poses{std::move(poses)});
  }
  throw libmap::Error("the scan has none", {.file = scan.path().string(),
                                            .field = "source",
                                            .value = wanted,
                                            .bound = "auto, " + found});
}

std::shared_ptr<ScanSource> open_source(const fs::path& path,
                                        const std::optional<fs::path>& calibration) {
  return without_lock([&]() -> std::shared_ptr<ScanSource> {
    auto scan = libmap::open_scan(path);
    if (!calibration) return scan;
    return libmap::with_calibration(std::move(scan), libmap::read_camera(*calibration));
  });
}

template <typename Number, typename Pixel>
py::object pixels_of(const libmap::Image<Pixel>& image, py::handle owner) {
  if (image.empty()) return py::none();
  Shape shape = {image.height, image.width};
  if (sizeof(Pixel) != sizeof(Number)) shape.push_back(sizeof(Pixel) / sizeof(Number));
  return view(reinterpret_cast<const Number*>(image.pixels.data()), std::move(shape), owner);
}

const char* name_of(libmap::DistortionModel model) {
  switch (model) {
    case libmap::DistortionModel::none:
      return "none";
    case libmap::DistortionModel::radial_tangential:
      return "radial_tangential";
    case libmap::DistortionModel::equidistant:
      return "equidistant";
  }
  return "";
}

void add_frames(py::module_& module) {
  using libmap::Camera;
  py::class_<Camera>(
      module, "Camera",
      "A pinhole camera: u = fx * x/z + cx, v = fy * y/z + cy in pixels, with OpenCV's\n"
      "terms of distortion; z forward, x right, y down.")
      .def_readonly("width", &Camera::width)
      .def_readonly("height", &Camera::height)
      .def_readonly("fx", &Camera::fx)
      .def_readonly("fy", &Camera::fy)
      .def_readonly("cx", &Camera::cx)
      .def_readonly("cy", &Camera::cy)
      .def_property_readonly("distortion_model",
                             [](const Camera& camera) { return name_of(camera.distortion_model); })
      .def_readonly("distortion", &Camera::distortion)
      .def_property_readonly(
          "base_from_camera",
          [](const Camera& camera) { return matrix_of(camera.base_from_camera); },
          "(4, 4) float64, m");
  py::class_<RgbdFrame, std::shared_ptr<RgbdFrame>>(
      module, "Frame",
      "What one node of a scan recorded. Cameras are side by side in one image, in their order.")
      .def_readonly("node", &RgbdFrame::node)
      .def_readonly("stamp_s", &RgbdFrame::stamp_s)
      .def_readonly("cameras", &RgbdFrame::cameras)
      .def_property_readonly("color",
                             viewing(&RgbdFrame::color, pixels_of<std::uint8_t, libmap::Color>),
                             "(height, width, 3) uint8, or None")
      .def_property_readonly("depth", viewing(&RgbdFrame::depth, pixels_of<float, float>),
                             "(height, width) float32: distance from the camera's plane, m; 0\n"
                             "where nothing was measured; or None")
      .def_property_readonly("right",
                             viewing(&RgbdFrame::right, pixels_of<std::uint8_t, std::uint8_t>),
                             "(height, width) uint8 of a stereo pair, or None");
}

void add_poses(py::module_& module) {
  using libmap::TrajectoryPose;
  py::class_<Poses, std::shared_ptr<Poses>>(module, "Poses", "Poses of a scan's nodes.")
      .def(py::init(&make_poses), py::arg("nodes"), py::arg("world_from_base"),
           py::arg("stamps_s") = py::none())
      .def_property_readonly(
          "nodes",
          [](const py::object& self) {
            return pose_view<int>(self, {}, {}, [](const TrajectoryPose& p) { return &p.node; });
          },
          "(N,) int32; 0 where not known")
      .def_property_readonly(
          "stamps_s",
          [](const py::object& self) {
            return pose_view<double>(self, {}, {},
                                     [](const TrajectoryPose& p) { return &p.stamp_s; });
          },
          "(N,) float64, s")
      .def_property_readonly(
          "world_from_base",
          [](const py::object& self) {
            // Eigen's matrices are stored column by column.
            return pose_view<double>(
                self, {4, 4}, {sizeof(double), 4 * sizeof(double)},
                [](const TrajectoryPose& p) { return p.world_from_base.matrix().data(); });
          },
          "(N, 4, 4) float64, m")
      .def("__len__", [](const Poses& poses) { return poses.poses.size(); });
  module.def("write_poses", [](const fs::path& path, const Poses& poses, bool nodes) {
    libmap::require_trajectory_format(path);
    write_whole(path, [&](const fs::path& file) {
      libmap::write_trajectory(file, {poses.poses, {}}, nodes);
    });
  });
  module.def("read_poses", [](const fs::path& path, const std::shared_ptr<ScanSource>& scan,
                              const py::dict& values) {
    const auto options = options_from<libmap::PoseImportOptions>(values);
    return without_lock([&] {
      if (scan == nullptr) {
        const libmap::TrajectoryFile file = libmap::read_trajectory(path, options.format);
        if (file.of_cameras)
          throw libmap::Error("poses of cameras need a scan",
                              {.file = path.string(), .field = "scan"});
        return shared(Poses{file.poses});
      }
      return shared(Poses{libmap::import_poses(path, *scan, options).trajectory.poses});
    });
  });
}

void add_scan(py::module_& module) {
  py::class_<ScanSource, std::shared_ptr<ScanSource>>(
      module, "Scan", "A recorded scan; frames are read one by one.")
      .def_property_readonly("path", [](const ScanSource& scan) { return scan.path().string(); })
      .def_property_readonly("warnings", &ScanSource::warnings)
      .def_property_readonly(
          "nodes",
          [](const ScanSource& scan) {
            return column<int>(scan.graph().nodes, [](const auto& node) { return node.id; });
          },
          "(N,) int32, ascending")
      .def_property_readonly(
          "stamps_s",
          [](const ScanSource& scan) {
            return column<double>(scan.graph().nodes,
                                  [](const auto& node) { return node.stamp_s; });
          },
          "(N,) float64, s")
      .def_property_readonly("pose_sources", &sources_of,
                             "those of optimized, odometry and ground-truth that the scan has")
      .def(
          "poses", &poses_of, py::arg("source") = "auto",
          "The scan's own poses: optimized, odometry or ground-truth; auto: the first that it has.")
      .def(
          "frame",
          [](const ScanSource& scan, int node, bool color, bool depth) {
            return without_lock(
                [&] { return shared(scan.read_frame(node, {.color = color, .depth = depth})); });
          },
          py::arg("node"), py::arg("color") = true, py::arg("depth") = true,
          "Decodes the images of a node; not those that are False.")
      .def("__len__", [](const ScanSource& scan) { return scan.graph().nodes.size(); });
  module.def("open_scan", &open_source);
}

py::list texts_of(const std::vector<std::pair<int, libmap::Error>>& skipped) {
  py::list list;
  for (const auto& [node, error] : skipped) list.append(py::make_tuple(node, error.what()));
  return list;
}

py::dict report_of(const libmap::StageReport& stage) {
  py::dict dict;
  dict["name"] = stage.name;
  dict["rejected"] = stage.rejected;
  dict["seconds"] = stage.seconds;
  dict["figures"] = numbers_of(stage.metrics);
  const auto change = [&](const char* name, const libmap::HeldOutChange& held_out) {
    if (held_out.count > 0) dict[name] = py::make_tuple(held_out.before, held_out.after);
  };
  change("held_out_matches", stage.held_out.matches);
  change("held_out_surfaces", stage.held_out.surfaces);
  if (stage.error) {
    dict["trajectory_rmse_m"] = stage.error->absolute.rmse_m;
    dict["trajectory_rotation_error_deg"] = stage.error->absolute.mean_rotation_deg;
  }
  return dict;
}

py::dict refine(const ScanSource& scan, const std::vector<std::string>& known_lengths,
                const std::optional<std::string>& board, const py::dict& values,
                const py::object& progress, unsigned threads) {
  auto options = options_from<libmap::RefinementOptions>(values);
  for (const std::string& text : known_lengths)
    options.known_lengths.push_back(libmap::parse_known_length(text));
  if (board) options.board = libmap::parse_known_board(*board);
  libmap::RefinementResult result = run(threads, progress, [&](libmap::Progress& bar) {
    return libmap::in_file(scan.path(), [&] { return libmap::refine_poses(scan, options, bar); });
  });
  py::dict made = dict_of(libmap::described(result));
  made["poses"] = shared(Poses{std::move(result.poses)});
  made["nodes_without_pose"] = result.without_pose;
  made["nodes_without_links"] = result.without_links;
  made["skipped"] = texts_of(result.skipped);
  py::list reports;
  for (const libmap::StageReport& stage : result.stages) reports.append(report_of(stage));
  made["stages"] = reports;
  made["findings"] = result.findings;
  made["warnings"] = result.warnings;
  return made;
}

py::dict fuse(const ScanSource& scan, const Poses& poses, const py::dict& values,
              const py::object& progress, unsigned threads) {
  const auto options = options_from<libmap::DepthFusionOptions>(values);
  libmap::DepthFusionResult result = run(threads, progress, [&](libmap::Progress& bar) {
    return libmap::in_file(scan.path(),
                           [&] { return libmap::fuse_depth(scan, poses.poses, options, bar); });
  });
  py::dict made = dict_of(libmap::described(result));
  made["cloud"] = shared(std::move(result.cloud));
  made["poses"] = shared(Poses{std::move(result.poses)});
  made["skipped"] = texts_of(result.skipped);
  made["timings_s"] = numbers_of(result.timings_s);
  return made;
}

}  // namespace

void add_scans(py::module_& module) {
  add_frames(module);
  add_poses(module);
  add_scan(module);
  module.def("refine", &refine);
  module.def("fuse", &fuse);
  add_stage<libmap::PoseImportOptions>("read_poses");
  add_stage<libmap::RefinementOptions, libmap::RefinementResult>(
      "refine", {"poses", "nodes_without_pose", "nodes_without_links"});
  add_stage<libmap::DepthFusionOptions, libmap::DepthFusionResult>("fuse");
}

}  // namespace graspmap_python
