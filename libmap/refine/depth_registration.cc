#include "libmap/refine/depth_registration.h"

#include <utility>

#include "libmap/consistency/edge_agreement.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

class RegisteredScan : public ScanSource {
 public:
  RegisteredScan(const ScanSource& scan, const Pose& color_from_depth)
      : scan_(scan), color_from_depth_(color_from_depth) {}

  const std::filesystem::path& path() const override { return scan_.path(); }
  const PoseGraph& graph() const override { return scan_.graph(); }
  const std::vector<std::string>& warnings() const override { return scan_.warnings(); }
  SourceNode source_of(int node) const override { return scan_.source_of(node); }
  std::string image_name(int node) const override { return scan_.image_name(node); }
  RgbdFrame read_frame(int node, FrameParts parts) const override {
    RgbdFrame frame = scan_.read_frame(node, parts);
    if (frame.cameras.size() == 1 && !frame.depth.empty())
      apply_calibration(frame,
                        {.camera = frame.cameras.front(), .color_from_depth = color_from_depth_});
    return frame;
  }

 private:
  const ScanSource& scan_;
  Pose color_from_depth_;
};

}  // namespace

CoarseRegistration register_coarsely(const ScanSource& scan, bool may_register) {
  const EdgeAgreement edges = check_edge_agreement(scan);
  CoarseRegistration registration;
  if (!edges.is_displaced()) return registration;
  registration.finding = edges.sentence();
  if (!may_register) return registration;
  if (edges.is_scaled())
    throw Error(edges.sentence() +
                    "; in scan.yaml, set depth_calibration to the calibration file of the depth "
                    "camera (convert a database first: graspmap convert SCAN -o FOLDER), or use "
                    "--no-register-depth",
                {.field = "depth_calibration"});
  registration.finding += ": registered by edges before refinement";
  registration.color_from_depth = edges.color_from_depth;
  registration.scan = std::make_unique<RegisteredScan>(scan, edges.color_from_depth);
  return registration;
}

void add_registration(const Pose& color_from_depth, std::size_t cameras,
                      SensorCalibration& calibration) {
  if (color_from_depth.matrix().isIdentity(0.0)) return;
  calibration.color_from_depth.resize(cameras, Pose::Identity());
  for (Pose& pose : calibration.color_from_depth) pose = pose * color_from_depth;
}

}  // namespace libmap
