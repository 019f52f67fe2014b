// Stands for libmap/ros in builds without ROS's libraries: every function says what is missing.
#include "libmap/core/error.h"
#include "libmap/ros/bag_cloud.h"
#include "libmap/ros/bag_reader.h"
#include "libmap/ros/bag_rig.h"
#include "libmap/ros/bag_writer.h"

namespace libmap {

namespace {

[[noreturn]] void refuse() {
  throw Error("graspmap was built without ROS 1; missing: " GRASPMAP_MISSING_ROS
              " (install them and build again)",
              {}, ErrorKind::failed);
}

}  // namespace

void require_ros() { refuse(); }

BagListing list_bag(const std::filesystem::path&) { refuse(); }

BagCloudResult read_bag_cloud(const std::filesystem::path&, const std::string&,
                              const std::optional<double>&) {
  refuse();
}

BagRigPlan plan_bag_rig(const std::filesystem::path&, const BagRigOptions&,
                        const std::optional<double>&) {
  refuse();
}
BagRigExport export_bag_rig(const std::filesystem::path&, const BagRigPlan&,
                            const std::filesystem::path&) {
  refuse();
}

void write_bag(const std::filesystem::path&, const BagContent&, BagCompression) { refuse(); }
void write_rig_bag(const std::filesystem::path&, const CameraRig&, const std::vector<RigImage>&,
                   const RigBagOptions&) {
  refuse();
}

}  // namespace libmap
