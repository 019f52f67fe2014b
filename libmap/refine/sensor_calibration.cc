#include "libmap/refine/sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <set>
#include <utility>

#include "libmap/core/text.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

namespace {

// A part of a scan as a scan of its own.
struct Excerpt {
  std::vector<FrameFeatures> frames;
  std::vector<FeatureLink> links;
  std::map<int, Pose> poses;
  std::vector<GraphLinkResult> graph_links;
  std::vector<GraphComponent> components;
};

// Breadth first from the frame with most links.
std::set<std::size_t> joined_frames(std::size_t frames, const std::vector<FeatureLink>& links,
                                    std::size_t most) {
  std::vector<std::vector<std::size_t>> joined(frames);
  for (const FeatureLink& link : links) {
    joined[link.frames.first].push_back(link.frames.second);
    joined[link.frames.second].push_back(link.frames.first);
  }
  const auto first =
      std::max_element(joined.begin(), joined.end(),
                       [](const auto& a, const auto& b) { return a.size() < b.size(); });
  std::set<std::size_t> taken;
  std::deque<std::size_t> next = {static_cast<std::size_t>(first - joined.begin())};
  while (!next.empty() && taken.size() < most) {
    const std::size_t frame = next.front();
    next.pop_front();
    if (!taken.insert(frame).second) continue;
    next.insert(next.end(), joined[frame].begin(), joined[frame].end());
  }
  return taken;
}

Excerpt excerpt_of(const std::vector<FrameFeatures>& frames, const std::vector<FeatureLink>& links,
                   const std::map<int, Pose>& map_from_base,
                   const std::vector<GraphLinkResult>& graph_links,
                   const std::vector<GraphComponent>& components, std::size_t most) {
  Excerpt part;
  std::map<std::size_t, std::size_t> place;
  for (const std::size_t f : joined_frames(frames.size(), links, most)) {
    const auto pose = map_from_base.find(frames[f].node);
    if (pose == map_from_base.end()) continue;
    place.emplace(f, part.frames.size());
    part.frames.push_back(frames[f]);
    part.frames.back().descriptors = {};
    part.poses.insert(*pose);
  }
  for (const FeatureLink& link : links) {
    const auto a = place.find(link.frames.first);
    const auto b = place.find(link.frames.second);
    if (a == place.end() || b == place.end()) continue;
    part.links.push_back(link);
    part.links.back().frames = {a->second, b->second};
  }
  for (const GraphLinkResult& link : graph_links)
    if (part.poses.contains(link.link.from) && part.poses.contains(link.link.to))
      part.graph_links.push_back(link);
  for (const GraphComponent& component : components) {
    GraphComponent kept;
    std::copy_if(component.nodes.begin(), component.nodes.end(), std::back_inserter(kept.nodes),
                 [&](int node) { return part.poses.contains(node); });
    if (kept.nodes.empty()) continue;
    kept.gauge_node =
        part.poses.contains(component.gauge_node) ? component.gauge_node : kept.nodes.front();
    part.components.push_back(std::move(kept));
  }
  return part;
}

constexpr int registration_rounds = 3;

// What is free in an adjustment.
struct Model {
  bool intrinsics = false;
  bool depth = false;
  bool registration = false;

  std::string name() const {
    std::string text;
    for (const auto& [free, part] : {std::pair(intrinsics, "intrinsics"), std::pair(depth, "depth"),
                                     std::pair(registration, "registration")})
      if (free) text += (text.empty() ? "" : "_") + std::string(part);
    return text;
  }
};

// How what was held out fits with a model.
struct Candidate {
  Model model;
  SensorCalibration calibration;
  BundleAdjustmentResult adjustment;
  HeldOutCosts costs;
};

bool is_negligible(const Pose& registration) {
  return registration.translation().norm() < 3e-4 &&
         rotation_vector_of(registration.linear()).norm() < 2e-4;
}

Candidate try_model(const Model& model, const Excerpt& part, BundleAdjustmentOptions options,
                    const std::vector<Pose>& color_from_depth) {
  options.refine_intrinsics = model.intrinsics;
  options.refine_depth = model.depth;
  options.refine_registration = model.registration;
  Candidate candidate;
  candidate.model = model;
  std::vector<FrameFeatures> frames = part.frames;
  std::map<int, Pose> poses = part.poses;
  if (model.registration && !color_from_depth.empty()) {
    candidate.calibration.color_from_depth = color_from_depth;
    for (FrameFeatures& frame : frames) register_depth(frame, color_from_depth);
  }
  // Other planes are met when depth is registered otherwise: once more from there.
  const int rounds = model.registration && color_from_depth.empty() ? registration_rounds : 1;
  for (int round = 0; round < rounds; ++round) {
    candidate.adjustment =
        adjust_bundle(frames, part.links, poses, part.graph_links, part.components, options);
    poses = candidate.adjustment.map_from_base;
    if (!model.registration) break;
    std::vector<Pose>& all = candidate.calibration.color_from_depth;
    const std::vector<Pose>& last = candidate.adjustment.color_from_depth;
    all.resize(last.size(), Pose::Identity());
    for (std::size_t n = 0; n < all.size(); ++n) all[n] = all[n] * last[n];
    if (std::all_of(last.begin(), last.end(), is_negligible)) break;
    frames = part.frames;
    for (FrameFeatures& frame : frames) register_depth(frame, all);
  }
  if (model.intrinsics) candidate.calibration.intrinsics = candidate.adjustment.intrinsics;
  if (model.depth) candidate.calibration.depth = candidate.adjustment.depth;
  frames = part.frames;
  for (FrameFeatures& frame : frames) calibrate(frame, candidate.calibration);
  candidate.costs = held_out_costs(frames, part.links, candidate.adjustment.map_from_base);
  return candidate;
}

// Whether what is free in the one model more is clearly worth it.
bool is_needed(const HeldOutCosts& without, const HeldOutCosts& with) {
  const HeldOutEvaluation change = evaluate_held_out(without, with);
  return !change.is_worse() && change.change() < -2.0 * change.deviation();
}

}  // namespace

void calibrate(FrameFeatures& frame, const SensorCalibration& calibration) {
  if (!calibration.color_from_depth.empty()) register_depth(frame, calibration.color_from_depth);
  // Before the intrinsics: it goes by pixels, which the stored camera made of the features' rays.
  if (!calibration.depth.empty()) correct_depth(frame, calibration.depth);
  if (!calibration.intrinsics.empty()) move_intrinsics(frame, calibration.intrinsics);
}

CalibrationEstimate estimate_calibration(const std::vector<FrameFeatures>& frames,
                                         const std::vector<FeatureLink>& links,
                                         const std::map<int, Pose>& map_from_base,
                                         const std::vector<GraphLinkResult>& graph_links,
                                         const std::vector<GraphComponent>& components,
                                         const BundleAdjustmentOptions& options,
                                         const CalibrationChoice& choice, std::size_t max_frames) {
  const Excerpt part =
      excerpt_of(frames, links, map_from_base, graph_links, components, max_frames);
  const HeldOutCosts before = held_out_costs(part.frames, part.links, part.poses);
  CalibrationEstimate estimate;
  estimate.frames = part.frames.size();
  const auto attempt = [&](const Model& model, const std::vector<Pose>& color_from_depth) {
    Candidate candidate = try_model(model, part, options, color_from_depth);
    estimate.tried.emplace_back(model.name(), evaluate_held_out(before, candidate.costs));
    return candidate;
  };
  const auto is_good = [&](const Candidate& candidate) {
    const HeldOutEvaluation change = evaluate_held_out(before, candidate.costs);
    return candidate.adjustment.converged &&
           (choice.only_if_better ? change.is_clearly_better() : !change.is_worse());
  };
  Candidate best =
      attempt({choice.intrinsics, choice.depth, choice.registration}, choice.color_from_depth);
  // Too much freedom for little data may hide what intrinsics alone explain.
  if (!is_good(best) && choice.leave_out && choice.intrinsics &&
      (choice.depth || choice.registration))
    best = attempt({choice.intrinsics, false, false}, {});
  for (bool Model::*part_of : {&Model::registration, &Model::depth, &Model::intrinsics}) {
    Model simpler = best.model;
    simpler.*part_of = false;
    if (!is_good(best) || !choice.only_if_better || !choice.leave_out || !(best.model.*part_of) ||
        simpler.name().empty())
      continue;
    Candidate candidate = attempt(simpler, best.calibration.color_from_depth);
    if (is_good(candidate) && !is_needed(candidate.costs, best.costs)) best = std::move(candidate);
  }
  if (is_good(best)) estimate.calibration = best.calibration;
  estimate.held_out = evaluate_held_out(before, best.costs);
  estimate.adjustment = std::move(best.adjustment);
  return estimate;
}

CameraFile calibrated_camera(const Camera& stored, const Camera& picture,
                             const SensorCalibration& calibration, std::size_t n) {
  CameraFile file{.camera = stored};
  if (n < calibration.intrinsics.size()) {
    // Estimated in pixels of the pictures, which may be smaller than the stored camera's.
    IntrinsicsStep step = calibration.intrinsics[n];
    step.cx_px *= static_cast<double>(stored.width) / picture.width;
    step.cy_px *= static_cast<double>(stored.height) / picture.height;
    file.camera = moved(stored, step);
  }
  if (n < calibration.color_from_depth.size())
    file.color_from_depth = calibration.color_from_depth[n];
  if (n < calibration.depth.size()) file.depth = calibration.depth[n];
  return file;
}

std::vector<std::string> findings(const SensorCalibration& calibration,
                                  const std::vector<Camera>& cameras) {
  std::vector<std::string> sentences;
  const auto of_camera = [&](std::size_t n) {
    return cameras.size() > 1 ? "camera " + std::to_string(n + 1) + ": " : std::string();
  };
  for (std::size_t n = 0; n < std::min(calibration.intrinsics.size(), cameras.size()); ++n) {
    const IntrinsicsStep& step = calibration.intrinsics[n];
    const double percent = 100.0 * (1.0 / (1.0 + 0.5 * (step.fx_share + step.fy_share)) - 1.0);
    sentences.push_back(of_camera(n) + "stored focal length " +
                        to_fixed_text(std::abs(percent), 2) + " % too " +
                        (percent > 0.0 ? "large" : "small") + ", principal point off by " +
                        to_fixed_text(std::hypot(step.cx_px, step.cy_px), 1) + " px: corrected");
  }
  for (std::size_t n = 0; n < std::min(calibration.depth.size(), cameras.size()); ++n) {
    const DepthCorrection& depth = calibration.depth[n];
    if (depth.empty()) continue;
    constexpr int places = 100;
    double lowest = depth.at(depth.first_m, 0.0);
    double highest = lowest;
    for (int k = 0; k <= places; ++k) {
      const double z = depth.first_m + (depth.last_m() - depth.first_m) * k / places;
      lowest = std::min(lowest, depth.at(z, 0.0));
      highest = std::max(highest, depth.at(z, 0.0));
    }
    const double middle = 0.5 * (depth.first_m + depth.last_m());
    sentences.push_back(
        of_camera(n) + "depth bends by " + to_fixed_text(500.0 * (highest - lowest), 1) +
        " mm with range and by " +
        to_fixed_text(1e3 * std::abs(depth.at(middle, 1.0) - depth.at(middle, 0.0)), 1) +
        " mm toward the corners: corrected; the scale is that of the depth camera");
  }
  for (std::size_t n = 0; n < std::min(calibration.color_from_depth.size(), cameras.size()); ++n) {
    const Pose& pose = calibration.color_from_depth[n];
    sentences.push_back(
        of_camera(n) + "depth registered to color " +
        to_fixed_text(1e3 * pose.translation().norm(), 1) + " mm and " +
        to_fixed_text(rotation_vector_of(pose.linear()).norm() * 180.0 / std::numbers::pi, 2) +
        " deg off: corrected");
  }
  return sentences;
}

}  // namespace libmap
