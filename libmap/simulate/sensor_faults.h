// Systematic faults of real RGB-D cameras for simulated scans: errors of the stored calibration,
// and errors of depth and color images in addition to noise. All faults are disabled by default. A
// disabled fault draws no random number and does not change the output.
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

// Depth errors as functions of depth and pixel. Time-of-flight cameras have an error that is
// periodic in range, because the modulation is not sinusoidal (Lindner and Kolb 2006; Kinect v2:
// Wasenmueller and Stricker 2016). Stereo and structured-light cameras have errors proportional to
// depth and in the image corners (Teichman et al. 2013; D415: Carfagni et al. 2019).
struct DepthFaults {
  double scale_percent = 0.0;     // scale error of depth
  double periodic_error_m = 0.0;  // amplitude of the error sin(2 pi depth / error_period_m)
  double error_period_m = 1.2;    // depth difference over which the periodic error repeats
  double corner_m = 0.0;          // error in the corners; proportional to squared image radius
  double holes = 0.0;             // fraction of the image that is covered by discs without depth
  double multipath = 0.0;         // 0 to 1: reflectance of surfaces for add_multipath

  bool changes_depth() const {
    return scale_percent != 0 || periodic_error_m != 0 || corner_m != 0;
  }
  // Returns the depth (m) that is measured at the true depth `depth_m`, without noise. `radius2` is
  // the squared distance from the image center, 1 in the corners.
  double measured(double depth_m, double radius2) const;
};
void bind(ParameterTable& table, DepthFaults& faults);

// Exposure changes, blur and compression of color images, as in phones and webcams.
struct PhotoFaults {
  double exposure_drift = 0.0;       // relative amplitude of brightness, periodic over the frames
  double white_balance_drift = 0.0;  // relative amplitude of red against blue, also periodic
  double exposure_s = 0.0;           // exposure time, in which motion blurs images; 0: no blur
  double blurred_frames = 1.0;       // fraction of frames with motion blur
  int jpeg_quality = 0;  // JPEG quality of a compression before storing, 1 to 100; 0: none
};
void bind(ParameterTable& table, PhotoFaults& faults);

// Errors of the stored calibration and stamps.
struct CalibrationFaults {
  double focal_percent = 0.0;  // error of the stored focal lengths
  double cx_px = 0.0;          // error of the stored principal point in x
  double cy_px = 0.0;          // error of the stored principal point in y
  // Translation and rotation error of the registration of depth to color, in random directions.
  double depth_shift_mm = 0.0;
  double depth_turn_deg = 0.0;
  // Known distance of the depth camera to the right of the color camera; depth is registered to
  // color, with occlusion shadows. 0: both cameras have one position, except for depth_shift_mm.
  double depth_baseline_mm = 0.0;
  int depth_width_px = 0;   // width of depth images, with the field of view of color; 0: as color
  int depth_height_px = 0;  // height of depth images; 0: as color
  double depth_delay_s = 0.0;      // delay of depth images after color images
  double rolling_shutter_s = 0.0;  // time from the first to the last row of color; the depth
                                   // shutter is global, as on the RealSense D435
};
void bind(ParameterTable& table, CalibrationFaults& faults);

// Errors of the recorder.
struct RecordingFaults {
  double dropped_frames = 0.0;     // fraction of missing frames; the first frame is always stored
  double duplicated_frames = 0.0;  // fraction of frames with the images of the previous frame
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

// Returns the camera with the errors of the stored calibration.
Camera stored_camera(Camera camera, const CalibrationFaults& faults);
// Return the true and the stored pose of the depth camera in the color camera's frame.
Pose color_from_depth(const CalibrationFaults& faults, std::uint64_t seed);
Pose stored_color_from_depth(const CalibrationFaults& faults);

// A stored frame. recorded_frames returns all stored frames, ascending.
struct RecordedFrame {
  std::size_t frame = 0;        // index of the frame, from 0
  std::size_t image_frame = 0;  // index of the frame that provides the images
  double stamp_error_s = 0.0;   // error added to the stamp
};
std::vector<RecordedFrame> recorded_frames(std::size_t frames, const RecordingFaults& faults,
                                           std::uint64_t seed);

// Applies DepthFaults::measured to the depths of a view, before noise.
void distort_depth(SurfaceView& view, const DepthFaults& faults);

// Adds multipath interference to the depths of a view; all surfaces are diffuse with `reflectance`
// (0 to 1). Light that reaches a surface via another surface travels farther than direct light. The
// camera measures the mean of both path lengths, weighted by intensity (Fuchs 2010, for path
// differences that are small against the modulation wavelength). Concave edges appear rounded and
// farther away; flat and convex surfaces do not change. One reflection is computed on a grid of
// pixels and interpolated.
void add_multipath(SurfaceView& view, const VisibleSurface& surface, const ViewRays& rays,
                   const Pose& world_from_camera, double reflectance);

// Removes depth in random discs. Returns the number of measurements that were removed.
std::size_t punch_holes(DepthImage& depth, const DepthFaults& faults, std::uint64_t seed);

// Averages the view's colors over the exposure, along the image motion of each surface point.
// `now_from_later(time_s)` is the camera's pose `time_s` after the middle of the exposure, relative
// to the pose at the middle.
void blur_by_motion(SurfaceView& view, const Camera& camera,
                    const std::function<Pose(double time_s)>& now_from_later, double exposure_s);
// Draws whether the frame with this seed is blurred.
bool is_blurred(const PhotoFaults& faults, std::uint64_t seed);
// Applies the drifts of brightness and white balance; `frame` counts from 0.
void change_exposure(SurfaceView& view, const PhotoFaults& faults, std::uint64_t seed,
                     std::uint64_t frame);
// Compresses and decompresses a photograph; returns it unchanged if jpeg_quality is 0.
ColorImage compress_photo(const ColorImage& photo, const PhotoFaults& faults);

}  // namespace libmap
