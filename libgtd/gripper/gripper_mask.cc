#include "libgtd/gripper/gripper_mask.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libgtd/gripper/closing_path.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

double tan_deg(double degrees) { return std::tan(degrees * (std::numbers::pi / 180.0)); }
double cos_deg(double degrees) { return std::cos(degrees * (std::numbers::pi / 180.0)); }

// Distance of (x, y) from (center, center), in single precision like the author's program.
float distance(double center, int x, int y) {
  return static_cast<float>(std::hypot(center - x, center - y));
}

// Limit of memory: one byte each for `solid` and `counted`.
constexpr double max_mask_voxels = 0x1p28;

libmap::Error too_small(double voxel_size_m, double mask_voxels) {
  const double gigabytes = 2.0 * mask_voxels / 0x1p30;
  return libmap::Error("too small for this gripper: the mask would take " +
                           libmap::to_text(static_cast<float>(gigabytes)) + " GiB, more than " +
                           libmap::to_text(2.0 * max_mask_voxels / 0x1p30) + " GiB",
                       {.field = "voxel_size_m", .value = libmap::to_text(voxel_size_m)});
}

// Number of voxels along one side. Rejects the thin and very wide masks of extreme dimensions.
int whole_voxels(double voxels, const GripperMaskOptions& options) {
  if (voxels >= 0.0 && voxels <= 0x1p20) return static_cast<int>(voxels);
  throw libmap::Error("too small: the mask is " + libmap::to_text(static_cast<float>(voxels)) +
                          " voxels wide or high, more than 2^20",
                      {.field = "voxel_size_m", .value = libmap::to_text(options.voxel_size_m)});
}

void allocate(GripperMask& mask) {
  const double voxels = static_cast<double>(mask.side) * mask.side * mask.layers;
  if (mask.side < 3 || mask.solid_layers < 2)
    throw libmap::Error("too large for this gripper: the mask would have " +
                            std::to_string(mask.side) + " voxels per side and " +
                            std::to_string(mask.solid_layers) + " layers",
                        {.field = "voxel_size_m", .value = libmap::to_text(mask.voxel_size_m)});
  if (voxels > max_mask_voxels) throw too_small(mask.voxel_size_m, voxels);
  mask.solid.assign(static_cast<std::size_t>(voxels), 0);
  mask.counted.assign(static_cast<std::size_t>(voxels), 1);
}

// Sets each voxel of the solid layers to solid(x, y, s), with s = 1 for the top layer.
template <typename Solid>
void fill(GripperMask& mask, const Solid& solid) {
  for (int s = 1; s <= mask.solid_layers; ++s)
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y)
        mask.solid[mask.index(x, y, mask.solid_layers - s)] = solid(x, y, s) ? 1 : 0;
}

// Dimensions in voxels, rounded as by `thesis` and `envelope` (eq. 3-6..3-12).
struct VoxelMeasures {
  float ratio = 0.0F;  // voxels per millimeter
  double half = 0.0;
  int H = 0;
  double RT = 0.0;
  double Hcl = 0.0;
  double RB = 0.0;

  double in_voxels(double millimeters) const {
    return static_cast<double>(static_cast<float>(millimeters * static_cast<double>(ratio)));
  }
};

VoxelMeasures measure(const Gripper& gripper, const GripperMaskOptions& options) {
  VoxelMeasures m;
  m.ratio = 1.0F / (static_cast<float>(options.voxel_size_m) * 1000.0F);
  const auto rounded = [&](double millimeters) { return std::round(m.in_voxels(millimeters)); };
  const bool exact_palm = options.method == Method::envelope;
  const double P =
      exact_palm ? m.in_voxels(gripper.palm_diameter_mm) : rounded(gripper.palm_diameter_mm);
  const double mt =
      exact_palm ? m.in_voxels(gripper.top_solid_margin_mm) : rounded(gripper.top_solid_margin_mm);
  m.half = rounded(gripper.finger_joint_diameter_mm) / 2.0 + rounded(gripper.finger_length_mm) +
           rounded(gripper.spine_length_mm);
  m.H = whole_voxels(rounded(gripper.closing_height_mm), options);
  const double L = std::floor(2.0 * m.half) + (options.method == Method::climblab ? 1.0 : 0.0);
  m.RT = std::round((P + mt) / 2.0);
  m.Hcl = std::round((L - P) / 2.0 * tan_deg(90.0 - gripper.opening_angle_deg));
  m.RB = std::round(P / 2.0 + m.H * tan_deg(gripper.closing_angle_deg) -
                    rounded(gripper.bottom_void_margin_mm));
  return m;
}

GripperMask empty_mask(const GripperMaskOptions& options, double side, int solid_layers) {
  GripperMask mask;
  mask.method = options.method;
  mask.voxel_size_m = options.voxel_size_m;
  mask.side = whole_voxels(side, options);
  mask.solid_layers = solid_layers;
  mask.layers = solid_layers + options.extra_void_layers;
  mask.pivot_xy = mask.side / 2;
  mask.pivot_z = solid_layers;
  allocate(mask);
  return mask;
}

GripperMask make_thesis(const Gripper& gripper, const GripperMaskOptions& options) {
  const VoxelMeasures m = measure(gripper, options);
  GripperMask mask = empty_mask(options, 2.0 * m.half, m.H);
  const double cone = tan_deg(90.0 - gripper.opening_angle_deg);
  fill(mask, [&](int x, int y, int s) {
    const float d = distance(m.half, x, y);
    const double Rg = std::round(m.RT + (s - 1) / cone);
    const double t = m.RB - m.H + s - 1;
    const double Rui = std::round(std::sqrt(2.0 * m.RB * t - t * t));
    return (s <= m.Hcl && d <= Rg) || (m.Hcl < s && s <= m.H - m.RB && d < m.half) ||
           (m.H - m.RB < s && s < m.H && d > Rui) || (s == m.H && d > m.RB);
  });
  return mask;
}

// Eq. 5-1, 5-2, and the counted volume of 5.1.2.
GripperMask make_envelope(const Gripper& gripper, const GripperMaskOptions& options) {
  const VoxelMeasures m = measure(gripper, options);
  GripperMask mask = empty_mask(options, 2.0 * m.half, m.H);
  const double cone = tan_deg(90.0 - gripper.opening_angle_deg);
  const double cos_closed = cos_deg(gripper.closing_angle_deg);
  // As in `thesis`, the ring has two parts, below Hcl and below H - RB: with RB > H (HubRobo) the
  // second starts above the end of the cone.
  const double ring_top = std::min(m.Hcl, m.H - m.RB);
  fill(mask, [&](int x, int y, int s) {
    const float d = distance(m.half, x, y);
    const double q = m.H - s + 1;
    const double depth = s - 1;
    const double Rg = std::round(m.RT + depth / cone);
    const double Ruo = std::round(m.RT + std::sqrt(2.0 * m.H / cos_closed * q - q * q));
    const double Rui = std::round(std::sqrt(2.0 * (m.H - m.Hcl) * depth - depth * depth) - m.Hcl);
    return (s <= m.Hcl && d <= Rg) || (ring_top < s && s < m.H && Rui < d && d <= Ruo) ||
           (s == m.H && m.RB < d && d <= Ruo);
  });
  const int center = mask.side / 2;
  const double Rc = std::round(m.in_voxels(gripper.palm_diameter_mm) / 2.0);
  for (int z = 0; z < mask.layers; ++z) {
    const double reach =
        std::round(Rc + std::sqrt(2.0 * (mask.layers - 1) / cos_closed * z - 1.0 * z * z));
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y)
        mask.counted[mask.index(x, y, z)] = distance(center, x, y) <= reach ? 1 : 0;
  }
  return mask;
}

// ClimbLab v3: odd side around the exact center, no void layers, pivot on top.
GripperMask make_climblab(const Gripper& gripper, GripperMaskOptions options) {
  options.extra_void_layers = 0;
  const VoxelMeasures m = measure(gripper, options);
  GripperMask mask = empty_mask(options, std::floor(2.0 * m.half) + 1.0, m.H);
  // One after the center: the index (L + 1) / 2 starts at 1 in MATLAB, at 0 here.
  mask.pivot_xy = (mask.side + 1) / 2;
  mask.pivot_z = m.H - 1;
  const double ROS = std::round(m.in_voxels(gripper.opening_spine_radius_mm));
  const double DOS = std::round(m.in_voxels(gripper.opening_spine_depth_mm));
  const double DS = std::round(m.in_voxels(gripper.spine_depth_mm));
  const int center = mask.side / 2;
  fill(mask, [&](int x, int y, int s) {
    const float d = distance(center, x, y);
    const double depth = s - 1;
    const double Rg = m.RT + (m.half - m.RT) * depth / (m.Hcl - 1.0);
    const double outer = m.half - std::round(m.half - (ROS + DS)) * depth / (DOS - 1.0);
    return (s <= m.Hcl && (d < Rg || d > outer)) || (m.Hcl < s && s < m.H) ||
           (s == m.H && d > m.RB);
  });
  return mask;
}

// Evaluates the radii of `thesis` in millimeters at the center of each voxel. The pivot is the
// center of the top solid layer (fig. 3-11).
GripperMask make_corrected(const Gripper& gripper, const GripperMaskOptions& options) {
  const double voxel_mm = options.voxel_size_m * 1000.0;
  const double half =
      gripper.finger_joint_diameter_mm / 2.0 + gripper.finger_length_mm + gripper.spine_length_mm;
  // The slack makes lengths of whole voxels independent of the rounding of a quotient.
  const double slack = 1e-9;
  const double rings = std::floor(half / voxel_mm + slack);
  const double depth_layers = std::ceil(gripper.closing_height_mm / voxel_mm - slack);
  GripperMask mask = empty_mask(options, 2.0 * rings + 1.0, whole_voxels(depth_layers, options));
  mask.pivot_z = mask.solid_layers - 1;
  const double cone = tan_deg(90.0 - gripper.opening_angle_deg);
  const double RT = (gripper.palm_diameter_mm + gripper.top_solid_margin_mm) / 2.0;
  const double Hcl = (2.0 * half - gripper.palm_diameter_mm) / 2.0 * cone;
  const double H = gripper.closing_height_mm;
  const double RB = gripper.palm_diameter_mm / 2.0 + H * tan_deg(gripper.closing_angle_deg) -
                    gripper.bottom_void_margin_mm;
  mask.closed_radius_m = 0.001 * RB;
  mask.open_radius_m = 0.001 * half;
  // More than the spine depth and than one voxel, which may be rounding. The value is midway
  // between two possible falls of heights in whole voxels, plus slack, because filled gaps have
  // half voxels.
  const double voxels = std::floor(std::max(1.0, gripper.spine_depth_mm / voxel_mm) + slack);
  mask.min_fall_m = options.voxel_size_m * (voxels + 0.5 + 1e-6);
  fill(mask, [&](int x, int y, int s) {
    const double d = voxel_mm * std::hypot(x - mask.pivot_xy, y - mask.pivot_xy);
    const double depth = voxel_mm * (s - 1);
    if (s == mask.solid_layers) return d > RB;
    if (depth < Hcl) return d <= RT + depth / cone;
    const double t = depth - (H - RB);
    return t <= 0.0 ? d < half : d > std::sqrt(2.0 * RB * t - t * t);
  });
  return mask;
}

}  // namespace

const std::vector<std::pair<std::string, Method>>& method_names() {
  static const std::vector<std::pair<std::string, Method>> names = {
      {"thesis", Method::thesis},
      {"envelope", Method::envelope},
      {"climblab", Method::climblab},
      {"corrected", Method::corrected},
      {"calibrated", Method::calibrated}};
  return names;
}

std::string name_of(Method method) {
  for (const auto& [name, value] : method_names())
    if (value == method) return name;
  return {};
}

namespace {

GripperMask make_mask(const Gripper& gripper, const GripperMaskOptions& options) {
  switch (options.method) {
    case Method::thesis:
      return make_thesis(gripper, options);
    case Method::envelope:
      return make_envelope(gripper, options);
    case Method::climblab:
      return make_climblab(gripper, options);
    case Method::corrected:
    case Method::calibrated:
      break;
  }
  GripperMask mask = make_corrected(gripper, options);
  mask.method = Method::corrected;
  if (options.method == Method::calibrated)
    mask.closing = std::make_shared<const ClosingPath>(
        make_closing_path(gripper, options.voxel_size_m, options.load_n));
  return mask;
}

}  // namespace

GripperMask make_gripper_mask(const Gripper& gripper, const GripperMaskOptions& options) {
  gripper.check();
  if (!(options.voxel_size_m > 0.0) || !std::isfinite(options.voxel_size_m))
    throw libmap::Error(
        "out of range",
        {.field = "voxel_size_m", .value = libmap::to_text(options.voxel_size_m), .bound = "> 0"});
  if (options.extra_void_layers < 0 || options.extra_void_layers > 10000)
    throw libmap::Error("out of range", {.field = "extra_void_layers",
                                         .value = std::to_string(options.extra_void_layers),
                                         .bound = ">= 0 and <= 10000"});
  // Checked before the dimensions in voxels, which might overflow their integers.
  const double half_m = (gripper.finger_joint_diameter_mm / 2.0 + gripper.finger_length_mm +
                         gripper.spine_length_mm) /
                        1000.0;
  const double side = 2.0 * half_m / options.voxel_size_m;
  const double layers = gripper.closing_height_mm / 1000.0 / options.voxel_size_m;
  if (side * side * layers > 4.0 * max_mask_voxels)
    throw too_small(options.voxel_size_m, side * side * layers);
  GripperMask mask = make_mask(gripper, options);
  mask.palm_diameter_m = gripper.palm_diameter_mm / 1000.0;
  return mask;
}

std::string to_text(const GripperMask& mask) {
  std::string text =
      "# dims nx ny nz, z = 0 is the lowest layer; a line is an x, a character a y\n";
  text += std::to_string(mask.side) + " " + std::to_string(mask.side) + " " +
          std::to_string(mask.layers) + "\n";
  for (int z = 0; z < mask.layers; ++z) {
    text += "z " + std::to_string(z) + "\n";
    for (int x = 0; x < mask.side; ++x) {
      for (int y = 0; y < mask.side; ++y) text += mask.is_solid(x, y, z) ? '1' : '0';
      text += '\n';
    }
  }
  return text;
}

libmap::PointCloud to_cloud(const GripperMask& mask) {
  libmap::PointCloud cloud;
  std::vector<double> layers;
  std::vector<double> counted;
  for (int x = 0; x < mask.side; ++x)
    for (int y = 0; y < mask.side; ++y)
      for (int z = 0; z < mask.layers; ++z) {
        if (!mask.is_solid(x, y, z)) continue;
        const Eigen::Vector3d offset(x - mask.pivot_xy, y - mask.pivot_xy, z - mask.pivot_z);
        cloud.positions.push_back(mask.voxel_size_m * offset);
        layers.push_back(z);
        counted.push_back(mask.is_counted(x, y, z) ? 1.0 : 0.0);
      }
  cloud.add_field("layer", libmap::ScalarType::uint16).values = layers;
  cloud.add_field("counted", libmap::ScalarType::uint8).values = counted;
  return cloud;
}

}  // namespace libgtd
