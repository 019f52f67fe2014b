#include "tools/support/info_scan.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <set>
#include <tuple>

#include "libmap/camera/camera_io.h"
#include "libmap/core/error.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/sqlite_file.h"
#include "tools/support/results.h"

namespace graspmap_tools {

namespace {

using Json = nlohmann::ordered_json;
using libmap::Camera;
using libmap::NodeContent;
using libmap::PoseSource;
using libmap::RtabmapDatabase;
using libmap::ScanSource;
using libmap::Trajectory;

// Limited, because phones store a focal length for each image.
constexpr std::size_t max_listed_cameras = 8;

Json sessions_json(const libmap::PoseGraph& graph) {
  struct Session {
    std::size_t nodes = 0;
    double first_s = 0.0;
    double last_s = 0.0;
  };
  std::map<int, Session> sessions;
  for (const libmap::GraphNode& node : graph.nodes) {
    Session& session = sessions[node.session];
    if (session.nodes++ == 0) session.first_s = session.last_s = node.stamp_s;
    session.first_s = std::min(session.first_s, node.stamp_s);
    session.last_s = std::max(session.last_s, node.stamp_s);
  }
  Json list = Json::array();
  for (const auto& [id, session] : sessions)
    list.push_back({{"session", id},
                    {"nodes", session.nodes},
                    {"begin_s", session.first_s},
                    {"duration_s", session.last_s - session.first_s}});
  return list;
}

Json weights_json(const libmap::PoseGraph& graph) {
  std::size_t normal = 0;
  std::size_t intermediate = 0;
  std::size_t invalid = 0;
  for (const libmap::GraphNode& node : graph.nodes)
    ++(node.weight >= 0 ? normal : node.weight == -1 ? intermediate : invalid);
  return {{"normal", normal}, {"intermediate", intermediate}, {"invalid", invalid}};
}

Json links_json(const libmap::PoseGraph& graph) {
  std::map<libmap::LinkType, std::size_t> counts;
  for (const libmap::PoseLink& link : graph.links) ++counts[link.type];
  Json json = {{"all", graph.links.size()}};
  for (const auto& [type, count] : counts) json[to_text(type)] = count;
  return json;
}

// Splits the trajectory into sessions, whose relative poses are unknown.
std::map<int, Trajectory> by_session(const libmap::PoseGraph& graph, const Trajectory& trajectory) {
  std::map<int, Trajectory> parts;
  for (const libmap::TrajectoryPose& pose : trajectory)
    parts[graph.find_node(pose.node)->session].push_back(pose);
  return parts;
}

Json poses_json(const libmap::PoseGraph& graph, const Trajectory& trajectory) {
  if (trajectory.empty()) return nullptr;
  std::vector<Eigen::Vector3d> positions;
  for (const libmap::TrajectoryPose& pose : trajectory)
    positions.emplace_back(pose.world_from_base.translation());
  double length_m = 0.0;
  for (const auto& [session, part] : by_session(graph, trajectory))
    length_m += libmap::path_length(part);
  return {{"poses", trajectory.size()},
          {"path_length_m", length_m},
          {"bounds_m", bounds_json(positions)}};
}

Json error_json(const Trajectory& estimate, const Trajectory& truth) {
  const libmap::AbsoluteTrajectoryError error = absolute_trajectory_error(estimate, truth);
  const libmap::TrajectoryError steps = relative_trajectory_error(estimate, truth);
  Json json = to_json(libmap::described(error));
  json["rmse_per_step_m"] = steps.rmse_m;
  json["mean_rotation_per_step_deg"] = steps.mean_rotation_deg;
  return json;
}

void add_error(Json& json, const std::string& name, const Trajectory& estimate,
               const Trajectory& truth) {
  try {
    json[name] = error_json(estimate, truth);
  } catch (const libmap::Error&) {
    // There are fewer than three common poses.
  }
}

Json errors_json(const libmap::PoseGraph& graph) {
  const Trajectory truth = trajectory_of(graph, PoseSource::ground_truth);
  if (truth.empty()) return nullptr;
  Json json = Json::object();
  // The odometry of each session has its own frame.
  const auto sessions = by_session(graph, trajectory_of(graph, PoseSource::odometry));
  for (const auto& [session, part] : sessions)
    add_error(json, sessions.size() == 1 ? "odometry" : fmt::format("odometry {}", session), part,
              truth);
  add_error(json, "optimized", trajectory_of(graph, PoseSource::optimized), truth);
  return json.empty() ? Json(nullptr) : json;
}

Json graph_json(const libmap::PoseGraph& graph) {
  Json poses = Json::object();
  for (const PoseSource source :
       {PoseSource::odometry, PoseSource::optimized, PoseSource::ground_truth})
    poses[to_text(source)] = poses_json(graph, trajectory_of(graph, source));
  std::size_t labels = 0;
  std::size_t velocities = 0;
  std::size_t fixes = 0;
  for (const libmap::GraphNode& node : graph.nodes) {
    labels += node.label.empty() ? 0 : 1;
    velocities += node.velocity ? 1 : 0;
    fixes += node.gps ? 1 : 0;
  }
  return {{"nodes", graph.nodes.size()},
          {"sessions", sessions_json(graph)},
          {"weights", weights_json(graph)},
          {"labels", labels},
          {"velocities", velocities},
          {"gps", fixes},
          {"links", links_json(graph)},
          {"poses", poses},
          {"trajectory_error", errors_json(graph)}};
}

std::string distortion_text(const Camera& camera) {
  if (!camera.is_distorted()) return "none";
  return fmt::format("{} of {} terms",
                     camera.distortion_model == libmap::DistortionModel::equidistant
                         ? "equidistant"
                         : "radial-tangential",
                     camera.distortion.size());
}

Json camera_json(const Camera& camera) {
  return {{"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"distortion", distortion_text(camera)}};
}

// Numbers of nodes by a description of their content.
using Counts = std::map<std::string, std::size_t>;

std::string image_text(const libmap::ImageInfo& info) {
  return fmt::format("{} {} x {}, {}{}", to_text(info.format), info.width, info.height,
                     info.channels == 1 ? "gray" : "color",
                     info.bits == 8 ? "" : fmt::format(", {} bits", info.bits));
}

std::string depth_text(const libmap::DepthInfo& info) {
  return fmt::format("{} {} x {}", to_text(info.format), info.width, info.height);
}

class ContentSummary {
 public:
  void add(const NodeContent& content) {
    const std::size_t cameras = content.calibration.cameras.size();
    const std::size_t pairs = content.calibration.stereo.size();
    add_cameras(content);
    ++images_[content.color_bytes == 0 ? "none"
              : content.color          ? image_text(*content.color)
                                       : "unreadable"];
    ++depths_[content.depth_bytes == 0 ? "none"
              : content.depth          ? depth_text(*content.depth)
              : content.right          ? "right image " + image_text(*content.right)
                                       : "unreadable"];
    if (cameras + pairs > 0)
      ++calibrations_[fmt::format("{} {}, {}", cameras + pairs,
                                  pairs > 0             ? "stereo"
                                  : cameras + pairs > 1 ? "cameras"
                                                        : "camera",
                                  to_text(content.calibration.layout))];
    image_bytes_ += content.color_bytes;
    depth_bytes_ += content.depth_bytes;
    laser_scans_ += content.laser_scan_bytes > 0 ? 1 : 0;
    user_data_bytes_ += content.user_data_bytes;
    for (const std::string& fault : content.faults)
      faults_.push_back(fmt::format("node {}: {}", content.node, fault));
  }

  Json json() const {
    return {
        {"cameras", cameras_},
        {"more_cameras", seen_.size() > max_listed_cameras ? seen_.size() - max_listed_cameras : 0},
        {"calibrations", calibrations_},
        {"images", images_},
        {"image_bytes", image_bytes_},
        {"depth", depths_},
        {"depth_bytes", depth_bytes_},
        {"laser_scans", laser_scans_},
        {"user_data_bytes", user_data_bytes_}};
  }

  const std::vector<std::string>& faults() const { return faults_; }

 private:
  void add_cameras(const NodeContent& content) {
    const auto add_all = [&](int width, int height) {
      const auto stereo = stereo_cameras_of(content.calibration, width, height);
      for (const libmap::StereoCamera& pair : stereo) add_camera(pair.left, pair.baseline_m);
      if (stereo.empty())
        for (const Camera& camera : cameras_of(content.calibration, width, height))
          add_camera(camera, 0.0);
    };
    try {
      if (content.color)
        add_all(content.color->width, content.color->height);
      else if (content.depth)
        add_all(content.depth->width, content.depth->height);
      else
        add_all(0, 0);
    } catch (const libmap::Error& error) {
      faults_.push_back(fmt::format("node {}: calibration: {}", content.node, error.what()));
    }
  }

  void add_camera(const Camera& camera, double baseline_m) {
    const auto key = std::tuple(camera.width, camera.height, camera.fx, camera.fy, camera.cx,
                                camera.cy, camera.distortion, baseline_m);
    if (!seen_.insert(key).second || seen_.size() > max_listed_cameras) return;
    Json json = camera_json(camera);
    if (baseline_m > 0) json["baseline_m"] = baseline_m;
    cameras_.push_back(json);
  }

  using Key = std::tuple<int, int, double, double, double, double, std::vector<double>, double>;
  std::set<Key> seen_;
  Json cameras_ = Json::array();
  Counts calibrations_;
  Counts images_;
  Counts depths_;
  std::size_t image_bytes_ = 0;
  std::size_t depth_bytes_ = 0;
  std::size_t laser_scans_ = 0;
  std::size_t user_data_bytes_ = 0;
  std::vector<std::string> faults_;
};

Json stored_map_json(const libmap::StoredMap& map) {
  return {{"grid", map.grid_width == 0 ? Json(nullptr)
                                       : Json(fmt::format("{} x {} cells of {} m", map.grid_width,
                                                          map.grid_height, map.grid_resolution_m))},
          {"cloud_points", map.cloud_points},
          {"polygons", map.polygons},
          {"texture", map.texture ? Json(image_text(*map.texture)) : Json(nullptr)},
          {"preview", map.preview ? Json(image_text(*map.preview)) : Json(nullptr)},
          {"last_localization", map.last_localization_map_from_base.has_value()}};
}

// Adds unreadable parts to `warnings`.
Json database_json(const RtabmapDatabase& scan, std::vector<std::string>& warnings) {
  ContentSummary summary;
  scan.each_content([&](const NodeContent& content) { summary.add(content); });
  Json json = summary.json();
  warnings.insert(warnings.end(), summary.faults().begin(), summary.faults().end());
  json["words"] = scan.word_count();
  json["features"] = scan.feature_count();
  json["parameters"] = scan.parameters().size();
  try {
    json["map"] = stored_map_json(scan.stored_map());
  } catch (const libmap::Error& error) {
    warnings.emplace_back(error.reason());
  }
  return json;
}

// Describes a scan of another format by its first frame.
Json frames_json(const ScanSource& scan, std::vector<std::string>& warnings) {
  Json cameras = Json::array();
  Json json = Json::object();
  if (scan.graph().nodes.empty()) return json;
  libmap::RgbdFrame frame;
  try {
    frame = scan.read_frame(scan.graph().nodes.front().id);
  } catch (const libmap::Error& error) {
    warnings.emplace_back(error.what());
    return json;
  }
  for (const Camera& camera : frame.cameras) cameras.push_back(camera_json(camera));
  const auto size = [](const auto& image) {
    return image.empty() ? Json(nullptr) : Json(fmt::format("{} x {}", image.width, image.height));
  };
  json["cameras"] = cameras;
  json["images"] = size(frame.color);
  json["depth"] = size(frame.depth);
  return json;
}

Json file_json(const ScanSource& scan, const RtabmapDatabase* database) {
  if (database == nullptr) return {{"format", "folder of images"}};
  return {{"format", "RTAB-Map database"},
          {"bytes", std::filesystem::file_size(scan.path())},
          {"version", database->version().empty() ? Json(nullptr) : Json(database->version())},
          {"schema", database->recognized_version()}};
}

Json verification_json(const libmap::ScanVerificationResult& result) {
  Json faults = Json::array();
  for (const libmap::ScanFault& fault : result.faults)
    faults.push_back({{"node", fault.node}, {"part", fault.part}, {"reason", fault.reason}});
  return {{"nodes", result.nodes},
          {"blobs", result.blobs},
          {"bytes", result.bytes},
          {"faults", faults}};
}

}  // namespace

bool may_be_scan(const std::string& path) {
  return std::filesystem::path(path).extension() == ".db" || std::filesystem::is_directory(path) ||
         (std::filesystem::is_regular_file(path) && libmap::is_sqlite_file(path));
}

Json camera_info(const std::string& path) {
  const libmap::CameraFile file = libmap::read_camera(path);
  Json json = {{"kind", "camera"}, {"name", file.name.empty() ? Json(nullptr) : Json(file.name)}};
  json.update(camera_json(file.camera));
  json["changes_depth"] = file.changes_depth();
  json["findings"] = file.findings;
  return json;
}

ScanInfo scan_info(const std::string& path, bool verify, libmap::Progress& progress) {
  const std::unique_ptr<ScanSource> scan = libmap::open_scan(path);
  const auto* database = dynamic_cast<const RtabmapDatabase*>(scan.get());
  ScanInfo info{.json = {{"kind", "scan"}, {"file", file_json(*scan, database)}}, .faults = {}};
  info.json.update(graph_json(scan->graph()));
  std::vector<std::string> warnings = scan->warnings();
  info.json.update(database != nullptr ? database_json(*database, warnings)
                                       : frames_json(*scan, warnings));
  info.json["warnings"] = warnings;
  if (verify) {
    libmap::ScanVerificationResult result = verify_scan(*scan, progress);
    info.json["verification"] = verification_json(result);
    info.faults = std::move(result.faults);
  }
  return info;
}

}  // namespace graspmap_tools
