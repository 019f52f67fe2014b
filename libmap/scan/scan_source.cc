#include "libmap/scan/scan_source.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/frame_folder.h"
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
    throw Error("is no scan: neither a database of RTAB-Map nor a folder of images",
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

  // Of the first.
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
      throw Error("the scan has no such node",
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
  std::int64_t step = 10;
  while (step <= largest) step *= 10;
  if (step > most)
    throw Error("node numbers are too large for so many scans",
                {.file = path().string(),
                 .field = "node",
                 .value = std::to_string(largest),
                 .bound = "< " + std::to_string(most / 10)});
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
  if (scans.empty()) throw Error("no scan is given");
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

}  // namespace libmap
