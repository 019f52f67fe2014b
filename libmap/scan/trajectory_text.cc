#include "libmap/scan/trajectory_text.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/scan/text_lines.h"

namespace libmap {

namespace {

constexpr double rotation_tolerance = 0.05;  // of a quaternion's length, or of R^T R

// Upper triangle of a symmetric 6 x 6 matrix.
constexpr std::size_t triangle_size = 21;

constexpr std::string_view vertex_tag = "VERTEX_SE3:QUAT";
constexpr std::string_view edge_tag = "EDGE_SE3:QUAT";
constexpr std::string_view type_comment = "graspmap:type";
constexpr std::string_view edge_comment = "graspmap:edge";

Error no_rotation(const TextLine& line, const std::string& file, double value,
                  const std::string& bound) {
  return Error("no rotation",
               {.file = file, .field = name_of(line), .value = to_text(value), .bound = bound});
}

// x y z qx qy qz qw.
Pose pose_from_words(const TextLine& line, std::size_t first, const std::string& file) {
  const std::vector<double> n = numbers_of(line, first, 7, file);
  const Eigen::Quaterniond rotation(n[6], n[3], n[4], n[5]);
  if (!(std::abs(rotation.norm() - 1.0) <= rotation_tolerance))
    throw no_rotation(line, file, rotation.norm(), "a quaternion of length 1");
  return make_pose(Eigen::Vector3d(n[0], n[1], n[2]), rotation);
}

// x y z qx qy qz qw; of the two quaternions that mean the same the one with qw >= 0.
std::string pose_to_words(const Pose& pose) {
  Eigen::Quaterniond rotation(pose.linear());
  rotation.normalize();
  if (rotation.w() < 0.0) rotation.coeffs() *= -1.0;
  const Eigen::Vector3d t = pose.translation();
  std::string text;
  for (const double value :
       {t.x(), t.y(), t.z(), rotation.x(), rotation.y(), rotation.z(), rotation.w()})
    text += (text.empty() ? "" : " ") + to_text(value);
  return text;
}

// How many times larger an error of an angle is than of its quaternion.
double rotation_factor(int index) { return index < 3 ? 1.0 : 2.0; }

std::string information_to_words(const Matrix6d& information) {
  std::string text;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      text +=
          " " + to_text(information(row, column) * rotation_factor(row) * rotation_factor(column));
  return text;
}

Matrix6d information_from_words(const TextLine& line, std::size_t first, const std::string& file) {
  const std::vector<double> numbers = numbers_of(line, first, triangle_size, file);
  Matrix6d information;
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const double value = numbers[next++] / (rotation_factor(row) * rotation_factor(column));
      information(row, column) = value;
      information(column, row) = value;
    }
  }
  return information;
}

// from to, pose, information, from word `first` on.
PoseLink link_from_words(const TextLine& line, std::size_t first, const std::string& file) {
  PoseLink link;
  link.from = integer_of(line, first, file);
  link.to = integer_of(line, first + 1, file);
  link.from_from_to = pose_from_words(line, first + 2, file);
  link.information = information_from_words(line, first + 9, file);
  return link;
}

std::string link_to_words(const PoseLink& link) {
  return std::to_string(link.from) + " " + std::to_string(link.to) + " " +
         pose_to_words(link.from_from_to) + information_to_words(link.information);
}

bool is_edge(const PoseLink& link) { return link.from != link.to && link.from > 0 && link.to > 0; }

// Edges between vertices that follow each other are odometry, as g2o's own tools write it.
void guess_type(PoseLink& link, const std::set<int>& vertices) {
  const auto [low, high] = std::minmax(link.from, link.to);
  const auto next = vertices.upper_bound(low);
  const bool follows = vertices.empty() ? high == low + 1 : next != vertices.end() && *next == high;
  link.type = follows ? LinkType::neighbor : LinkType::global_closure;
}

struct G2oReader {
  const std::string& file;
  PoseGraphText graph{};
  std::optional<LinkType> type{};
  std::set<int> vertices{};
  std::vector<std::size_t> untyped{};

  void add_link(const TextLine& line, std::size_t first) {
    PoseLink link = link_from_words(line, first, file);
    if (type)
      link.type = *type;
    else
      untyped.push_back(graph.links.size());
    graph.links.push_back(link);
  }

  void read_comment(const TextLine& line) {
    if (line.words.size() < 2 || line.words[0] != "#") return;
    if (line.words[1] == type_comment) type = LinkType{integer_of(line, 2, file)};
    if (line.words[1] == edge_comment) add_link(line, 2);
  }

  void read_record(const TextLine& line) {
    const std::string_view tag = line.words[0];
    if (tag == vertex_tag) {
      const int id = integer_of(line, 1, file);
      if (!vertices.insert(id).second)
        throw Error(
            "stands twice",
            {.file = file, .field = name_of(line), .value = "vertex " + std::to_string(id)});
      graph.poses.push_back({id, 0.0, pose_from_words(line, 2, file)});
    } else if (tag == edge_tag) {
      add_link(line, 1);
    } else if (tag.find("_SE2") != std::string_view::npos) {
      throw Error("a planar pose graph", {.file = file,
                                          .field = name_of(line),
                                          .value = std::string(tag),
                                          .bound = "VERTEX_SE3:QUAT or EDGE_SE3:QUAT"});
    }
  }
};

}  // namespace

std::string stamp_text(double stamp_s) {
  constexpr int most_decimals = 9;
  std::string text = to_text(stamp_s);
  if (text.find('e') == std::string::npos) return text;
  for (int decimals = 1; decimals <= most_decimals; ++decimals) {
    text = to_fixed_text(stamp_s, decimals);
    if (parse_double(text) == stamp_s) break;
  }
  return text;
}

Trajectory parse_tum(std::string_view text, const std::string& file) {
  Trajectory trajectory;
  for (const TextLine& line : split_lines(text)) {
    if (is_comment(line)) continue;
    if (line.words.size() != 8 && line.words.size() != 9)
      throw Error("no pose", {.file = file,
                              .field = name_of(line),
                              .value = std::to_string(line.words.size()) + " columns",
                              .bound = "stamp x y z qx qy qz qw, and perhaps a node"});
    TrajectoryPose pose;
    pose.stamp_s = numbers_of(line, 0, 1, file).front();
    pose.world_from_base = pose_from_words(line, 1, file);
    if (line.words.size() == 9) pose.node = integer_of(line, 8, file);
    trajectory.push_back(pose);
  }
  return trajectory;
}

std::string to_tum(const Trajectory& trajectory, bool nodes) {
  std::string text = nodes ? "# stamp x y z qx qy qz qw node\n" : "# stamp x y z qx qy qz qw\n";
  for (const TrajectoryPose& pose : trajectory) {
    text += stamp_text(pose.stamp_s) + " " + pose_to_words(pose.world_from_base);
    text += nodes ? " " + std::to_string(pose.node) + "\n" : "\n";
  }
  return text;
}

Trajectory parse_kitti(std::string_view text, const std::string& file) {
  Trajectory trajectory;
  for (const TextLine& line : split_lines(text)) {
    if (is_comment(line)) continue;
    if (line.words.size() != 12)
      throw Error("no pose", {.file = file,
                              .field = name_of(line),
                              .value = std::to_string(line.words.size()) + " columns",
                              .bound = "12"});
    const std::vector<double> numbers = numbers_of(line, 0, 12, file);
    Eigen::Matrix<double, 3, 4> matrix;
    for (int i = 0; i < 12; ++i) matrix(i / 4, i % 4) = numbers[static_cast<std::size_t>(i)];
    const Eigen::Matrix3d rotation = matrix.leftCols<3>();
    const double deviation =
        (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    if (!(deviation <= rotation_tolerance) || rotation.determinant() <= 0.0)
      throw no_rotation(line, file, rotation.determinant(), "a rotation matrix, determinant 1");
    Pose pose = Pose::Identity();
    pose.linear() = nearest_rotation(rotation);
    pose.translation() = matrix.col(3);
    trajectory.push_back({0, 0.0, pose});
  }
  return trajectory;
}

std::string to_kitti(const Trajectory& trajectory) {
  std::string text;
  for (const TrajectoryPose& pose : trajectory)
    for (int i = 0; i < 12; ++i)
      text += to_text(pose.world_from_base.matrix()(i / 4, i % 4)) + (i < 11 ? " " : "\n");
  return text;
}

PoseGraphText parse_g2o(std::string_view text, const std::string& file) {
  G2oReader reader{file};
  for (const TextLine& line : split_lines(text)) {
    if (is_comment(line))
      reader.read_comment(line);
    else
      reader.read_record(line);
  }
  for (const std::size_t index : reader.untyped)
    guess_type(reader.graph.links[index], reader.vertices);
  return std::move(reader.graph);
}

std::string to_g2o(const Trajectory& poses, const std::vector<PoseLink>& links) {
  std::string text =
      "# information matrices in the order x y z qx qy qz: half angles, as g2o defines them\n";
  for (const TrajectoryPose& pose : poses)
    text += std::string(vertex_tag) + " " + std::to_string(pose.node) + " " +
            pose_to_words(pose.world_from_base) + "\n";
  std::optional<LinkType> type;
  for (const PoseLink& link : links) {
    if (link.type != type)
      text += "# " + std::string(type_comment) + " " + std::to_string(static_cast<int>(link.type)) +
              " " + to_text(link.type) + "\n";
    type = link.type;
    text += is_edge(link) ? std::string(edge_tag) : "# " + std::string(edge_comment);
    text += " " + link_to_words(link) + "\n";
  }
  return text;
}

}  // namespace libmap
