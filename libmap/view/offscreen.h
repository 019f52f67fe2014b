// Offscreen rendering with VTK.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/image.h"

class vtkRenderWindow;

namespace libmap {

// Ensures an X server with OpenGL during the lifetime of this object. If the server in DISPLAY does
// not answer, starts an Xvfb (Debian package xvfb) with Mesa's software renderer (libgl1-mesa-dri),
// so that images do not depend on the machine, and sets DISPLAY. The destructor stops that Xvfb and
// restores the environment; all X connections must be closed before. Xvfb also stops if the process
// or the thread that started it is killed.
class VirtualDisplay {
 public:
  // Throws Error (failed) naming the package if Xvfb is not in PATH or does not start.
  VirtualDisplay();
  ~VirtualDisplay();
  VirtualDisplay(const VirtualDisplay&) = delete;
  VirtualDisplay& operator=(const VirtualDisplay&) = delete;

  bool started() const { return server_ > 0; }  // true if an Xvfb was started
  int process_id() const { return server_; }    // process id of this Xvfb; 0: none

 private:
  void start();
  void stop();
  void set_variable(const std::string& name, const std::string& value);

  int server_ = 0;
  std::vector<std::pair<std::string, std::optional<std::string>>> former_variables_;
};

// Renders a window of the given size in pixels, to which `fill` adds the renderers. Creates a
// VirtualDisplay for the call. Calls from several threads are serialized. Throws Error (failed)
// with VTK's message if rendering fails, as VirtualDisplay does, and what `fill` throws.
ColorImage draw_offscreen(int width, int height, const std::function<void(vtkRenderWindow&)>& fill);

}  // namespace libmap
