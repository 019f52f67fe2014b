// Scores a scene of primitive shapes with the installed libraries.
#include <libgtd/detect.h>
#include <libgtd/gripper/gripper_io.h>
#include <libmap/simulate/scene_sampling.h>

#include <iostream>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  libmap::PrimitiveScene scene;
  scene.shapes.push_back({libmap::Plane{1.0, 1.0}, {}, "ground"});
  scene.shapes.push_back({libmap::Sphere{0.15}, {}, "hemisphere"});
  libmap::SceneSamplingOptions sampling;
  sampling.spacing_m = 0.01;
  libgtd::DetectionOptions options;
  options.gripper = libgtd::read_gripper(argv[1]);
  const auto result = libgtd::detect(libmap::sample_scene(scene, sampling).cloud, options);
  std::cout << result.map.voxels.size() << " voxels\n";
  return result.map.voxels.size() > 5000 ? 0 : 1;
}
