// A scan with a calibration of its camera: other intrinsics than the stored ones, corrected depth.
#pragma once

#include <memory>

#include "libmap/image/camera_io.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// The frame with the focal lengths, principal point and distortion of `calibration`, and its depth
// corrected and registered; where the camera is mounted stays, and pictures keep their rolling
// shutter. Throws Error for a frame of several cameras, of a
// stereo pair, or of another size than the calibration's.
void apply_calibration(RgbdFrame& frame, const CameraFile& calibration);

// `scan` with the calibration applied to each frame; read_frame throws Error naming the node where
// that is not possible.
std::unique_ptr<ScanSource> with_calibration(std::unique_ptr<ScanSource> scan,
                                             const CameraFile& calibration);

}  // namespace libmap
