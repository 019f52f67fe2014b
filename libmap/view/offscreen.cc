#include "libmap/view/offscreen.h"

#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkRenderWindow.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cstring>
#include <mutex>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/view/virtual_display.h"

namespace libmap {
namespace {

// Above it the multisampled buffers would take gigabytes.
constexpr double max_multisampled_pixels = 1.7e7;
constexpr int multisamples = 4;

// Takes VTK's messages off the console while it lives; the first error is kept.
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
    // VTK's log writes errors to the console beside the window.
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

}  // namespace

ColorImage pixels_of(vtkRenderWindow& window, int width, int height) {
  ColorImage image(width, height);
  vtkNew<vtkUnsignedCharArray> pixels;
  window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels);
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(width);
  const std::size_t bytes = row_bytes * static_cast<std::size_t>(height);
  if (static_cast<std::size_t>(pixels->GetNumberOfValues()) != bytes)
    throw Error("the picture could not be read back from OpenGL", {}, ErrorKind::failed);
  // OpenGL's rows begin at the bottom.
  for (std::size_t row = 0; row < static_cast<std::size_t>(height); ++row)
    std::memcpy(image.pixels.data() + row * static_cast<std::size_t>(width),
                pixels->GetPointer(0) + (static_cast<std::size_t>(height) - 1 - row) * row_bytes,
                row_bytes);
  return image;
}

ColorImage draw_offscreen(int width, int height,
                          const std::function<void(vtkRenderWindow&)>& fill) {
  // VTK's rendering and the environment are for one thread at a time.
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
  // The window is closed before the display ends.
  ColorImage image = draw();
  if (!quiet.first_error().empty()) {
    std::string reason = quiet.first_error();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    throw Error("VTK could not draw the picture: " + std::string(trim(reason)), {},
                ErrorKind::failed);
  }
  return image;
}

}  // namespace libmap
