#include "libmap/poses/trajectory_error.h"
