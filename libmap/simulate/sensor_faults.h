// Systematic faults of real RGB-D cameras for simulated scans: errors of the stored calibration,
// and errors of depth and color images beyond noise. All are disabled by default. A disabled fault
// draws no random number and changes no byte.
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

// Depth errors as functions of depth and pixel. Time-of-flight cameras: a periodic error over
// range, because the modulation is not sinusoidal (Lindner and Kolb 2006; Kinect v2: Wasenmueller
// and Stricker 2016, a few millimeters). Stereo and structured light: an error proportional to
// depth, and an error in the corners (Teichman et al. 2013; D415: Carfagni et al. 2019).
struct DepthFaults {
  double scale_percent = 0.0;     // scale error of depth
  double periodic_error_m = 0.0;  // amplitude of the error sin(2 pi depth / error_period_m)
  double error_period_m = 1.2;    // depth difference over which this error repeats
  double corner_m = 0.0;          // error in the corners, proportional to the squared radius
  double holes = 0.0;             // share of the image in discs without depth
  double multipath = 0.0;  // reflectance of surfaces for multipath interference (add_multipath)

  bool changes_depth() const {
    return scale_percent != 0 || periodic_error_m != 0 || corner_m != 0;
  }
  // Depth (m) measured at the true depth `depth_m`, without noise. `radius2` is the squared
  // distance from the image center, 1 in the corners.
  double measured(double depth_m, double radius2) const;
};
void bind(ParameterTable& table, DepthFaults& faults);

// Exposure changes, blur and compression of color images, as of phones and webcams.
struct PhotoFaults {
  double exposure_drift = 0.0;       // relative amplitude of the brightness over the frames
  double white_balance_drift = 0.0;  // relative amplitude of red against blue over the frames
  double exposure_s = 0.0;           // exposure time of motion blur
  double blurred_frames = 1.0;       // share of frames with motion blur
  int jpeg_quality = 0;  // JPEG quality of a compression before storing, 1 to 100; 0: none
};
void bind(ParameterTable& table, PhotoFaults& faults);

// Errors of the stored calibration and stamps.
struct CalibrationFaults {
  double focal_percent = 0.0;  // error of the stored focal lengths
  double cx_px = 0.0;          // error of the stored principal point
  double cy_px = 0.0;
  // Translation and rotation error of the registration of depth to color; the seed sets directions.
  double depth_shift_mm = 0.0;
  double depth_turn_deg = 0.0;
  // Known position of the depth camera to the right of the color camera. Its images are registered
  // to color, with occlusion shadows. 0: both cameras have one position, except for the errors
  // above.
  double depth_baseline_mm = 0.0;
  int depth_width_px = 0;  // size of depth images, with the field of view of color; 0: color's size
  int depth_height_px = 0;
  double depth_delay_s = 0.0;      // time of depth after color
  double rolling_shutter_s = 0.0;  // time from the first to the last row of color; the depth
                                   // shutter is global, as on the RealSense D435
};
void bind(ParameterTable& table, CalibrationFaults& faults);

// Errors of the recorder.
struct RecordingFaults {
  double dropped_frames = 0.0;     // share of missing frames; the first is always stored
  double duplicated_frames = 0.0;  // share of frames with the images of the previous frame
  double stamp_error_s = 0.0;      // standard deviation of the errors of stored stamps
};
void bind(ParameterTable& table, RecordingFaults& faults);

struct SensorFaults {
  DepthFaults depth{};
  PhotoFaults photo{};
  CalibrationFaults calibration{};
  RecordingFaults recording{};
};
void bind(ParameterTable& table, SensorFaults& faults);

// The camera with the errors of the stored calibration.
Camera stored_camera(Camera camera, const CalibrationFaults& faults);
// True and stored pose of the depth camera in the color camera's frame, constant for a scan.
Pose color_from_depth(const CalibrationFaults& faults, std::uint64_t seed);
Pose stored_color_from_depth(const CalibrationFaults& faults);

// A stored frame: index of the frame (from 0) and index of the frame that provides the images.
struct RecordedFrame {
  std::size_t frame = 0;
  std::size_t image_frame = 0;
  double stamp_error_s = 0.0;  // added to the stamp
};
std::vector<RecordedFrame> recorded_frames(std::size_t frames, const RecordingFaults& faults,
                                           std::uint64_t seed);

// Applies the systematic depth errors to a view, before noise.
void distort_depth(SurfaceView& view, const DepthFaults& faults);

// Adds the multipath interference of diffuse surfaces of this reflectance (0 to 1) to the depths of
// a view. Light that reaches a surface via another one travels farther than direct light. The
// camera measures the mean of both path lengths, weighted by intensity (the limit of path
// differences that are small against the modulation wavelength: Fuchs 2010). Concave edges appear
// rounded and farther away; flat and convex surfaces do not change. Interpolates one reflection on
// a grid of pixels.
void add_multipath(SurfaceView& view, const VisibleSurface& surface, const ViewRays& rays,
                   const Pose& world_from_camera, double reflectance);

// Removes depth in random discs. Returns the number of measured pixels that were removed.
std::size_t punch_holes(DepthImage& depth, const DepthFaults& faults, std::uint64_t seed);

// Averages the view's colors over the exposure, along the motion of each surface point in the
// image. `now_from_later(time_s)` is the camera's pose at `time_s` after the middle of the
// exposure, relative to the pose at the middle.
void blur_by_motion(SurfaceView& view, const Camera& camera,
                    const std::function<Pose(double time_s)>& now_from_later, double exposure_s);
// Draws whether a frame is blurred.
bool is_blurred(const PhotoFaults& faults, std::uint64_t seed);
// Applies the drifts of brightness and white balance; `frame` counts from 0.
void change_exposure(SurfaceView& view, const PhotoFaults& faults, std::uint64_t seed,
                     std::uint64_t frame);
// Compresses and decompresses a photograph.
ColorImage compress_photo(const ColorImage& photo, const PhotoFaults& faults);

}  // namespace libmap
