// Few of many views of a scene that still show all of it.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"

namespace libmap {

struct ViewSelectionOptions {
  double radius_m = 0.5;    // >= 0; 0: all views are kept
  double angle_deg = 30.0;  // 0..180, between the optical axes
};
void bind(ParameterTable& table, ViewSelectionOptions& options);

// Which views are kept, ascending: the best first, each that no kept one resembles, and two
// resemble each other if they lie nearer than the radius and look within the angle. So no two that
// are kept resemble each other, and each that is not kept resembles a better one that is.
// `qualities`, one a view, say which is better; of equal ones the first. Poses are of optical
// frames.
std::vector<std::size_t> select_views(const std::vector<Pose>& world_from_camera,
                                      const std::vector<double>& qualities,
                                      const ViewSelectionOptions& options = {});

}  // namespace libmap
