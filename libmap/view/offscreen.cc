#include "libmap/view/offscreen.h"

#include <X11/Xlib.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkRenderWindow.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <string_view>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto start_patience = std::chrono::seconds(30);
constexpr auto stop_patience = std::chrono::seconds(5);

// Returns true if the X server in DISPLAY answers and supports GLX.
bool display_answers() {
  const char* name = std::getenv("DISPLAY");
  if (name == nullptr || *name == '\0') return false;
  ::Display* display = XOpenDisplay(name);
  if (display == nullptr) return false;
  int opcode = 0;
  int event = 0;
  int error = 0;
  const bool has_glx = XQueryExtension(display, "GLX", &opcode, &event, &error) != 0;
  XCloseDisplay(display);
  return has_glx;
}

std::string find_in_path(std::string_view program) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "/usr/bin:/bin";
  while (!rest.empty()) {
    const std::size_t colon = rest.find(':');
    const std::string folder(rest.substr(0, colon));
    rest = colon == std::string_view::npos ? std::string_view{} : rest.substr(colon + 1);
    std::string candidate = (folder.empty() ? "." : folder) + "/" + std::string(program);
    if (access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  return {};
}

// Runs in the child process: only calls that are safe between fork and exec.
[[noreturn]] void become_server(const char* program, char* const* arguments, int number_pipe,
                                pid_t parent) {
  constexpr int number_fd = 3;
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  setsid();  // Ctrl-C must not reach the server, which the program stops itself
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  const int null = open("/dev/null", O_RDWR);
  // The pipe may have any descriptor: moves it above 0 to 3 first.
  const int pipe_copy = fcntl(number_pipe, F_DUPFD, number_fd + 1);
  for (int fd = 0; fd < number_fd; ++fd) dup2(null, fd);
  dup2(pipe_copy, number_fd);
  close_range(number_fd + 1, ~0U, 0);
  execv(program, arguments);
  _exit(127);
}

// Reads the display number that the server writes when it is ready; empty after a timeout or error.
std::string read_display_number(int number_pipe) {
  std::string text;
  const Clock::time_point end = Clock::now() + start_patience;
  while (text.find('\n') == std::string::npos) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left <= 0) return {};
    pollfd waiting{.fd = number_pipe, .events = POLLIN, .revents = 0};
    const int ready = poll(&waiting, 1, static_cast<int>(left));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return {};
    std::array<char, 64> buffer{};
    const ssize_t count = read(number_pipe, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return {};
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  return text.substr(0, text.find('\n'));
}

// Larger images are not multisampled, because the buffers would take gigabytes.
constexpr double max_multisampled_pixels = 1.7e7;
constexpr int multisamples = 4;

// Suppresses VTK's console messages and keeps the first error.
class QuietOutput : public vtkOutputWindow {
 public:
  static QuietOutput* New();
  vtkTypeMacro(QuietOutput, vtkOutputWindow);
  void DisplayText(const char*) override {}
  void DisplayErrorText(const char* text) override {
    if (first_error_.empty() && text != nullptr) first_error_ = text;
  }
  void DisplayWarningText(const char*) override {}
  void DisplayGenericWarningText(const char*) override {}
  void DisplayDebugText(const char*) override {}
  const std::string& first_error() const { return first_error_; }

 private:
  std::string first_error_;
};
vtkStandardNewMacro(QuietOutput);

class QuietScope {
 public:
  QuietScope()
      : former_(vtkOutputWindow::GetInstance()),
        verbosity_before_(vtkLogger::GetCurrentVerbosityCutoff()) {
    vtkOutputWindow::SetInstance(quiet_);
    // VTK's logger writes errors to the console in addition to the output window.
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
  }
  ~QuietScope() {
    vtkLogger::SetStderrVerbosity(verbosity_before_);
    vtkOutputWindow::SetInstance(former_);
  }
  QuietScope(const QuietScope&) = delete;
  QuietScope& operator=(const QuietScope&) = delete;
  const std::string& first_error() const { return quiet_->first_error(); }

 private:
  vtkSmartPointer<vtkOutputWindow> former_;
  vtkLogger::Verbosity verbosity_before_;
  vtkNew<QuietOutput> quiet_;
};

ColorImage pixels_of(vtkRenderWindow& window, int width, int height) {
  ColorImage image(width, height);
  vtkNew<vtkUnsignedCharArray> pixels;
  window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels);
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(width);
  const std::size_t bytes = row_bytes * static_cast<std::size_t>(height);
  if (static_cast<std::size_t>(pixels->GetNumberOfValues()) != bytes)
    throw Error("the image could not be read back", {.field = "OpenGL"}, ErrorKind::failed);
  // Rows of OpenGL begin at the bottom.
  for (std::size_t row = 0; row < static_cast<std::size_t>(height); ++row)
    std::memcpy(image.pixels.data() + row * static_cast<std::size_t>(width),
                pixels->GetPointer(0) + (static_cast<std::size_t>(height) - 1 - row) * row_bytes,
                row_bytes);
  return image;
}

}  // namespace

VirtualDisplay::VirtualDisplay() {
  if (display_answers()) return;
  try {
    start();
  } catch (...) {
    stop();
    throw;
  }
}

VirtualDisplay::~VirtualDisplay() { stop(); }

void VirtualDisplay::start() {
  const std::string program = find_in_path("Xvfb");
  if (program.empty())
    throw Error("missing, and there is no X display; install the Debian package xvfb",
                {.field = "program Xvfb"}, ErrorKind::failed);
  // The child process inherits the environment.
  set_variable("LIBGL_ALWAYS_SOFTWARE", "1");
  set_variable("GALLIUM_DRIVER", "llvmpipe");

  std::array<std::string, 13> words{"Xvfb",         "-displayfd", "3",       "-screen",    "0",
                                    "1280x1024x24", "-dpi",       "96",      "+extension", "GLX",
                                    "-nolisten",    "tcp",        "-noreset"};
  std::array<char*, words.size() + 1> arguments{};
  for (std::size_t i = 0; i < words.size(); ++i) arguments[i] = words[i].data();

  std::array<int, 2> number_pipe{};
  if (pipe2(number_pipe.data(), O_CLOEXEC) != 0)
    throw Error(std::strerror(errno), {.field = "pipe to Xvfb"}, ErrorKind::failed);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) become_server(program.c_str(), arguments.data(), number_pipe[1], parent);
  close(number_pipe[1]);
  if (child < 0) {
    close(number_pipe[0]);
    throw Error(std::strerror(errno), {.field = "start of Xvfb"}, ErrorKind::failed);
  }
  server_ = child;
  const std::string number = read_display_number(number_pipe[0]);
  close(number_pipe[0]);
  if (number.empty())
    throw Error("failed (Debian package xvfb): " + program, {.field = "start of Xvfb"},
                ErrorKind::failed);
  set_variable("DISPLAY", ":" + number);
  if (!display_answers())
    throw Error("Xvfb has none; install the Debian package libgl1-mesa-dri", {.field = "OpenGL"},
                ErrorKind::failed);
}

void VirtualDisplay::stop() {
  if (server_ > 0) {
    kill(server_, SIGTERM);
    const Clock::time_point end = Clock::now() + stop_patience;
    int status = 0;
    while (waitpid(server_, &status, WNOHANG) == 0) {
      if (Clock::now() > end) {
        kill(server_, SIGKILL);
        waitpid(server_, &status, 0);
        break;
      }
      usleep(5000);
    }
    server_ = 0;
  }
  for (auto former = former_variables_.rbegin(); former != former_variables_.rend(); ++former) {
    if (former->second)
      setenv(former->first.c_str(), former->second->c_str(), 1);
    else
      unsetenv(former->first.c_str());
  }
  former_variables_.clear();
}

void VirtualDisplay::set_variable(const std::string& name, const std::string& value) {
  const char* former = std::getenv(name.c_str());
  former_variables_.emplace_back(
      name, former != nullptr ? std::optional<std::string>(former) : std::nullopt);
  setenv(name.c_str(), value.c_str(), 1);
}

ColorImage draw_offscreen(int width, int height,
                          const std::function<void(vtkRenderWindow&)>& fill) {
  // VTK's rendering and the environment are not thread-safe.
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  const VirtualDisplay display;
  const QuietScope quiet;
  const auto draw = [&] {
    vtkNew<vtkRenderWindow> window;
    window->OffScreenRenderingOn();
    window->ShowWindowOff();
    window->SetSize(width, height);
    window->SetDPI(72);
    const bool small = double{1} * width * height <= max_multisampled_pixels;
    window->SetMultiSamples(small ? multisamples : 0);
    fill(*window);
    window->Render();
    return pixels_of(*window, width, height);
  };
  // The window must be closed before the display is stopped.
  ColorImage image = draw();
  if (!quiet.first_error().empty()) {
    std::string reason = quiet.first_error();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    throw Error("VTK failed to render the image: " + std::string(trim(reason)), {},
                ErrorKind::failed);
  }
  return image;
}

}  // namespace libmap
