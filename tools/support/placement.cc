#include "tools/support/placement.h"

#include <filesystem>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"
#include "tools/support/option_values.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

libmap::Pose read_matrix(const fs::path& path) {
  const std::string file = path.string();
  const std::string text = libmap::read_whole_file(path, std::uint64_t{1} << 16U);
  const auto refuse = [&](const std::string& field, const std::string& value) {
    throw libmap::Error(
        "not a transform",
        {.file = file, .field = field, .value = value, .bound = "four rows of four numbers"});
  };
  Eigen::Matrix4d matrix;
  Eigen::Index row = 0;
  for (const libmap::TextLine& line : libmap::split_lines(text)) {
    if (libmap::is_comment(line)) continue;
    if (row == 4 || line.words.size() != 4) refuse(libmap::name_of(line), {});
    matrix.row(row++) = Eigen::RowVector4d(libmap::numbers_of(line, 0, 4, file).data());
  }
  if (row != 4) refuse("rows", std::to_string(row));
  constexpr double tolerance = 1e-3;
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  if (!(rotation.transpose() * rotation).isApprox(Eigen::Matrix3d::Identity(), tolerance) ||
      !(rotation.determinant() > 0.0) || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw libmap::Error("not a rigid transform (rotation and translation)", {.file = file});
  libmap::Pose pose = libmap::Pose::Identity();
  pose.linear() = libmap::nearest_rotation(rotation);
  pose.translation() = matrix.topRightCorner<3, 1>();
  return pose;
}

}  // namespace

libmap::Pose parse_transform(const std::string& text, const std::string& field) {
  if (text.empty()) return libmap::Pose::Identity();
  if (fs::exists(text)) return read_matrix(text);
  const std::vector<double> n = parse_numbers(
      text, 6, field, "X,Y,Z,ROLL,PITCH,YAW in meters and degrees, or a file of a 4 x 4 matrix");
  return libmap::make_pose_from_rpy({n[0], n[1], n[2]}, {n[3], n[4], n[5]});
}

std::string transform_text(const libmap::Pose& pose) {
  std::string text;
  const auto add = [&](double value, int decimals) {
    const std::string number = libmap::to_fixed_text(value, decimals);
    // Numbers that round to zero get no sign.
    text += (number.find_first_of("123456789") == std::string::npos
                 ? libmap::to_fixed_text(0.0, decimals)
                 : number) +
            ",";
  };
  for (const double length : pose.translation()) add(length, 7);
  for (const double angle_deg : libmap::roll_pitch_yaw_deg(pose)) add(angle_deg, 6);
  text.pop_back();
  return text;
}

std::optional<libmap::Bounds3d> parse_box(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const char* bound = "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX in meters";
  const std::vector<double> n = parse_numbers(text, 6, "--box", bound);
  const libmap::Bounds3d box{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
  if ((box.min.array() > box.max.array()).any())
    throw libmap::Error("a minimum of the box is above its maximum",
                        {.file = {}, .field = "--box", .value = text, .bound = bound});
  return box;
}

bool is_inside(const std::optional<libmap::Bounds3d>& box, const Eigen::Vector3d& point) {
  return !box ||
         ((point.array() >= box->min.array()).all() && (point.array() <= box->max.array()).all());
}

libmap::PointCloud part_in_box(const libmap::PointCloud& cloud,
                               const std::optional<libmap::Bounds3d>& box,
                               const std::string& file) {
  std::vector<std::size_t> inside;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (is_inside(box, cloud.positions[n])) inside.push_back(n);
  if (inside.empty())
    throw cloud.empty() ? libmap::no_elements("points of the cloud", file)
                        : libmap::Error("no point is in the box", {.file = file, .field = "--box"});
  return libmap::select_points(cloud, inside);
}

}  // namespace graspmap_tools
