#include "libmap/bag/bag_reader.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "libmap/bag/bag_cloud.h"
#include "libmap/bag/bag_rig.h"
#include "tests/libmap/bag/bag_samples.h"
#include "tests/support/test_support.h"

namespace bag_reader_test {

namespace fs = std::filesystem;
namespace rm = graspmap_test::rm;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_text;
using graspmap_test::SampleBag;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;

fs::path bag_path() { return scratch_folder() / "a.bag"; }

void write_sample(
    rosbag::compression::CompressionType compression = rosbag::compression::Uncompressed) {
  SampleBag bag(bag_path(), compression);
  bag.transform("base_link", "front_optical", libmap::Pose::Identity());
  bag.transform("base_link", "rear_optical", libmap::Pose::Identity());
  bag.camera("/front", {5.0, 5.25}).camera("/rear", {5.125});
  bag.close();
}

// Overwrites the 4 bytes at `place`.
std::string with_number(std::string bytes, std::size_t place, std::uint32_t value) {
  return bytes.replace(place, 4, reinterpret_cast<const char*>(&value), 4);
}

TEST(BagReader, TopicsInTheOrderOfRecording) {
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    write_sample(compression);
    const libmap::BagListing listing = libmap::list_bag(bag_path());
    ASSERT_EQ(listing.topics.size(), 5U);
    EXPECT_EQ(listing.topics[0].name, "/tf_static");
    EXPECT_EQ(listing.topics[0].messages, 2U);
    EXPECT_EQ(listing.topics[1], (libmap::BagTopic{"/front/image_raw", "sensor_msgs/Image",
                                                   "060021388200f6f0f447d0fcd9c64743", false,
                                                   libmap::MessageEncoding::ros1, 2}));
    EXPECT_EQ(listing.topics[4].name, "/rear/camera_info");
    EXPECT_EQ(listing.messages, 8U);
    EXPECT_EQ(listing.start_s, 1.0);
    EXPECT_EQ(listing.end_s, 5.25);
  }
}

TEST(BagReader, TopicsOfOtherTypesAreSaid) {
  write_sample();
  const libmap::BagListing listing = libmap::list_bag(bag_path());
  const auto said = [&](const char* type, const char* md5sum) {
    return error_of([&] { libmap::require_topic(listing, "/front/image_raw", {type, md5sum}); });
  };
  const char* const md5sum = "060021388200f6f0f447d0fcd9c64743";
  EXPECT_EQ(
      libmap::require_topic(listing, "/front/image_raw", {"sensor_msgs/Image", md5sum}).messages,
      2U);
  EXPECT_TRUE(is_error(said("sensor_msgs/Image", "0123"),
                       {.field = "md5sum of /front/image_raw", .value = md5sum, .bound = "0123"}));
  EXPECT_TRUE(is_error(said("tf2_msgs/TFMessage", md5sum), {.field = "type of /front/image_raw",
                                                            .value = "sensor_msgs/Image",
                                                            .bound = "tf2_msgs/TFMessage"}));
}

TEST(BagReader, MessagesOfTheWantedTopics) {
  write_sample();
  std::vector<std::string> seen;
  std::vector<std::size_t> lengths;
  const auto take = [&](const libmap::BagMessage& message) {
    seen.push_back(message.topic.name);
    lengths.push_back(message.bytes.size());
  };
  libmap::read_bag(bag_path(), {{"/rear/image_raw", 10}, {"/front/image_raw"}}, take);
  ASSERT_GE(seen.size(), 2U);
  EXPECT_EQ(seen[0], "/front/image_raw");
  EXPECT_EQ(seen[1], "/rear/image_raw");
  EXPECT_EQ(lengths[1], 10U);
  libmap::read_bag(bag_path(), {{"/none"}}, [](const auto&) { throw 1; });
  // Exceptions of `take` are propagated, and the reading process ends.
  EXPECT_TRUE(is_error(error_of([&] {
                         libmap::read_bag(bag_path(), {{"/tf_static"}},
                                          [](const auto&) { throw libmap::Error("enough"); });
                       }),
                       {.about = "enough"}));
}

TEST(BagReader, WhatIsNoWholeBagIsSaid) {
  write_sample();
  const std::string whole = read_text(bag_path());
  const auto said = [&](const std::string& bytes) {
    write_text(bag_path(), bytes);
    return error_of([] { libmap::list_bag(bag_path()); });
  };
  EXPECT_TRUE(is_error(said(""), {.file = bag_path(), .field = "first line"}));
  EXPECT_TRUE(
      is_error(said("P6\n\x96\n"), {.file = bag_path(), .field = "first line", .value = "P6"}));
  for (const std::size_t length : {13UL, 4109UL, 4200UL, whole.size() / 2, whole.size() - 1})
    EXPECT_TRUE(is_error(said(whole.substr(0, length)), {.file = bag_path()})) << length;
  std::string unindexed = whole;
  unindexed.replace(whole.find("index_pos=") + 10, 8, 8, '\0');
  EXPECT_TRUE(is_error(said(unindexed), {.file = bag_path()}));
  EXPECT_TRUE(is_error(error_of([] { libmap::list_bag(scratch_folder() / "none.bag"); }),
                       {.file = graspmap_test::scratch_folder() / "none.bag"}));
}

TEST(BagReader, EncryptedBagsAreSaid) {
  write_sample();
  std::string bytes = read_text(bag_path());
  // Another field of the file's header, in the blanks after it.
  const std::string field = "encryptor=rosbag/NoSuchEncryptor";
  const std::size_t header = 13;
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + header, 4);
  const auto field_length = static_cast<std::uint32_t>(field.size());
  bytes.insert(header + 4 + length,
               std::string(reinterpret_cast<const char*>(&field_length), 4) + field);
  bytes = with_number(bytes, header, length + 4 + field_length);
  const std::size_t blanks = header + 4 + length + 4 + field_length;
  std::uint32_t blank_length = 0;
  std::memcpy(&blank_length, bytes.data() + blanks, 4);
  bytes = with_number(bytes, blanks, blank_length - 4 - field_length);
  bytes.erase(blanks + 4, 4 + field_length);
  write_text(bag_path(), bytes);
  EXPECT_TRUE(is_error(error_of([] { libmap::list_bag(bag_path()); }), {.file = "a.bag"}));
}

// Where the index says that the messages lie, and how long they say that they are: librosbag
// follows both out of its buffers.
TEST(BagReader, MessagesThatLieOutsideAreErrors) {
  write_sample();
  const std::string whole = read_text(bag_path());
  const auto rig = [] { libmap::plan_bag_rig(bag_path(), {}); };
  std::string led_astray = whole;
  for (std::size_t at = whole.find("op=\x04"); at != std::string::npos;
       at = whole.find("op=\x04", at + 1)) {
    const std::size_t entry = whole.find(std::string("ver=\x01\0\0\0", 8), at) + 8 + 4;
    led_astray = with_number(led_astray, entry + 8, 0x7fffffff);
  }
  write_text(bag_path(), led_astray);
  EXPECT_TRUE(is_error(error_of(rig), {.file = "a.bag"}));
  std::size_t data = whole.find(std::string("op=\x02", 4));
  data = whole.find("time=", data) + 5 + 8;
  for (const std::uint32_t length : {0xffffffffU, 0x7fffffffU, 1U}) {
    write_text(bag_path(), with_number(whole, data, length));
    EXPECT_TRUE(is_error(error_of([&] { rig(); }), {.file = bag_path()})) << length;
  }
}

// The declared lengths of the message's arrays exceed its data.
TEST(BagReader, PromisedArraysTakeNoMemory) {
  rm::PointCloud2 cloud;
  cloud.height = cloud.width = 1;
  cloud.data = {'m', 'a', 'r', 'k'};
  SampleBag(bag_path()).write("/cloud", 1.0, cloud).close();
  std::string bytes = read_text(bag_path());
  const std::size_t at = bytes.find("mark");
  write_text(bag_path(), with_number(bytes, at - 4, 0x7fffffff));
  rusage before{};
  rusage after{};
  getrusage(RUSAGE_SELF, &before);
  EXPECT_TRUE(
      is_error(error_of([] { libmap::read_bag_cloud(bag_path()); }), {.about = "46 bytes"}));
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 100 * 1024);  // KiB
}

TEST(BagReader, SeededCorruptionsAreErrorsOrRead) {
  std::size_t errors = 0;
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    write_sample(compression);
    const std::string whole = read_text(bag_path());
    for (int n = 0; n < 24; ++n) {
      std::string bytes = whole;
      const auto place = [&] {
        return static_cast<std::size_t>(
            graspmap_test::uniform(0, static_cast<double>(whole.size() - 4)));
      };
      if (n % 4 == 0)
        bytes.resize(place());
      else if (n % 4 == 1)
        bytes = with_number(bytes, place(), 0x7fffffff);
      else
        for (int flip = 0; flip < 20; ++flip) bytes[place()] ^= static_cast<char>(1 << (flip % 8));
      write_text(bag_path(), bytes);
      try {
        const libmap::BagRigPlan plan = libmap::plan_bag_rig(bag_path(), {});
        libmap::export_bag_rig(bag_path(), plan, {});
      } catch (const libmap::Error& error) {
        ++errors;
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        EXPECT_TRUE(is_error(error, {.file = bag_path()}));
      }
    }
  }
  EXPECT_GT(errors, 18U);
}

}  // namespace bag_reader_test
