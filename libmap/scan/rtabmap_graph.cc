#include "libmap/scan/rtabmap_blobs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <tuple>
#include <utility>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/error.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace {

constexpr std::size_t max_warnings = 100;

class Warnings {
 public:
  explicit Warnings(std::vector<std::string>& list) : list_(list) {}
  ~Warnings() {
    if (count_ > max_warnings)
      list_.push_back("... and " + std::to_string(count_ - max_warnings) + " more");
  }
  Warnings(const Warnings&) = delete;
  Warnings& operator=(const Warnings&) = delete;

  void add(const std::string& text) {
    if (++count_ <= max_warnings) list_.push_back(text);
  }

  // Returns make(); on Error, adds a warning and returns nullopt.
  template <typename Make>
  auto attempt(const std::string& what, const Make& make) -> decltype(make()) {
    try {
      return make();
    } catch (const Error& error) {
      add(what + ": " + error.what());
      return std::nullopt;
    }
  }

 private:
  std::vector<std::string>& list_;
  std::size_t count_ = 0;
};

std::optional<int> as_id(std::int64_t number) {
  return std::in_range<int>(number) ? std::optional(static_cast<int>(number)) : std::nullopt;
}

std::string node_text(std::int64_t id) { return "node " + std::to_string(id); }

// ------------------------------------------------------------------------------------------ nodes

std::optional<Pose> pose_in(const SqliteRow& row, int column, const std::string& what,
                            Warnings& warnings) {
  const std::string bytes = row.bytes(column);
  if (bytes.empty()) return std::nullopt;
  return warnings.attempt(what, [&] { return decode_pose(bytes); });
}

// Columns: id map_id weight stamp label pose ground_truth_pose velocity gps.
GraphNode node_in(const SqliteRow& row, int id, Warnings& warnings) {
  const std::string what = node_text(id);
  GraphNode node{.id = id,
                 .session = as_id(row.integer(1)).value_or(0),
                 .weight = as_id(row.integer(2)).value_or(0)};
  node.stamp_s = row.is_null(3) ? 0.0 : row.real(3);
  if (!std::isfinite(node.stamp_s)) node.stamp_s = 0.0;
  node.label = row.bytes(4);
  node.label.resize(std::min(node.label.find('\0'), node.label.size()));
  node.odometry_from_base = pose_in(row, 5, what + ": pose", warnings);
  node.truth_from_base = pose_in(row, 6, what + ": ground_truth_pose", warnings);
  if (const std::string bytes = row.bytes(7); !bytes.empty())
    node.velocity = warnings.attempt(what + ": velocity", [&] { return decode_velocity(bytes); });
  if (const std::string bytes = row.bytes(8); !bytes.empty())
    node.gps = warnings.attempt(what + ": gps", [&] { return decode_gps(bytes); });
  return node;
}

void read_nodes(const SqliteFile& file, const RtabmapColumns& columns, PoseGraph& graph,
                Warnings& warnings) {
  std::string list = "id";
  for (const char* name :
       {"map_id", "weight", "stamp", "label", "pose", "ground_truth_pose", "velocity", "gps"})
    list += ", " + columns.or_null("Node", name);
  file.each_row("SELECT " + list + " FROM Node ORDER BY id", {}, [&](const SqliteRow& row) {
    const std::optional<int> id = as_id(row.integer(0));
    if (!id || *id <= 0)
      warnings.add(node_text(row.integer(0)) + ": dropped: ids start at 1");
    else
      graph.nodes.push_back(node_in(row, *id, warnings));
  });
  // SQLite's order differs if the column contains texts.
  std::stable_sort(graph.nodes.begin(), graph.nodes.end(),
                   [](const GraphNode& a, const GraphNode& b) { return a.id < b.id; });
  const auto is_again = [&](const GraphNode& a, const GraphNode& b) {
    if (a.id != b.id) return false;
    warnings.add(node_text(a.id) + ": occurs more than once; the first row is used");
    return true;
  };
  graph.nodes.erase(std::unique(graph.nodes.begin(), graph.nodes.end(), is_again),
                    graph.nodes.end());
}

// ------------------------------------------------------------------------------------------ links

Matrix6d information_of(double rotation_variance, double translation_variance) {
  if (!(rotation_variance > 0) || !(translation_variance > 0) ||
      !std::isfinite(rotation_variance) || !std::isfinite(translation_variance))
    throw Error("not finite and positive", {.field = "variance"});
  if (1 / translation_variance > max_information || 1 / rotation_variance > max_information)
    throw Error("larger than 1e300", {.field = "reciprocal of the variance"});
  Matrix6d information = Matrix6d::Zero();
  information.diagonal() << Eigen::Vector3d::Constant(1 / translation_variance),
      Eigen::Vector3d::Constant(1 / rotation_variance);
  return information;
}

enum class InformationForm { matrix, two_variances, one_variance, none };

class LinkReader {
 public:
  LinkReader(const SqliteFile& file, const RtabmapColumns& columns, PoseGraph& graph,
             Warnings& warnings)
      : file_(file), columns_(columns), graph_(graph), warnings_(warnings) {}

  void read() {
    form_ = form();
    std::string list = "from_id, to_id, type, transform";
    if (form_ == InformationForm::matrix) list += ", information_matrix";
    if (form_ == InformationForm::two_variances) list += ", rot_variance, trans_variance";
    if (form_ == InformationForm::one_variance) list += ", variance";
    file_.each_row("SELECT " + list + " FROM Link ORDER BY from_id, to_id, type, rowid", {},
                   [&](const SqliteRow& row) { take(row); });
    for (const auto& [key, link] : links_) graph_.links.push_back(link);
  }

 private:
  InformationForm form() const {
    if (columns_.has("Link", "information_matrix")) return InformationForm::matrix;
    if (columns_.has("Link", "rot_variance")) return InformationForm::two_variances;
    if (columns_.has("Link", "variance")) return InformationForm::one_variance;
    return InformationForm::none;
  }

  void take(const SqliteRow& row) {
    const std::string what =
        "link " + std::to_string(row.integer(0)) + " -> " + std::to_string(row.integer(1));
    try {
      if (const std::optional<PoseLink> link = link_in(row)) keep(*link);
    } catch (const Error& error) {
      warnings_.add(what + ": dropped: " + error.what());
    }
  }

  // Returns nullopt for a null transform, which RTAB-Map stores after a loss of odometry.
  std::optional<PoseLink> link_in(const SqliteRow& row) const {
    const std::optional<int> from = as_id(row.integer(0));
    const std::optional<int> to = as_id(row.integer(1));
    const std::optional<int> type = as_id(row.integer(2));
    if (!from || !to || !type) throw Error("node ids or type of the link are invalid");
    PoseLink link{.from = *from, .to = *to, .type = static_cast<LinkType>(*type)};
    // Before 0.7.4, the types were neighbor, loop closure and child.
    if (form_ == InformationForm::none && *type != 0) link.type = LinkType::global_closure;
    check_ends(link);
    const std::optional<Pose> pose = decode_pose(row.bytes(3));
    if (!pose) return std::nullopt;
    link.from_from_to = *pose;
    if (form_ == InformationForm::matrix) link.information = decode_information(row.bytes(4));
    if (form_ == InformationForm::two_variances)
      link.information = information_of(row.real(4), row.real(5));
    if (form_ == InformationForm::one_variance)
      link.information = information_of(row.real(4), row.real(4));
    return link;
  }

  void check_ends(const PoseLink& link) const {
    if (graph_.find_node(link.from) == nullptr) throw Error(node_text(link.from) + " is missing");
    if (link.type != LinkType::landmark && graph_.find_node(link.to) == nullptr)
      throw Error(node_text(link.to) + " is missing");
    if (link.from == link.to && !is_absolute(link))
      throw Error("a " + to_text(link.type) + " link from a node to itself");
  }

  // Rows are in ascending order of `from`, so the direction from the lower node is first.
  void keep(const PoseLink& link) {
    const auto [low, high] = std::minmax(link.from, link.to);
    links_.try_emplace({low, high, static_cast<int>(link.type)}, link);
  }

  const SqliteFile& file_;
  const RtabmapColumns& columns_;
  PoseGraph& graph_;
  Warnings& warnings_;
  InformationForm form_ = InformationForm::none;
  std::map<std::tuple<int, int, int>, PoseLink> links_;
};

// -------------------------------------------------------------------------------- optimized poses

std::map<int, Pose> decode_optimized_poses(const std::string& ids_blob,
                                           const std::string& poses_blob, const PoseGraph& graph,
                                           Warnings& warnings) {
  require_optimized_poses(ids_blob, poses_blob);
  const auto list = decode_matrix(ids_blob).values<std::int32_t>();
  const StoredMatrix poses = decode_matrix(poses_blob);
  std::map<int, Pose> map_from_base;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const auto pose = warnings.attempt(node_text(list[i]) + ": Admin.opt_poses", [&] {
      return decode_pose(std::string_view(poses.bytes).substr(i * pose_bytes, pose_bytes));
    });
    // Other ids are landmarks and deleted nodes.
    if (pose && graph.find_node(list[i]) != nullptr) map_from_base.emplace(list[i], *pose);
  }
  return map_from_base;
}

void read_optimized_poses(const SqliteFile& file, const RtabmapColumns& columns, PoseGraph& graph,
                          Warnings& warnings) {
  if (!columns.has("Admin", "opt_ids") || !columns.has("Admin", "opt_poses")) return;
  std::string ids;
  std::string poses;
  file.each_row("SELECT opt_ids, opt_poses FROM Admin LIMIT 1", {}, [&](const SqliteRow& row) {
    ids = row.bytes(0);
    poses = row.bytes(1);
  });
  if (is_absent(ids) || is_absent(poses)) return;
  try {
    graph.optimized_map_from_base = decode_optimized_poses(ids, poses, graph, warnings);
  } catch (const Error& error) {
    warnings.add(std::string("Admin.opt_poses: ") + error.what());
  }
}

}  // namespace

RtabmapGraph read_rtabmap_graph(const SqliteFile& file, const RtabmapColumns& columns) {
  RtabmapGraph result;
  Warnings warnings(result.warnings);
  read_nodes(file, columns, result.graph, warnings);
  if (columns.has_table("Link")) LinkReader(file, columns, result.graph, warnings).read();
  read_optimized_poses(file, columns, result.graph, warnings);
  return result;
}

}  // namespace libmap
