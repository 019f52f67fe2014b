// Common clouds and comparisons of the tests of cloud and mesh files.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/point_cloud.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline constexpr std::array<libmap::ScalarType, 8> all_types = {
    libmap::ScalarType::int8,    libmap::ScalarType::uint8,  libmap::ScalarType::int16,
    libmap::ScalarType::uint16,  libmap::ScalarType::int32,  libmap::ScalarType::uint32,
    libmap::ScalarType::float32, libmap::ScalarType::float64};
inline constexpr std::array<double, 8> type_minimum = {-128,          0, -32768, 0,
                                                       -2147483648.0, 0, -1e30,  -1e300};
inline constexpr std::array<double, 8> type_maximum = {127,          255,          32767, 65535,
                                                       2147483647.0, 4294967295.0, 1e30,  1e300};

inline double as_float(double value) { return static_cast<double>(static_cast<float>(value)); }

// One field of each type, with its limits in the first two rows and random values.
inline std::vector<libmap::ScalarField> sample_fields(std::size_t rows) {
  std::vector<libmap::ScalarField> fields;
  for (std::size_t t = 0; t < all_types.size(); ++t) {
    libmap::ScalarField field{"field" + std::to_string(t), all_types[t], {}};
    for (std::size_t i = 0; i < rows; ++i) {
      double value = uniform(std::max(type_minimum[t], -1e9), std::min(type_maximum[t], 1e9));
      if (i == 0) value = type_minimum[t];
      if (i == 1) value = type_maximum[t];
      if (t < 6) value = std::round(value);
      if (t == 6) value = as_float(value);
      field.values.push_back(value);
    }
    fields.push_back(std::move(field));
  }
  return fields;
}

// Coordinates that are exact in float32.
inline libmap::PointCloud sample_cloud(std::size_t size) {
  libmap::PointCloud cloud;
  for (std::size_t i = 0; i < size; ++i) {
    cloud.positions.emplace_back(as_float(uniform(-3, 3)), as_float(uniform(-3, 3)),
                                 as_float(uniform(-3, 3)));
    cloud.normals.emplace_back(static_cast<float>(uniform(-1, 1)),
                               static_cast<float>(uniform(-1, 1)),
                               static_cast<float>(uniform(-1, 1)));
    cloud.colors.push_back({static_cast<std::uint8_t>(uniform(0, 255)),
                            static_cast<std::uint8_t>(uniform(0, 255)),
                            static_cast<std::uint8_t>(uniform(0, 255))});
  }
  cloud.fields = sample_fields(size);
  cloud.viewpoint = libmap::make_pose({1234.5678901, -2.0, 0.1},
                                      Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2).normalized());
  return cloud;
}

// `attempt` on `bytes` cut at many places and with bytes changed: whatever it does, it returns or
// throws libmap::Error.
inline void expect_no_crash(const std::string& bytes,
                            const std::function<void(const std::string&)>& attempt,
                            std::size_t trials) {
  const auto guarded = [&](const std::string& damaged, const std::string& what) {
    try {
      attempt(damaged);
    } catch (const libmap::Error& error) {
      EXPECT_FALSE(std::string(error.what()).empty());
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
      EXPECT_EQ(error.kind(), libmap::ErrorKind::bad_input) << error.what();
      EXPECT_FALSE(error.context().file.empty()) << error.what();
    } catch (const std::exception& other) {
      ADD_FAILURE() << what << ": " << other.what();
    }
  };
  const std::size_t step = std::max<std::size_t>(1, bytes.size() / trials);
  for (std::size_t size = 0; size < bytes.size(); size += step)
    guarded(bytes.substr(0, size), "cut at " + std::to_string(size));
  for (std::size_t trial = 0; trial < trials; ++trial) {
    std::string damaged = bytes;
    const auto flips = static_cast<std::size_t>(uniform(1, 4));
    for (std::size_t flip = 0; flip < flips; ++flip) {
      // Every other change is in the first part, which contains the header.
      const std::size_t span =
          trial % 2 == 0 ? damaged.size() : std::min<std::size_t>(damaged.size(), 400);
      const auto at = static_cast<std::size_t>(uniform(0, static_cast<double>(span) - 0.5));
      damaged[at] = trial % 3 == 0 ? static_cast<char>('0' + static_cast<int>(uniform(0, 9.9)))
                                   : static_cast<char>(static_cast<int>(uniform(0, 255.9)));
    }
    guarded(damaged, "trial " + std::to_string(trial));
  }
}

}  // namespace graspmap_test
