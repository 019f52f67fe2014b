// Drawing by VTK without a screen.
#pragma once

#include <functional>

#include "libmap/core/image.h"

class vtkRenderWindow;

namespace libmap {

// The pixels of a window of that size, after `fill` has put its renderers in. Starts a
// VirtualDisplay of its own if no display answers. Calls from several threads are run one after
// the other. Throws Error (failed) if VTK cannot draw it, with VTK's reason, and what `fill`
// throws.
ColorImage draw_offscreen(int width, int height, const std::function<void(vtkRenderWindow&)>& fill);

// The pixels that were rendered last. Throws Error (failed) if OpenGL does not give them.
ColorImage pixels_of(vtkRenderWindow& window, int width, int height);

}  // namespace libmap
