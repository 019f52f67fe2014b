#include <algorithm>

#include "class_documentation.h"
#include "libmap/core/error.h"
#include "libmap/fusion/depth_fusion.h"
#include "libmap/refine/noise_estimate.h"
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

// Trajectory in a class of its own, because pybind11 would convert a vector to a list.
struct Poses {
  libmap::Trajectory poses;
};

}  // namespace

template <>
struct Argument<Poses> : ObjectArgument<Poses> {};
template <>
struct Argument<ScanSource> : ObjectArgument<ScanSource> {};

namespace {

constexpr PoseSource sources[] = {PoseSource::optimized, PoseSource::odometry,
                                  PoseSource::ground_truth};

// Returns the array of one field of all poses; `row` and `strides` describe the field of one pose.
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
  const auto numbers = array_from<std::int64_t>(nodes, "nodes", whole_numbers, {any_length},
                                                "whole numbers of shape (N,)");
  const py::ssize_t count = numbers.size();
  const std::string length = std::to_string(count);
  const py::array given = checked_array(matrices, "world_from_base", real_numbers, {count, 4, 4},
                                        "rigid transforms of shape (" + length + ", 4, 4)");
  py::array_t<double> times;
  if (!stamps.is_none())
    times = checked_array(stamps, "stamps_s", real_numbers, {count},
                          "numbers of shape (" + length + ",)");
  Poses made;
  for (py::ssize_t n = 0; n < count; ++n) {
    libmap::TrajectoryPose& pose = made.poses.emplace_back();
    pose.node = static_cast<int>(numbers.at(n));
    pose.stamp_s = stamps.is_none() ? 0.0 : times.at(n);
    pose.world_from_base =
        pose_from(given[py::int_(n)], "world_from_base, pose " + std::to_string(n));
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
  throw libmap::Error("the scan has no poses from this source", {.file = scan.path().string(),
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
  if constexpr (sizeof(Pixel) != sizeof(Number)) shape.push_back(sizeof(Pixel) / sizeof(Number));
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
  py::class_<Camera>(module, "Camera", documentation::camera)
      .def_readonly("width", &Camera::width, documentation::camera_width)
      .def_readonly("height", &Camera::height, documentation::camera_height)
      .def_readonly("fx", &Camera::fx, documentation::camera_fx)
      .def_readonly("fy", &Camera::fy, documentation::camera_fy)
      .def_readonly("cx", &Camera::cx, documentation::camera_cx)
      .def_readonly("cy", &Camera::cy, documentation::camera_cy)
      .def_property_readonly(
          "distortion_model", [](const Camera& camera) { return name_of(camera.distortion_model); },
          documentation::camera_distortion_model)
      .def_readonly("distortion", &Camera::distortion, documentation::camera_distortion)
      .def_property_readonly(
          "base_from_camera",
          [](const Camera& camera) { return matrix_of(camera.base_from_camera); },
          documentation::camera_base_from_camera);
  py::class_<RgbdFrame, std::shared_ptr<RgbdFrame>>(module, "Frame", documentation::frame)
      .def_readonly("node", &RgbdFrame::node, documentation::frame_node)
      .def_readonly("stamp_s", &RgbdFrame::stamp_s, documentation::frame_stamp_s)
      .def_readonly("cameras", &RgbdFrame::cameras, documentation::frame_cameras)
      .def_property_readonly("color",
                             viewing(&RgbdFrame::color, pixels_of<std::uint8_t, libmap::Color>),
                             documentation::frame_color)
      .def_property_readonly("depth", viewing(&RgbdFrame::depth, pixels_of<float, float>),
                             documentation::frame_depth)
      .def_property_readonly("right",
                             viewing(&RgbdFrame::right, pixels_of<std::uint8_t, std::uint8_t>),
                             documentation::frame_right);
}

py::array nodes_of(const py::object& self) {
  return pose_view<int>(self, {}, {}, [](const auto& pose) { return &pose.node; });
}

py::array stamps_of(const py::object& self) {
  return pose_view<double>(self, {}, {}, [](const auto& pose) { return &pose.stamp_s; });
}

py::array matrices_of(const py::object& self) {
  // Eigen's matrices are stored column by column.
  return pose_view<double>(self, {4, 4}, {sizeof(double), 4 * sizeof(double)},
                           [](const auto& pose) { return pose.world_from_base.matrix().data(); });
}

void write_poses(const fs::path& path, const Poses& poses, bool nodes) {
  libmap::require_trajectory_format(path);
  write_whole(path, [&](const fs::path& file) {
    libmap::write_trajectory(file, {poses.poses, {}}, nodes);
  });
}

std::shared_ptr<Poses> read_poses(const fs::path& path, const std::shared_ptr<ScanSource>& scan,
                                  const py::dict& values) {
  const auto options = options_from<libmap::PoseImportOptions>(values);
  return without_lock([&] {
    if (scan != nullptr)
      return shared(Poses{libmap::import_poses(path, *scan, options).trajectory.poses});
    const libmap::TrajectoryFile file = libmap::read_trajectory(path, options.format);
    if (file.of_cameras)
      throw libmap::Error("required for camera poses", {.file = path.string(), .field = "scan"});
    return shared(Poses{file.poses});
  });
}

void add_poses(py::module_& module) {
  py::class_<Poses, std::shared_ptr<Poses>> poses(module, "Poses", documentation::poses);
  define_constructor(poses, &make_poses, py::arg("nodes"), py::arg("world_from_base"),
                     py::arg("stamps_s") = py::none());
  poses.def_property_readonly("nodes", &nodes_of, documentation::poses_nodes)
      .def_property_readonly("stamps_s", &stamps_of, documentation::poses_stamps_s)
      .def_property_readonly("world_from_base", &matrices_of, documentation::poses_world_from_base)
      .def(
          "__len__", [](const Poses& all) { return all.poses.size(); }, documentation::poses_len);
  define(module, "write_poses", &write_poses, {"path", "poses", "nodes"});
  define(module, "read_poses", &read_poses, {"path", "scan", "options"});
}

std::shared_ptr<RgbdFrame> frame_of(const ScanSource& scan, int node, bool color, bool depth) {
  return without_lock(
      [&] { return shared(scan.read_frame(node, {.color = color, .depth = depth})); });
}

void add_scan(py::module_& module) {
  py::class_<ScanSource, std::shared_ptr<ScanSource>> scan(module, "Scan", documentation::scan);
  scan.def_property_readonly(
          "path", [](const ScanSource& source) { return source.path().string(); },
          documentation::scan_path)
      .def_property_readonly("warnings", &ScanSource::warnings, documentation::scan_warnings)
      .def_property_readonly(
          "nodes",
          [](const ScanSource& source) {
            return column<int>(source.graph().nodes, [](const auto& node) { return node.id; });
          },
          documentation::scan_nodes)
      .def_property_readonly(
          "stamps_s",
          [](const ScanSource& source) {
            return column<double>(source.graph().nodes,
                                  [](const auto& node) { return node.stamp_s; });
          },
          documentation::scan_stamps_s)
      .def_property_readonly("pose_sources", &sources_of, documentation::scan_pose_sources)
      .def(
          "__len__", [](const ScanSource& source) { return source.graph().nodes.size(); },
          documentation::scan_len);
  define_method(scan, "poses", &poses_of, documentation::scan_poses, py::arg("source") = "auto");
  define_method(scan, "frame", &frame_of, documentation::scan_frame, py::arg("node"),
                py::arg("color") = true, py::arg("depth") = true);
  define(module, "open_scan", &open_source, {"path", "calibration"});
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

py::dict fuse(const ScanSource& scan, const std::shared_ptr<Poses>& given, const py::dict& values,
              const py::object& progress, unsigned threads) {
  auto options = options_from<libmap::DepthFusionOptions>(values);
  const std::shared_ptr<Poses> poses = given != nullptr ? given : poses_of(scan, "auto");
  libmap::DepthFusionResult result = run(threads, progress, [&](libmap::Progress& bar) {
    return libmap::in_file(scan.path(), [&] {
      options.planes.noise =
          libmap::choose_noise(scan, poses->poses, options.sensor, options.planes, bar).noise;
      return libmap::fuse_depth(scan, poses->poses, options, bar);
    });
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
  define(module, "refine", &refine,
         {"scan", "known_lengths", "board", "options", "progress", "threads"});
  define(module, "fuse", &fuse, {"scan", "poses", "options", "progress", "threads"});
  add_stage<libmap::PoseImportOptions>("read_poses");
  add_stage<libmap::RefinementOptions, libmap::RefinementResult>(
      "refine", {"poses", "nodes_without_pose", "nodes_without_links"});
  add_stage<libmap::DepthFusionOptions, libmap::DepthFusionResult>("fuse");
}

}  // namespace graspmap_python
