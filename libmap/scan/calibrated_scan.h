// A scan as its camera is known now: other intrinsics than the stored ones, and corrected depth.
#pragma once

#include <memory>

#include "libmap/image/camera_io.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// The frame with the focal lengths, principal point and distortion of `calibration`, and its depth
// corrected; where the camera is mounted stays. Throws Error for a frame of several cameras, of a
// stereo pair, or of another size than the calibration's.
void apply_calibration(RgbdFrame& frame, const CameraFile& calibration);

// Every frame of `scan` so; read_frame throws Error naming the node where that cannot be.
std::unique_ptr<ScanSource> with_calibration(std::unique_ptr<ScanSource> scan,
                                             const CameraFile& calibration);

}  // namespace libmap
