// Drawing by VTK without a screen.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/image.h"

class vtkRenderWindow;

namespace libmap {

// While it lives, DISPLAY names an X server that can draw with OpenGL. If the one that is set
// answers, nothing happens; else an Xvfb of its own is started (Debian package xvfb) and ended in
// the destructor, and Mesa's software renderer (libgl1-mesa-dri) is asked for, so that pictures do
// not depend on the machine. Every X connection must be closed before the destructor runs. The
// Xvfb ends by itself if the process, or the thread that started it, is killed.
class VirtualDisplay {
 public:
  // Throws Error (failed) if Xvfb is not in PATH, naming the package, or does not come up.
  VirtualDisplay();
  ~VirtualDisplay();
  VirtualDisplay(const VirtualDisplay&) = delete;
  VirtualDisplay& operator=(const VirtualDisplay&) = delete;

  // Whether an Xvfb was started, and its process id (0 if not).
  bool started() const { return server_ > 0; }
  int process_id() const { return server_; }

 private:
  void start();
  void stop();
  void set_variable(const std::string& name, const std::string& value);

  int server_ = 0;
  std::vector<std::pair<std::string, std::optional<std::string>>> former_variables_;
};

// The pixels of a window of that size, after `fill` has put its renderers in. Starts a
// VirtualDisplay of its own if no display answers. Calls from several threads are run one after
// the other. Throws Error (failed) if VTK cannot draw it, with VTK's reason, and what `fill`
// throws.
ColorImage draw_offscreen(int width, int height, const std::function<void(vtkRenderWindow&)>& fill);

}  // namespace libmap
