// Texts: YAML of all kinds, tables, manifests.
#include "libgtd/evaluate/expected_map.h"
#include "libgtd/evaluate/lookup.h"
#include "libgtd/evaluate/roc_tables.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/gripper/gripper_io.h"
#include "libgtd/score/scenario.h"
#include "libmap/camera/camera_io.h"
#include "libmap/core/table.h"
#include "libmap/scan/rig_io.h"
#include "libmap/scenes/primitive_scene.h"
#include "libmap/simulate/rock_site.h"
#include "tests/fuzz/target_support.h"

namespace graspmap_fuzz {

namespace {

bool run_yaml(std::string_view bytes) {
  const std::size_t choice = take_choice(bytes, 6);
  const std::string text(bytes);
  return accepts([&] {
    switch (choice) {
      case 0:
        libgtd::parse_gripper(text, file_name);
        break;
      case 1: {
        libgtd::Scenario scenario;
        libmap::ParameterTable table;
        libgtd::bind(table, scenario);
        libmap::set_from_yaml(table, text, file_name);
        scenario.check();
        break;
      }
      case 2:
        libmap::parse_rig(text, file_name);
        break;
      case 3:
        libmap::parse_camera(text, file_name);
        break;
      case 4:
        libmap::parse_scene(text, file_name);
        break;
      default:
        libmap::parse_site(text, file_name);
    }
  });
}

Seeds yaml_seeds() {
  Seeds seeds;
  add_data(seeds, 0, "grippers");
  add_data(seeds, 1, "scenarios");
  add_data(seeds, 2, "rigs");
  const std::string size =
      "image_width: 8\nimage_height: 8\n"
      "camera_matrix: {rows: 3, cols: 3, data: [8, 0, 4, 0, 8, 4, 0, 0, 1]}\n";
  const std::string pose = "[[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0.25]]\n";
  seeds.push_back(with_choice(3, size));
  seeds.push_back(
      with_choice(3, size +
                         "distortion_model: plumb_bob\n"
                         "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, "
                         "0.001, 0.002, 0.03]}\nlocal_transform: " +
                         pose));
  seeds.push_back(with_choice(3, size +
                                     "fisheye_model: 1\ndistortion_coefficients: [0.1, 0.2, 0, 0, "
                                     "0.3, 0.4]\n"));
  seeds.push_back(
      with_choice(3, size + "distortion_model: rational_polynomial\n"
                            "distortion_coefficients: [1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0, "
                            "0, 0]\n"));
  seeds.push_back(with_choice(2,
                              "cameras:\n  - name: a\n    image_width: 8\n    image_height: 8\n"
                              "    camera_matrix: [8, 0, 4, 0, 8, 4, 0, 0, 1]\n"
                              "    distortion_model: equidistant\n"
                              "    distortion_coefficients: [0.1, 0.2, 0.3, 0.4]\n"
                              "    robot_from_camera: " +
                                  pose));
  add_data(seeds, 4, "scenes");
  add_data(seeds, 5, "sites");
  return seeds;
}

bool run_table(std::string_view bytes) {
  return accepts([&] { libmap::to_csv(libmap::parse_csv(bytes, file_name)); });
}

Seeds table_seeds() {
  Seeds seeds;
  add_data(seeds, 0, "field_test");
  for (std::string& seed : seeds) seed.erase(0, 1);
  seeds.emplace_back("a,b\n\"quoted, \"\"text\"\"\",1e-3\r\n");
  return seeds;
}

libmap::PointCloud three_scores() {
  libmap::PointCloud map;
  map.positions = {{0, 0, 0}, {0.01, 0, 0}, {0, 0.01, 0}};
  map.add_field("score", libmap::ScalarType::float32).values = {0.5, 0.9, 1.0};
  map.add_field("graspable", libmap::ScalarType::uint8).values = {0, 1, 1};
  return map;
}

void look_up_points(const libmap::Table& table) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    points.emplace_back(table.number(row, table.column("x")), table.number(row, table.column("y")),
                        table.number(row, table.column("z")));
  for (const auto& [name, mode] : libgtd::lookup_mode_names())
    libgtd::look_up(three_scores(), points, {.mode = mode});
}

void evaluate(const libmap::Table& table) {
  libgtd::TableEvaluationOptions options;
  options.roc.bootstrap_replicates = 3;
  const libgtd::TableEvaluation evaluation = libgtd::evaluate_table(table, options);
  libmap::to_csv(libgtd::roc_table(evaluation));
  libmap::to_csv(libgtd::rates_table(evaluation));
  libmap::to_csv(libgtd::accuracy_table(evaluation));
  libgtd::to_json(evaluation);
  libgtd::to_markdown(evaluation, "title");
}

bool run_points(std::string_view bytes) {
  const std::size_t choice = take_choice(bytes, 3);
  return accepts([&] {
    const libmap::Table table = libmap::parse_csv(bytes, file_name);
    if (choice == 0)
      look_up_points(table);
    else if (choice == 1)
      evaluate(table);
    else
      libgtd::evaluate_expected_map(three_scores(), libgtd::parse_expected_map(table), 0.8);
  });
}

Seeds points_seeds() {
  Seeds seeds;
  add_data(seeds, 0, "field_test");
  seeds.push_back(with_choice(1, "id,graspable,score,ssv\n1,1,0.9,3\n2,no,0.1,7\n3,,0.5,\n"));
  add_data(seeds, 2, "expected");
  seeds.push_back(with_choice(2,
                              "region,x,y,z,to_x,to_y,to_z,radius,graspable,why\n"
                              "a,0,0,0,,,,0.005,1,\nb,0.01,0,0,0.01,0.01,0,0.005,0,\n"));
  return seeds;
}

bool run_manifest(std::string_view bytes) {
  return accepts([&] {
    const libmap::Manifest manifest = libmap::parse_manifest(std::string(bytes), file_name);
    libgtd::map_info(manifest);
    libmap::to_json(manifest);
  });
}

Seeds manifest_seeds() { return {libmap::to_json(small_manifest())}; }

}  // namespace

std::vector<FuzzTarget> text_targets() {
  return {
      {"manifest", "manifests", run_manifest, manifest_seeds},
      {"points", "tables to look up, evaluate and expect", run_points, points_seeds},
      {"table", "CSV tables", run_table, table_seeds},
      {"yaml", "grippers, scenarios, rigs, cameras, scenes and sites", run_yaml, yaml_seeds},
  };
}

}  // namespace graspmap_fuzz
