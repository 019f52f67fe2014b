#include "libmap/scan/picture_file.h"

#include <algorithm>

#include "libmap/core/error.h"
#include "libmap/image/image_codec.h"
#include "libmap/scan/rtabmap_reader.h"

namespace libmap {

std::string picture_name(int node, std::size_t camera, const std::string& extension) {
  constexpr std::size_t digits = 6;
  const std::string number = std::to_string(node);
  return std::string(digits - std::min(digits, number.size()), '0') + number +
         (camera == 0 ? std::string() : "_" + std::to_string(camera)) + extension;
}

PictureFile picture_file(const ScanSource& scan, int node, const std::vector<CameraView>& views,
                         std::size_t camera) {
  PictureFile file;
  const auto* database = dynamic_cast<const RtabmapDatabase*>(&scan);
  file.bytes = database != nullptr && views.size() == 1 ? database->read_blobs(node).image
                                                        : encode_png(views[camera].color);
  const ImageFormat format = image_format(file.bytes).value_or(ImageFormat::png);
  file.name = picture_name(node, camera, file_extension(format));
  return file;
}

std::vector<CameraView> read_pictures(const ScanSource& scan, int node, FrameParts parts) {
  const RgbdFrame frame = scan.read_frame(node, parts);
  const std::string name = "node " + std::to_string(node);
  if (frame.color.empty())
    throw Error("it has no color image", {.file = scan.path().string(), .field = name});
  if (frame.cameras.empty())
    throw Error("it has no calibration", {.file = scan.path().string(), .field = name});
  return camera_views(frame);
}

}  // namespace libmap
