#include "libmap/core/error.h"
#include "libmap/scan/frame_folder.h"

namespace libmap {

std::vector<std::pair<std::string, PoseFrame>> pose_frame_names() {
  return {{"camera", PoseFrame::camera}, {"base", PoseFrame::base}};
}

void bind(ParameterTable& table, FrameFolderOptions& options) {
  table.add("depth_unit_m", options.depth_unit_m, positive,
            "meters per unit of the depth images; 0.0002: TUM RGB-D, 0.001: millimeters");
  table.add("calibration", options.calibration, "camera file of the color images");
  table.add("depth_calibration", options.depth_calibration,
            "camera file of a separate depth camera; empty: depth is already registered to color");
  table.add("pose_frame", options.pose_frame, pose_frame_names(),
            "frame of the poses in the pose files; camera: optical frame; base: robot's base");
  table.add("pairing_tolerance_s", options.pairing_tolerance_s, not_negative,
            "maximum time difference between color and depth, and between image and pose, s");
}

std::filesystem::path FrameFolder::calibration_file(const std::string& name) const {
  std::filesystem::path file = path_ / name;
  std::error_code code;  // lists can contain invalid file names
  if (!std::filesystem::exists(file, code))
    throw Error(name == options_.calibration
                    ? "no such calibration file; set the key 'calibration' in scan.yaml"
                    : "no such calibration file",
                {.file = file.string()});
  return file;
}

}  // namespace libmap
