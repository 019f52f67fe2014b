#include "libmap/view/image_io.h"

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libmap {
namespace {

// Limit of libpng. VTK does not check it, so libpng would abort the program.
constexpr int largest_side = 1'000'000;

void check(const ColorImage& image) {
  if (image.width <= 0 || image.height <= 0) throw Error("the image has none", {.field = "pixels"});
  if (std::max(image.width, image.height) > largest_side)
    throw Error("too large for PNG",
                {.field = "size",
                 .value = size_text(image.width, image.height),
                 .bound = "<= " + std::to_string(largest_side) + " pixels per side"});
  const std::size_t pixels =
      static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (image.pixels.size() != pixels)
    throw Error("the number of pixels does not match the image size",
                {.field = "pixels",
                 .value = std::to_string(image.pixels.size()),
                 .bound = std::to_string(pixels)});
}

}  // namespace

std::string to_png(const ColorImage& image) {
  check(image);
  vtkNew<vtkImageData> pixels;
  pixels->SetDimensions(image.width, image.height, 1);
  pixels->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  // Rows of VTK begin at the bottom.
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.width);
  auto* target = static_cast<unsigned char*>(pixels->GetScalarPointer());
  for (int row = 0; row < image.height; ++row) {
    const auto from = static_cast<std::size_t>(image.height - 1 - row);
    std::memcpy(target + static_cast<std::size_t>(row) * row_bytes,
                image.pixels.data() + from * static_cast<std::size_t>(image.width), row_bytes);
  }
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputData(pixels);
  writer->WriteToMemoryOn();
  writer->Write();
  vtkUnsignedCharArray* bytes = writer->GetResult();
  if (bytes == nullptr || bytes->GetNumberOfValues() == 0)
    throw Error("the image could not be encoded as PNG", {}, ErrorKind::failed);
  return {reinterpret_cast<const char*>(bytes->GetPointer(0)),
          static_cast<std::size_t>(bytes->GetNumberOfValues())};
}

}  // namespace libmap
