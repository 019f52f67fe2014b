#include "libgtd/gripper/gripper_urdf.h"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"
#include "libmap/core/pose.h"
#include "libmap/core/sandboxed_process.h"

namespace libgtd {

namespace {

using libmap::Error;
using libmap::Pose;
using Measures = std::vector<std::pair<std::string, std::string>>;

constexpr std::uint64_t max_data_bytes = std::uint64_t{1} << 30;
constexpr double max_length_m = 1.0;
constexpr double tolerance = 0.1;  // mm or degrees, between fingers
constexpr double max_spacing_error_deg = 1.0;
constexpr double min_tangential_cosine = 0.999;  // 2.6 degrees
constexpr double max_beside_fraction = 0.05;     // fraction of the distance from the joint

double degrees(double radians) { return radians / libmap::radians_per_degree; }

// Collects the error messages of urdfdom.
class LastMessage : public console_bridge::OutputHandler {
 public:
  LastMessage() { console_bridge::useOutputHandler(this); }
  ~LastMessage() override { console_bridge::restorePreviousOutputHandler(); }
  LastMessage(const LastMessage&) = delete;
  LastMessage& operator=(const LastMessage&) = delete;
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first_.empty()) first_ = text;
  }
  const std::string& first() const { return first_; }

 private:
  std::string first_;
};

Pose pose_of(const urdf::Pose& pose) {
  Pose result = Pose::Identity();
  result.linear() =
      Eigen::Quaterniond(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z)
          .toRotationMatrix();
  result.translation() = Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z);
  return result;
}

Eigen::Vector3d axis_of(const urdf::Joint& joint) {
  return Eigen::Vector3d(joint.axis.x, joint.axis.y, joint.axis.z).normalized();
}

Error wrong_joint(const std::string& name, const std::string& reason) {
  return Error(reason, {.field = "joint " + name});
}

// Angle as a linear function of the angle of a joint that does not mimic another.
struct Drive {
  std::string joint;
  double multiplier = 1.0;
  double offset = 0.0;
};

class Robot {
 public:
  explicit Robot(const std::string& xml) {
    const LastMessage message;
    model_ = urdf::parseURDF(xml);
    if (!model_)
      throw Error("is not a URDF" + (message.first().empty() ? "" : ": " + message.first()));
    for (const auto& [name, joint] : model_->joints_) {
      const auto [other, is_new] = parent_of_.emplace(joint->child_link_name, joint.get());
      if (!is_new)
        throw wrong_joint(name, "child link " + joint->child_link_name +
                                    " is also the child of joint " + other->second->name);
    }
  }

  const urdf::Link& link(const std::string& key, const std::string& name) const {
    const auto found = model_->links_.find(name);
    if (found == model_->links_.end()) throw missing(key, name, names_of(model_->links_));
    return *found->second;
  }
  const urdf::Joint& joint(const std::string& key, const std::string& name) const {
    const auto found = model_->joints_.find(name);
    if (found == model_->joints_.end()) throw missing(key, name, names_of(model_->joints_));
    return *found->second;
  }
  // Follows all joints that mimic each other.
  Drive drive_of(const urdf::Joint& joint) const {
    Drive drive;
    const urdf::Joint* at = &joint;
    for (std::size_t step = 0; at->mimic; ++step) {
      if (step > model_->joints_.size()) throw wrong_joint(joint.name, "mimics itself");
      drive.offset += drive.multiplier * at->mimic->offset;
      drive.multiplier *= at->mimic->multiplier;
      at = &this->joint("joint that " + at->name + " mimics", at->mimic->joint_name);
    }
    drive.joint = at->name;
    return drive;
  }
  bool has_joint(const std::string& name) const { return model_->joints_.contains(name); }
  bool has_link(const std::string& name) const { return model_->links_.contains(name); }
  std::vector<std::string> joint_names() const { return names_of(model_->joints_); }

  // Pose of link `link` in the frame of link `from`, connected by fixed joints.
  Pose fixed_pose(const std::string& from, const std::string& link) const {
    Pose pose = Pose::Identity();
    std::string at = link;
    for (std::size_t step = 0; at != from; ++step) {
      const auto found = parent_of_.find(at);
      if (found == parent_of_.end() || step > parent_of_.size())
        throw Error("is not connected by joints to link " + from, {.field = "link " + link});
      const urdf::Joint& joint = *found->second;
      if (joint.type != urdf::Joint::FIXED)
        throw wrong_joint(joint.name, "moves between links " + from + " and " + link +
                                          ", which fixed joints must connect");
      pose = pose_of(joint.parent_to_joint_origin_transform) * pose;
      at = joint.parent_link_name;
    }
    return pose;
  }

 private:
  template <typename Map>
  static std::vector<std::string> names_of(const Map& map) {
    std::vector<std::string> names;
    for (const auto& entry : map) names.push_back(entry.first);
    return names;
  }
  static Error missing(const std::string& key, const std::string& name,
                       const std::vector<std::string>& known) {
    return Error("not in the URDF" + libmap::did_you_mean(name, known),
                 {.field = key, .value = name});
  }

  urdf::ModelInterfaceSharedPtr model_;
  std::map<std::string, const urdf::Joint*> parent_of_;  // key: child link
};

struct FingerNames {
  std::string finger_joint;
  std::string spine_joint;
  std::string tip_link;
};

std::string with_star(const std::string& pattern, const std::string& text) {
  const std::size_t star = pattern.find('*');
  return star == std::string::npos ? pattern
                                   : pattern.substr(0, star) + text + pattern.substr(star + 1);
}

// Joints that match the pattern and have a spine joint or tip with the same text for '*':
// "finger_1_tip_joint" matches "finger_*_joint", too.
std::vector<FingerNames> matching_fingers(const UrdfMapping& mapping, const Robot& robot) {
  const std::string& pattern = mapping.finger_joint;
  const std::size_t star = pattern.find('*');
  const std::string begin = pattern.substr(0, star), end = pattern.substr(star + 1);
  std::vector<FingerNames> fingers;
  for (const std::string& name : robot.joint_names()) {
    if (name.size() <= begin.size() + end.size() || !name.starts_with(begin) ||
        !name.ends_with(end))
      continue;
    const std::string text = name.substr(star, name.size() - begin.size() - end.size());
    const FingerNames finger{name, with_star(mapping.spine_joint, text),
                             with_star(mapping.tip_link, text)};
    if (robot.has_joint(finger.spine_joint) || robot.has_link(finger.tip_link))
      fingers.push_back(finger);
  }
  if (fingers.empty())
    throw Error(
        "no matching joint has a urdf.spine_joint or urdf.tip_link with the same text for '*'",
        {.field = "urdf.finger_joint", .value = pattern});
  return fingers;
}

std::vector<FingerNames> finger_names(const UrdfMapping& mapping, const Robot& robot) {
  const std::string& pattern = mapping.finger_joint;
  if (pattern.find('*') != std::string::npos) return matching_fingers(mapping, robot);
  std::vector<FingerNames> fingers;
  const auto joints = libmap::split_list(pattern);
  const auto spines = libmap::split_list(mapping.spine_joint);
  const auto tips = libmap::split_list(mapping.tip_link);
  if (joints.empty() || joints.size() != spines.size() || joints.size() != tips.size())
    throw Error("lists of urdf.finger_joint, urdf.spine_joint and urdf.tip_link differ in length",
                {.field = "urdf.finger_joint", .value = pattern});
  for (std::size_t n = 0; n < joints.size(); ++n)
    fingers.push_back({joints[n], spines[n], tips[n]});
  return fingers;
}

// One finger in the frame of the palm, rotated so that z is the palm's axis toward the ground.
class Finger {
 public:
  Finger(const Robot& robot, const UrdfMapping& mapping, const FingerNames& names,
         const Eigen::Matrix3d& axis_from_palm)
      : joint_(robot.joint("urdf.finger_joint", names.finger_joint)),
        spine_(robot.joint("urdf.spine_joint", names.spine_joint)) {
    robot.link("urdf.tip_link", names.tip_link);
    require_limits(joint_);
    if (spine_.type == urdf::Joint::REVOLUTE)
      require_limits(spine_);
    else if (spine_.type != urdf::Joint::FIXED)
      throw wrong_joint(spine_.name, "is neither revolute nor fixed");
    if (spine_.mimic) couple(robot.drive_of(spine_), robot.drive_of(joint_));
    Pose palm = Pose::Identity();
    palm.linear() = axis_from_palm;
    joint_pose_ = palm * robot.fixed_pose(mapping.palm_link, joint_.parent_link_name) *
                  pose_of(joint_.parent_to_joint_origin_transform);
    spine_pose_ = robot.fixed_pose(joint_.child_link_name, spine_.parent_link_name) *
                  pose_of(spine_.parent_to_joint_origin_transform);
    tip_pose_ = robot.fixed_pose(spine_.child_link_name, names.tip_link);
    outward_ = joint_pose_.translation().head<2>();
    require_length("distance from the palm's axis", outward_.norm());
    outward_.normalize();
    require_tangential(joint_, joint_pose_.linear() * axis_of(joint_));
    if (spine_.type == urdf::Joint::REVOLUTE)
      require_tangential(spine_, turned(joint_.limits->lower).linear() * axis_of(spine_));
    find_limits();
  }

  double azimuth() const { return std::atan2(outward_.y(), outward_.x()); }

  std::map<std::string, double> measures() const {
    const double mm = 1000.0;
    const double open = open_, closed = closed_;
    std::map<std::string, double> measures = {
        {"finger_joint_diameter_mm", 2.0 * mm * joint_pose_.translation().head<2>().norm()},
        {"finger_length_mm", mm * length(spine_pose_)},
        {"spine_length_mm", mm * length(tip_pose_)},
        {"opening_angle_deg", degrees(finger_angle(open))},
        {"closing_angle_deg", degrees(finger_angle(closed))},
        {"opening_spine_radius_mm", mm * in_plane(tip(open, rest(open))).x()},
        {"opening_spine_depth_mm", mm * tip(open, rest(open)).z()},
        {"closing_height_mm", mm * tip(closed, rest(closed)).z()},
        {"fingers.curl_deg", degrees(curl(open, rest(open)))}};
    if (spine_.type == urdf::Joint::REVOLUTE && !spine_.mimic)
      measures["fingers.curl_limit_deg"] =
          degrees(std::max(curl(open, spine_.limits->lower), curl(open, spine_.limits->upper)));
    return measures;
  }

 private:
  static void require_limits(const urdf::Joint& joint) {
    if (joint.type != urdf::Joint::REVOLUTE || !joint.limits)
      throw wrong_joint(joint.name, "must be revolute with limits (angles open and closed)");
    for (const double limit : {joint.limits->lower, joint.limits->upper})
      if (!(std::abs(limit) <= 2.0 * std::numbers::pi))
        throw Error("not an angle in radians", {.field = "limit of joint " + joint.name,
                                                .value = libmap::to_text(limit),
                                                .bound = ">= -2 pi and <= 2 pi"});
    if (!(joint.limits->lower < joint.limits->upper))
      throw Error("the joint has no range of motion",
                  {.field = "upper limit of joint " + joint.name,
                   .value = libmap::to_text(joint.limits->upper),
                   .bound = "> " + libmap::to_text(joint.limits->lower)});
  }
  void require_length(const std::string& what, double length_m) const {
    if (!(length_m > 0.0 && length_m <= max_length_m))
      throw Error("not a length in meters", {.field = what + " of joint " + joint_.name,
                                             .value = libmap::to_text(length_m),
                                             .bound = "> 0 and <= 1 m"});
  }
  void require_tangential(const urdf::Joint& joint, const Eigen::Vector3d& axis) const {
    const double cosine = std::abs(axis.dot(tangent()));
    if (!(cosine >= min_tangential_cosine))
      throw Error("the finger must rotate in the plane of the palm's axis",
                  {.field = "axis of joint " + joint.name,
                   .value = libmap::to_fixed_text(degrees(std::acos(std::min(1.0, cosine))), 1) +
                            " deg from tangential",
                   .bound = "<= 2.6 deg"});
  }

  static double length(const Pose& pose) { return pose.translation().norm(); }
  Eigen::Vector3d tangent() const { return {-outward_.y(), outward_.x(), 0.0}; }

  Pose turned(double angle) const {
    return joint_pose_ * Eigen::AngleAxisd(angle, axis_of(joint_));
  }
  Eigen::Vector3d carrier(double angle) const { return turned(angle) * spine_pose_.translation(); }
  Eigen::Vector3d tip(double angle, double spine_angle) const {
    Pose spine = turned(angle) * spine_pose_;
    if (spine_.type == urdf::Joint::REVOLUTE)
      spine = spine * Eigen::AngleAxisd(spine_angle, axis_of(spine_));
    return spine * tip_pose_.translation();
  }
  // Coordinates outward and toward the ground. Throws Error for a vector outside the plane of the
  // finger.
  Eigen::Vector2d in_plane(const Eigen::Vector3d& vector) const {
    const double beside_m = std::abs(vector.dot(tangent()));
    if (beside_m > max_beside_fraction * vector.norm())
      throw wrong_joint(joint_.name, "the finger of this joint is " +
                                         libmap::to_fixed_text(1000.0 * beside_m, 1) +
                                         " mm outside the plane of the palm's axis");
    return {vector.head<2>().dot(outward_), vector.z()};
  }
  // Angle from the palm's axis, outward.
  double angle_of(const Eigen::Vector3d& vector) const {
    const Eigen::Vector2d flat = in_plane(vector);
    return std::atan2(flat.x(), flat.y());
  }
  double finger_angle(double angle) const {
    return angle_of(carrier(angle) - joint_pose_.translation());
  }
  double curl(double angle, double spine_angle) const {
    const double inward = finger_angle(angle) - angle_of(tip(angle, spine_angle) - carrier(angle));
    return std::remainder(inward, 2.0 * std::numbers::pi);
  }
  // Angle of the spine joint without contact.
  double rest(double angle) const {
    if (spine_.mimic) return coupling_ * angle + coupling_offset_;
    if (spine_.type != urdf::Joint::REVOLUTE) return 0.0;
    return std::clamp(0.0, spine_.limits->lower, spine_.limits->upper);
  }

  // Angle of the spine as a function of the finger's, if one motor drives both.
  void couple(const Drive& spine, const Drive& finger) {
    if (spine.joint != finger.joint || finger.multiplier == 0.0)
      throw wrong_joint(spine_.name, "mimics a joint other than " + joint_.name);
    coupling_ = spine.multiplier / finger.multiplier;
    coupling_offset_ = spine.offset - coupling_ * finger.offset;
  }

  void find_limits() {
    require_length("finger", length(spine_pose_));
    require_length("spine", length(tip_pose_));
    open_ = joint_.limits->lower;
    closed_ = joint_.limits->upper;
    if (finger_angle(open_) < finger_angle(closed_)) std::swap(open_, closed_);
  }

  const urdf::Joint& joint_;
  const urdf::Joint& spine_;
  Pose joint_pose_ = Pose::Identity();
  Pose spine_pose_ = Pose::Identity();  // in the frame of the finger's link
  Pose tip_pose_ = Pose::Identity();    // in the frame of the carrier's link
  Eigen::Vector2d outward_ = Eigen::Vector2d::Zero();
  double open_ = 0.0;
  double closed_ = 0.0;
  double coupling_ = 0.0;  // factor of a spine joint that mimics
  double coupling_offset_ = 0.0;
};

Eigen::Matrix3d axis_from_palm(const UrdfMapping& mapping) {
  Eigen::Vector3d axis = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  const auto words = libmap::split_list(mapping.palm_axis);
  for (Eigen::Index n = 0; n < 3 && words.size() == 3; ++n)
    axis[n] = libmap::parse_double(words[static_cast<std::size_t>(n)])
                  .value_or(std::numeric_limits<double>::quiet_NaN());
  if (!axis.allFinite() || !(axis.norm() > 0.0))
    throw Error("not a direction", {.field = "urdf.palm_axis",
                                    .value = mapping.palm_axis,
                                    .bound = "three finite numbers X,Y,Z, not all 0"});
  return Eigen::Quaterniond::FromTwoVectors(axis, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

std::optional<double> palm_diameter_m(const urdf::Link& palm) {
  for (const urdf::GeometrySharedPtr& geometry :
       {palm.collision ? palm.collision->geometry : nullptr,
        palm.visual ? palm.visual->geometry : nullptr})
    if (geometry && geometry->type == urdf::Geometry::CYLINDER)
      return 2.0 * static_cast<const urdf::Cylinder&>(*geometry).radius;
  return std::nullopt;
}

void require_even(const std::vector<Finger>& fingers) {
  std::vector<double> azimuths;
  for (const Finger& finger : fingers) azimuths.push_back(degrees(finger.azimuth()));
  std::sort(azimuths.begin(), azimuths.end());
  const double step = 360.0 / static_cast<double>(azimuths.size());
  azimuths.push_back(azimuths.front() + 360.0);
  for (std::size_t n = 1; n < azimuths.size(); ++n)
    if (!(std::abs(azimuths[n] - azimuths[n - 1] - step) <= max_spacing_error_deg))
      throw Error("fingers are not evenly spaced",
                  {.field = "angle between finger joints",
                   .value = libmap::to_fixed_text(azimuths[n] - azimuths[n - 1], 1) + " deg",
                   .bound = libmap::to_fixed_text(step, 1) + " +- 1 deg"});
}

Measures derive(const Robot& robot, const UrdfMapping& mapping) {
  const urdf::Link& palm = robot.link("urdf.palm_link", mapping.palm_link);
  const std::vector<FingerNames> names = finger_names(mapping, robot);
  const Eigen::Matrix3d turn = axis_from_palm(mapping);
  std::vector<Finger> fingers;
  for (const FingerNames& finger : names) fingers.emplace_back(robot, mapping, finger, turn);
  std::map<std::string, double> values = fingers.front().measures();
  for (std::size_t n = 1; n < fingers.size(); ++n)
    for (const auto& [key, value] : fingers[n].measures())
      if (!(std::abs(value - values.at(key)) <= tolerance))
        throw wrong_joint(names[n].finger_joint,
                          "the finger of this joint differs from the finger of joint " +
                              names.front().finger_joint + " in " + key + ": " +
                              libmap::to_fixed_text(value, 2) + ", not " +
                              libmap::to_fixed_text(values.at(key), 2));
  require_even(fingers);
  values["fingers.count"] = static_cast<double>(fingers.size());
  if (const auto diameter_m = palm_diameter_m(palm))
    values["palm_diameter_mm"] = 1000.0 * *diameter_m;
  Measures measures;
  // Rounds, because URDFs contain radians with few digits: 75, not 74.99999999.
  for (const auto& [key, value] : values)
    measures.emplace_back(key, libmap::to_text(std::round(value * 1e4) / 1e4));
  return measures;
}

}  // namespace

void bind(libmap::ParameterTable& table, UrdfMapping& mapping) {
  table.add("urdf.file", mapping.file, "path of the URDF, relative to the gripper file");
  table.add("urdf.palm_link", mapping.palm_link,
            "link with the origin at the center of the palm's face");
  table.add("urdf.palm_axis", mapping.palm_axis,
            "direction X,Y,Z from the palm toward the ground, in the frame of the palm link");
  table.add("urdf.finger_joint", mapping.finger_joint,
            "revolute joints from palm to finger: list with commas, or name with '*' for finger");
  table.add("urdf.spine_joint", mapping.spine_joint,
            "joints from finger to spine carrier: list with commas, or name with '*' for finger");
  table.add("urdf.tip_link", mapping.tip_link,
            "links with origin at the spine tip: list with commas, or name with '*' for finger");
}

Measures read_urdf_dimensions(const std::string& xml, const UrdfMapping& mapping) {
  return libmap::run_sandboxed<Measures>(
      max_data_bytes, "is damaged: urdfdom crashed on it",
      [&] { return derive(Robot(xml), mapping); },
      [](auto& pipe, Measures& measures) {
        pipe.size(measures);
        for (auto& [key, value] : measures) {
          pipe.array(key);
          pipe.array(value);
        }
      });
}

}  // namespace libgtd
