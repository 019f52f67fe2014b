// ROS 1's storage in builds without its libraries: reports the missing packages.
#include "libmap/bag/bag_storage.h"
#include "libmap/core/error.h"

namespace libmap {

namespace {

[[noreturn]] void refuse() {
  throw Error("graspmap was built without ROS 1; missing: " GRASPMAP_MISSING_ROS
              " (install them and build again)",
              {}, ErrorKind::failed);
}

}  // namespace

const BagStorage ros1_storage = {"bag of ROS 1",
                                 [](const std::filesystem::path&, RecordedTopics&) { refuse(); },
                                 [](const std::filesystem::path&, const std::vector<BagRequest>&,
                                    const TakeMessage&) { refuse(); }};

std::unique_ptr<BagSink> new_ros1_bag(const std::filesystem::path&, BagCompression) { refuse(); }

}  // namespace libmap
