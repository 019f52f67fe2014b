// graspmap calibrate: intrinsics and lens distortion of a camera from images of a chessboard.
#include "libmap/camera/camera_calibration.h"
#include "libmap/camera/camera_io.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/parallel.h"
#include "libmap/core/table.h"
#include "libmap/view/charts.h"
#include "libmap/view/image_io.h"
#include "tools/support/command_line.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using libmap::CalibratedImage;
using libmap::CameraCalibrationResult;
using libmap::Chart;
using libmap::ChartCurve;

// Maximum error of a good calibration, by the thesis.
constexpr double good_error_px = 0.5;
// Lens terms are of the order of 1.
constexpr double good_term_deviation = 1.0;
// A larger relative error of the focal length causes errors above 5 mm per meter.
constexpr double good_focal_deviation = 0.005;
constexpr double good_coverage = 0.6;

struct CalibrateOptions {
  std::vector<std::string> images;
  std::string output;
  std::string board = "8x6";
  std::string name = "camera";
  std::string report;
  libmap::CameraCalibrationOptions calibration;
};

struct BoardPhoto {
  std::string name{};
  int width = 0;
  int height = 0;
  std::optional<std::vector<Eigen::Vector2d>> corners{};
  std::optional<libmap::Error> fault{};  // reason if the image cannot be read
};

void bind(libmap::ParameterTable& table, CalibrateOptions& options) {
  table.add(
      "board", options.board,
      "numbers of inner corners of the chessboard, COLUMNSxROWS; 8x6 for a board of 9 x 7 squares");
  bind(table, options.calibration);
  table.add("name", options.name, "name of the camera in the written camera file");
}

bool has_image_extension(const fs::path& path) {
  const std::string extension = libmap::lower_case(path.extension().string());
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

// Returns the files, and for a folder its images, sorted by name.
std::vector<std::string> image_files(const std::vector<std::string>& given) {
  std::vector<std::string> files;
  for (const std::string& path : given) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> inside;
    for (const fs::directory_entry& entry : fs::directory_iterator(path))
      if (entry.is_regular_file() && has_image_extension(entry.path()))
        inside.push_back(entry.path().string());
    if (inside.empty()) throw libmap::Error("contains no .png or .jpg image", {.file = path});
    std::sort(inside.begin(), inside.end());
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

// Limit of the search for a board, which needs about 30 bytes per pixel.
constexpr std::int64_t max_pixels = std::int64_t{1} << 24;

BoardPhoto read_photo(const std::string& file, const libmap::Chessboard& board) {
  try {
    const std::string bytes = libmap::read_whole_file(file);
    const auto info = libmap::read_image_info(bytes);
    if (info && std::int64_t{info->width} * info->height > max_pixels)
      throw libmap::Error("too large for the detection of the board; reduce the image",
                          {.field = "image size",
                           .value = fmt::format("{} x {}", info->width, info->height),
                           .bound = fmt::format("<= {} pixels", max_pixels)});
    const bool is_deep = info && info->bits == 16 && info->channels == 1;
    const libmap::GrayImage image = is_deep ? libmap::stretch_contrast(libmap::decode_gray16(bytes))
                                            : libmap::decode_gray(bytes);
    return {file, image.width, image.height, libmap::find_chessboard(image, board)};
  } catch (const libmap::Error& error) {
    return {.name = file, .fault = error.in_file(file)};
  }
}

// Returns the first readable image. Throws the Error of the first image if none is readable.
const BoardPhoto& first_readable(const std::vector<BoardPhoto>& photos) {
  for (const BoardPhoto& photo : photos)
    if (!photo.fault) return photo;
  throw libmap::Error(*photos.front().fault);
}

std::vector<BoardPhoto> read_photos(const std::vector<std::string>& files,
                                    const libmap::Chessboard& board, Run& run) {
  std::vector<BoardPhoto> photos(files.size());
  run.progress().begin("boards", files.size());
  libmap::parallel_each(files.size(), [&](std::size_t n) {
    photos[n] = read_photo(files[n], board);
    run.progress().advance(1);
  });
  run.progress().end();
  const BoardPhoto& first = first_readable(photos);
  const auto size = [](const BoardPhoto& photo) {
    return fmt::format("{} x {}", photo.width, photo.height);
  };
  for (const BoardPhoto& photo : photos) {
    if (photo.fault)
      run.warn(std::string(photo.fault->what()) + "; the image is skipped");
    else if (size(photo) != size(first))
      throw libmap::Error("all images must have the same size",
                          {.file = photo.name,
                           .field = "size",
                           .value = size(photo),
                           .bound = size(first) + " as " + first.name});
  }
  return photos;
}

std::vector<libmap::BoardImage> boards_of(const std::vector<BoardPhoto>& photos,
                                          const CalibrateOptions& options, Run& run) {
  std::vector<libmap::BoardImage> boards;
  for (const BoardPhoto& photo : photos)
    if (photo.corners) boards.push_back({photo.name, *photo.corners});
  if (boards.empty())
    throw libmap::Error("no image shows a whole board with these inner corners",
                        {.field = "--board",
                         .value = options.board,
                         .bound = "the numbers of inner corners, one less than of squares"});
  for (const BoardPhoto& photo : photos)
    if (!photo.corners && !photo.fault)
      run.warn("{}: does not show a board of {} inner corners", photo.name, options.board);
  return boards;
}

struct Term {
  std::string name;
  double value = 0.0;
  double deviation = 0.0;
};

// Estimated terms: four intrinsics, then the lens terms.
std::vector<Term> terms_of(const CameraCalibrationResult& result) {
  const libmap::Camera& camera = result.camera;
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  if (camera.distortion_model == libmap::DistortionModel::equidistant)
    names.insert(names.end(), {"k1", "k2", "k3", "k4"});
  else
    names.insert(names.end(), {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"});
  std::vector<double> values = {camera.fx, camera.fy, camera.cx, camera.cy};
  values.insert(values.end(), camera.distortion.begin(), camera.distortion.end());
  std::vector<Term> terms;
  for (std::size_t n = 0; n < values.size(); ++n)
    terms.push_back({names[n], values[n], result.deviations[n]});
  return terms;
}

// "365.23 +- 0.18", with two digits of the deviation.
std::string with_deviation(const Term& term) {
  const double exponent = term.deviation > 0 ? std::floor(std::log10(term.deviation)) : -5.0;
  const int decimals = std::clamp(1 - static_cast<int>(exponent), 0, 12);
  return libmap::to_fixed_text(term.value, decimals) + " +- " +
         libmap::to_fixed_text(term.deviation, decimals);
}

std::string summary(const CameraCalibrationResult& result, const CalibrateOptions& options) {
  std::string text = fmt::format(
      "{} images of a board of {} inner corners, squares of {} mm\n"
      "reprojection error {:.3f} px (root mean square)\n",
      result.images.size(), options.board, libmap::to_text(options.calibration.board.square_mm),
      result.rms_px);
  for (const Term& term : terms_of(result)) text += term.name + " " + with_deviation(term) + "\n";
  return text + "+-: one standard deviation\n";
}

libmap::Table photo_table(const std::vector<BoardPhoto>& photos,
                          const CameraCalibrationResult& result) {
  libmap::Table table;
  table.columns = {"image", "used", "rms_px", "max_px", "distance_m", "tilt_deg"};
  for (const BoardPhoto& photo : photos) {
    const auto found = std::find_if(
        result.images.begin(), result.images.end(),
        [&](const CalibratedImage& calibrated) { return calibrated.name == photo.name; });
    const bool is_repeated = std::find(result.repeated.begin(), result.repeated.end(),
                                       photo.name) != result.repeated.end();
    if (found == result.images.end()) {
      table.rows.push_back({photo.name,
                            photo.fault      ? "unreadable"
                            : !photo.corners ? "no board"
                            : is_repeated    ? "repeated"
                                             : "rejected",
                            "", "", "", ""});
      continue;
    }
    table.rows.push_back({photo.name, "yes", libmap::to_text(found->rms_px),
                          libmap::to_text(found->max_px),
                          libmap::to_text(found->camera_from_board.translation().norm()),
                          libmap::to_text(found->tilt_deg)});
  }
  return table;
}

libmap::Table residual_table(const CameraCalibrationResult& result,
                             const libmap::Chessboard& board) {
  libmap::Table table;
  table.columns = {"image", "row", "column", "x_px", "y_px", "residual_x_px", "residual_y_px"};
  const auto columns = static_cast<std::size_t>(board.columns);
  for (const CalibratedImage& photo : result.images)
    for (std::size_t n = 0; n < photo.corners.size(); ++n)
      table.rows.push_back(
          {photo.name, std::to_string(n / columns), std::to_string(n % columns),
           libmap::to_text(photo.corners[n].x()), libmap::to_text(photo.corners[n].y()),
           libmap::to_text(photo.residuals_px[n].x()), libmap::to_text(photo.residuals_px[n].y())});
  return table;
}

void note_results(const std::vector<BoardPhoto>& photos, const CameraCalibrationResult& result,
                  Run& run) {
  const auto count = [&](const auto& is) {
    return std::count_if(photos.begin(), photos.end(), is);
  };
  run.add_results(
      {{"images", photos.size()},
       {"images_unreadable", count([](const BoardPhoto& p) { return p.fault.has_value(); })},
       {"images_without_board", count([](const BoardPhoto& p) { return !p.corners && !p.fault; })},
       {"images_repeated", result.repeated.size()},
       {"images_rejected", result.rejected.size()},
       {"images_used", result.images.size()},
       {"rms_px", result.rms_px},
       {"sigma_px", result.sigma_px}});
  for (const Term& term : terms_of(result))
    run.add_results({{term.name, term.value}, {term.name + "_deviation", term.deviation}});
  run.add_results({{"corners_width_share", result.width_coverage},
                   {"corners_height_share", result.height_coverage}});
}

void warn_of_weaknesses(const CameraCalibrationResult& result, Run& run) {
  for (const std::string& name : result.repeated)
    run.warn(name + ": skipped because an earlier image shows the board in the same pose");
  for (const std::string& name : result.rejected)
    run.warn(name + ": skipped because its reprojection error is too large");
  for (const CalibratedImage& photo : result.images)
    if (photo.rms_px > good_error_px)
      run.warn("{}: reprojection error {:.2f} px, above {} px", photo.name, photo.rms_px,
               good_error_px);
  if (result.relative_focal_deviation() > good_focal_deviation)
    run.warn(
        "the focal length is uncertain by {:.1f} %: add images tilted by 30 degrees and more about "
        "both axes of the board",
        100 * result.relative_focal_deviation());
  const std::vector<Term> terms = terms_of(result);
  const auto vague = std::find_if(terms.begin() + 4, terms.end(), [](const Term& term) {
    return term.deviation > good_term_deviation;
  });
  if (vague != terms.end())
    run.warn("the images do not determine the lens term {}, {}: use a simpler --lens", vague->name,
             with_deviation(*vague));
  if (std::min(result.width_coverage, result.height_coverage) < good_coverage)
    run.warn(
        "the corners cover {:.0f} % of the image's width and {:.0f} % of its height; outside, the "
        "distortion is extrapolated",
        100 * result.width_coverage, 100 * result.height_coverage);
}

constexpr libmap::Color corner_color = {150, 150, 150};
constexpr libmap::Color residual_color = {213, 94, 0};
constexpr libmap::Color bound_color = {90, 90, 90};
constexpr int chart_width_px = 1000;

std::string chart_png(const Chart& chart, int height_px) {
  return libmap::to_png(libmap::draw_chart(chart, {chart_width_px, height_px}));
}

// The largest of 1, 2, 5, 10, ... with which the mean residual is at most 1/40 of the image width.
double magnification(const CameraCalibrationResult& result) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const CalibratedImage& photo : result.images)
    for (const Eigen::Vector2d& residual : photo.residuals_px) {
      sum += residual.norm();
      ++count;
    }
  if (!(sum > 0)) return 1.0;
  const double wanted = result.camera.width / 40.0 / (sum / static_cast<double>(count));
  const double power = std::pow(10.0, std::floor(std::log10(std::clamp(wanted, 1.0, 1e6))));
  double scale = power;
  for (const double multiple : {2.0, 5.0})
    if (multiple * power <= wanted) scale = multiple * power;
  return scale;
}

// Chart of the corners' image positions with magnified residuals.
std::string draw_residuals(const CameraCalibrationResult& result) {
  const int width = result.camera.width;
  const int height = result.camera.height;
  const double scale = magnification(result);
  Chart chart;
  chart.title = "Found minus projected corners, " + libmap::to_text(scale) + " times";
  chart.x_axis = {"column [px]", std::pair(0.0, static_cast<double>(width))};
  chart.y_axis = {"height above the image's lower edge [px]",
                  std::pair(0.0, static_cast<double>(height))};
  // The y axis points up in charts and down in images.
  const auto add = [&](ChartCurve& curve, const Eigen::Vector2d& pixel) {
    curve.x.push_back(pixel.x());
    curve.y.push_back(height - 1 - pixel.y());
  };
  for (const CalibratedImage& photo : result.images)
    for (std::size_t n = 0; n < photo.corners.size(); ++n) {
      ChartCurve dot;
      dot.color = corner_color;
      dot.markers = true;
      dot.width_px = 1.2;
      add(dot, photo.corners[n]);
      chart.curves.push_back(std::move(dot));
      ChartCurve arrow;
      arrow.color = residual_color;
      arrow.width_px = 1.5;
      add(arrow, photo.corners[n]);
      add(arrow, photo.corners[n] + scale * photo.residuals_px[n]);
      chart.curves.push_back(std::move(arrow));
    }
  const double inner_width = chart_width_px - 150.0;
  const int height_px = static_cast<int>(std::lround(inner_width * height / width)) + 164;
  return chart_png(chart, std::clamp(height_px, 400, 3000));
}

// Chart of the error of each image as a bar, with a line at `bound_px`.
std::string draw_errors(const CameraCalibrationResult& result, double bound_px) {
  Chart chart;
  chart.title = "Reprojection error of each image";
  const auto count = static_cast<double>(result.images.size());
  chart.x_axis = {"image", std::pair(0.5, count + 0.5)};
  libmap::ChartHistogram bars;
  bars.name = "root mean square";
  bars.first_edge = 0.5;
  double largest = bound_px;
  for (const CalibratedImage& photo : result.images) {
    bars.heights.push_back(photo.rms_px);
    largest = std::max(largest, photo.rms_px);
  }
  chart.y_axis = {"error [px]", std::pair(0.0, 1.2 * largest)};
  chart.histograms.push_back(std::move(bars));
  ChartCurve bound;
  bound.name = libmap::to_text(bound_px) + " px";
  bound.x = {0.5, count + 0.5};
  bound.y = {bound_px, bound_px};
  bound.color = bound_color;
  bound.dashed = true;
  chart.curves.push_back(std::move(bound));
  return chart_png(chart, 600);
}

void write_report(const std::vector<BoardPhoto>& photos, const CameraCalibrationResult& result,
                  const CalibrateOptions& options, Run& run) {
  const auto csv = [](const libmap::Table& table) {
    return Run::text_writer(libmap::to_csv(table));
  };
  run.write_output_folder(
      options.report, {{"images.csv", csv(photo_table(photos, result))},
                       {"residuals.csv", csv(residual_table(result, options.calibration.board))},
                       {"residuals.png", Run::text_writer(draw_residuals(result))},
                       {"errors.png", Run::text_writer(draw_errors(result, good_error_px))}});
}

void calibrate(CalibrateOptions& options, Run& run) {
  const double square_mm = options.calibration.board.square_mm;
  options.calibration.board = libmap::parse_chessboard(options.board, "--board");
  options.calibration.board.square_mm = square_mm;
  const std::vector<std::string> files = image_files(options.images);
  for (const std::string& file : files) libmap::require_readable_file(file);
  run.claim_output(options.output, files);
  if (!options.output.ends_with(".yaml") && !options.output.ends_with(".yml"))
    throw libmap::Error("calibrations are written as YAML (.yaml)", {.file = options.output});
  if (!options.report.empty()) run.claim_output_folder(options.report);
  const std::vector<BoardPhoto> photos =
      run.timed("find boards", [&] { return read_photos(files, options.calibration.board, run); });
  for (const std::string& file : files) run.add_input(file);
  const std::vector<libmap::BoardImage> boards = boards_of(photos, options, run);
  const CameraCalibrationResult result = run.timed("calibrate", [&] {
    const BoardPhoto& first = first_readable(photos);
    return libmap::calibrate_camera(boards, first.width, first.height, options.calibration);
  });
  note_results(photos, result, run);
  warn_of_weaknesses(result, run);
  const std::string said = summary(result, options);
  run.info(said.substr(0, said.size() - 1));
  if (!options.report.empty())
    run.timed("report", [&] { write_report(photos, result, options, run); });
  run.write_text(options.output, libmap::to_yaml({options.name, result.camera}, said));
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> words(argv, argv + argc);
  std::vector<char*> arguments;
  for (std::string& word : words) {
    // Boards are specified in millimeters, so the flag may have its unit.
    if (word == "--square-mm" || word.starts_with("--square-mm=")) word.erase(8, 3);
    arguments.push_back(word.data());
  }
  CalibrateOptions options;
  Command command("calibrate");
  command.inputs("IMAGES", options.images, "images of a chessboard (.png, .jpg), or their folders");
  command.output(options.output, "calibration file of the camera (.yaml)");
  command.option("--report", "DIR", options.report,
                 "output folder for reprojection errors of images and corners (tables, charts)");
  bind(command.parameters(), options);
  return command.run(argc, arguments.data(), [&](Run& run) { calibrate(options, run); });
}
