#include "libmap/scan/scan_source.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/lens_rays.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace {

std::vector<std::filesystem::path> databases_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> databases;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".db" && entry.is_regular_file())
      databases.push_back(entry.path());
  std::sort(databases.begin(), databases.end());
  return databases;
}

}  // namespace

std::unique_ptr<ScanSource> open_scan(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) {
    const std::vector<std::filesystem::path> databases = databases_in(path);
    return databases.empty() ? open_frame_folder(path) : open_scans(databases);
  }
  require_readable_file(path);
  if (std::filesystem::file_size(path) == 0)
    throw Error("is empty: 0 bytes", {.file = path.string()});
  if (!is_sqlite_file(path))
    throw Error("is not a scan: neither an RTAB-Map database nor a folder of images",
                {.file = path.string()});
  return std::make_unique<RtabmapDatabase>(path);
}

namespace {

class JoinedScan : public ScanSource {
 public:
  explicit JoinedScan(std::vector<std::unique_ptr<ScanSource>> scans) : scans_(std::move(scans)) {
    find_step();
    for (std::size_t n = 0; n < scans_.size(); ++n) add(n);
  }

  // Path of the first scan.
  const std::filesystem::path& path() const override { return scans_.front()->path(); }
  const PoseGraph& graph() const override { return graph_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }
  std::string image_name(int node) const override {
    const std::string name = of(node).image_name(node % step_);
    return name.empty() || node < step_ ? name : std::to_string(node / step_ + 1) + "_" + name;
  }
  RgbdFrame read_frame(int node, FrameParts parts) const override {
    RgbdFrame frame = of(node).read_frame(node % step_, parts);
    frame.node = node;
    return frame;
  }

  SourceNode source_of(int node) const override { return {of(node).path(), node % step_}; }

 private:
  const ScanSource& of(int node) const {
    const auto scan = static_cast<std::size_t>(node / step_);
    if (node < 0 || scan >= scans_.size())
      throw Error("the scan has no node with this id",
                  {.file = path().string(), .field = "node", .value = std::to_string(node)});
    return *scans_[scan];
  }
  void find_step();
  void add(std::size_t scan);

  std::vector<std::unique_ptr<ScanSource>> scans_;
  int step_ = 10;
  int sessions_ = 0;
  PoseGraph graph_;
  std::vector<std::string> warnings_;
};

void JoinedScan::find_step() {
  std::int64_t largest = 0;
  const auto take = [&](int node) { largest = std::max(largest, std::abs(std::int64_t{node})); };
  for (const auto& scan : scans_) {
    for (const GraphNode& node : scan->graph().nodes) take(node.id);
    for (const PoseLink& link : scan->graph().links) {
      take(link.from);
      take(link.to);
    }
  }
  const auto most = static_cast<std::int64_t>(std::numeric_limits<int>::max()) /
                    static_cast<std::int64_t>(scans_.size());
  std::int64_t bound = 1;  // largest power of ten <= most
  while (10 * bound <= most) bound *= 10;
  std::int64_t step = 10;
  while (step <= largest) step *= 10;
  if (step > bound)
    throw Error("node ids are too large for joining this many scans",
                {.file = path().string(),
                 .field = "largest node id",
                 .value = std::to_string(largest),
                 .bound = "< " + std::to_string(bound)});
  step_ = static_cast<int>(step);
}

void JoinedScan::add(std::size_t scan) {
  const PoseGraph& graph = scans_[scan]->graph();
  const int higher = static_cast<int>(scan) * step_;
  const auto renumbered = [&](int node) { return node < 0 ? node - higher : node + higher; };
  int sessions = 0;
  for (GraphNode node : graph.nodes) {
    sessions = std::max(sessions, node.session + 1);
    node.id = renumbered(node.id);
    node.session += sessions_;
    graph_.nodes.push_back(std::move(node));
  }
  sessions_ += sessions;
  for (PoseLink link : graph.links) {
    link.from = renumbered(link.from);
    link.to = renumbered(link.to);
    graph_.links.push_back(std::move(link));
  }
  for (const std::string& warning : scans_[scan]->warnings())
    warnings_.push_back(scan == 0 ? warning : scans_[scan]->path().string() + ": " + warning);
}

}  // namespace

std::unique_ptr<ScanSource> join_scans(std::vector<std::unique_ptr<ScanSource>> scans) {
  if (scans.empty()) throw Error("at least one is required", {.field = "scans"});
  if (scans.size() == 1) return std::move(scans.front());
  for (std::size_t a = 0; a < scans.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (std::filesystem::equivalent(scans[a]->path(), scans[b]->path()))
        throw Error("the same scan is given twice", {.file = scans[a]->path().string()});
  return std::make_unique<JoinedScan>(std::move(scans));
}

std::unique_ptr<ScanSource> open_scans(const std::vector<std::filesystem::path>& paths) {
  std::vector<std::unique_ptr<ScanSource>> scans;
  for (const std::filesystem::path& path : paths) scans.push_back(open_scan(path));
  return join_scans(std::move(scans));
}

namespace {

constexpr double max_step = 0.03;  // maximum relative depth difference of pixels of one surface
constexpr double max_miss_px = 0.5;
constexpr double close_px = 0.03;
constexpr int search_rounds = 5;

class CalibratedScan : public ScanSource {
 public:
  CalibratedScan(std::unique_ptr<ScanSource> scan, CameraFile calibration)
      : scan_(std::move(scan)), calibration_(std::move(calibration)) {}

  const std::filesystem::path& path() const override { return scan_->path(); }
  const PoseGraph& graph() const override { return scan_->graph(); }
  const std::vector<std::string>& warnings() const override { return scan_->warnings(); }
  SourceNode source_of(int node) const override { return scan_->source_of(node); }
  std::string image_name(int node) const override { return scan_->image_name(node); }
  RgbdFrame read_frame(int node, FrameParts parts) const override;

 private:
  std::unique_ptr<ScanSource> scan_;
  CameraFile calibration_;
  mutable LensRays rays_;
};

// Interpolated depth if the four pixels are of one surface, else depth of the nearest pixel.
double depth_between(const DepthImage& depth, const Eigen::Vector2d& at) {
  const int left = std::clamp(static_cast<int>(std::floor(at.x())), 0, depth.width - 2);
  const int top = std::clamp(static_cast<int>(std::floor(at.y())), 0, depth.height - 2);
  const float* const row = &depth.pixels[depth.index(left, top)];
  const float* const below = row + depth.width;
  const double u = std::clamp(at.x() - left, 0.0, 1.0);
  const double v = std::clamp(at.y() - top, 0.0, 1.0);
  const double least = std::min(std::min(row[0], row[1]), std::min(below[0], below[1]));
  const double most = std::max(std::max(row[0], row[1]), std::max(below[0], below[1]));
  if (!(least > 0.0 && most - least < max_step * most))
    return (v < 0.5 ? row : below)[u < 0.5 ? 0 : 1];
  return (1.0 - v) * ((1.0 - u) * row[0] + u * row[1]) + v * ((1.0 - u) * below[0] + u * below[1]);
}

// Iterative search for the depth measurement on the ray of a color pixel. Each step moves by the
// residual, in pixels by the local pitch of the rays.
class DepthSearch {
 public:
  DepthSearch(const DepthImage& taken, const LensRays::Table& rays, const Pose& color_from_depth)
      : taken_(taken),
        rays_(rays),
        rotation_(color_from_depth.linear()),
        shift_(color_from_depth.translation()) {}

  // Returns the depth in the color camera at x, y; 0 if there is none. Starts at `source` and sets
  // it to the position of the measurement.
  double find(int x, int y, Eigen::Vector2d& source) const {
    const Eigen::Vector2d wanted = rays_[taken_.index(x, y)];
    const int left = std::max(x - 1, 0);
    const int top = std::max(y - 1, 0);
    Eigen::Matrix2d pitch;  // ray differences per column and per row
    pitch << rays_[taken_.index(left + 1, y)] - rays_[taken_.index(left, y)],
        rays_[taken_.index(x, top + 1)] - rays_[taken_.index(x, top)];
    const Eigen::Matrix2d pixels_of_pitch = pitch.inverse();
    for (int round = 0; round < search_rounds; ++round) {
      if (!(source.x() > -0.5 && source.y() > -0.5 && source.x() < taken_.width - 0.5 &&
            source.y() < taken_.height - 0.5))
        return 0.0;
      const double z = depth_between(taken_, source);
      const int column = static_cast<int>(source.x() + 0.5);
      const int row = static_cast<int>(source.y() + 0.5);
      const Eigen::Vector2d ray =
          rays_[taken_.index(column, row)] + pitch * (source - Eigen::Vector2d(column, row));
      const Eigen::Vector3d point = rotation_ * (z * ray.homogeneous()) + shift_;
      if (!(z > 0.0 && point.z() > 0.0)) return 0.0;
      const Eigen::Vector2d miss = pixels_of_pitch * (wanted - point.head<2>() / point.z());
      const double miss_px = miss.norm();
      if (miss_px <= close_px || (round + 1 == search_rounds && miss_px < max_miss_px))
        return point.z();
      source += miss;
    }
    return 0.0;
  }

 private:
  const DepthImage& taken_;
  const LensRays::Table& rays_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d shift_;
};

// Returns the depth image registered to the color camera.
DepthImage registered_depth(const RgbdFrame& frame, const Pose& color_from_depth, LensRays& rays) {
  const DepthImage& taken = frame.depth;
  DepthImage seen(taken.width, taken.height);
  if (taken.width < 2 || taken.height < 2) return seen;
  RgbdFrame depth_only;
  depth_only.cameras = frame.cameras;
  depth_only.depth = taken;
  const auto table = rays.rays_of(camera_views(depth_only).front().depth_camera);
  const DepthSearch search(taken, *table, color_from_depth);
  for (int y = 0; y < taken.height; ++y) {
    Eigen::Vector2d offset = Eigen::Vector2d::Zero();  // offset of the previous pixel
    for (int x = 0; x < taken.width; ++x) {
      Eigen::Vector2d source = Eigen::Vector2d(x, y) + offset;
      double z = search.find(x, y, source);
      if (!(z > 0.0) && !offset.isZero(0.0)) z = search.find(x, y, source = Eigen::Vector2d(x, y));
      offset = z > 0.0 ? Eigen::Vector2d(source - Eigen::Vector2d(x, y)) : Eigen::Vector2d::Zero();
      seen.at(x, y) = static_cast<float>(z);
    }
  }
  return seen;
}

void apply(RgbdFrame& frame, const CameraFile& calibration, LensRays& rays) {
  if (frame.cameras.empty() && frame.stereo.empty()) return;
  if (frame.cameras.size() != 1 || !frame.stereo.empty())
    throw Error("a calibration file describes one camera, but the frame has several",
                {.field = "number of cameras",
                 .value = std::to_string(frame.cameras.size() + 2 * frame.stereo.size()),
                 .bound = "1"});
  Camera& camera = frame.cameras.front();
  const Camera& known = calibration.camera;
  if (camera.width != known.width || camera.height != known.height)
    throw Error("differs from the calibration", {.field = "size of the camera's image",
                                                 .value = size_text(camera.width, camera.height),
                                                 .bound = size_text(known.width, known.height)});
  const Pose base_from_camera = camera.base_from_camera;
  // Uses the stored camera, for which the transform was estimated.
  const Pose color_from_depth =
      calibration.color_from_depth_at(frame.stamp_s, frame.depth_stamp_offset_s);
  if (!color_from_depth.matrix().isIdentity(0.0))
    frame.depth = registered_depth(frame, color_from_depth, rays);
  camera = known;
  camera.base_from_camera = base_from_camera;
  correct_depth(frame.depth, calibration.depth);
}

RgbdFrame CalibratedScan::read_frame(int node, FrameParts parts) const {
  RgbdFrame frame = scan_->read_frame(node, parts);
  in_file(scan_->path(), [&] {
    in_field("node " + std::to_string(node), [&] { apply(frame, calibration_, rays_); });
  });
  return frame;
}

}  // namespace

void apply_calibration(RgbdFrame& frame, const CameraFile& calibration) {
  LensRays rays;
  apply(frame, calibration, rays);
}

std::unique_ptr<ScanSource> with_calibration(std::unique_ptr<ScanSource> scan,
                                             const CameraFile& calibration) {
  return std::make_unique<CalibratedScan>(std::move(scan), calibration);
}

}  // namespace libmap
