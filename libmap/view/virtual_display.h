// An X display where there is none: VTK knows only X windows and ends the program without one.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

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

}  // namespace libmap
