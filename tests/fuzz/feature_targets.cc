// Features kept between runs of `refine`.
#include "libmap/core/manifest.h"
#include "libmap/features/feature_cache.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/target_support.h"

namespace graspmap_fuzz {

namespace {

std::vector<libmap::Camera> small_cameras() {
  libmap::Camera camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 8.0;
  return {camera};
}

// The bytes behind the digest, which is always right.
bool run_features(std::string_view bytes) {
  static const ScratchFile file("cache/key.features");
  file.write(libmap::sha256_of(bytes) + "\n" + std::string(bytes));
  const libmap::FeatureCache cache(file.path().parent_path());
  libmap::FrameFeatures frame;
  frame.cameras = small_cameras();
  return accepts([&] {
    if (!cache.read("key", small_cameras(), frame)) throw libmap::Error("not taken");
    for (std::size_t n = 0; n < frame.features.size(); ++n) frame.point_in_base(n);
    for (const libmap::DepthSurface& surface : frame.surfaces) {
      libmap::SurfacePatch element;
      surface.at(0, 0, element);
      surface.nearest_to({0.1, 0.1, 1.0}, element);
    }
    libmap::descriptor_vectors(frame);
  });
}

Seeds features_seeds() {
  libmap::FrameFeatures frame;
  frame.features = {{{0.1F, 0.2F}, 1.5F, 0.01F, 0.2F, 0}, {{-0.1F, 0.0F}, 2.5F, 0.01F, 0.2F, 0}};
  frame.descriptors.assign(std::size_t{2} * 128, 7);
  libmap::DepthSurface::Cell cell{.normal_x = 10, .normal_y = 20, .noise = 5};
  cell.set_depth_m(1.5F);
  frame.surfaces.emplace_back(small_cameras().front(), 4, std::vector(4, cell));
  const std::string text = written("cache/seed.features", [&](const std::filesystem::path& path) {
    libmap::FeatureCache(path.parent_path()).write("seed", frame);
  });
  return {text.substr(text.find('\n') + 1)};
}

}  // namespace

std::vector<FuzzTarget> feature_targets() {
  return {{"features", "cached features", run_features, features_seeds}};
}

}  // namespace graspmap_fuzz
