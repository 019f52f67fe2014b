// VTP files as ParaView and VTK's own programs write them, which graspmap does not.
#pragma once

#include <string>
#include <vector>

namespace graspmap_fuzz {

// A triangle with a score at each corner, in every place that VTK has for its numbers (texts,
// base64 beside the XML, appended as base64 or bytes), without compression and with each of its
// kinds, with lengths of 32 and 64 bits, in both byte orders.
std::vector<std::string> vtp_samples();

}  // namespace graspmap_fuzz
