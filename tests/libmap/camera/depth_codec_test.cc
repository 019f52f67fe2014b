#include "libmap/camera/depth_codec.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "libmap/camera/image_codec.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace depth_codec_test {

using graspmap_test::error_of;
using graspmap_test::ExpectedError;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using graspmap_test::sample_depth;
using libmap::DepthImage;
using libmap::MillimeterImage;

// RVL by its definition, with the stream as one long row of bits: slow and plain.
class SlowRvl {
 public:
  static std::string encode(const MillimeterImage& image) {
    SlowRvl rvl;
    std::size_t at = 0;
    int previous = 0;
    while (at < image.pixels.size()) {
      std::size_t zeros = 0;
      while (at + zeros < image.pixels.size() && image.pixels[at + zeros] == 0) ++zeros;
      std::size_t values = 0;
      while (at + zeros + values < image.pixels.size() && image.pixels[at + zeros + values] != 0)
        ++values;
      rvl.append(static_cast<long>(zeros));
      rvl.append(static_cast<long>(values));
      for (std::size_t i = 0; i < values; ++i) {
        const int delta = image.pixels[at + zeros + i] - previous;
        rvl.append(delta >= 0 ? 2L * delta : -2L * delta - 1);
        previous = image.pixels[at + zeros + i];
      }
      at += zeros + values;
    }
    while (rvl.nibbles_.size() % 8 != 0) rvl.nibbles_.push_back(0);
    std::string bytes = "DEPTHRVL";
    append_word(bytes, static_cast<std::uint32_t>(image.width));
    append_word(bytes, static_cast<std::uint32_t>(image.height));
    for (std::size_t i = 0; i < rvl.nibbles_.size(); i += 8) {
      std::uint32_t word = 0;
      for (std::size_t j = 0; j < 8; ++j) word = word * 16 + rvl.nibbles_[i + j];
      append_word(bytes, word);
    }
    return bytes;
  }

 private:
  void append(long number) {
    std::vector<unsigned> digits;  // to the base of 8
    do {
      digits.push_back(static_cast<unsigned>(number % 8));
      number /= 8;
    } while (number > 0);
    for (std::size_t i = 0; i < digits.size(); ++i)
      nibbles_.push_back(digits[i] + (i + 1 < digits.size() ? 8 : 0));
  }

  static void append_word(std::string& bytes, std::uint32_t word) {
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<char>(word >> (8 * i)));
  }

  std::vector<unsigned> nibbles_;
};

MillimeterImage random_image(int width, int height, unsigned zeros_in_100) {
  MillimeterImage image(width, height);
  for (std::uint16_t& pixel : image.pixels) {
    const std::uint64_t draw = random_engine()();
    const bool is_smooth = draw % 7 != 0;
    if (draw / 8 % 100 >= zeros_in_100)
      pixel = static_cast<std::uint16_t>(is_smooth ? 2000 + draw % 31 : 1 + draw % 65535);
  }
  return image;
}

TEST(Rvl, AgreesWithASlowEncoder) {
  for (const unsigned zeros : {0U, 3U, 50U, 97U, 100U})
    for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {64, 48}, {1, 300}}) {
      const MillimeterImage image = random_image(width, height, zeros);
      const std::string bytes = SlowRvl::encode(image);
      EXPECT_EQ(libmap::encode_rvl(image), bytes);
      EXPECT_EQ(libmap::decode_rvl(bytes), image);
    }
}

TEST(Rvl, BytesByHand) {
  // One zero, two values 10 and 9: runs 1 and 2, deltas +10 -> 20 = 4 + 2 * 8, -1 -> 1.
  // Nibbles 1, 2, 4|8, 2, 1, padded: 0x12c21000.
  MillimeterImage image(3, 1);
  image.pixels = {0, 10, 9};
  const std::string bytes = std::string("DEPTHRVL\3\0\0\0\1\0\0\0\x00\x10\xc2\x12", 20);
  EXPECT_EQ(libmap::encode_rvl(image), bytes);
  EXPECT_EQ(libmap::decode_rvl(bytes), image);
}

TEST(Rvl, EveryTruncationIsAnError) {
  const std::string whole = libmap::encode_rvl(sample_depth(1));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_TRUE(
        is_error(error_of([&] { libmap::decode_depth(whole.substr(0, size)); }),
                 size < 8 ? ExpectedError{.field = "image"} : ExpectedError{.about = "RVL"}))
        << size;
}

TEST(Rvl, FlippedBytesNeverReachBeyondTheImage) {
  const std::string whole = libmap::encode_rvl(sample_depth(1));
  for (std::size_t at = 16; at < whole.size(); ++at)
    for (const int bit : {0, 3, 7}) {
      std::string broken = whole;
      broken[at] = static_cast<char>(broken[at] ^ (1 << bit));
      try {
        EXPECT_EQ(libmap::decode_rvl(broken).pixels.size(), 32U * 24U);
      } catch (const libmap::Error&) {
      }
    }
}

// Each nibble says that another follows; 32 bits need eleven.
TEST(Rvl, NumbersThatDoNotEnd) {
  const std::string bytes = std::string("DEPTHRVL\3\0\0\0\1\0\0\0", 16) + std::string(8, '\xff');
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_rvl(bytes); }), {.field = "RVL data"}));
}

TEST(Rvl, SizesThatCannotBe) {
  std::string bytes = libmap::encode_rvl(sample_depth(1));
  const auto with_size = [&](std::uint32_t columns, std::uint32_t rows) {
    std::string changed = bytes;
    std::memcpy(changed.data() + 8, &columns, 4);
    std::memcpy(changed.data() + 12, &rows, 4);
    return changed;
  };
  EXPECT_EQ(error_of([&] { libmap::decode_depth(with_size(32, 0x80000000U)); }).context().field,
            "image size");
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_depth(with_size(0xffffffffU, 0xffffffffU)); }),
                       {.field = "image size", .value = "4294967295 x 4294967295"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_depth(with_size(0, 5)); }),
                       {.field = "image size", .value = "0 x 5"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_depth(with_size(10000, 10000)); }),
                       {.field = "image size", .value = "10000 x 10000"}));
  // One row more or less than stored.
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::decode_depth(with_size(32, 25)); }), {.about = "824 bytes"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_depth(with_size(32, 23)); }),
                       {.field = "run of pixels", .value = "17", .bound = "<= 9"}));
}

// Some 130 kB stand for 8000 x 8000 zeros.
TEST(DepthCodec, ImagesLargerThanAnyCamerasAreRefusedByTheirHeader) {
  const std::string bytes = libmap::encode_png(MillimeterImage(4097, 4096));
  const libmap::Error error = error_of([&] { libmap::decode_depth(bytes.substr(0, 40)); });
  EXPECT_EQ(error.context().value, "4097 x 4096");
  EXPECT_EQ(error.context().bound, "<= 16777216 pixels");
}

TEST(DepthCodec, MillimetersBecomeMeters) {
  MillimeterImage image(4, 1);
  image.pixels = {0, 1, 1234, 65535};
  for (const std::string& bytes : {libmap::encode_rvl(image), libmap::encode_png(image)}) {
    const DepthImage depth = libmap::decode_depth(bytes);
    EXPECT_EQ(depth.pixels, (std::vector<float>{0.0F, 0.001F, 1.234F, 0.0F}));
  }
}

TEST(DepthCodec, MillimetersSurviveMeters) {
  MillimeterImage all(256, 256);
  for (std::size_t i = 0; i < all.pixels.size(); ++i) all.pixels[i] = static_cast<std::uint16_t>(i);
  all.pixels[65535] = 0;
  EXPECT_EQ(libmap::to_millimeters(libmap::to_meters(all)), all);
  DepthImage odd(5, 1);
  odd.pixels = {std::numeric_limits<float>::quiet_NaN(), -1.0F, 65.535F, 1e30F, 0.0004F};
  EXPECT_EQ(libmap::to_millimeters(odd), MillimeterImage(5, 1));
}

TEST(DepthCodec, FloatsKeepTheirBits) {
  DepthImage depth(6, 2);
  depth.pixels = {0.1F,
                  1.2345678F,
                  1e-30F,
                  3.4e38F,
                  std::bit_cast<float>(0x3f800001U),
                  -0.0F,
                  -1.0F,
                  std::numeric_limits<float>::infinity(),
                  std::numeric_limits<float>::quiet_NaN(),
                  4.0F,
                  0.0F,
                  2.5F};
  const std::string bytes = libmap::encode_float_png(depth);
  const DepthImage raw = libmap::decode_float_png(bytes);
  for (std::size_t n = 0; n < 12; ++n)
    EXPECT_EQ(std::bit_cast<std::uint32_t>(raw.pixels[n]),
              std::bit_cast<std::uint32_t>(depth.pixels[n]));
  const DepthImage clean = libmap::decode_depth(bytes);
  for (const std::size_t invalid : {5U, 6U, 7U, 8U, 10U}) EXPECT_EQ(clean.pixels[invalid], 0.0F);
  EXPECT_EQ(clean.pixels[1], 1.2345678F);
}

// OpenCV writes the four bytes of a float as blue, green, red, alpha: in the file red is the third.
TEST(DepthCodec, FloatsHaveTheirBytesInOpenCvsOrder) {
  const auto bytes = std::bit_cast<std::array<std::uint8_t, 4>>(1.5625F * 1.7F);
  libmap::RgbaImage rgba(1, 1);
  rgba.pixels[0] = {bytes[2], bytes[1], bytes[0], bytes[3]};
  EXPECT_EQ(libmap::decode_depth(libmap::encode_png(rgba)).pixels[0], 1.5625F * 1.7F);
}

TEST(DepthCodec, HeadersTellTheFormats) {
  using libmap::DepthFormat;
  const auto format = [](const std::string& bytes) {
    const auto info = libmap::read_depth_info(bytes);
    EXPECT_EQ(info->width, 32);
    EXPECT_EQ(info->height, 24);
    return info->format;
  };
  EXPECT_EQ(format(libmap::encode_rvl(sample_depth(1)).substr(0, 16)), DepthFormat::rvl);
  EXPECT_EQ(format(libmap::encode_png(sample_depth(1)).substr(0, 40)), DepthFormat::png16);
  EXPECT_EQ(format(libmap::encode_float_png(DepthImage(32, 24)).substr(0, 40)),
            DepthFormat::float_png);
  EXPECT_FALSE(libmap::read_depth_info(libmap::encode_jpeg(libmap::GrayImage(8, 8))));
  EXPECT_FALSE(libmap::read_depth_info(libmap::encode_png(libmap::GrayImage(8, 8))));
  EXPECT_TRUE(
      is_error(error_of([] { libmap::decode_depth(libmap::encode_png(libmap::GrayImage(8, 8))); }),
               {.field = "depth image", .bound = "RVL, 16-bit PNG or float PNG"}));
  EXPECT_TRUE(is_error(error_of([] { libmap::decode_depth("no image at all"); }),
                       {.field = "image", .bound = "JPEG or PNG"}));
}

}  // namespace depth_codec_test
