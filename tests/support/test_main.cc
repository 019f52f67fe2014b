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
  return RUN_ALL_TESTS();
}
