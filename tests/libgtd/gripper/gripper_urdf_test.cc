#include "libgtd/gripper/gripper_urdf.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "libgtd/gripper/gripper_io.h"
#include "tests/support/test_support.h"

namespace gripper_urdf_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libgtd::UrdfMapping;

fs::path shipped(const std::string& name) {
  return graspmap_test::source_folder() / "data/grippers" / name;
}

std::string replaced(std::string text, const std::string& old, const std::string& with) {
  const std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return text.replace(at, old.size(), with);
}

std::map<std::string, double> measures(const std::string& xml, const UrdfMapping& mapping) {
  std::map<std::string, double> values;
  for (const auto& [key, text] : libgtd::read_urdf_dimensions(xml, mapping))
    values[key] = libmap::parse_double(text).value();
  return values;
}

UrdfMapping hubrobo_mapping() {
  return {"hubrobo.urdf",         "palm",        "0,0,-1", "finger_*_joint",
          "finger_*_spine_joint", "finger_*_tip"};
}

std::vector<std::pair<std::string, std::string>> values_of(libgtd::Gripper gripper) {
  libmap::ParameterTable table;
  bind(table, gripper);
  bind(table, *gripper.fingers);
  bind(table, gripper.engagement);
  return table.values();
}

// Compares all fields of the two files, and thus all masks.
TEST(GripperUrdf, HubRoboIsThePublishedGripper) {
  EXPECT_EQ(values_of(libgtd::find_gripper("hubrobo-urdf")),
            values_of(libgtd::find_gripper("hubrobo")));
  EXPECT_EQ(libgtd::gripper_files(shipped("hubrobo-urdf.yaml")),
            (std::vector<fs::path>{shipped("hubrobo-urdf.yaml"), shipped("hubrobo.urdf")}));
  EXPECT_EQ(libgtd::gripper_files(shipped("hubrobo.yaml")).size(), 1U);
}

// The published positions of the tips are in whole mm; those of the URDF round to them.
TEST(GripperUrdf, TipsAreWhereTheyArePublished) {
  const auto found = measures(graspmap_test::read_text(shipped("hubrobo.urdf")), hubrobo_mapping());
  EXPECT_EQ(found.at("fingers.count"), 8);
  EXPECT_EQ(found.at("fingers.curl_limit_deg"), 100);
  EXPECT_EQ(std::round(found.at("opening_spine_radius_mm")), 37);
  EXPECT_EQ(std::round(found.at("opening_spine_depth_mm")), 5);
  EXPECT_EQ(std::round(found.at("closing_height_mm")), 16);
}

// Gripper with three fingers in closed form, in any frames: the palm's axis is `palm_from_axis` z,
// joints rotate about their own x axis, and a mount is between palm and fingers.
struct Frames {
  Eigen::Matrix3d palm_from_axis = Eigen::Matrix3d::Identity();
  std::string spine_limits = "<limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
};
constexpr double joint_radius_m = 0.05, joint_height_m = 0.02, link_m = 0.04, spine_m = 0.03;

std::string numbers(const Eigen::Vector3d& v) {
  return libmap::to_text(v.x()) + " " + libmap::to_text(v.y()) + " " + libmap::to_text(v.z());
}
std::string origin_of(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d ypr = pose.linear().eulerAngles(2, 1, 0);
  return "<origin xyz=\"" + numbers(pose.translation()) + "\" rpy=\"" +
         numbers({ypr.z(), ypr.y(), ypr.x()}) + "\"/>";
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const Eigen::Isometry3d& pose,
                  const std::string& more = "") {
  return "<joint name=\"" + name + "\" type=\"" + type + "\">" + origin_of(pose) +
         "<parent link=\"" + parent + "\"/><child link=\"" + child + "\"/>" + more +
         "</joint><link name=\"" + child + "\"/>";
}

std::string three_fingers(const Frames& frames) {
  Eigen::Isometry3d mount = Eigen::Isometry3d::Identity();
  mount.linear() = frames.palm_from_axis;  // z toward the ground
  std::string xml = "<robot name=\"r\"><link name=\"palm\"/>" +
                    joint("mount_joint", "fixed", "palm", "mount", mount);
  const std::string axis = "<axis xyz=\"1 0 0\"/>";
  for (int n = 0; n < 3; ++n) {
    const std::string name = std::string("left right rear")
                                 .substr(static_cast<std::size_t>(n == 0   ? 0
                                                                  : n == 1 ? 5
                                                                           : 11),
                                         n == 0   ? 4
                                         : n == 1 ? 5
                                                  : 4);
    // x tangential, y inward, z toward the ground: a rotation about x leads from z to -y, outward.
    Eigen::Isometry3d base = Eigen::Isometry3d::Identity();
    base.rotate(Eigen::AngleAxisd(2.0 * M_PI * n / 3.0, Eigen::Vector3d::UnitZ()));
    base.translate(Eigen::Vector3d(0, -joint_radius_m, -joint_height_m));
    Eigen::Isometry3d along = Eigen::Isometry3d::Identity();
    along.translation() = Eigen::Vector3d(0, 0, link_m);
    Eigen::Isometry3d tip = Eigen::Isometry3d::Identity();
    tip.translation() = Eigen::Vector3d(0, 0, spine_m);
    xml += joint(name + "_root", "revolute", "mount", name, base,
                 axis + "<limit lower=\"0.25\" upper=\"1.25\" effort=\"1\" velocity=\"1\"/>") +
           joint(name + "_tarsus", "revolute", name, name + "_carrier", along,
                 "<axis xyz=\"-1 0 0\"/>" + frames.spine_limits) +
           joint(name + "_claw", "fixed", name + "_carrier", name + "_tip", tip);
  }
  return xml + "</robot>";
}

UrdfMapping three_mapping(const Eigen::Vector3d& axis) {
  return {
      "r.urdf",
      "palm",
      libmap::to_text(axis.x()) + "," + libmap::to_text(axis.y()) + "," + libmap::to_text(axis.z()),
      "*_root",
      "*_tarsus",
      "*_tip"};
}

TEST(GripperUrdf, MeasuresInClosedFormInAnyFrame) {
  for (int turn = 0; turn < 4; ++turn) {
    Frames frames;
    if (turn > 0)
      frames.palm_from_axis = Eigen::AngleAxisd(graspmap_test::uniform(0.1, 3.0),
                                                Eigen::Vector3d(graspmap_test::uniform(-1, 1),
                                                                graspmap_test::uniform(-1, 1), 0.4)
                                                    .normalized())
                                  .toRotationMatrix();
    const auto found = measures(three_fingers(frames), three_mapping(frames.palm_from_axis.col(2)));
    const auto near = [&](const char* key, double value) {
      EXPECT_NEAR(found.at(key), value, 1e-4) << key << " " << turn;
    };
    near("finger_joint_diameter_mm", 2000 * joint_radius_m);
    near("finger_length_mm", 1000 * link_m);
    near("spine_length_mm", 1000 * spine_m);
    near("opening_angle_deg", 1.25 * 180 / M_PI);
    near("closing_angle_deg", 0.25 * 180 / M_PI);
    near("opening_spine_radius_mm", 1000 * (joint_radius_m + (link_m + spine_m) * std::sin(1.25)));
    near("opening_spine_depth_mm", 1000 * ((link_m + spine_m) * std::cos(1.25) - joint_height_m));
    near("closing_height_mm", 1000 * ((link_m + spine_m) * std::cos(0.25) - joint_height_m));
    near("fingers.count", 3);
    near("fingers.curl_deg", 0);
    near("fingers.curl_limit_deg", 180 / M_PI);
    EXPECT_FALSE(found.contains("palm_diameter_mm"));
  }
}

TEST(GripperUrdf, ACoupledSpineJointFollowsItsFinger) {
  Frames frames;
  frames.spine_limits += "<mimic joint=\"left_root\" multiplier=\"0.5\" offset=\"0.1\"/>";
  std::string xml = three_fingers(frames);
  EXPECT_EQ(error_of([&] {
              measures(xml, three_mapping({0, 0, 1}));
            })
                .context()
                .field,
            "joint rear_tarsus");
  for (const char* name : {"right", "rear"})
    xml = replaced(xml,
                   std::string(name) + "_carrier\"/><axis xyz=\"-1 0 0\"/>" + frames.spine_limits,
                   std::string(name) + "_carrier\"/><axis xyz=\"-1 0 0\"/>" +
                       replaced(frames.spine_limits, "left", name));
  const auto found = measures(xml, three_mapping({0, 0, 1}));
  const double curl = 0.1 + 0.5 * 1.25;
  EXPECT_NEAR(found.at("fingers.curl_deg"), curl * 180 / M_PI, 1e-4);
  EXPECT_NEAR(found.at("opening_spine_radius_mm"),
              1000 * (joint_radius_m + link_m * std::sin(1.25) + spine_m * std::sin(1.25 - curl)),
              1e-4);
  EXPECT_FALSE(found.contains("fingers.curl_limit_deg"));
}

// One motor: all joints mimic that of the left finger, some indirectly.
TEST(GripperUrdf, OneJointMayDriveAllFingers) {
  Frames frames;
  frames.spine_limits += "<mimic joint=\"left_root\" multiplier=\"0.5\" offset=\"0.1\"/>";
  const std::string mimic = "<mimic joint=\"left_root\" multiplier=\"2\" offset=\"-0.25\"/>";
  std::string xml = three_fingers(frames);
  const auto drive = [&](const std::string& joint, const std::string& by) {
    const std::string head = "<joint name=\"" + joint + "\" type=\"revolute\">";
    xml = replaced(xml, head, head + by);
  };
  drive("right_root", mimic);
  drive("rear_root", replaced(mimic, "left_root", "right_root"));
  // Each spine as a function of its own finger: 0.5 q + 0.1 for the left one.
  const auto spine = [&](const std::string& name, const std::string& by) {
    const std::string head = name + "_carrier\"/><axis xyz=\"-1 0 0\"/>";
    xml = replaced(xml, head + frames.spine_limits,
                   head + replaced(frames.spine_limits,
                                   "joint=\"left_root\" multiplier=\"0.5\" offset=\"0.1\"", by));
  };
  // right = 2 left - 0.25, so that left = (right + 0.25) / 2.
  spine("right", "joint=\"left_root\" multiplier=\"1\" offset=\"-0.025\"");
  // rear = 2 right - 0.25 = 4 left - 0.75.
  spine("rear", "joint=\"left_root\" multiplier=\"2\" offset=\"-0.275\"");
  const auto found = measures(xml, three_mapping({0, 0, 1}));
  EXPECT_NEAR(found.at("fingers.curl_deg"), (0.1 + 0.5 * 1.25) * 180 / M_PI, 1e-4);
  drive("left_root", replaced(mimic, "left_root", "rear_root"));
  EXPECT_EQ(error_of([&] {
              measures(xml, three_mapping({0, 0, 1}));
            })
                .context()
                .field.substr(0, 6),
            "joint ");
}

TEST(GripperUrdf, NamesMayBeListed) {
  UrdfMapping listed = three_mapping({0, 0, 1});
  listed.finger_joint = "rear_root, left_root, right_root";
  listed.spine_joint = "rear_tarsus, left_tarsus, right_tarsus";
  listed.tip_link = "rear_tip, left_tip, right_tip";
  EXPECT_EQ(measures(three_fingers({}), listed),
            measures(three_fingers({}), three_mapping({0, 0, 1})));
  listed.tip_link = "rear_tip, left_tip";
  EXPECT_EQ(error_of([&] { measures(three_fingers({}), listed); }).context().field,
            "urdf.finger_joint");
}

struct BadUrdf {
  const char* name;
  const char* old;  // text in the URDF of HubRobo
  const char* with;
  const char* field;  // field of the error
};
void PrintTo(const BadUrdf& bad, std::ostream* out) { *out << bad.name; }
class BadUrdfs : public testing::TestWithParam<BadUrdf> {};

TEST_P(BadUrdfs, NameTheJointOrLink) {
  const std::string xml =
      replaced(graspmap_test::read_text(shipped("hubrobo.urdf")), GetParam().old, GetParam().with);
  const libmap::Error error = error_of([&] { measures(xml, hubrobo_mapping()); });
  EXPECT_EQ(error.context().field, GetParam().field) << error.what();
}

INSTANTIATE_TEST_SUITE_P(
    All, BadUrdfs,
    testing::Values(
        BadUrdf{"no_tip", "<link name=\"finger_3_tip\"/>", "<link name=\"finger_3_top\"/>", ""},
        BadUrdf{"no_palm", "<link name=\"palm\">", "<link name=\"base\">", ""},
        BadUrdf{"circle", "<parent link=\"palm\"/> <child link=\"finger_2\"/>",
                "<parent link=\"finger_2_tip\"/> <child link=\"finger_2\"/>",
                "joint finger_2_spine_joint"},
        BadUrdf{"two_parents", "<child link=\"finger_2_tip\"/>", "<child link=\"finger_1\"/>", ""},
        BadUrdf{"axis", "<axis xyz=\"0 -1 0\"/>", "<axis xyz=\"1 0 0\"/>",
                "axis of joint finger_1_joint"},
        BadUrdf{"no_axis", "<axis xyz=\"0 -1 0\"/>", "<axis xyz=\"0 0 0\"/>",
                "axis of joint finger_1_joint"},
        BadUrdf{"spine_axis", "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 1\"/>",
                "axis of joint finger_1_spine_joint"},
        BadUrdf{"degrees", "upper=\"1.3089969\"", "upper=\"75\"", "limit of joint finger_1_joint"},
        BadUrdf{"limits_swapped", "lower=\"0.5235988\" upper=\"1.3089969\"",
                "lower=\"1.3089969\" upper=\"0.5235988\"", "upper limit of joint finger_1_joint"},
        BadUrdf{"millimeters", "xyz=\"0 0 -0.015\"", "xyz=\"0 0 -15\"",
                "finger of joint finger_1_joint"},
        BadUrdf{"at_the_axis", "xyz=\"0.014 0 0.0113\"", "xyz=\"0 0 0.0113\"",
                "distance from the palm's axis of joint finger_1_joint"},
        BadUrdf{"beside", "xyz=\"0 0 -0.015\"", "xyz=\"0 0.01 -0.015\"", "joint finger_1_joint"},
        BadUrdf{"other_finger", "xyz=\"0 0 -0.015\"", "xyz=\"0 0 -0.016\"", "joint finger_2_joint"},
        BadUrdf{"uneven", "rpy=\"0 0 0.7853982\"", "rpy=\"0 0 0.9\"",
                "axis of joint finger_2_joint"},
        BadUrdf{"uneven_place", "xyz=\"0.009899495 0.009899495 0.0113\" rpy=\"0 0 0.7853982\"",
                "xyz=\"0.00870254 0.01096658 0.0113\" rpy=\"0 0 0.9\"",
                "angle between finger joints"},
        BadUrdf{"continuous", "type=\"revolute\"", "type=\"continuous\"", "joint finger_1_joint"},
        BadUrdf{"no_xml", "</robot>", "", ""}),
    [](const auto& of) { return of.param.name; });

TEST(GripperUrdf, BadMappings) {
  const std::string xml = graspmap_test::read_text(shipped("hubrobo.urdf"));
  const auto field_of = [&](std::string UrdfMapping::*name, const char* value) {
    UrdfMapping mapping = hubrobo_mapping();
    mapping.*name = value;
    return error_of([&] { measures(xml, mapping); }).context().field;
  };
  EXPECT_EQ(field_of(&UrdfMapping::palm_link, "plam"), "urdf.palm_link");
  EXPECT_EQ(field_of(&UrdfMapping::palm_axis, "down"), "urdf.palm_axis");
  EXPECT_EQ(field_of(&UrdfMapping::palm_axis, "0,0,0"), "urdf.palm_axis");
  EXPECT_EQ(field_of(&UrdfMapping::palm_axis, "x,1,0"), "urdf.palm_axis");
  EXPECT_EQ(field_of(&UrdfMapping::finger_joint, "toe_*_joint"), "urdf.finger_joint");
  EXPECT_EQ(field_of(&UrdfMapping::spine_joint, "finger_*_wrist"), "urdf.spine_joint");
  EXPECT_EQ(field_of(&UrdfMapping::tip_link, "finger_*_claw"), "urdf.tip_link");
}

// TinyXML parses nested elements recursively, until the stack overflows.
TEST(GripperUrdf, AFileThatCrashesTheLibraryIsAnError) {
  std::string xml = "<robot name=\"r\">";
  for (int n = 0; n < 300000; ++n) xml += "<a>";
  EXPECT_TRUE(is_error(error_of([&] { measures(xml, hubrobo_mapping()); }), {.about = "urdfdom"}));
  for (const std::string& text : {std::string(), std::string("no xml"), std::string(5, '\0'),
                                  std::string("<robot/>"), std::string("<robot name=\"r\"/>")})
    EXPECT_TRUE(is_error(error_of([&] { measures(text, hubrobo_mapping()); }), {.about = "URDF"}));
}

// Values of the gripper file take precedence; values in neither file are missing.
TEST(GripperUrdf, TheFileStatesTheRest) {
  const std::string file = shipped("mine.yaml").string();
  const std::string yaml = graspmap_test::read_text(shipped("hubrobo-urdf.yaml"));
  EXPECT_NEAR(
      libgtd::parse_gripper(replaced(yaml, "closing_height_mm: 16\n", ""), file).closing_height_mm,
      16.4148, 1e-4);
  EXPECT_EQ(libgtd::parse_gripper(yaml + "palm_diameter_mm: 30\n", file).palm_diameter_mm, 30);
  EXPECT_EQ(libgtd::parse_gripper(yaml, file, {{"palm_diameter_mm", "29"}}).palm_diameter_mm, 29);
  const auto error_in = [&](const std::string& old, const std::string& with) {
    return error_of([&] { libgtd::parse_gripper(replaced(yaml, old, with), file); }).context();
  };
  EXPECT_EQ(error_in("spine_depth_mm: 5", "").field, "spine_depth_mm");
  EXPECT_EQ(error_in("  tip_link: finger_*_tip\n", "").field, "urdf.tip_link");
  EXPECT_EQ(error_in("tip_link: finger_*_tip", "tip_link: toe").file,
            shipped("hubrobo.urdf").string());
  EXPECT_EQ(error_in("file: hubrobo.urdf", "file: other.urdf").file,
            shipped("other.urdf").string());
  EXPECT_EQ(error_in("  spines_per_finger: 10\n", "").field, "fingers.spines_per_finger");
  // Without keys of fingers there is no such section.
  const std::size_t fingers = yaml.find("fingers:\n");
  EXPECT_FALSE(libgtd::parse_gripper(yaml.substr(0, fingers), file).fingers.has_value());
}

}  // namespace gripper_urdf_test
