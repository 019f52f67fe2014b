#include <gtest/gtest.h>

#include <random>

#include "tests/support/test_support.h"

namespace {

class Reseed : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo&) override {
    graspmap_test::random_engine().seed(20230401);
  }
};

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  testing::UnitTest::GetInstance()->listeners().Append(new Reseed);
  const int status = RUN_ALL_TESTS();
  // For ctest, a program whose cases were all skipped is skipped.
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  const int run = all.test_to_run_count();
  return status == 0 && run > 0 && all.skipped_test_count() == run ? 77 : status;
}
