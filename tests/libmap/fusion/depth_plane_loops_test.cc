#include "libmap/fusion/depth_plane_loops.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "tests/support/test_support.h"

namespace libmap {
namespace depth_plane_loops_test {

using graspmap_test::uniform;

constexpr int count = 45;  // no multiple of any register's lanes
constexpr int stride = 64;
constexpr int radius = 3;
constexpr int rows = 2 * radius + 1;

// Outputs of all loops for a few rows of a rough surface with gaps.
struct Made {
  std::vector<float> numbers;
  std::vector<std::uint8_t> bytes;
};

Made make_with(InstructionSet instructions, const std::vector<float>& depths,
               const std::vector<std::uint8_t>& wanted) {
  const DepthPlaneLoops& loops = depth_plane_loops_of(instructions);
  std::vector<float> numbers(40 * stride, 0.0F);
  const auto at = [&](int row) { return numbers.data() + row * stride; };
  std::vector<float> inverse((rows + 1) * stride, 0.0F);
  std::vector<float> rays(2 * 3 * stride);
  for (int n = 0; n < 3 * stride; ++n) {
    rays[static_cast<std::size_t>(n)] = 0.003F * static_cast<float>(n % stride);
    rays[static_cast<std::size_t>(3 * stride + n)] = 0.0031F * static_cast<float>(n / stride);
  }
  std::vector<std::uint8_t> bytes(2 * stride, 0);
  const DepthPlaneLoops::Limits limits{0.1F, 4.0F, 3.6F, 0.002F, 0.005F, 0.001F};
  std::vector<int> counts;
  for (int y = 0; y < rows; ++y) {
    const auto measured = loops.measure(depths.data() + y * count, count, limits,
                                        inverse.data() + y * stride + radius, at(y));
    counts.insert(counts.end(), {measured.unmeasured, measured.out_of_range});
  }
  std::vector<DepthPlaneLoops::Offset> offsets;
  for (int dy = 0; dy <= radius; ++dy)
    for (int dx = -radius; dx <= radius; ++dx)
      if (dy > 0 || dx > 0)
        offsets.push_back({dy * stride + dx, 1 | (dx * dx) << 8 | (dy * dy) << 20, dx * dy,
                           static_cast<float>(dx), static_cast<float>(dy), 0.01F});
  const float* const middle = inverse.data() + radius * stride + radius;
  const DepthPlaneLoops::InversePlanes fitted{at(10), at(11), at(12), bytes.data()};
  loops.fit(middle, at(radius), wanted.empty() ? nullptr : wanted.data(), count, offsets.data(),
            offsets.size(), 6.0F, fitted);
  const DepthPlaneLoops::Planes planes{
      at(13), {at(14), at(15), at(16)}, at(17), bytes.data() + stride};
  const DepthPlaneLoops::Rays at_rays{rays.data() + stride, rays.data() + 4 * stride, -stride,
                                      stride};
  const auto finished = loops.finish(middle, fitted, at_rays, count, 0.08F, planes);
  counts.insert(counts.end(), {finished.used, finished.flying, finished.grazing});
  const DepthPlaneLoops::Placement placement{
      {0.8F, -0.6F, 0.1F, 0.6F, 0.8F, -0.2F, 0.1F, 0.3F, 0.9F},
      {1, 2, 3},
      100,
      0.002F,
      0.005F,
      0.001F};
  loops.place(planes, at_rays.x, at_rays.y, count, placement,
              {{at(18), at(19), at(20)}, {at(21), at(22), at(23)}, at(24)});
  loops.place_depths(depths.data(), at_rays.x, at_rays.y, count, placement, at(25), at(26));
  // Values beyond the last pixel and without a plane are arbitrary.
  Made made;
  for (int row = 0; row < 27; ++row)
    for (int x = 0; x < count; ++x)
      if (row < rows || row > 24 || bytes[static_cast<std::size_t>(stride + x)] > 0)
        made.numbers.push_back(at(row)[x]);
  for (int x = 0; x < count; ++x)
    made.bytes.insert(made.bytes.end(), {bytes[static_cast<std::size_t>(x)],
                                         bytes[static_cast<std::size_t>(stride + x)]});
  for (const int number : counts) made.numbers.push_back(static_cast<float>(number));
  return made;
}

TEST(DepthPlaneLoops, AllInstructionSetsYieldTheSame) {
  std::vector<float> depths;
  for (int n = 0; n < rows * count; ++n) {
    const double wave = 0.05 * std::sin(0.4 * (n % count)) + 0.004 * uniform(-1, 1);
    const double kind = uniform(0, 1);
    depths.push_back(kind < 0.1 ? 0.0F : kind < 0.15 ? 5.0F : static_cast<float>(1.5 + wave));
  }
  std::vector<std::uint8_t> some(stride, 0);
  for (const std::size_t n : {3U, 17U, 18U, 40U}) some[n] = 1;
  for (const std::vector<std::uint8_t>& wanted : {std::vector<std::uint8_t>(), some}) {
    const Made truth = make_with(InstructionSet::portable, depths, wanted);
    EXPECT_GT(std::count_if(truth.bytes.begin(), truth.bytes.end(), [](int n) { return n > 0; }),
              wanted.empty() ? 20 : 2);
    for (const InstructionSet instructions : {InstructionSet::avx2, InstructionSet::avx512}) {
      if (!has_instruction_set(instructions)) continue;
      const Made made = make_with(instructions, depths, wanted);
      ASSERT_EQ(made.bytes, truth.bytes);
      ASSERT_EQ(made.numbers.size(), truth.numbers.size());
      EXPECT_EQ(std::memcmp(made.numbers.data(), truth.numbers.data(),
                            sizeof(float) * truth.numbers.size()),
                0);
    }
  }
}

}  // namespace depth_plane_loops_test
}  // namespace libmap
