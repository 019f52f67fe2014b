#include "libgtd/gripper/gripper.h"

#include <gtest/gtest.h>
