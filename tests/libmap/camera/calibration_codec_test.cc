#include "libmap/camera/calibration_codec.h"

#include <gtest/gtest.h>

#include <cstring>

#include "libmap/core/pose.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace calibration_codec_test {

using graspmap_test::bytes_of;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::Calibration;
using libmap::CalibrationLayout;
using libmap::Camera;
using libmap::DistortionModel;

const std::vector<float> local{0, 0, 1, 0.5F, -1, 0, 0, 0.25F, 0, -1, 0, 0.125F};
const std::vector<double> k{300, 0, 160, 0, 310, 120, 0, 0, 1};
const std::vector<double> p{320, 0, 161, 0, 0, 330, 121, 0, 0, 0, 1, 0};
const std::vector<double> eye{1, 0, 0, 0, 1, 0, 0, 0, 1};

struct Parts {
  std::vector<double> k{};
  std::vector<double> d{};
  std::vector<double> r{};
  std::vector<double> p{};
  std::vector<float> l = local;
};

std::string record(const Parts& of, int width = 320, int height = 240) {
  const auto count = [](const auto& list) { return static_cast<std::int32_t>(list.size()); };
  return bytes_of(std::vector<std::int32_t>{0, 20, 1, 0, width, height, count(of.k), count(of.d),
                                            count(of.r), count(of.p), count(of.l)}) +
         bytes_of(of.k) + bytes_of(of.d) + bytes_of(of.r) + bytes_of(of.p) + bytes_of(of.l);
}

std::string stereo_record(const Parts& left, const Parts& right, const std::vector<double>& r,
                          const std::vector<double>& t) {
  const std::string a = record(left);
  const std::string b = record(right);
  const auto count = [](const auto& list) { return static_cast<std::int32_t>(list.size()); };
  return bytes_of(std::vector<std::int32_t>{0, 20, 1, 1, count(r), count(t), 0, 0,
                                            static_cast<std::int32_t>(a.size()),
                                            static_cast<std::int32_t>(b.size())}) +
         bytes_of(r) + bytes_of(t) + a + b;
}

// The stored bytes, and the camera that a reader of that version takes them for.
Camera only_camera(const std::string& bytes, int width = 0, int height = 0) {
  const Calibration calibration = libmap::decode_calibration(bytes);
  if (calibration.layout == CalibrationLayout::records) {
    EXPECT_EQ(encode_calibration(calibration), bytes);
  }
  const std::vector<Camera> cameras = cameras_of(calibration, width, height);
  EXPECT_EQ(cameras.size(), 1U);
  return cameras.at(0);
}

void expect_local(const Camera& camera) {
  for (int i = 0; i < 12; ++i)
    EXPECT_FLOAT_EQ(static_cast<float>(camera.base_from_camera.matrix()(i / 4, i % 4)),
                    local[static_cast<std::size_t>(i)]);
}

TEST(CalibrationCodec, RecordOfKAlone) {
  const std::string bytes = record({.k = k});
  EXPECT_EQ(bytes.size(), 164U);
  const Camera camera = only_camera(bytes);
  EXPECT_EQ(camera.width, 320);
  EXPECT_EQ(camera.height, 240);
  EXPECT_EQ(camera.fx, 300);
  EXPECT_EQ(camera.fy, 310);
  EXPECT_EQ(camera.cx, 160);
  EXPECT_EQ(camera.cy, 120);
  EXPECT_FALSE(camera.is_distorted());
  expect_local(camera);
}

TEST(CalibrationCodec, PGoesOverKAndSaysThatTheImageIsRectified) {
  const std::string bytes = record({.k = k, .d = {0.1, 0.2, 0, 0, 0.3}, .r = eye, .p = p});
  EXPECT_EQ(bytes.size(), 372U);
  const Camera camera = only_camera(bytes);
  EXPECT_EQ(camera.fx, 320);
  EXPECT_EQ(camera.fy, 330);
  EXPECT_EQ(camera.cx, 161);
  EXPECT_EQ(camera.cy, 121);
  EXPECT_FALSE(camera.is_distorted());
  // A zero P is equivalent to no P.
  EXPECT_EQ(only_camera(record({.k = k, .p = std::vector<double>(12, 0.0)})).fx, 300);
}

TEST(CalibrationCodec, DistortionOfRawImages) {
  const Camera five = only_camera(record({.k = k, .d = {0.1, 0.2, 0.01, 0.02, 0.3}}));
  EXPECT_EQ(five.distortion_model, DistortionModel::radial_tangential);
  EXPECT_EQ(five.distortion, (std::vector<double>{0.1, 0.2, 0.01, 0.02, 0.3}));
  const Camera six = only_camera(record({.k = k, .d = {0.1, 0.2, 0, 0, 0.3, 0.4}}));
  EXPECT_EQ(six.distortion_model, DistortionModel::equidistant);
  EXPECT_EQ(six.distortion, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  for (const std::size_t count : {4U, 8U, 12U})
    EXPECT_EQ(
        only_camera(record({.k = k, .d = std::vector<double>(count, 0.01)})).distortion.size(),
        count);
  EXPECT_FALSE(only_camera(record({.k = k, .d = std::vector<double>(5, 0.0)})).is_distorted());
  std::vector<double> tilted(14, 0.01);
  EXPECT_EQ(error_of([&] { only_camera(record({.k = k, .d = tilted})); }).context().value, "14");
  tilted[12] = tilted[13] = 0;
  EXPECT_EQ(only_camera(record({.k = k, .d = tilted})).distortion.size(), 12U);
}

TEST(CalibrationCodec, DefaultPlaceOnTheBase) {
  const Camera camera = only_camera(record({.k = k, .l = {}}));
  EXPECT_TRUE(
      camera.base_from_camera.matrix().isApprox(libmap::optical_to_body_rotation().matrix(), 0));
}

TEST(CalibrationCodec, SeveralCamerasSideBySide) {
  const std::string bytes = record({.k = k}, 0, 0) + record({.k = k, .p = p}, 0, 0);
  const Calibration calibration = libmap::decode_calibration(bytes);
  EXPECT_EQ(encode_calibration(calibration), bytes);
  const std::vector<Camera> cameras = cameras_of(calibration, 640, 240);
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].width, 320);
  EXPECT_EQ(cameras[1].height, 240);
  EXPECT_EQ(cameras[1].fx, 320);
}

TEST(CalibrationCodec, StereoRecords) {
  std::vector<double> right_p = p;
  right_p[3] = -320 * 0.12;
  const std::string bytes =
      stereo_record({.k = k, .p = p}, {.k = k, .p = right_p}, eye, {-0.12, 0, 0});
  const Calibration calibration = libmap::decode_calibration(bytes + bytes);
  EXPECT_EQ(encode_calibration(calibration), bytes + bytes);
  ASSERT_EQ(calibration.stereo.size(), 2U);
  const auto pair = stereo_cameras_of(calibration, 0, 0).at(1);
  EXPECT_EQ(pair.left.fx, 320);
  EXPECT_DOUBLE_EQ(pair.baseline_m, 0.12);
  EXPECT_DOUBLE_EQ(pair.right_from_left.translation().x(), -0.12);
  EXPECT_EQ(cameras_of(calibration, 0, 0).size(), 2U);

  // For raw images, R and T define the pose of the right camera.
  const std::vector<double> turned{0, -1, 0, 1, 0, 0, 0, 0, 1};
  const auto raw = stereo_cameras_of(
      libmap::decode_calibration(stereo_record({.k = k}, {.k = k}, turned, {-0.3, 0, 0.4})), 0, 0);
  EXPECT_DOUBLE_EQ(raw.at(0).baseline_m, 0.5);
  EXPECT_DOUBLE_EQ(raw.at(0).right_from_left.linear()(1, 0), 1);
  EXPECT_DOUBLE_EQ(raw.at(0).right_from_left.translation().z(), 0.4);
}

TEST(CalibrationCodec, FloatsOfEarlierVersions) {
  const std::vector<float> numbers{300, 310, 160.5F, 120.25F};
  const std::vector<float> size{320, 240};
  const std::string sized = bytes_of(numbers) + bytes_of(size) + bytes_of(local);
  EXPECT_EQ(sized.size(), 72U);
  EXPECT_EQ(only_camera(sized).width, 320);
  EXPECT_EQ(only_camera(sized).cy, 120.25);
  expect_local(only_camera(sized));
  EXPECT_EQ(libmap::decode_calibration(sized).layout, CalibrationLayout::floats_with_size);

  const std::string plain = bytes_of(numbers) + bytes_of(local);
  EXPECT_EQ(plain.size(), 64U);
  EXPECT_EQ(only_camera(plain, 640, 480).width, 640);
  EXPECT_EQ(only_camera(plain, 640, 480).cx, 160.5);
  EXPECT_EQ(error_of([&] { only_camera(plain); }).context().field, "width");
  EXPECT_EQ(libmap::decode_calibration(plain).layout, CalibrationLayout::floats);

  for (const bool has_size : {true, false}) {
    const std::string stereo = bytes_of(numbers) + bytes_of(std::vector<float>{0.25F}) +
                               (has_size ? bytes_of(size) : "") + bytes_of(local);
    EXPECT_EQ(stereo.size(), has_size ? 76U : 68U);
    const Calibration calibration = libmap::decode_calibration(stereo);
    const auto pair = stereo_cameras_of(calibration, 320, 240).at(0);
    EXPECT_EQ(pair.baseline_m, 0.25);
    EXPECT_EQ(pair.left.width, 320);
    EXPECT_EQ(pair.right.fx, 300);
  }
}

// 576 bytes are eight cameras with sizes or nine without.
TEST(CalibrationCodec, SizesTellApartWhatTheLengthDoesNot) {
  const std::string sized =
      bytes_of(std::vector<float>{300, 310, 160, 120, 320, 240}) + bytes_of(local);
  const std::string plain = bytes_of(std::vector<float>{300, 310, 160, 120}) + bytes_of(local);
  std::string eight;
  std::string nine;
  for (int i = 0; i < 8; ++i) eight += sized;
  for (int i = 0; i < 9; ++i) nine += plain;
  ASSERT_EQ(eight.size(), nine.size());
  EXPECT_EQ(libmap::decode_calibration(eight).cameras.size(), 8U);
  EXPECT_EQ(libmap::decode_calibration(nine).cameras.size(), 9U);
}

TEST(CalibrationCodec, RandomRecordsKeepTheirBytes) {
  auto& engine = graspmap_test::random_engine();
  for (int round = 0; round < 200; ++round) {
    const auto random_list = [&](std::size_t count, bool may_be_empty = true) {
      std::vector<double> list(may_be_empty && engine() % 2 == 0 ? 0 : count);
      for (double& number : list) number = graspmap_test::uniform(-1e3, 1e3);
      return list;
    };
    const auto random_parts = [&] {
      return Parts{.k = random_list(9),
                   .d = random_list(engine() % 15),
                   .r = random_list(9),
                   .p = random_list(12),
                   .l = engine() % 2 == 0 ? local : std::vector<float>()};
    };
    std::string bytes;
    const bool is_stereo = engine() % 2 == 0;
    for (std::uint64_t i = 0; i <= engine() % 3; ++i)
      bytes += is_stereo
                   ? stereo_record(random_parts(), random_parts(), random_list(9), random_list(3))
                   : record(random_parts());
    EXPECT_EQ(encode_calibration(libmap::decode_calibration(bytes)), bytes);
  }
}

TEST(CalibrationCodec, RecordOfACameraReadsBack) {
  Camera camera{.width = 512, .height = 424, .fx = 365.5, .fy = 366.5, .cx = 255.5, .cy = 211.5};
  camera.base_from_camera = libmap::make_pose_from_rpy({0.1, -0.2, 0.3}, {5, 10, 15}) *
                            libmap::optical_to_body_rotation();
  for (const auto& [model, terms] :
       {std::pair{DistortionModel::none, std::vector<double>{}},
        {DistortionModel::radial_tangential, {0.1, -0.2, 0.01, 0.02, 0.05}},
        {DistortionModel::equidistant, {0.1, -0.2, 0.03, 0.04}},
        {DistortionModel::equidistant, {0, 0, 0, 0}}}) {
    camera.distortion_model = model;
    camera.distortion = terms;
    const Camera read = only_camera(libmap::encode_calibration(
        {.layout = CalibrationLayout::records, .cameras = {record_of(camera)}}));
    EXPECT_EQ(read.fx, camera.fx);
    EXPECT_EQ(read.cy, camera.cy);
    EXPECT_EQ(read.distortion_model, model);
    EXPECT_EQ(read.distortion, terms);
    EXPECT_TRUE(read.base_from_camera.isApprox(camera.base_from_camera, 1e-6));
  }
}

TEST(CalibrationCodec, TruncationsAndLyingCounts) {
  const std::string whole = record({.k = k, .d = {0.1, 0.2, 0, 0, 0.3}, .r = eye, .p = p});
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_TRUE(is_error(error_of([&] { libmap::decode_calibration(whole.substr(0, size)); }), {}))
        << size;
  for (const std::size_t place : {6U, 7U, 8U, 9U, 10U})
    for (const std::int32_t count : {-1, 1, 0x7fffffff}) {
      std::string lying = whole;
      std::memcpy(lying.data() + 4 * place, &count, 4);
      const std::string field =
          error_of([&] { libmap::decode_calibration(lying); }).context().field;
      EXPECT_TRUE(field == "records" || field.starts_with("number of elements of")) << field;
    }
  const std::string stereo = stereo_record({.k = k}, {.k = k}, eye, {-0.1, 0, 0});
  for (std::size_t size = 0; size < stereo.size(); ++size)
    EXPECT_TRUE(is_error(error_of([&] { libmap::decode_calibration(stereo.substr(0, size)); }), {}))
        << size;
  EXPECT_TRUE(is_error(error_of([] { libmap::decode_calibration(std::string(100, '\1')); }),
                       {.field = "layout", .value = "100 bytes"}));
}

TEST(CalibrationCodec, RecordsThatDoNotBelongTogether) {
  const std::string stereo = stereo_record({.k = k}, {.k = k}, eye, {-0.1, 0, 0});
  const auto refusal_of = [&](std::size_t at, std::int32_t number) {
    std::string changed = stereo;
    std::memcpy(changed.data() + at, &number, 4);
    return error_of([&] { libmap::decode_calibration(changed); });
  };
  // 10 int32, R and T stand before the left camera, three int32 of a version before its kind.
  EXPECT_TRUE(is_error(refusal_of(40 + 72 + 24 + 12, 1), {.value = "1", .bound = "0"}));
  EXPECT_TRUE(is_error(refusal_of(32, 163), {.value = "163"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::decode_calibration(stereo + record({.k = k})); }),
                       {.field = "cameras"}));
}

TEST(CalibrationCodec, StereoCamerasAtOnePlace) {
  const Calibration calibration =
      libmap::decode_calibration(stereo_record({.k = k}, {.k = k}, eye, {0, 0, 0}));
  EXPECT_TRUE(is_error(error_of([&] { stereo_cameras_of(calibration, 0, 0); }),
                       {.field = "baseline_m", .value = "0", .bound = "> 0"}));
}

TEST(CalibrationCodec, NumbersThatAreNoCamera) {
  std::vector<double> zero = k;
  zero[0] = 0;
  EXPECT_EQ(error_of([&] { only_camera(record({.k = zero})); }).context().field, "fx");
  zero[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(error_of([&] { only_camera(record({.k = zero})); }).context().field, "fx");
  EXPECT_EQ(error_of([&] { only_camera(record({.k = k}, -3, 240)); }).context().field, "width");
  EXPECT_TRUE(is_error(error_of([] { only_camera(record({})); }), {.field = "K and P"}));
}

}  // namespace calibration_codec_test
