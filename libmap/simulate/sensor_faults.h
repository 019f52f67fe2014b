// Systematic faults of real RGB-D cameras, for simulated scans: what a stored calibration does not
// know of the camera, and what depth and pictures suffer from beyond noise. All are off by default;
// a fault that is off draws no random number and changes no byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/simulate/depth_camera.h"

namespace libmap {

// Errors of depth as functions of depth and place. Time-of-flight cameras: a wave over range, since
// their modulation is no pure sine (Lindner and Kolb 2006; Kinect v2: Wasenmueller and Stricker
// 2016, a few millimeters); stereo and structured light: a share of depth and a bowl towards the
// corners (Teichman et al. 2013; Carfagni et al. 2019 for the D415).
struct DepthFaults {
  double scale_percent = 0.0;  // of depth, added
  double wiggle_m = 0.0;       // amplitude of sin(2 pi depth / wiggle_period_m), added
  double wiggle_period_m = 1.2;
  double corner_m = 0.0;   // added at the corners, growing with the squared radius
  double holes = 0.0;      // share of the image in discs without depth
  double multipath = 0.0;  // reflectance of surfaces that mirror light onto others (add_multipath)

  bool changes_depth() const { return scale_percent != 0 || wiggle_m != 0 || corner_m != 0; }
  // What is measured at `depth_m`, without noise; radius2: from the middle of the image, of that of
  // its corners, squared.
  double measured(double depth_m, double radius2) const;
};
void bind(ParameterTable& table, DepthFaults& faults);

// Exposure and blur of a phone's or webcam's pictures.
struct PhotoFaults {
  double exposure_drift = 0.0;  // brightness wanders between 1 - and 1 + this from frame to frame
  double white_balance_drift = 0.0;  // the same of red against blue
  double exposure_s = 0.0;           // pictures blur along the true motion of this time ...
  double blurred_frames = 1.0;       // ... in this share of the frames
  int jpeg_quality = 0;              // 1 to 100; 0: no loss but that of how pictures are stored
};
void bind(ParameterTable& table, PhotoFaults& faults);

// What the stored calibration and stamps say wrongly.
struct CalibrationFaults {
  double focal_percent = 0.0;  // of the stored focal lengths, too large
  double cx_px = 0.0;          // of the stored principal point, too large
  double cy_px = 0.0;
  double depth_shift_mm = 0.0;  // length of the error of depth registered to color, ...
  double depth_turn_deg = 0.0;  // ... and its angle, in directions drawn from the seed
  // The depth camera's place to the right of the color camera, known: its images are registered to
  // color, with shadows. 0: both look from one place, but for the errors above.
  double depth_baseline_mm = 0.0;
  int depth_width_px = 0;  // of depth images, which cover what color does; 0: color's size
  int depth_height_px = 0;
  double depth_delay_s = 0.0;      // depth is taken this much after color
  double rolling_shutter_s = 0.0;  // from the first to the last row of a picture; depth is global,
                                   // as of the RealSense D435
};
void bind(ParameterTable& table, CalibrationFaults& faults);

// What the recorder does with frames.
struct RecordingFaults {
  double dropped_frames = 0.0;     // share of the frames after the first that are missing
  double duplicated_frames = 0.0;  // share that repeat the images of the frame before
  double stamp_error_s = 0.0;      // standard deviation of the stored stamps
};
void bind(ParameterTable& table, RecordingFaults& faults);

struct SensorFaults {
  DepthFaults depth{};
  PhotoFaults photo{};
  CalibrationFaults calibration{};
  RecordingFaults recording{};
};
void bind(ParameterTable& table, SensorFaults& faults);

// The camera as the scan stores it.
Camera stored_camera(Camera camera, const CalibrationFaults& faults);
// Where depth looks from, as seen from the color camera: the same for a whole scan. And where it is
// stored to look from.
Pose color_from_depth(const CalibrationFaults& faults, std::uint64_t seed);
Pose stored_color_from_depth(const CalibrationFaults& faults);

// A frame that is stored: of frames that count from 0, which one it is and whose images it has.
struct RecordedFrame {
  std::size_t frame = 0;
  std::size_t images_of = 0;
  double stamp_error_s = 0.0;
};
std::vector<RecordedFrame> recorded_frames(std::size_t frames, const RecordingFaults& faults,
                                           std::uint64_t seed);

// Depths of a view as the sensor errs, before its noise.
void distort_depth(SurfaceView& view, const DepthFaults& faults);

// Ranges of the view with what diffuse surfaces of this reflectance (0 to 1) mirror onto each
// other: light of the camera that meets one surface, then a second one, arrives later than the
// direct light of the second, and the camera measures the mean of both by their strength (the limit
// of paths that differ by little of the modulation's wavelength: Fuchs 2010). Concave edges become
// round and move away; flat and convex surfaces stay. One reflection, on a grid of pixels,
// interpolated.
void add_multipath(SurfaceView& view, const VisibleSurface& surface, const ViewRays& rays,
                   const Pose& world_from_camera, double reflectance);

// Discs without depth; how many measured pixels were lost.
std::size_t punch_holes(DepthImage& depth, const DepthFaults& faults, std::uint64_t seed);

// The view's colors averaged over the exposure: each point of the surface moves in the picture as
// the camera does. `now_from_later` gives the camera's pose a time after the middle of the exposure
// in its pose at the middle.
void blur_by_motion(SurfaceView& view, const Camera& camera,
                    const std::function<Pose(double time_s)>& now_from_later, double exposure_s);
// Brightness, white balance and loss of compression; `frame` counts from 0.
bool is_blurred(const PhotoFaults& faults, std::uint64_t seed);
void change_exposure(SurfaceView& view, const PhotoFaults& faults, std::uint64_t seed,
                     std::uint64_t frame);
ColorImage compress_photo(const ColorImage& photo, const PhotoFaults& faults);

}  // namespace libmap
