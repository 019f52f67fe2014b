#include "libmap/core/manifest.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/error.h"
#include "tests/support/test_support.h"

namespace manifest_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using libmap::Manifest;
using libmap::ManifestValue;

Manifest sample() {
  Manifest manifest;
  manifest.command = "score";
  manifest.version = "1.2.3";
  manifest.parameters = {{"method", std::string("thesis")},
                         {"voxel_size_m", 0.1},
                         {"layers", std::int64_t{3}},
                         {"fill", true},
                         {"whole", 2.0}};
  manifest.inputs = {{"a b.pcd", std::string(64, 'a'), 123456789012ULL}};
  manifest.frame = "terrain";
  manifest.transforms = {
      {"terrain_from_input", libmap::make_pose_from_rpy({0.1, -2e-7, 3e5}, {10, 20, 30})}};
  manifest.results = {{"points", std::int64_t{72080}},
                      {"rmse_m", 1.0 / 3.0},
                      {"origin_m", std::vector<double>{0.1, -0.2, 1e-30}},
                      {"source", std::string("viewpoint")}};
  manifest.timings_s = {{"read", 0.25}};
  manifest.threads = 8;
  return manifest;
}

fs::path written(const std::string& json) {
  const fs::path output = scratch_folder() / "map.pcd";
  graspmap_test::write_text(libmap::manifest_path(output), json);
  return output;
}

TEST(ManifestTest, PathStandsBesideTheOutput) {
  EXPECT_EQ(libmap::manifest_path("maps/map.pcd"), fs::path("maps/map.pcd.json"));
  EXPECT_EQ(libmap::manifest_path("folder"), fs::path("folder.json"));
}

TEST(ManifestTest, ComesBackWhole) {
  const Manifest manifest = sample();
  const auto read = libmap::read_manifest_of(written(libmap::to_json(manifest)));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->command, manifest.command);
  EXPECT_EQ(read->version, manifest.version);
  EXPECT_EQ(read->frame, manifest.frame);
  EXPECT_EQ(read->parameters, manifest.parameters) << "order and types included";
  EXPECT_EQ(read->results, manifest.results);
  EXPECT_EQ(read->timings_s, manifest.timings_s);
  EXPECT_EQ(read->threads, 8U);
  ASSERT_EQ(read->inputs.size(), 1U);
  EXPECT_EQ(read->inputs[0].path, "a b.pcd");
  EXPECT_EQ(read->inputs[0].sha256, std::string(64, 'a'));
  EXPECT_EQ(read->inputs[0].bytes, 123456789012ULL);
  ASSERT_NE(read->find_transform("terrain_from_input"), nullptr);
  EXPECT_EQ(read->find_transform("terrain_from_input")->matrix(),
            manifest.transforms[0].second.matrix())
      << "every bit of the pose";
  EXPECT_EQ(libmap::to_json(*read), libmap::to_json(manifest));
}

TEST(ManifestTest, FindsByName) {
  const Manifest manifest = sample();
  EXPECT_EQ(*manifest.find_parameter("voxel_size_m"), ManifestValue(0.1));
  EXPECT_EQ(*manifest.find_result("points"), ManifestValue(std::int64_t{72080}));
  EXPECT_EQ(manifest.find_parameter("points"), nullptr);
  EXPECT_EQ(manifest.find_result("none"), nullptr);
  EXPECT_EQ(manifest.find_transform("none"), nullptr);
}

TEST(ManifestTest, WhatChangesFromRunToRunStandsInOneSection) {
  Manifest first = sample();
  Manifest second = sample();
  second.threads = 1;
  second.timings_s = {{"read", 99.0}};
  const std::string one = libmap::to_json(first);
  const std::string two = libmap::to_json(second);
  EXPECT_NE(one, two);
  EXPECT_EQ(one.substr(0, one.find("\"run\"")), two.substr(0, two.find("\"run\"")));
}

TEST(ManifestTest, ParametersKeepTheirTypes) {
  double size = 0.5;
  int layers = 2;
  std::uint64_t seed = 7;
  bool fill = true;
  std::string name = "12";
  std::vector<std::pair<std::string, std::string>> overrides = {{"angle_deg", "80"}};
  libmap::ParameterTable table;
  table.add("size_m", size, libmap::positive, "");
  table.add("layers", layers, libmap::not_negative, "");
  table.add("seed", seed, libmap::any_number, "");
  table.add("fill", fill, "");
  table.add("name", name, "");
  table.add_overrides("gripper", overrides);
  Manifest manifest;
  manifest.add_parameters(table);
  const std::vector<std::pair<std::string, ManifestValue>> wanted = {
      {"size_m", 0.5}, {"layers", std::int64_t{2}}, {"seed", std::int64_t{7}},
      {"fill", true},  {"name", std::string("12")}, {"gripper.angle_deg", std::string("80")}};
  EXPECT_EQ(manifest.parameters, wanted);
}

TEST(ManifestTest, ParametersWithoutAValueAreAuto) {
  std::optional<double> plane_m;
  std::optional<double> threshold = 0.25;
  libmap::ParameterTable table;
  table.add("plane_m", plane_m, libmap::any_number, "");
  table.add("threshold", threshold, libmap::zero_to_one, "");
  Manifest manifest;
  manifest.add_parameters(table);
  EXPECT_EQ(*manifest.find_parameter("plane_m"), ManifestValue(std::string("auto")));
  EXPECT_EQ(*manifest.find_parameter("threshold"), ManifestValue(0.25));
  plane_m = -0.5;  // a value that is found later
  manifest.add_parameters(table);
  EXPECT_EQ(*manifest.find_parameter("plane_m"), ManifestValue(-0.5));
  EXPECT_EQ(manifest.parameters.size(), 2U);
}

TEST(ManifestTest, InputIsHashed) {
  const fs::path path = scratch_folder() / "in.txt";
  graspmap_test::write_text(path, "abc");
  Manifest manifest;
  manifest.add_input(path);
  EXPECT_EQ(manifest.inputs.at(0).path, path.string());
  EXPECT_EQ(manifest.inputs.at(0).bytes, 3U);
  EXPECT_EQ(manifest.inputs.at(0).sha256, libmap::sha256_of("abc"));
  EXPECT_TRUE(is_error(error_of([&] { manifest.add_input(scratch_folder() / "none"); }),
                       {.file = scratch_folder() / "none"}));
}

TEST(ManifestTest, NothingBesideIsNothing) {
  EXPECT_FALSE(libmap::read_manifest_of(scratch_folder() / "map.pcd"));
}

TEST(ManifestTest, BrokenJsonNamesTheFile) {
  const std::string good = libmap::to_json(sample());
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  const std::vector<std::string> broken = {
      "",
      "{}",
      "[]",
      "null",
      "not json",
      good.substr(0, good.size() / 2),
      std::string(100000, '['),
      with("\"version\": \"1.2.3\"", "\"version\": 3"),
      with("\"threads\": 8", "\"threads\": \"eight\""),
      with("\"terrain_from_input\": [", "\"terrain_from_input\": [1,"),
      with("\"parameters\": {", "\"parameters\": {\"a\": {\"b\": 1}, "),
      std::string("\0\0", 2),
  };
  for (const std::string& json : broken) {
    const fs::path output = written(json);
    EXPECT_EQ(error_of([&] { libmap::read_manifest_of(output); }).context().file,
              libmap::manifest_path(output).string())
        << json.substr(0, 60);
  }
}

TEST(ManifestTest, WholeNumbersBeyondInt64AreReal) {
  std::string json = libmap::to_json(sample());
  const std::string number = "72080";
  json.replace(json.find(number), number.size(), "9223372036854775808");
  const auto read = libmap::read_manifest_of(written(json));
  EXPECT_EQ(*read->find_result("points"), ManifestValue(9223372036854775808.0));
}

TEST(ManifestTest, TransformsThatAreNone) {
  Manifest manifest = sample();
  for (const double number : {2.0, 1e308}) {
    manifest.transforms[0].second = libmap::Pose::Identity();
    manifest.transforms[0].second.linear()(1, 1) = number;
    EXPECT_EQ(error_of([&] { libmap::read_manifest_of(written(libmap::to_json(manifest))); })
                  .context()
                  .field,
              "transforms");
  }
  manifest.transforms[0].second = libmap::Pose(Eigen::Translation3d(0, 0, -2e8));
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::read_manifest_of(written(libmap::to_json(manifest))); }),
               {.field = "transforms"}));
}

TEST(ManifestTest, ObjectsWithoutABoundAreRefused) {
  Manifest manifest = sample();
  for (int n = 0; n < 9'999; ++n) manifest.timings_s.emplace_back("step " + std::to_string(n), 1.0);
  EXPECT_EQ(libmap::read_manifest_of(written(libmap::to_json(manifest)))->timings_s.size(),
            10'000U);
  manifest.timings_s.emplace_back("one more", 1.0);
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::read_manifest_of(written(libmap::to_json(manifest))); }),
               {.field = "object"}));
}

TEST(ManifestTest, NumbersThatAreNotFiniteStayReadable) {
  Manifest manifest = sample();
  manifest.results = {{"auc", std::nan("")}, {"origin_m", std::vector<double>{1, std::nan(""), 2}}};
  const auto read = libmap::read_manifest_of(written(libmap::to_json(manifest)));
  ASSERT_TRUE(read);
  EXPECT_TRUE(std::isnan(std::get<double>(*read->find_result("auc"))));
  EXPECT_TRUE(std::isnan(std::get<std::vector<double>>(*read->find_result("origin_m")).at(1)));
}

TEST(ManifestTest, TextOfAnyBytesStaysJson) {
  Manifest manifest = sample();
  manifest.command = "quote\" \\ \n \xFF \xE2\x82\xAC";
  const auto read = libmap::read_manifest_of(written(libmap::to_json(manifest)));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->command, "quote\" \\ \n \xEF\xBF\xBD \xE2\x82\xAC");
}

// Examples of FIPS 180-4 and NIST.
TEST(ManifestTest, Sha256OfKnownMessages) {
  EXPECT_EQ(libmap::sha256_of(""),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(libmap::sha256_of("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(libmap::sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(libmap::sha256_of(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(ManifestTest, Sha256OfAFileIsThatOfItsBytes) {
  const fs::path path = scratch_folder() / "bytes";
  // Sizes near the buffer for reading files, and an empty file.
  for (const std::size_t size : {0U, 1U, 65535U, 65536U, 65537U, 200000U}) {
    std::string bytes(size, '\0');
    for (char& c : bytes) c = static_cast<char>(graspmap_test::random_engine()());
    graspmap_test::write_text(path, bytes);
    EXPECT_EQ(libmap::sha256_of_file(path), libmap::sha256_of(bytes)) << size;
  }
  EXPECT_TRUE(is_error(error_of([&] { libmap::sha256_of_file(scratch_folder()); }),
                       {.file = scratch_folder()}));
}

}  // namespace manifest_test
