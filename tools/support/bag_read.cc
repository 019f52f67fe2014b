// graspmap convert BAG: its depth images as a rig's folder, or one of its clouds.
#include "libmap/cloud/cloud_io.h"
#include "libmap/ros/bag_cloud.h"
#include "libmap/ros/bag_reader.h"
#include "tools/support/convert_bag.h"

namespace graspmap_tools {

namespace {

namespace fs = std::filesystem;

void add_bag_input(const BagCommandOptions& options, Run& run) {
  for (const fs::path& file : libmap::files_of_bag(options.input)) run.add_input(file);
}

void report(const libmap::BagRigPlan& plan, const libmap::BagRigExport& result,
            const BagCommandOptions& options, Run& run) {
  for (const std::string& warning : result.warnings) {
    if (options.strict) throw libmap::Error(warning, {.file = options.input});
    run.warn(options.input + ": " + warning);
  }
  if (result.pixels_beyond > 0)
    run.warn("{}: {} pixels are deeper than 16 bits can represent and are left out (--depth-scale)",
             options.input, result.pixels_beyond);
  std::size_t fullest = 0;
  for (const libmap::SynchronizedSet& set : result.sets) fullest = std::max(fullest, set.seen());
  run.add_results({{"cameras", plan.rig.cameras.size()},
                   {"images", result.images},
                   {"images_broken", result.broken},
                   {"moments", result.sets.size()},
                   {"moments_in_bag", plan.all_sets},
                   {"cameras_of_fullest_moment", fullest},
                   {"pixels_beyond", result.pixels_beyond}});
  for (std::size_t n = 0; n < plan.rig.cameras.size(); ++n) {
    const libmap::RigCamera& camera = plan.rig.cameras[n];
    run.add_results({{camera.name + ".topic", plan.topics[n]}});
    run.manifest().transforms.emplace_back("robot_from_" + camera.name,
                                           camera.camera.base_from_camera);
    if (plan.topics[n].empty()) run.warn(camera.name + ": no topic of its images");
  }
  run.say("{} images of {} cameras, {} of {} moments, {} cameras at the fullest", result.images,
          plan.rig.cameras.size(), result.sets.size(), plan.all_sets, fullest);
}

}  // namespace

void read_bag_into_folder(const BagCommandOptions& options, Run& run) {
  libmap::BagRigOptions depth = options.depth;
  depth.topics = options.topics;
  if (!options.rig.empty()) depth.rig = read_named_rig(options.rig, run);
  const libmap::BagRigPlan plan = run.timed(
      "survey", [&] { return libmap::plan_bag_rig(options.input, depth, bag_stamp(options)); });
  const std::vector<std::string> names = libmap::names_in_rig_folder(plan);
  run.claim_output_tree(options.output, names, {options.input});
  for (const std::string& warning : plan.warnings) run.warn(options.input + ": " + warning);
  add_bag_input(options, run);
  run.manifest().frame = "robot";
  run.write_output_tree(options.output, names, [&](const fs::path& temporary) {
    report(plan, libmap::export_bag_rig(options.input, plan, temporary), options, run);
  });
}

void read_bag_into_cloud(const BagCommandOptions& options, Run& run) {
  if (options.topics.size() > 1)
    throw libmap::Error("a cloud comes from one topic", {.field = "--topic"});
  run.claim_output(options.output, {options.input});
  const libmap::BagCloudResult result = run.timed("read", [&] {
    return libmap::read_bag_cloud(options.input,
                                  options.topics.empty() ? std::string() : options.topics.front(),
                                  bag_stamp(options));
  });
  add_bag_input(options, run);
  run.manifest().frame = result.frame;
  run.add_results({{"topic", result.topic},
                   {"stamp_s", result.stamp_s},
                   {"messages", result.messages},
                   {"points", result.cloud.size()},
                   {"dropped_points", result.dropped_points}});
  if (result.cloud.empty()) run.warn(options.input + ": " + result.topic + ": no finite points");
  run.say("{} points of {} at {} s, one of {} messages; {} not finite", result.cloud.size(),
          result.topic, libmap::to_fixed_text(result.stamp_s, 6), result.messages,
          result.dropped_points);
  run.write_output(options.output, [&](const fs::path& temporary) {
    libmap::write_cloud(temporary, result.cloud);
  });
}

}  // namespace graspmap_tools
