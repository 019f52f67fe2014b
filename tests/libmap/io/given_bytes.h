// Cloud files from given bytes.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "libmap/core/error.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline libmap::CloudReadResult read_as(const std::string& extension, const std::string& bytes) {
  const std::filesystem::path path = scratch_folder() / ("given" + extension);
  write_text(path, bytes);
  return libmap::read_cloud(path);
}

// The reader's error of kind bad_input.
inline libmap::Error error_as(const std::string& extension, const std::string& bytes) {
  const libmap::Error error = error_of([&] { read_as(extension, bytes); });
  EXPECT_EQ(error.kind(), libmap::ErrorKind::bad_input);
  EXPECT_EQ(error.context().file, (scratch_folder() / ("given" + extension)).string());
  return error;
}

// Bytes of a number in the machine's little-endian order.
template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

}  // namespace graspmap_test
