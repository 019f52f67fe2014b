#include "libmap/poses/trajectory_text.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "libmap/core/camera.h"
#include "libmap/core/error.h"
#include "libmap/core/json_input.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"

namespace libmap {

namespace {

constexpr double rotation_tolerance = 0.05;  // maximum deviation of R^T R from the identity

// Number of entries in the upper triangle of a symmetric 6 x 6 matrix.
constexpr std::size_t triangle_size = 21;

constexpr std::string_view type_comment = "graspmap:type";
constexpr std::string_view edge_comment = "graspmap:edge";

// Parses x y z qx qy qz qw.
Pose pose_from_words(const TextLine& line, std::size_t first, const std::string& file) {
  const std::vector<double> n = numbers_of(line, first, 7, file);
  return pose_of(line, Eigen::Vector3d(n[0], n[1], n[2]),
                 Eigen::Quaterniond(n[6], n[3], n[4], n[5]), file);
}

std::string pose_to_words(const Pose& pose) {
  const Eigen::Quaterniond q = quaternion_of(pose);
  const Eigen::Vector3d t = pose.translation();
  return to_words({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
}

// Parses x y z roll pitch yaw, radians.
Pose pose_from_angles(const TextLine& line, std::size_t first, const std::string& file) {
  const std::vector<double> n = numbers_of(line, first, 6, file);
  const Eigen::Vector3d angles_rad(n[3], n[4], n[5]);
  const Pose pose =
      make_pose_from_rpy(Eigen::Vector3d(n[0], n[1], n[2]), angles_rad * (180.0 / M_PI));
  return pose_of(line, pose.translation(), Eigen::Quaterniond(pose.linear()), file);
}

std::string pose_to_angles(const Pose& pose) {
  // Adding 0 removes the sign of -0.
  const Eigen::Vector3d angles_rad = (roll_pitch_yaw_deg(pose) * (M_PI / 180.0)).array() + 0.0;
  const Eigen::Vector3d t = pose.translation();
  return to_words({t.x(), t.y(), t.z(), angles_rad.x(), angles_rad.y(), angles_rad.z()});
}

// Returns the pose of the first 12 numbers, [R|t] in row-major order.
Pose pose_of_rows(const TextLine& line, const std::vector<double>& numbers,
                  const std::string& file) {
  Eigen::Matrix<double, 3, 4> matrix;
  for (int i = 0; i < 12; ++i) matrix(i / 4, i % 4) = numbers[static_cast<std::size_t>(i)];
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  const double deviation =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(deviation <= rotation_tolerance) || rotation.determinant() <= 0.0)
    throw in_line("not a rotation", line, file,
                  "a matrix with determinant " + to_text(rotation.determinant()),
                  "orthogonal, determinant 1");
  const Eigen::Matrix3d nearest = nearest_rotation(rotation);
  Pose pose = pose_of(line, matrix.col(3), Eigen::Quaterniond(nearest), file);
  pose.linear() = nearest;
  return pose;
}

struct GraphFormat {
  std::string_view vertex_tag;
  std::string_view edge_tag;
  std::string_view planar_mark;  // in tags of planar graphs
  std::size_t pose_words;
  double angle_factor;  // ratio of an angle's error to the error in the file
  Pose (*pose_from)(const TextLine& line, std::size_t first, const std::string& file);
  std::string (*pose_to)(const Pose& pose);
};
constexpr GraphFormat g2o_format = {"VERTEX_SE3:QUAT", "EDGE_SE3:QUAT", "_SE2", 7, 2.0,
                                    pose_from_words,   pose_to_words};
constexpr GraphFormat toro_format = {"VERTEX3", "EDGE3",          "2",           6,
                                     1.0,       pose_from_angles, pose_to_angles};

double factor_of(const GraphFormat& format, int row, int column) {
  return (row < 3 ? 1.0 : format.angle_factor) * (column < 3 ? 1.0 : format.angle_factor);
}

std::string information_to_words(const GraphFormat& format, const Matrix6d& information) {
  std::string text;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      text += " " + to_text(information(row, column) * factor_of(format, row, column));
  return text;
}

Matrix6d information_from_words(const GraphFormat& format, const TextLine& line, std::size_t first,
                                const std::string& file) {
  const std::vector<double> numbers = numbers_of(line, first, triangle_size, file);
  Matrix6d information;
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const double value = numbers[next++] / factor_of(format, row, column);
      if (!(std::abs(value) <= max_information))
        throw in_line("information entry is too large", line, file, to_text(value), "<= 1e300");
      information(row, column) = value;
      information(column, row) = value;
    }
  }
  return information;
}

// Parses from, to, pose and information, starting at word `first`.
PoseLink link_from_words(const GraphFormat& format, const TextLine& line, std::size_t first,
                         const std::string& file) {
  PoseLink link;
  link.from = integer_of(line, first, file);
  link.to = integer_of(line, first + 1, file);
  link.from_from_to = format.pose_from(line, first + 2, file);
  link.information = information_from_words(format, line, first + 2 + format.pose_words, file);
  return link;
}

std::string vertices_to_text(const GraphFormat& format, const Trajectory& poses) {
  std::string text;
  for (const TrajectoryPose& pose : poses)
    text += std::string(format.vertex_tag) + " " + std::to_string(pose.node) +
            format.pose_to(pose.world_from_base) + "\n";
  return text;
}

std::string link_to_words(const GraphFormat& format, const PoseLink& link) {
  return std::to_string(link.from) + " " + std::to_string(link.to) +
         format.pose_to(link.from_from_to) + information_to_words(format, link.information);
}

bool is_edge(const PoseLink& link) { return link.from != link.to && link.from > 0 && link.to > 0; }

// Edges between consecutive vertices are odometry, as g2o's tools write it.
void guess_type(PoseLink& link, const std::set<int>& vertices) {
  const auto [low, high] = std::minmax(link.from, link.to);
  const auto next = vertices.upper_bound(low);
  const bool follows =
      vertices.empty() ? high > low && high - 1 == low : next != vertices.end() && *next == high;
  link.type = follows ? LinkType::neighbor : LinkType::global_closure;
}

struct GraphReader {
  const GraphFormat& format;
  const std::string& file;
  PoseGraphText graph{};
  std::optional<LinkType> type{};
  std::set<int> vertices{};
  std::vector<std::size_t> untyped{};

  void add_link(const TextLine& line, std::size_t first) {
    PoseLink link = link_from_words(format, line, first, file);
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
    if (tag == format.vertex_tag) {
      const int id = integer_of(line, 1, file);
      if (!vertices.insert(id).second) throw duplicate(line, "vertex " + std::to_string(id), file);
      graph.poses.push_back({id, 0.0, format.pose_from(line, 2, file)});
    } else if (tag == format.edge_tag) {
      add_link(line, 1);
    } else if (tag.find(format.planar_mark) != std::string_view::npos) {
      throw in_line("planar pose graphs are not supported", line, file, std::string(tag),
                    std::string(format.vertex_tag) + " or " + std::string(format.edge_tag));
    }
  }

  PoseGraphText read(std::string_view text) {
    for (const TextLine& line : split_lines(text)) {
      if (is_comment(line))
        read_comment(line);
      else
        read_record(line);
    }
    for (const std::size_t index : untyped) guess_type(graph.links[index], vertices);
    return std::move(graph);
  }
};

}  // namespace

std::string stamp_text(double stamp_s) {
  constexpr int max_decimals = 9;
  std::string text = to_text(stamp_s);
  if (text.find('e') == std::string::npos) return text;
  for (int decimals = 1; decimals <= max_decimals; ++decimals) {
    text = to_fixed_text(stamp_s, decimals);
    if (parse_double(text) == stamp_s) break;
  }
  return text;
}

Trajectory parse_tum(std::string_view text, const std::string& file) {
  Trajectory trajectory;
  std::set<int> nodes;
  for (const TextLine& line : split_lines(text)) {
    if (is_comment(line)) continue;
    if (line.words.size() != 8 && line.words.size() != 9)
      throw wrong_columns("not a pose", line, file, "stamp x y z qx qy qz qw [node]");
    TrajectoryPose pose;
    pose.stamp_s = numbers_of(line, 0, 1, file).front();
    pose.world_from_base = pose_from_words(line, 1, file);
    if (line.words.size() == 9) {
      pose.node = integer_of(line, 8, file);
      if (!nodes.insert(pose.node).second)
        throw duplicate(line, "node " + std::to_string(pose.node), file);
    }
    trajectory.push_back(pose);
  }
  return trajectory;
}

std::string to_tum(const Trajectory& trajectory, bool nodes) {
  std::string text = nodes ? "# stamp x y z qx qy qz qw node\n" : "# stamp x y z qx qy qz qw\n";
  for (const TrajectoryPose& pose : trajectory) {
    text += stamp_text(pose.stamp_s) + pose_to_words(pose.world_from_base);
    text += nodes ? " " + std::to_string(pose.node) + "\n" : "\n";
  }
  return text;
}

Trajectory parse_kitti(std::string_view text, const std::string& file) {
  Trajectory trajectory;
  for (const TextLine& line : split_lines(text)) {
    if (is_comment(line)) continue;
    if (line.words.size() != 12) throw wrong_columns("not a pose", line, file, "12");
    trajectory.push_back({0, 0.0, pose_of_rows(line, numbers_of(line, 0, 12, file), file)});
  }
  return trajectory;
}

Trajectory parse_open3d(std::string_view text, const std::string& file) {
  Trajectory trajectory;
  std::vector<double> rows;
  std::size_t number = 0;
  for (const TextLine& line : split_lines(text)) {
    const std::size_t row = number++ % 5;
    if (line.words.size() != (row == 0 ? 3U : 4U))
      throw wrong_columns("not a pose of Open3D", line, file, row == 0 ? "3" : "4");
    if (row == 0) rows.clear();
    if (row == 0) continue;
    const std::vector<double> numbers = numbers_of(line, 0, 4, file);
    rows.insert(rows.end(), numbers.begin(), numbers.end());
    if (row == 4) trajectory.push_back({0, 0.0, pose_of_rows(line, rows, file)});
  }
  if (number % 5 != 0)
    throw Error("the last pose is truncated",
                {.file = file, .field = "lines", .value = std::to_string(number)});
  return trajectory;
}

Trajectory parse_euroc(std::string_view text, const std::string& file) {
  Trajectory trajectory;
  for (const TextLine& line : split_lines(text)) {
    if (is_comment(line)) continue;
    if (line.words.size() < 8)
      throw wrong_columns("not a pose", line, file, "timestamp [ns], x, y, z, qw, qx, qy, qz, ...");
    const std::vector<double> n = numbers_of(line, 0, 8, file);
    const Pose pose = pose_of(line, Eigen::Vector3d(n[1], n[2], n[3]),
                              Eigen::Quaterniond(n[4], n[5], n[6], n[7]), file);
    trajectory.push_back({0, 1e-9 * n[0], pose});
  }
  return trajectory;
}

std::vector<ImagePose> parse_nerfstudio(std::string_view text, const std::string& file) {
  std::vector<ImagePose> images;
  try {
    const auto json = parse_json<nlohmann::json>(std::string(text));
    for (const auto& frame : json.at("frames")) {
      const TextLine entry{images.size() + 1, {}, {}};
      std::vector<double> rows;
      for (const auto& row : frame.at("transform_matrix"))
        for (const auto& value : row) rows.push_back(value.get<double>());
      if (rows.size() < 12)
        throw in_line("not a matrix", entry, file, std::to_string(rows.size()), "12 or 16 numbers");
      Pose pose = pose_of_rows(entry, rows, file);
      // OpenGL's camera: y up, z backward.
      pose.linear().rightCols<2>() = -pose.linear().rightCols<2>();
      images.push_back({frame.at("file_path").get<std::string>(), pose});
    }
  } catch (const nlohmann::json::exception& error) {
    throw Error(std::string("not a transforms.json of nerfstudio: ") + error.what(),
                {.file = file});
  }
  return images;
}

std::string to_kitti(const Trajectory& trajectory) {
  std::string text;
  for (const TrajectoryPose& pose : trajectory)
    for (int i = 0; i < 12; ++i)
      text += to_text(pose.world_from_base.matrix()(i / 4, i % 4)) + (i < 11 ? " " : "\n");
  return text;
}

PoseGraphText parse_g2o(std::string_view text, const std::string& file) {
  return GraphReader{g2o_format, file}.read(text);
}

std::string to_g2o(const Trajectory& poses, const std::vector<PoseLink>& links) {
  std::string text =
      "# information matrices in the order x y z qx qy qz: half angles, as g2o defines them\n" +
      vertices_to_text(g2o_format, poses);
  std::optional<LinkType> type;
  for (const PoseLink& link : links) {
    if (link.type != type)
      text += "# " + std::string(type_comment) + " " + std::to_string(static_cast<int>(link.type)) +
              " " + to_text(link.type) + "\n";
    type = link.type;
    text += is_edge(link) ? std::string(g2o_format.edge_tag) : "# " + std::string(edge_comment);
    text += " " + link_to_words(g2o_format, link) + "\n";
  }
  return text;
}

PoseGraphText parse_toro(std::string_view text, const std::string& file) {
  return GraphReader{toro_format, file}.read(text);
}

std::string to_toro(const Trajectory& poses, const std::vector<PoseLink>& links) {
  std::string text = vertices_to_text(toro_format, poses);
  for (const PoseLink& link : links)
    if (is_edge(link))
      text += std::string(toro_format.edge_tag) + " " + link_to_words(toro_format, link) + "\n";
  return text;
}

namespace {

// RTAB-Map's world axes of motion capture: map = map_from_motion_capture() * world.
Pose map_from_motion_capture() {
  Pose pose = Pose::Identity();
  pose.linear() << 0, 0, 1, 0, -1, 0, 1, 0, 0;
  return pose;
}

}  // namespace

// rtabmap/corelib/src/Graph.cpp, importPoses: P = A (O Q O^-1) of format 1, P = O Q O^-1 of format
// 2, with O the axes of an optical frame.
Pose from_axes(PoseAxes axes, const Pose& pose_in_file) {
  const Pose optical = optical_to_body_rotation();
  switch (axes) {
    case PoseAxes::map:
      return pose_in_file;
    case PoseAxes::optical:
      return optical * pose_in_file * optical.inverse();
    case PoseAxes::motion_capture:
      return map_from_motion_capture() * optical * pose_in_file * optical.inverse();
  }
  return pose_in_file;
}

Pose to_axes(PoseAxes axes, const Pose& world_from_base) {
  const Pose optical = optical_to_body_rotation();
  switch (axes) {
    case PoseAxes::map:
      return world_from_base;
    case PoseAxes::optical:
      return optical.inverse() * world_from_base * optical;
    case PoseAxes::motion_capture:
      return optical.inverse() * map_from_motion_capture().inverse() * world_from_base * optical;
  }
  return world_from_base;
}

std::string recognize_poses(std::string_view text, const std::string& file) {
  if (const std::size_t begin = text.find_first_not_of("\xEF\xBB\xBF \t\r\n");
      begin != std::string_view::npos && text[begin] == '{')
    return ".json";
  const std::vector<TextLine> lines = split_lines(text);
  for (const TextLine& line : lines) {
    // EuRoC's header contains the names of the columns.
    if (is_comment(line) && line.text.find("q_RS_w") < line.text.find("q_RS_x")) return ".euroc";
    if (is_comment(line)) continue;
    if (line.words.size() == 3 && &line != &lines.back() && (&line + 1)->words.size() == 4)
      return ".log";
    const std::string_view tag = line.words[0];
    for (const char* start : {"VERTEX_", "EDGE_", "PARAMS_", "FIX"})
      if (tag.starts_with(start)) return ".g2o";
    for (const char* start : {"VERTEX", "EDGE"})
      if (tag.starts_with(start)) return ".toro";
    if (line.words.size() == 12) return ".kitti";
    if (line.words.size() == 8 || line.words.size() == 9) return ".tum";
    throw wrong_columns("unknown pose format", line, file,
                        "8 or 9 of TUM, 12 of KITTI, 3 of Open3D, or VERTEX... of g2o or TORO");
  }
  throw no_elements("poses", file);
}

}  // namespace libmap
