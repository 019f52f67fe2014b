#include "libmap/camera/image_codec.h"

#include <gtest/gtest.h>

#include <boost/crc.hpp>
#include <cmath>
#include <cstdlib>

#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace image_codec_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using graspmap_test::sample_color;
using libmap::ColorImage;
using libmap::GrayImage;

std::uint8_t random_byte() { return static_cast<std::uint8_t>(random_engine()() & 255); }

void set_big_endian(std::string& bytes, std::size_t at, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i)
    bytes[at + static_cast<std::size_t>(i)] = static_cast<char>(value >> (8 * (count - 1 - i)));
}

TEST(ImageCodec, PngKeepsEveryKindOfPixel) {
  ColorImage color(7, 5);
  GrayImage gray(7, 5);
  libmap::Image<std::uint16_t> gray16(7, 5);
  libmap::RgbaImage rgba(7, 5);
  for (std::size_t i = 0; i < color.pixels.size(); ++i) {
    color.pixels[i] = {random_byte(), random_byte(), random_byte()};
    gray.pixels[i] = random_byte();
    gray16.pixels[i] = static_cast<std::uint16_t>(random_engine()());
    rgba.pixels[i] = {random_byte(), random_byte(), random_byte(), random_byte()};
  }
  EXPECT_EQ(libmap::decode_color(encode_png(color)), color);
  EXPECT_EQ(libmap::decode_gray(encode_png(gray)), gray);
  EXPECT_EQ(libmap::decode_gray16(encode_png(gray16)), gray16);
  EXPECT_EQ(libmap::decode_rgba(encode_png(rgba)), rgba);
}

TEST(ImageCodec, GrayBecomesColorAndColorGray) {
  GrayImage gray(2, 1);
  gray.pixels = {10, 200};
  const ColorImage color = libmap::decode_color(encode_png(gray));
  EXPECT_EQ(color.pixels[1], (libmap::Color{200, 200, 200}));
  ColorImage red(1, 1, libmap::Color{255, 0, 0});
  EXPECT_EQ(libmap::decode_gray(encode_png(red)).pixels[0], 76);  // 0.299 * 255
}

TEST(ImageCodec, JpegKeepsColorsAndTheirOrder) {
  ColorImage image(64, 48);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      image.at(x, y) = {static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(5 * y), 30};
  const ColorImage read = libmap::decode_color(libmap::encode_jpeg(image, 95));
  double sum = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) sum += std::abs(image.pixels[i][c] - read.pixels[i][c]);
  EXPECT_LT(sum / static_cast<double>(3 * image.pixels.size()), 2.0);
  const GrayImage gray = libmap::decode_gray(libmap::encode_jpeg(GrayImage(16, 16, 77)));
  EXPECT_NEAR(gray.at(8, 8), 77, 1);
  EXPECT_NEAR(libmap::decode_color(libmap::encode_jpeg(GrayImage(16, 16, 77))).at(3, 3)[2], 77, 1);
}

TEST(ImageCodec, HeadersSayTheSizeOfAPrefix) {
  const std::string png = encode_png(sample_color(1));
  const std::string jpeg = libmap::encode_jpeg(sample_color(1));
  for (const std::string& bytes : {png.substr(0, 33), jpeg.substr(0, 400)}) {
    const auto info = libmap::read_image_info(bytes);
    ASSERT_TRUE(info);
    EXPECT_EQ(info->width, 32);
    EXPECT_EQ(info->height, 24);
    EXPECT_EQ(info->channels, 3);
    EXPECT_EQ(info->bits, 8);
  }
  EXPECT_FALSE(libmap::read_image_info(png.substr(0, 20)));
  EXPECT_FALSE(libmap::read_image_info(jpeg.substr(0, 10)));
  EXPECT_EQ(libmap::read_image_info(encode_png(libmap::RgbaImage(3, 2)))->channels, 4);
  EXPECT_EQ(libmap::read_image_info(encode_png(libmap::Image<std::uint16_t>(3, 2)))->bits, 16);
  EXPECT_TRUE(is_error(error_of([] { libmap::read_image_info("GIF89a"); }),
                       {.field = "image", .bound = "JPEG or PNG"}));
  EXPECT_TRUE(is_error(error_of([] { libmap::read_image_info(""); }),
                       {.field = "image", .bound = "JPEG or PNG"}));
}

// `png` with one chunk more after its header (PNG specification, 5.3).
std::string with_chunk(const std::string& png, const std::string& type_and_data) {
  boost::crc_32_type sum;
  sum.process_bytes(type_and_data.data(), type_and_data.size());
  std::string chunk = std::string(4, '\0') + type_and_data + std::string(4, '\0');
  set_big_endian(chunk, 0, static_cast<std::uint32_t>(type_and_data.size() - 4), 4);
  set_big_endian(chunk, chunk.size() - 4, sum.checksum(), 4);
  return std::string(png).insert(33, chunk);
}

TEST(ImageCodec, ChunksBesideThePixelsChangeNothing) {
  const ColorImage image = sample_color(1);
  const std::string png = encode_png(image);
  const std::string gamma("gAMA\0\0\xb1\x8f", 8);
  const std::string exif("eXIfII*\0\x8\0\0\0\0\0", 14);
  const std::string text("tEXtComment\0rocks", 17);
  std::string long_text = text;
  long_text.resize(20'000'000, 'x');
  for (const std::string& chunk : {gamma, exif, text, long_text, std::string("grAsp")})
    EXPECT_EQ(libmap::decode_color(with_chunk(png, chunk)), image) << chunk.substr(0, 4);
  for (const std::string& chunk : {exif, text}) {
    std::string endless = with_chunk(png, chunk);
    set_big_endian(endless, 33, 0x7ffffff0, 4);
    EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(endless); }), {.field = "PNG data"}));
  }
}

TEST(ImageCodec, EveryTruncationIsAnError) {
  for (const std::string& whole :
       {encode_png(sample_color(1)), libmap::encode_jpeg(sample_color(1))}) {
    ASSERT_NO_THROW(libmap::decode_color(whole));
    for (std::size_t size = 0; size < whole.size(); ++size)
      EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(whole.substr(0, size)); }), {}))
          << size << " of " << whole.size();
  }
}

TEST(ImageCodec, FlippedBytesOfAPngAreNoticed) {
  const std::string whole = encode_png(sample_color(2));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string broken = whole;
    broken[at] = static_cast<char>(broken[at] ^ 0x10);
    EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(broken); }), {})) << at;
  }
}

TEST(ImageCodec, SizesThatCannotBeAreRefusedByTheirHeader) {
  std::string png = encode_png(sample_color(1));
  set_big_endian(png, 16, 0x7fffffff, 4);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(png); }),
                       {.field = "image size", .value = "2147483647 x 24 pixels"}));
  set_big_endian(png, 16, 5000, 4);
  set_big_endian(png, 20, 5000, 4);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(png); }),
                       {.field = "image size", .value = "5000 x 5000 pixels"}));
  set_big_endian(png, 16, 0, 4);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(png); }), {.value = "0 x 5000"}));

  std::string jpeg = libmap::encode_jpeg(sample_color(1));
  const std::size_t frame = jpeg.find("\xff\xc0");
  ASSERT_NE(frame, std::string::npos);
  set_big_endian(jpeg, frame + 5, 5000, 2);
  set_big_endian(jpeg, frame + 7, 5000, 2);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(jpeg); }),
                       {.field = "image size", .value = "5000 x 5000 pixels"}));
  set_big_endian(jpeg, frame + 5, 0, 2);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(jpeg); }), {.value = "5000 x 0"}));
}

TEST(ImageCodec, JpegsWithoutAFrameBeforeTheirPixels) {
  for (const char marker : {'\xda', '\xd8', '\xd9', '\x01'}) {
    const std::string bytes = std::string("\xff\xd8\xff") + marker + std::string("\0\x8\0", 3);
    EXPECT_TRUE(is_error(error_of([&] { libmap::decode_color(bytes); }), {.field = "JPEG header"}));
  }
}

TEST(ImageCodec, ImagesThatNoFileCanHold) {
  const libmap::Error jpeg = error_of([] { libmap::encode_jpeg(GrayImage(65501, 1)); });
  EXPECT_TRUE(is_error(
      jpeg, {.field = "image size", .value = "65501 x 1", .kind = libmap::ErrorKind::failed}))
      << jpeg.what();
  const libmap::Error png = error_of([] { libmap::encode_png(GrayImage(1000001, 1)); });
  EXPECT_TRUE(is_error(
      png, {.field = "image size", .value = "1000001 x 1", .kind = libmap::ErrorKind::failed}))
      << png.what();
}

TEST(ImageCodec, OnlyWhatWasAskedForIsTaken) {
  const std::string color = encode_png(sample_color(1));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_gray16(color); }),
                       {.value = "PNG of 3 x 8 bits per pixel"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_rgba(color); }),
                       {.value = "PNG of 3 x 8 bits per pixel"}));
  EXPECT_TRUE(
      is_error(error_of([] { libmap::encode_png(ColorImage()); }), {.field = "image size"}));
  EXPECT_TRUE(
      is_error(error_of([] { libmap::encode_jpeg(ColorImage()); }), {.field = "image size"}));
}

}  // namespace image_codec_test
