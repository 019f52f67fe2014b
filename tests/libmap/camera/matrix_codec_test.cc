#include "libmap/camera/matrix_codec.h"

#include <gtest/gtest.h>

#include <cstring>

#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace matrix_codec_test {

using graspmap_test::bytes_of;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::MatrixElement;
using libmap::StoredMatrix;

StoredMatrix example(MatrixElement element, int rows, int columns, int channels) {
  StoredMatrix matrix{rows, columns, channels, element, {}};
  matrix.bytes.resize(static_cast<std::size_t>(rows * columns * channels) *
                      libmap::bytes_of(element));
  for (char& byte : matrix.bytes) byte = static_cast<char>(graspmap_test::random_engine()());
  return matrix;
}

std::string with_trailer(const StoredMatrix& matrix, std::int32_t rows, std::int32_t columns,
                         std::int32_t type) {
  const std::string blob = encode_matrix(matrix);
  return blob.substr(0, blob.size() - 12) +
         bytes_of(std::vector<std::int32_t>{rows, columns, type});
}

TEST(MatrixCodec, RoundTrip) {
  for (int element = 0; element <= 6; ++element)
    for (const auto& [rows, columns, channels] :
         {std::tuple{1, 1, 1}, {3, 5, 1}, {1, 40, 7}, {0, 0, 1}, {300, 200, 4}}) {
      const StoredMatrix matrix =
          example(static_cast<MatrixElement>(element), rows, columns, channels);
      EXPECT_EQ(libmap::decode_matrix(encode_matrix(matrix)), matrix);
    }
}

// Compared with zlib and OpenCV: 32FC3 is 21, and the stream is that of zlib.
TEST(MatrixCodec, FramingByHand) {
  const StoredMatrix matrix{1, 2, 3, MatrixElement::float32,
                            bytes_of(std::vector<float>{1, 2, 3, 4, 5, 6})};
  const std::string blob = encode_matrix(matrix);
  EXPECT_EQ(blob.substr(blob.size() - 12), bytes_of(std::vector<std::int32_t>{1, 2, 21}));
  EXPECT_EQ(static_cast<unsigned char>(blob[0]), 0x78);
  EXPECT_EQ(matrix.values<float>()[4], 5.0F);
  EXPECT_EQ(libmap::read_matrix_header(blob).columns, 2);
}

TEST(MatrixCodec, Texts) {
  for (const std::string& text : {std::string("a:1;b:2"), std::string()}) {
    const StoredMatrix matrix{1, static_cast<int>(text.size()) + 1, 1, MatrixElement::int8,
                              text + '\0'};
    EXPECT_EQ(libmap::decode_compressed_text(encode_matrix(matrix)), text);
  }
  EXPECT_TRUE(is_error(error_of([] {
                         libmap::decode_compressed_text(
                             encode_matrix(example(MatrixElement::float32, 1, 3, 1)));
                       }),
                       {.field = "compressed matrix"}));
}

TEST(MatrixCodec, SizesThatDoNotFit) {
  const StoredMatrix matrix = example(MatrixElement::uint8, 10, 10, 1);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, 10, 9, 0)); }),
                       {.value = "10 x 9 x 1 bytes"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, 10, 11, 0)); }),
                       {.about = "100 of 110 bytes"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, -10, 10, 0)); }),
                       {.value = "-10 x 10"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, 10, 10, 7)); }),
                       {.value = "7"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, 10, 10, -1)); }),
                       {.value = "-1"}));
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, 10, 10, 1 << 30)); }),
               {.value = "1073741824"}));
  // 100 MB out of 111 bytes: more than deflate can.
  for (const auto& [rows, columns, type] :
       {std::tuple{0x7fffffff, 1, 6}, {10000, 10000, 0}, {0x7fffffff, 0x7fffffff, 8 * 511 + 6}})
    EXPECT_TRUE(is_error(error_of([&, rows = rows, columns = columns, type = type] {
                           libmap::decode_matrix(with_trailer(matrix, rows, columns, type));
                         }),
                         {.about = "111 bytes"}));
}

TEST(MatrixCodec, WhatIsTooLargeToBeHeldCanBeGoneThrough) {
  StoredMatrix matrix{.rows = 1, .columns = (1 << 26) + 1, .channels = 1, .bytes = {}};
  matrix.bytes.assign(static_cast<std::size_t>(matrix.columns), '\3');
  const std::string blob = encode_matrix(matrix);
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(blob); }),
                       {.value = "1 x 67108865 x 1 bytes"}));
  std::size_t bytes = 0;
  std::size_t others = 0;
  libmap::for_each_matrix_chunk(blob, [&](std::string_view piece) {
    EXPECT_LE(piece.size(), 1U << 16);
    bytes += piece.size();
    if (piece.find_first_not_of('\3') != std::string_view::npos) ++others;
  });
  EXPECT_EQ(bytes, matrix.bytes.size());
  EXPECT_EQ(others, 0U);
}

TEST(MatrixCodec, StreamsOfAnotherLengthThanTheirSize) {
  StoredMatrix matrix = example(MatrixElement::uint8, 300, 300, 1);
  for (const int rows : {0, 1, 299}) {
    EXPECT_TRUE(
        is_error(error_of([&, rows] { libmap::decode_matrix(with_trailer(matrix, rows, 300, 0)); }),
                 {.field = "size of the compressed matrix"}));
  }
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(with_trailer(matrix, 301, 300, 0)); }),
                       {.about = "90000"}));
}

TEST(MatrixCodec, TruncationsAndFlips) {
  const std::string whole = encode_matrix(example(MatrixElement::uint8, 4, 5, 1));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_TRUE(is_error(error_of([&] { libmap::decode_matrix(whole.substr(0, size)); }), {}))
        << size;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string broken = whole;
    broken[at] = static_cast<char>(broken[at] ^ 0x41);
    try {
      const StoredMatrix read = libmap::decode_matrix(broken);
      EXPECT_EQ(read.bytes.size(), 20U);
    } catch (const libmap::Error&) {
    }
  }
}

}  // namespace matrix_codec_test
