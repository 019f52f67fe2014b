// Points as records of equal length one after the other, as binary PCD and PLY hold them: what it
// takes to read them block by block. Inner part of libmap/cloud.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/cloud/columns.h"
#include "libmap/core/pose.h"

namespace libmap {

struct BinaryRecords {
  std::uint64_t begin = 0;  // of the first record in the file
  std::size_t bytes = 0;    // of a record
  std::uint64_t count = 0;
  std::vector<Column> columns;  // on a block of records that the caller keeps
  Pose viewpoint = Pose::Identity();
};

}  // namespace libmap
