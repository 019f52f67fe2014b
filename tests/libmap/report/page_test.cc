#include "libmap/report/report_page.h"

#include <gtest/gtest.h>

#include "libmap/camera/image_codec.h"
#include "libmap/report/html.h"
#include "libmap/report/image_fit.h"
#include "libmap/report/report_reader.h"
#include "tests/support/test_support.h"

namespace page_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using libmap::ColorImage;
using libmap::PageAssets;
using libmap::ReportContent;
using libmap::ReportImage;
using libmap::ReportImages;

// Noise cannot be compressed.
ColorImage noise(int width, int height) {
  ColorImage image(width, height);
  for (libmap::Color& pixel : image.pixels)
    for (std::uint8_t& value : pixel) value = static_cast<std::uint8_t>(random_engine()() & 255U);
  return image;
}

ReportImage image_of(const ColorImage& image) {
  ReportImage report_image = libmap::read_image_bytes(libmap::encode_png(image));
  report_image.file = "a.png";
  return report_image;
}

const PageAssets assets{.style = "p { color: red }",
                        .scripts = {"start();"},
                        .libraries = {},
                        .library_notice = "",
                        .version = "1.2.3"};

TEST(ReportPage, NothingFromTheRunCanRun) {
  const std::string attack = "\"'><script>alert(1)</script><img src=x onerror=alert(2)>";
  ReportContent content;
  content.heading = attack;
  libmap::ReportSection section;
  section.heading = section.folder = attack;
  libmap::ReportItem item;
  item.caption = item.source = attack;
  item.gaps.push_back({attack, attack});
  libmap::ReportTable table;
  table.table.columns = table.headings = {attack, attack};
  table.table.rows = {{attack, attack}};
  libmap::ReportParameters parameters;
  libmap::Manifest manifest;
  manifest.command = manifest.version = manifest.frame = attack;
  manifest.parameters = {{attack, attack}};
  manifest.inputs = {{attack, attack, 1}};
  manifest.timings_s = {{attack, 1.0}};
  parameters.outputs = {{attack, manifest}};
  for (const libmap::ReportBody& body :
       {libmap::ReportBody(table), libmap::ReportBody(parameters),
        libmap::ReportBody(libmap::timing_table({{attack, {manifest}}})),
        libmap::ReportBody(libmap::ReportScene{{}, {{libmap::Color{1, 2, 3}, attack}}}),
        libmap::ReportBody(libmap::ReportListing{attack, 3})}) {
    item.body = body;
    section.items.push_back(item);
  }
  parameters.outputs.emplace_back(attack + "2", libmap::Manifest{});
  item.body = parameters;
  section.items.push_back(item);
  content.sections.push_back(section);
  content.sources.push_back({attack, manifest, ""});
  content.sources.push_back({attack, {}, attack});
  const std::string html = libmap::report_page(content, assets);
  EXPECT_EQ(html.find("<script>alert"), std::string::npos);
  EXPECT_EQ(html.find("<img"), std::string::npos);
  // Only our own script, by its hash, and the palette, which is data.
  EXPECT_NE(html.find("script-src " + libmap::csp_hash("start();") + ";"), std::string::npos);
  EXPECT_EQ(html.find("unsafe"), std::string::npos);
  EXPECT_EQ(html, libmap::report_page(content, assets));
}

TEST(ReportPage, LibrariesComeOnlyWithViews) {
  PageAssets with_library = assets;
  with_library.libraries = {"library();"};
  with_library.library_notice = "whose it is";
  ReportContent content;
  content.heading = "a";
  EXPECT_EQ(libmap::report_page(content, with_library).find("library();"), std::string::npos);
  libmap::ReportMap map;
  map.view.cell_size_m = 0.01;
  map.view.cells.resize(1);
  content.items.push_back({.body = map});
  const std::string html = libmap::report_page(content, with_library);
  EXPECT_NE(html.find("<script>library();</script>"), std::string::npos);
  EXPECT_NE(html.find("whose it is"), std::string::npos);
  EXPECT_EQ(libmap::report_page(content, assets).find("<canvas"), std::string::npos);
}

// Corners, places in steps from the lowest corner, colors.
TEST(ReportPage, AScenesMesh) {
  PageAssets with_library = assets;
  with_library.libraries = {"library();"};
  libmap::ReportScene scene;
  scene.mesh.vertices = {{1.0, 5.0, 0.0}, {3.0, 5.0, 0.0}, {1.0, 6.0, 0.0}};
  scene.mesh.triangles = {{0, 1, 2}};
  scene.mesh.vertex_colors = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  scene.legend = {{{255, 16, 0}, "a & b"}};
  ReportContent content;
  content.heading = "a";
  content.items.push_back({.body = scene});
  const std::string html = libmap::report_page(content, with_library);
  const std::string bytes{0, 0, 1, 0,      2, 0,                              //
                          0, 0, 0, 0,      0, 0, '\xff', '\xff', 0, 0, 0, 0,  //
                          0, 0, 0, '\x80', 0, 0, 1,      2,      3, 4, 5, 6, 7, 8, 9};
  EXPECT_NE(html.find("\"mesh\":\"" + libmap::to_base64(bytes) + "\",\"vertices\":3"),
            std::string::npos);
  EXPECT_NE(html.find("fill=\"#ff1000\"/></svg>a &amp; b</li>"), std::string::npos);
  EXPECT_NE(html.find("<script>library();</script>"), std::string::npos);
  EXPECT_EQ(libmap::report_page(content, assets).find("<canvas"), std::string::npos);
}

TEST(ReportPage, ImagesAreMadeSmallerUntilThePageFits) {
  ReportContent content;
  content.heading = "a";
  content.items.push_back({.body = ReportImages{image_of(noise(1600, 700))}});
  const libmap::FittedPage whole = libmap::fit_report_page(content, assets, 10'000'000);
  EXPECT_EQ(whole.image_level, 0);
  EXPECT_NE(whole.html.find("data:image/png;base64,"), std::string::npos);
  EXPECT_EQ(whole.html.find("Made smaller"), std::string::npos);
  const libmap::FittedPage fitted = libmap::fit_report_page(content, assets, 900'000);
  EXPECT_GE(fitted.image_level, 2);
  EXPECT_LE(fitted.html.size(), 900'000U);
  EXPECT_EQ(fitted.changed_images, 1U);
  EXPECT_NE(fitted.html.find("Made smaller for this page. a.png: JPEG, quality 90, 1400 instead of "
                             "1600 pixels wide."),
            std::string::npos);
  EXPECT_TRUE(is_error(error_of([&] { libmap::fit_report_page(content, assets, 10'000); }),
                       {.field = "size", .value = "0.0 MB", .bound = "<= 0.0 MB"}));
}

TEST(ReportPage, TablesAreCutIfSmallImagesAreNotEnough) {
  libmap::ReportTable table;
  table.table.columns = table.headings = std::vector<std::string>(20, "score");
  for (int n = 0; n < 1000; ++n) {
    table.table.rows.emplace_back(20, "0.5");
    table.table.rows.back().front() = "P" + std::to_string(n);
  }
  ReportContent content;
  content.heading = "a";
  libmap::ReportSection section;
  section.items.push_back({.body = table});
  section.items.push_back({.body = ReportImages{image_of(noise(400, 300))}});
  content.sections.push_back(section);
  const std::size_t whole = libmap::report_page(content, assets).size();
  const libmap::FittedPage page = libmap::fit_report_page(content, assets, whole);
  EXPECT_NE(page.html.find(">P999<"), std::string::npos);
  // The image alone has no room beside the whole table, and is whole beside the short one.
  content.sections[0].items.pop_back();
  const std::size_t alone = libmap::report_page(content, assets).size();
  content.sections[0] = section;
  ASSERT_GT(whole, alone + 300'000);
  const libmap::FittedPage cut = libmap::fit_report_page(content, assets, alone);
  EXPECT_EQ(cut.html.find(">P100<"), std::string::npos);
  EXPECT_NE(cut.html.find(">P99<"), std::string::npos);
  EXPECT_NE(cut.html.find("The first 100 rows of 1000."), std::string::npos);
  EXPECT_EQ(cut.image_level, 0);
}

TEST(Image, ShrinkingTakesMeans) {
  ColorImage image(4, 2);
  for (int x = 0; x < 4; ++x)
    for (int y = 0; y < 2; ++y)
      image.at(x, y) = {static_cast<std::uint8_t>(x < 2 ? 40 * y : 200), 10, 0};
  const ColorImage small = libmap::shrink_image(image, 2, 1);
  EXPECT_EQ(small.at(0, 0), (libmap::Color{20, 10, 0}));
  EXPECT_EQ(small.at(1, 0), (libmap::Color{200, 10, 0}));
}

TEST(Image, TransparencyLiesOnWhite) {
  libmap::RgbaImage image(64, 64, {0, 0, 0, 0});
  for (std::size_t n = 0; n < image.pixels.size(); n += 2)
    image.pixels[n] = {static_cast<std::uint8_t>(n % 251), 0, 0, 0};
  const ReportImage fitted =
      libmap::fit_image(libmap::read_image_bytes(libmap::encode_png(image)), 1);
  ASSERT_EQ(fitted.media_type, "image/jpeg");
  EXPECT_EQ(libmap::decode_color(fitted.bytes).at(5, 5), (libmap::Color{255, 255, 255}));
}

TEST(Image, BrokenOnesAreErrors) {
  const std::string whole = libmap::encode_png(noise(40, 30));
  EXPECT_EQ(libmap::read_image_bytes(whole).height, 30);
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::read_image_bytes(whole.substr(0, whole.size() / 2)); }),
               {.field = "PNG data"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_image_bytes("no picture"); }),
                       {.field = "image", .bound = "PNG, JPEG or SVG"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_image_bytes(""); }),
                       {.field = "image", .bound = "PNG, JPEG or SVG"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_image_bytes("<svg><rect>"); }),
                       {.field = "image", .bound = "PNG, JPEG or SVG"}));
  const std::string filled = "<svg>" + std::string(std::size_t{4} << 20, ' ') + "</svg>";
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_image_bytes(filled); }),
                       {.value = "4194315 bytes", .bound = "<= 4194304"}));
  const ReportImage drawing = libmap::read_image_bytes("<?xml version='1.0'?><svg></svg>");
  EXPECT_EQ(drawing.media_type, "image/svg+xml");
  EXPECT_EQ(libmap::fit_image(drawing, libmap::max_image_level).bytes, drawing.bytes);
}

}  // namespace page_test
