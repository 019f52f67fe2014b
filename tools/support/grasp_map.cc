#include "tools/support/grasp_map.h"

#include <array>
#include <cstddef>
#include <sstream>
#include <system_error>

#include "libgtd/grasp/grip_candidates.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/parallel.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t field_count = 5;
using Values = std::array<double, field_count>;  // of one voxel, as grasp_fields
constexpr Values no_candidate = {0.0, 0.0, -1.0, 0.0, 0.0};

// As they are written: what is read again from a tile is the same.
Values values_of(const libgtd::LocationResult& result) {
  Values values = {result.hold_probability, result.force_n[1],
                   result.has_force ? static_cast<double>(result.limiting_direction) : -1.0,
                   result.unseen, static_cast<double>(result.trials)};
  for (double& value : values) value = static_cast<float>(value);
  return values;
}

// Each location of a tile is a step of the whole map.
class StepsOfTile : public libmap::Progress {
 public:
  explicit StepsOfTile(libmap::Progress& whole) : whole_(whole) {}
  void begin(std::string_view /*stage*/, std::size_t /*total*/) override {}
  void advance(std::size_t steps) override { whole_.advance(steps); }
  void end() override {}

 private:
  libmap::Progress& whole_;
};

using TileNumber = std::pair<std::int64_t, std::int64_t>;
using Tiles = std::map<TileNumber, std::vector<std::size_t>>;  // voxels of each

// The finished tiles of a run, a file each. One of another key, or not whole, does not count.
class FinishedTiles {
 public:
  FinishedTiles(fs::path folder, std::string key)
      : folder_(std::move(folder)), key_(std::move(key)) {
    std::error_code error;
    fs::create_directory(folder_, error);
    if (!fs::is_directory(folder_))
      throw libmap::Error("is no folder for finished tiles", {.file = folder_.string()});
  }

  std::optional<std::vector<Values>> find(const TileNumber& tile, std::size_t voxels) const {
    if (!fs::exists(file_of(tile))) return std::nullopt;
    std::istringstream text(libmap::read_whole_file(file_of(tile)));
    std::string line;
    if (!std::getline(text, line) || line != key_) return std::nullopt;
    std::vector<Values> found;
    while (std::getline(text, line)) {
      const std::vector<std::string> words = libmap::split_list(line);
      if (words.size() != field_count) return std::nullopt;
      Values& values = found.emplace_back();
      for (std::size_t n = 0; n < field_count; ++n) {
        const auto value = libmap::parse_double(words[n]);
        if (!value) return std::nullopt;
        values[n] = *value;
      }
    }
    if (found.size() != voxels) return std::nullopt;
    return found;
  }

  void add(const TileNumber& tile, const std::vector<Values>& values) const {
    std::string text = key_ + "\n";
    for (const Values& voxel : values) {
      for (std::size_t n = 0; n < field_count; ++n)
        text += (n == 0 ? "" : ",") + libmap::to_text(voxel[n]);
      text += "\n";
    }
    libmap::write_whole_file(file_of(tile), text);
  }

  // What others put into the folder stays.
  void remove(const Tiles& tiles) const {
    std::error_code error;
    for (const auto& [tile, voxels] : tiles) fs::remove(file_of(tile), error);
    fs::remove(folder_, error);
  }

 private:
  fs::path file_of(const TileNumber& tile) const {
    return folder_ / fmt::format("{}_{}.txt", tile.first, tile.second);
  }

  fs::path folder_;
  std::string key_;
};

Tiles tiles_of(const std::vector<Eigen::Vector3d>& positions) {
  constexpr double tile_m = 1.0;
  Tiles tiles;
  for (std::size_t n = 0; n < positions.size(); ++n) {
    const Eigen::Vector3d tile = (positions[n] / tile_m).array().floor();
    if (!(tile.head<2>().cwiseAbs().maxCoeff() < 1e9))
      throw libmap::Error("a voxel's place is out of bounds",
                          {.field = "point " + std::to_string(n + 1)});
    tiles[{static_cast<std::int64_t>(tile.x()), static_cast<std::int64_t>(tile.y())}].push_back(n);
  }
  return tiles;
}

// The places in the mesh's frame where the gripper is closed; nothing at the others.
std::vector<std::optional<Eigen::Vector3d>> candidates_of(
    const std::vector<Eigen::Vector3d>& positions, const libmap::Pose& map_from_mesh,
    const libmap::TriangleMesh& mesh, const libgtd::Ground& ground, const libgtd::Gripper& gripper,
    const libgtd::GraspOptions& options) {
  const libgtd::GripCandidates from_above(mesh, gripper,
                                          {.start_height_m = options.closing.start_height_m});
  const libmap::Pose mesh_from_map = map_from_mesh.inverse();
  std::vector<std::optional<Eigen::Vector3d>> candidates(positions.size());
  bool is_on_mesh = false;
  for (const Eigen::Vector3d& position : positions)
    is_on_mesh =
        is_on_mesh || ground.distance(mesh_from_map * position, options.max_distance_m).has_value();
  if (!is_on_mesh)
    throw libmap::Error("none of its voxels is on the mesh",
                        {.bound = "within " + libmap::to_text(options.max_distance_m) + " m"});
  constexpr std::size_t grain = 256;
  libmap::parallel_for(positions.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const Eigen::Vector3d place = mesh_from_map * positions[n];
      // Along a normal the gripper comes from anywhere.
      if (options.approach == libgtd::ApproachDirection::up && !from_above.may_hold(place))
        continue;
      if (ground.distance(place, options.max_distance_m)) candidates[n] = place;
    }
  });
  return candidates;
}

void note_results(const libmap::PointCloud& map, Run& run) {
  const std::vector<double>& probability = map.find_field("hold_probability")->values;
  std::int64_t candidates = 0;
  std::int64_t holding = 0;
  double trials = 0.0;
  for (std::size_t n = 0; n < map.size(); ++n) {
    const double made = map.find_field("grasp_trials")->values[n];
    candidates += made > 0.0 ? 1 : 0;
    holding += probability[n] >= 0.5 ? 1 : 0;
    trials += made;
  }
  run.add_results(
      {{"grasp_voxels", map.size()},
       {"grasp_candidates", candidates},
       {"grasp_holding", holding},
       {"grasp_mean_trials", candidates == 0 ? 0.0 : trials / static_cast<double>(candidates)}});
  run.say("{} of {} voxels hold; {} were tested, with {:.1f} trials each", holding, map.size(),
          candidates, candidates == 0 ? 0.0 : trials / static_cast<double>(candidates));
}

}  // namespace

const std::vector<std::string>& grasp_fields() {
  static const std::vector<std::string> names = {
      "hold_probability", "holding_force_n", "limiting_direction", "grasp_unseen", "grasp_trials"};
  return names;
}

void grasp_map(const GraspMapInput& input, const libmap::TriangleMesh& mesh,
               const libgtd::Gripper& gripper, const libgtd::GraspOptions& options, Run& run) {
  libmap::PointCloud map = libmap::read_cloud(input.map_file).cloud;
  if (map.empty()) throw libmap::Error("the map has no points", {.file = input.map_file});
  for (const std::string& name : grasp_fields())
    if (map.find_field(name) != nullptr)
      throw libmap::Error("the map has this field already",
                          {.file = input.map_file, .field = name});
  const std::optional<libmap::Manifest> manifest = libmap::read_manifest_of(input.map_file);
  if (manifest) carry_facts(*manifest, run);
  const auto ground = in_file(input.mesh_file, [&] { return libgtd::Ground(mesh); });
  const Tiles tiles = in_file(input.map_file, [&] { return tiles_of(map.positions); });
  const auto candidates = in_file(input.map_file, [&] {
    return run.timed("candidates", [&] {
      return candidates_of(map.positions, map_from_input(manifest), mesh, ground, gripper, options);
    });
  });
  if (!manifest)
    run.warn(input.map_file + ": no manifest beside it: it is taken in the mesh's frame");
  if (run.options().dry_run) return;
  std::string key = run.manifest().version + input.parameters_hash + std::to_string(options.seed);
  for (const std::string& file : {input.mesh_file, input.map_file})
    key += libmap::sha256_of_file(file);
  if (manifest) key += libmap::to_text(map_from_input(manifest).matrix().sum());
  const FinishedTiles finished(input.output + ".progress", libmap::sha256_of(key));
  std::vector<libmap::ScalarField> fields;
  for (const std::string& name : grasp_fields())
    fields.push_back({name, libmap::ScalarType::float32, std::vector<double>(map.size())});
  run.timed("grasp", [&] {
    run.progress().begin("grasp", map.size());
    StepsOfTile steps(run.progress());
    for (const auto& [tile, voxels] : tiles) {
      std::optional<std::vector<Values>> values = finished.find(tile, voxels.size());
      if (values) {
        steps.advance(voxels.size());
      } else {
        std::vector<Eigen::Vector3d> places;
        for (const std::size_t n : voxels)
          if (candidates[n]) places.push_back(*candidates[n]);
        steps.advance(voxels.size() - places.size());
        const auto results = libgtd::test_grasps(ground, gripper, places, options, steps);
        values.emplace();
        auto next = results.begin();
        for (const std::size_t n : voxels)
          values->push_back(candidates[n] ? values_of(*next++) : no_candidate);
        finished.add(tile, *values);
      }
      for (std::size_t v = 0; v < voxels.size(); ++v)
        for (std::size_t n = 0; n < field_count; ++n) fields[n].values[voxels[v]] = (*values)[v][n];
    }
    run.progress().end();
  });
  for (libmap::ScalarField& field : fields) map.fields.push_back(std::move(field));
  note_results(map, run);
  run.write_output(input.output,
                   [&](const fs::path& temporary) { libmap::write_cloud(temporary, map); });
  finished.remove(tiles);
}

}  // namespace graspmap_tools
