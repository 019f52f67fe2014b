// The faces of libmap::Progress on stderr.
#pragma once

#include <memory>
#include <string>

#include "libmap/core/progress.h"

namespace graspmap_tools {

// "auto": a bar if stderr is a terminal, else nothing; "json": one JSON line a step; "none". A
// stage of more than a few seconds says the time left, by what is done. Throws libmap::Error for
// another name.
std::unique_ptr<libmap::Progress> make_progress(const std::string& style);

}  // namespace graspmap_tools
