#include "libmap/features/feature_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/test_support.h"

namespace feature_cache_test {

namespace fs = std::filesystem;
using graspmap_test::boulders;
using graspmap_test::TexturedScan;
using libmap::FeatureCache;
using libmap::FeatureResult;

TexturedScan two_frames() {
  TexturedScan scan;
  for (int n = 0; n < 2; ++n)
    scan.see(boulders(), graspmap_test::around(20.0 * n), libmap::Vector6d::Zero());
  return scan;
}

fs::path folder() { return graspmap_test::scratch_folder() / "poses.tum.features"; }

FeatureResult found(const TexturedScan& scan, const FeatureCache& cache,
                    const libmap::FeatureOptions& options = {}) {
  return libmap::find_features(scan, {1, 2}, options, libmap::no_progress(), &cache);
}

void expect_same(const FeatureResult& one, const FeatureResult& other) {
  ASSERT_EQ(one.frames.size(), other.frames.size());
  for (std::size_t f = 0; f < one.frames.size(); ++f) {
    const libmap::FrameFeatures& a = one.frames[f];
    const libmap::FrameFeatures& b = other.frames[f];
    EXPECT_EQ(a.node, b.node);
    EXPECT_EQ(a.descriptors, b.descriptors);
    EXPECT_EQ(a.without_depth, b.without_depth);
    ASSERT_EQ(a.features.size(), b.features.size());
    EXPECT_GT(a.features.size(), 20U);
    for (std::size_t n = 0; n < a.features.size(); ++n) {
      EXPECT_EQ(a.features[n].ray, b.features[n].ray);
      EXPECT_EQ(a.features[n].depth_m, b.features[n].depth_m);
      EXPECT_EQ(a.features[n].depth_noise_m, b.features[n].depth_noise_m);
      EXPECT_EQ(a.features[n].pixel_noise_px, b.features[n].pixel_noise_px);
    }
    ASSERT_EQ(a.surfaces.size(), 1U);
    ASSERT_EQ(b.surfaces.size(), 1U);
    for (int row = 0; row < a.surfaces[0].rows(); ++row)
      for (int column = 0; column < a.surfaces[0].columns(); ++column) {
        libmap::SurfacePatch in_a;
        libmap::SurfacePatch in_b;
        ASSERT_EQ(a.surfaces[0].at(column, row, in_a), b.surfaces[0].at(column, row, in_b));
        ASSERT_EQ(in_a.point, in_b.point);
        ASSERT_EQ(in_a.normal, in_b.normal);
        ASSERT_EQ(in_a.noise_m, in_b.noise_m);
      }
  }
}

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(FeatureCache, DescriptorsOfLongScansAreInAFileWithoutAName) {
  const TexturedScan scan = two_frames();
  const FeatureCache cache(folder());
  libmap::FeatureOptions options;
  const FeatureResult in_memory = found(scan, cache, options);
  const auto before = files_in(folder());
  options.max_frames_in_memory = 1;
  const FeatureResult on_disk = found(scan, cache, options);
  for (std::size_t f = 0; f < 2; ++f) {
    EXPECT_FALSE(in_memory.frames[f].descriptors.empty());
    EXPECT_TRUE(on_disk.frames[f].descriptors.empty());
    EXPECT_EQ(libmap::descriptor_vectors(on_disk.frames[f]),
              libmap::descriptor_vectors(in_memory.frames[f]));
  }
  EXPECT_EQ(files_in(folder()), before);
  // Without a folder, descriptors stay in memory.
  EXPECT_FALSE(found(scan, {}, options).frames[0].descriptors.empty());
}

TEST(FeatureCache, GivesBackTheSame) {
  TexturedScan scan = two_frames();
  // With lens distortion, each pixel has its own ray.
  scan.frames.at(2).cameras[0].distortion_model = libmap::DistortionModel::radial_tangential;
  scan.frames.at(2).cameras[0].distortion = {-0.05, 0.01, 0.0, 0.0};
  const FeatureCache cache(folder());
  const FeatureResult without = libmap::find_features(scan, {1, 2});
  const FeatureResult first = found(scan, cache);
  const FeatureResult second = found(scan, cache);
  EXPECT_EQ(first.from_cache, 0U);
  EXPECT_EQ(second.from_cache, 2U);
  expect_same(without, first);
  expect_same(without, second);
  EXPECT_EQ(files_in(folder()).size(), 2U);
}

TEST(FeatureCache, OtherImagesCamerasOrOptionsAreOthers) {
  TexturedScan scan = two_frames();
  const FeatureCache cache(folder());
  found(scan, cache);
  libmap::FeatureOptions options;
  options.max_features = 100;
  EXPECT_EQ(found(scan, cache, options).from_cache, 0U);
  options = {};
  options.planes.radius_px = 2;  // not a bound parameter
  EXPECT_EQ(found(scan, cache, options).from_cache, 0U);
  scan.frames.at(1).color.pixels[100][1] ^= 1;
  EXPECT_EQ(found(scan, cache).from_cache, 1U);
  scan.frames.at(2).depth.pixels[9000] += 0.001F;
  EXPECT_EQ(found(scan, cache).from_cache, 1U);
  scan.frames.at(1).cameras[0].cx += 0.25;
  EXPECT_EQ(found(scan, cache).from_cache, 1U);
  EXPECT_EQ(found(scan, cache).from_cache, 2U);
}

// Truncated, modified, empty and foreign files are ignored and replaced.
TEST(FeatureCache, DamagedFilesAreMadeAnew) {
  const TexturedScan scan = two_frames();
  const FeatureCache cache(folder());
  const FeatureResult first = found(scan, cache);
  const std::vector<fs::path> files = files_in(folder());
  ASSERT_EQ(files.size(), 2U);
  const std::string whole = libmap::read_whole_file(files[0]);
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 4;
  // The last file has a valid digest of invalid content.
  const std::string foreign = libmap::read_whole_file(files[1]);
  for (const std::string& damaged :
       {whole.substr(0, whole.size() / 2), whole.substr(0, 10), flipped, std::string(),
        foreign.substr(1),
        std::string("44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a\n{}")}) {
    libmap::write_text(files[0], damaged);
    const FeatureResult again = found(scan, cache);
    EXPECT_EQ(again.from_cache, 1U);
    expect_same(first, again);
    EXPECT_EQ(libmap::read_whole_file(files[0]), whole);
  }
  EXPECT_EQ(files_in(folder()).size(), 2U);
}

// Files with a valid digest and content that graspmap never writes.
TEST(FeatureCache, ForeignContentIsMadeAnew) {
  const TexturedScan scan = two_frames();
  const FeatureCache cache(folder());
  const FeatureResult first = found(scan, cache);
  const fs::path file = files_in(folder())[0];
  const std::string body = libmap::read_whole_file(file).substr(65);
  const auto expect_anew = [&](const std::string& content, const std::string& what) {
    libmap::write_text(file, libmap::sha256_of(content) + "\n" + content);
    const FeatureResult again = found(scan, cache);
    EXPECT_EQ(again.from_cache, 1U) << what;
    expect_same(first, again);
  };
  const auto change = [&](const char* key, const nlohmann::json& value) {
    auto json = nlohmann::json::from_cbor(body);
    json[nlohmann::json::json_pointer(key)] = value;
    std::string changed;
    nlohmann::json::to_cbor(json, changed);
    expect_anew(changed, key);
  };
  change("/descriptors", nlohmann::json::binary({1, 2, 3}));
  change("/cameras", nlohmann::json::binary({1, 0}));  // the scan has only camera 0
  change("/surfaces/0/step_px", 2147483647);
  change("/surfaces/0/step_px", 1e300);
  change("/without_depth", -1);
  expect_anew(std::string(1 << 20, '\x81'), "arrays in arrays");
}

TEST(FeatureCache, WithoutAFolderNothingIsKept) {
  const TexturedScan scan = two_frames();
  const FeatureCache cache(graspmap_test::scratch_folder() / "none" / "deeper");
  EXPECT_EQ(found(scan, cache).from_cache, 0U);
  EXPECT_EQ(found(scan, cache).from_cache, 0U);
}

}  // namespace feature_cache_test
