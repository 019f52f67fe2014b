// graspmap info: describes the content of a scan, cloud, mesh, map or bag.
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/surface/mesh_report.h"
#include "tools/support/command_line.h"
#include "tools/support/info_scan.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"
#include "tools/support/results.h"

using namespace graspmap_tools;

namespace {

using Json = nlohmann::ordered_json;

struct InfoOptions {
  std::string file;
  bool json = false;
  bool verify = false;
  bool quick = false;
};

// Maximum number of listed boundaries of a mesh, the longest first.
constexpr std::size_t listed_boundaries = 10;

Json range_of(const std::vector<double>& values) {
  double low = HUGE_VAL;
  double high = -HUGE_VAL;
  std::size_t finite = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
    ++finite;
  }
  if (finite == 0) return nullptr;
  return Json::array({low, high});
}

Json fields_json(const std::vector<libmap::ScalarField>& fields) {
  Json list = Json::array();
  for (const libmap::ScalarField& field : fields)
    list.push_back({{"name", field.name},
                    {"type", libmap::to_text(field.type)},
                    {"range", range_of(field.values)}});
  return list;
}

Json file_json(const libmap::GeometryFileInfo& info) {
  return {{"format", info.format},
          {"encoding", libmap::to_text(info.encoding)},
          {"bytes", info.bytes},
          {"skipped", info.skipped}};
}

Json cloud_json(const std::string& path) {
  const libmap::CloudReadResult read = libmap::read_cloud(path);
  const bool is_map =
      read.cloud.find_field("score") != nullptr && read.cloud.find_field("ssv") != nullptr;
  return {{"kind", is_map ? "graspability map" : "cloud"},
          {"file", file_json(read.info)},
          {"points", read.cloud.size()},
          {"dropped_points", read.dropped_points},
          {"normals", read.cloud.has_normals()},
          {"colors", read.cloud.has_colors()},
          {"bounds_m", bounds_json(read.cloud.positions)},
          {"fields", fields_json(read.cloud.fields)}};
}

Json boundaries_json(const std::vector<libmap::MeshBoundary>& boundaries) {
  double length = 0.0;
  Json longest = Json::array();
  for (const libmap::MeshBoundary& boundary : boundaries) {
    length += boundary.length_m;
    if (longest.size() < listed_boundaries)
      longest.push_back({{"length_m", boundary.length_m},
                         {"diameter_m", boundary.diameter_m},
                         {"edges", boundary.edges}});
  }
  return {{"count", boundaries.size()}, {"length_m", length}, {"longest", longest}};
}

Json surface_json(const libmap::MeshReport& report) {
  const bool has_genus = report.genus >= 0;
  const libmap::EdgeLengths& lengths = report.edge_lengths;
  return {
      {"watertight", report.is_watertight()},
      {"manifold", report.is_manifold()},
      {"oriented", report.is_oriented()},
      {"components", report.components},
      {"largest_component_area_m2", report.largest_component_area_m2},
      {"genus", has_genus ? Json(report.genus) : Json(nullptr)},
      {"euler_characteristic", report.euler_characteristic},
      {"volume_m3", has_genus && report.is_closed() ? Json(report.volume_m3) : Json(nullptr)},
      {"edge_lengths_m", Json::array({lengths.min_m, lengths.median_m, lengths.max_m})},
      {"boundaries", boundaries_json(report.boundaries)},
      {"filled_triangles", report.filled_triangles},
      {"faults",
       {{"non_manifold_edges", report.non_manifold_edges},
        {"non_manifold_vertices", report.non_manifold_vertices},
        {"misoriented_edges", report.misoriented_edges},
        {"degenerate_triangles", report.degenerate_triangles},
        {"duplicate_triangles", report.duplicate_triangles},
        {"unused_vertices", report.unused_vertices},
        {"self_intersections",
         report.self_intersections_counted ? Json(report.self_intersections) : Json(nullptr)}}}};
}

Json mesh_json(const InfoOptions& options) {
  const libmap::MeshReadResult read = libmap::read_mesh(options.file);
  const libmap::TriangleMesh& mesh = read.mesh;
  const libmap::MeshReport report = in_file(options.file, [&] {
    return libmap::report_mesh(mesh, {.self_intersections = !options.quick});
  });
  return {{"kind", "mesh"},
          {"file", file_json(read.info)},
          {"vertices", mesh.vertices.size()},
          {"triangles", mesh.triangles.size()},
          {"area_m2", report.area_m2},
          {"normals", !mesh.vertex_normals.empty()},
          {"colors", !mesh.vertex_colors.empty()},
          {"bounds_m", bounds_json(mesh.vertices)},
          {"surface", surface_json(report)},
          {"fields", fields_json(mesh.vertex_fields)},
          {"face_fields", fields_json(mesh.face_fields)}};
}

Json bag_json(const std::string& path) {
  const libmap::BagListing listing = libmap::list_bag(path);
  Json topics = Json::array();
  for (const libmap::BagTopic& topic : listing.topics)
    topics.push_back({{"name", topic.name},
                      {"type", topic.type},
                      {"md5sum", topic.md5sum},
                      {"messages", topic.messages},
                      {"latching", topic.latching}});
  return {{"kind", listing.storage},
          {"messages", listing.messages},
          {"start_s", listing.start_s},
          {"end_s", listing.end_s},
          {"duration_s", listing.end_s - listing.start_s},
          {"topics", topics}};
}

std::string plain(const Json& value) {
  if (value.is_null()) return "none";
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_number_float()) {
    // Stamps need more digits than single precision has.
    const auto number = value.get<double>();
    return std::abs(number) < 1e6 ? libmap::to_text(static_cast<float>(number))
                                  : libmap::to_fixed_text(number, 3);
  }
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const Json& one : value) text += (text.empty() ? "" : " ") + plain(one);
  return text.empty() ? "none" : text;
}

// An object of a list as one line.
std::string line_of(const Json& object) {
  if (object.contains("type") && object.contains("range"))
    return fmt::format("{:<12} {:<8} {}", plain(object.at("name")), plain(object.at("type")),
                       plain(object.at("range")));
  std::string line;
  for (const auto& [name, value] : object.items())
    line += fmt::format("{}{} {}", line.empty() ? "" : ", ", name, plain(value));
  return line;
}

bool is_list_of(const Json& value, bool (Json::*kind)() const noexcept) {
  return value.is_array() && !value.empty() && (value.front().*kind)();
}

void print_plainly(const Json& json, const std::string& indent) {
  for (const auto& [name, value] : json.items()) {
    if (value.is_object()) {
      std::cout << indent << name << ":\n";
      print_plainly(value, indent + "  ");
    } else if (is_list_of(value, &Json::is_object) || is_list_of(value, &Json::is_string)) {
      std::cout << indent << name << ":\n";
      for (const Json& one : value)
        std::cout << indent << "  " << (one.is_object() ? line_of(one) : plain(one)) << "\n";
    } else {
      std::cout << indent << fmt::format("{}: {}", name, plain(value)) << "\n";
    }
  }
}

// Tilt of a map's terrain frame, by its manifest: relative to the scored cloud and, if known, to
// the map before `crop` or the map of a simulated robot. If z is up in that map, the latter is the
// error of the regression plane.
Json plane_json(const libmap::Manifest& manifest) {
  const libmap::Pose* terrain_from_input = manifest.find_transform("terrain_from_input");
  if (terrain_from_input == nullptr) return nullptr;
  const auto tilt_deg = [](const libmap::Pose& terrain_from_other) {
    const Eigen::Vector3d up = terrain_from_other.linear().transpose() * Eigen::Vector3d::UnitZ();
    return std::atan2(up.head<2>().norm(), up.z()) * 180.0 / M_PI;
  };
  Json json = {{"tilt_from_input_z_deg", tilt_deg(*terrain_from_input)}};
  if (const libmap::Pose* input_from_map = manifest.find_transform(site_from_map_name))
    json["tilt_from_map_z_deg"] = tilt_deg(*terrain_from_input * *input_from_map);
  return json;
}

// Faults found by --verify.
struct Faults {
  std::vector<libmap::ScanFault> scan;
  std::vector<std::string> tiles;
};

// Reads every tile. Returns the reasons of unusable tiles, in their order.
std::vector<std::string> broken_tiles(const MapTiles& tiles, libmap::Progress& progress) {
  std::vector<std::string> reasons(tiles.index().tiles.size());
  progress.begin("verify", reasons.size());
  libmap::parallel_each(reasons.size(), [&](std::size_t n) {
    try {
      tiles.load_checked(n);
    } catch (const libmap::Error& error) {
      reasons[n] = error.what();
    }
    progress.advance(1);
  });
  progress.end();
  std::erase(reasons, "");
  return reasons;
}

Json tiles_json(const InfoOptions& options, Run& run, Faults& faults) {
  const MapTiles tiles(options.file);
  const libgtd::TileStoreIndex& index = tiles.index();
  Eigen::AlignedBox3d box;
  std::uint64_t bytes = 0;
  for (std::size_t n = 0; n < index.tiles.size(); ++n) {
    box.extend(tiles.box(n));
    bytes += index.tiles[n].bytes;
  }
  Json json = {{"kind", "graspability map in tiles"},
               {"points", index.voxels()},
               {"border_voxels", index.border_voxels()},
               {"graspable_voxels", index.graspable_voxels()},
               {"bounds_m", bounds_json({box.min(), box.max()})},
               {"tiles",
                {{"count", index.tiles.size()},
                 {"width_m", index.tile_voxels * index.lattice.voxel_size_m},
                 {"bytes", bytes}}},
               {"lattice",
                {{"voxel_size_m", index.lattice.voxel_size_m},
                 {"origin_m", numbers_json(index.lattice.origin_m)}}}};
  if (!options.verify) return json;
  faults.tiles = broken_tiles(tiles, run.progress());
  json["broken_tiles"] = faults.tiles;
  return json;
}

Json content_json(const InfoOptions& options, Run& run, Faults& faults) {
  if (is_tile_store(options.file)) return tiles_json(options, run, faults);
  const bool is_bag = libmap::is_bag_path(options.file);
  if (!options.verify && std::filesystem::path(options.file).extension() == ".yaml")
    return camera_info(options.file);
  if (!is_bag && may_be_scan(options.file)) {
    ScanInfo scan = scan_info(options.file, options.verify, run.progress());
    faults.scan = std::move(scan.faults);
    return std::move(scan.json);
  }
  if (options.verify)
    throw libmap::Error("can only be used for a scan or a tile store",
                        {.file = options.file, .field = "--verify"});
  if (is_bag) return bag_json(options.file);
  return libmap::file_kind(options.file) == libmap::FileKind::mesh ? mesh_json(options)
                                                                   : cloud_json(options.file);
}

// Throws Error with the number of faults of a verified scan or tile store; stdout has the list.
void require_sound(const std::string& file, const Faults& found) {
  if (!found.tiles.empty())
    throw libmap::Error(fmt::format("{} {} broken", found.tiles.size(),
                                    found.tiles.size() == 1 ? "tile is" : "tiles are"),
                        {.file = file});
  const std::vector<libmap::ScanFault>& faults = found.scan;
  if (faults.empty()) return;
  std::set<int> nodes;
  for (const libmap::ScanFault& fault : faults)
    if (fault.node > 0) nodes.insert(fault.node);
  throw libmap::Error(fmt::format("{} {} broken, in {} {}", faults.size(),
                                  faults.size() == 1 ? "part is" : "parts are", nodes.size(),
                                  nodes.size() == 1 ? "node" : "nodes"),
                      {.file = file});
}

void info(InfoOptions& options, Run& run) {
  options.file = without_trailing_slash(options.file);
  Json json = {{"path", options.file}};
  Faults faults;
  json.update(content_json(options, run, faults));
  if (const auto manifest = libmap::read_manifest_of(options.file)) {
    json["made_by"] = "graspmap " + manifest->command + " " + manifest->version;
    json["frame"] = manifest->frame;
    json["results"] = Json::object();
    for (const auto& [name, value] : manifest->results) json["results"][name] = to_json(value);
    if (Json plane = plane_json(*manifest); !plane.is_null()) json["plane"] = std::move(plane);
  }
  if (options.json)
    print_json(json);
  else
    print_plainly(json, "");
  require_sound(options.file, faults);
}

}  // namespace

int main(int argc, char** argv) {
  InfoOptions options;
  Command command("info");
  command.input("FILE", options.file,
                "scan, camera (.yaml), cloud, mesh, map, tile store (.tiles) or ROS bag");
  command.flag("--json", options.json, "print the description as JSON");
  command.flag("--verify", options.verify,
               "read the whole content of a scan or a tile store and list broken parts");
  command.flag("--quick", options.quick, "skip the test for self-intersections of a mesh");
  return command.run(argc, argv, [&](Run& run) { info(options, run); });
}
