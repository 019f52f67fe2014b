// VTP as ParaView writes it, and VTP that lies.
#include "libmap/cloud/cloud_io.h"

#include <gmock/gmock.h>

#include <string>

#include "tests/libmap/cloud/cloud_samples.h"
#include "tests/libmap/cloud/given_bytes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace vtp_codec_test {

namespace fs = std::filesystem;
using graspmap_test::error_as;
using graspmap_test::read_as;
using graspmap_test::read_text;
using graspmap_test::sample_cloud;
using graspmap_test::scratch_folder;
using ::testing::Contains;
using ::testing::HasSubstr;

TEST(VtpFiles, PointsAreVertexCells) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, sample_cloud(17), {FileEncoding::ascii, false});
  EXPECT_THAT(read_text(path), HasSubstr("NumberOfVerts=\"17\""));
  EXPECT_THAT(read_text(path), HasSubstr("Normals=\"Normals\""));
}

// As ParaView writes by default: base64 beside the XML, 32-bit block headers.
std::string inline_vtp(const std::string& points_base64, const std::string& score_base64) {
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
         "byte_order=\"LittleEndian\">\n<PolyData><Piece NumberOfPoints=\"2\" NumberOfVerts=\"0\" "
         "NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData><DataArray "
         "type=\"Int16\" Name=\"level\" format=\"binary\">" +
         score_base64 +
         "</DataArray></PointData>\n<Points><DataArray type=\"Float32\" Name=\"Points\" "
         "NumberOfComponents=\"3\" format=\"binary\">\n  " +
         points_base64 + "\n</DataArray></Points></Piece></PolyData></VTKFile>\n";
}

TEST(VtpFiles, InlineBase64) {
  // A length of 24 and 1 2 3 4 5 6; a length of 4 and 7 -1.
  const std::string points = "GAAAAAAAgD8AAABAAABAQAAAgEAAAKBAAADAQA==";
  const CloudReadResult read = read_as(".vtp", inline_vtp(points, "BAAAAAcA//8="));
  ASSERT_EQ(read.cloud.size(), 2U);
  EXPECT_EQ(read.cloud.positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(read.cloud.fields[0], (ScalarField{"level", ScalarType::int16, {7, -1}}));
  EXPECT_THAT(error_as(".vtp", inline_vtp("//8" + points, "BAAAAAcA//8=")),
              HasSubstr("claims more than the file holds"));
  error_as(".vtp", inline_vtp(points, ""));
}

TEST(VtpFiles, AppendedDataBeginWithAnUnderscore) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, sample_cloud(17), {FileEncoding::binary_compressed, false});
  std::string bytes = read_text(path);
  bytes[bytes.find('>', bytes.find("<AppendedData")) + 1] = 'x';
  EXPECT_THAT(error_as(".vtp", bytes), HasSubstr("'_'"));
}

TEST(VtpFiles, CountsThatLie) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, sample_cloud(17), {FileEncoding::ascii, false});
  const std::string good = read_text(path);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return error_as(".vtp", bytes);
  };
  changed("NumberOfPoints=\"17\"", "NumberOfPoints=\"18\"");
  EXPECT_THAT(changed("NumberOfPoints=\"17\"", "NumberOfPoints=\"17000000000000\""),
              HasSubstr("NumberOfPoints"));
  EXPECT_THAT(changed("NumberOfComponents=\"3\"", "NumberOfComponents=\"1000000000\""),
              HasSubstr("NumberOfComponents"));
  EXPECT_THAT(changed("</VTKFile>", "</VTKFil>"), HasSubstr("VTK cannot read it"));
}

struct AsciiVtp {
  std::string points = "4";
  std::string field_data = {};
  std::string point_data = {};
  std::string cell_data = {};
  std::string offsets_type = "Int64";
  std::string polygons = "1";
  std::string corners = "0 1 2";
  std::string offsets = "3";

  std::string text() const {
    return "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\"><PolyData>" + field_data +
           "<Piece NumberOfPoints=\"" + points + "\" NumberOfPolys=\"" + polygons +
           "\"><PointData>" + point_data + "</PointData><CellData>" + cell_data +
           "</CellData><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" "
           "format=\"ascii\">0 0 0 1 0 0 0 1 0 1 1 0</DataArray></Points><Polys><DataArray "
           "type=\"Int64\" Name=\"connectivity\" format=\"ascii\">" +
           corners + "</DataArray><DataArray type=\"" + offsets_type +
           "\" Name=\"offsets\" format=\"ascii\">" + offsets +
           "</DataArray></Polys></Piece></PolyData></VTKFile>\n";
  }
  CloudReadResult read() const { return read_as(".vtp", text()); }
  std::string error() const { return error_as(".vtp", text()); }
};

std::string array_of(const std::string& type, const std::string& values,
                     const std::string& attributes = "format=\"ascii\"") {
  return "<Array type=\"" + type + "\" Name=\"tags\" " + attributes + ">" + values + "</Array>";
}

// VTK reads on behind the end of texts that are too few, and falls.
TEST(VtpFiles, TextsThatLie) {
  const std::string four = "97 0 0 98 98 0 99 0";
  const std::string tuples = " NumberOfTuples=\"4\" format=\"ascii\"";
  EXPECT_THAT(AsciiVtp{.point_data = array_of("String", four)}.read().info.skipped,
              Contains("array of text tags"));
  // A length of 8 and the same.
  const std::string packed = array_of("String", "CAAAAGEAAGJiAGMA", "format=\"binary\"");
  EXPECT_EQ(AsciiVtp{.point_data = packed}.read().cloud.size(), 4U);
  EXPECT_EQ(
      (AsciiVtp{.field_data = "<FieldData>" + array_of("String", four, tuples) + "</FieldData>",
                .cell_data = array_of("String", "97 0")}
           .read()
           .cloud.size()),
      4U);
  for (const char* const values : {"", "97 0", "97 0 98 0 99 0 97", "97 0 98 0 99 0 97 0 97 0"})
    EXPECT_THAT(
        AsciiVtp{.point_data = array_of("String", values)}.error(),
        HasSubstr("an array of texts holds another number of them than its data (must be 4)"))
        << values;
  for (const char* const values : {"97 0.5 0 0 0 0", "97 256 0 0 0 0", "-1 0 0 0 0"})
    EXPECT_THAT(AsciiVtp{.point_data = array_of("String", values)}.error(), HasSubstr("no byte"));
  EXPECT_THAT(AsciiVtp{.cell_data = array_of("String", "")}.error(), HasSubstr("'tags' is 0"));
  EXPECT_THAT((AsciiVtp{.points = "5", .point_data = packed}.error()), HasSubstr("must be 5"));
  EXPECT_THAT(
      AsciiVtp{.point_data = array_of("String", four, "NumberOfComponents=\"2\"" + tuples)}.error(),
      HasSubstr("must be 8"));
  EXPECT_THAT(
      AsciiVtp{.field_data = "<FieldData>" + array_of("String", "97 0", tuples) + "</FieldData>"}
          .error(),
      HasSubstr("must be 4"));
  EXPECT_THAT(AsciiVtp{.point_data = array_of("String", four, "")}.error(), HasSubstr("format"));
  EXPECT_THAT(
      AsciiVtp{.point_data = array_of("String", "", "format=\"appended\" offset=\"0\"")}.error(),
      HasSubstr("offset"));
  EXPECT_THAT(AsciiVtp{.point_data = array_of("Bit", "1 0 1 1")}.error(), HasSubstr("'Bit'"));
  std::string text = AsciiVtp{}.text();
  text.replace(text.find("DataArray type=\"Float32\""), 24, "Array type=\"String\"");
  text.replace(text.find("</DataArray></Points>"), 12, "</Array>");
  EXPECT_THAT(error_as(".vtp", text), HasSubstr("Array type is 'String'"));
}

TEST(VtpFiles, WhatVtkLeavesOutWithoutAWord) {
  const std::string data =
      "<FieldData><DataArray type=\"Int32\" Name=\"a\" "
      "NumberOfTuples=\"100\" format=\"ascii\">7</DataArray></FieldData>";
  EXPECT_THAT(AsciiVtp{.field_data = data}.error(),
              HasSubstr("points is 0: VTK cannot read all of it (must be 4)"));
}

TEST(VtpFiles, ArraysOfOneNameOrNotOfAllPieces) {
  const std::string array =
      "<DataArray type=\"Int32\" Name=\"a\" format=\"ascii\">1 2 3 4</DataArray>";
  std::string twice = array + array;
  EXPECT_THAT(AsciiVtp{.cell_data = twice}.error(), HasSubstr("array 'a': two arrays of one name"));
  EXPECT_THAT(AsciiVtp{.point_data = twice}.error(), HasSubstr("two arrays of one name"));
  std::string text = AsciiVtp{.point_data = array}.text();
  const std::size_t piece = text.find("<Piece");
  const std::size_t end = text.find("</PolyData>");
  const std::string bare = AsciiVtp{}.text();
  text.insert(end, text.substr(piece, end - piece));
  EXPECT_EQ(read_as(".vtp", text).cloud.find_field("a")->values.size(), 8U);
  text.insert(piece, bare.substr(piece, bare.find("</PolyData>") - piece));
  EXPECT_THAT(error_as(".vtp", text),
              HasSubstr("rows of array 'a' is 8: an array is not in every piece (must be 12)"));
}

TEST(VtpFiles, CellDataWithoutTheirCells) {
  std::string text = AsciiVtp{.cell_data = array_of("Int32", "7")}.text();
  const std::size_t polygons = text.find("<Polys>");
  text.erase(polygons, text.find("</Piece>") - polygons);
  EXPECT_THAT(error_as(".vtp", text), HasSubstr("a cell array has another length than the cells"));
}

TEST(VtpFiles, CommentsAreNotRead) {
  for (const char* const mark : {"<!-- x -->", "&#60;"})
    EXPECT_THAT(AsciiVtp{.field_data = mark}.error(),
                HasSubstr("comments, entities and document types are not read"));
}

// 300 is 44 in eight bits.
TEST(VtpFiles, OffsetsThatTheirTypeCannotHold) {
  AsciiVtp vtp;
  vtp.corners.clear();
  for (int n = 0; n < 100; ++n) vtp.corners += "0 1 2 ";
  vtp.polygons = "2";
  vtp.offsets = "3 300";
  EXPECT_EQ(vtp.read().info.faces, 2U);
  vtp.offsets = "200 300";
  vtp.offsets_type = "UInt8";
  EXPECT_THAT(vtp.error(), HasSubstr("offsets"));
}

// Each takes gigabytes, or a second for every megabyte of its tags, unless it is refused.
TEST(VtpFiles, MoreThanTheMemoryHolds) {
  const std::string wide = array_of("Float64", "1", "NumberOfComponents=\"4096\" format=\"ascii\"");
  const std::string spaces(100'000, ' ');
  EXPECT_THAT(error_as(".vtp", AsciiVtp{.points = "10000", .point_data = wide}.text() + spaces),
              HasSubstr("more memory than those of a file of this size"));
  EXPECT_THAT(error_as(".vtp", AsciiVtp{.points = "90000000"}.text() + spaces),
              HasSubstr("more memory than those of a file of this size"));
}

// One block of nothing but zeros, as the offsets of a thousand lists of cells.
TEST(VtpFiles, OneBlockManyTimes) {
  const std::string zeros(1 << 20, '\0');
  const auto vtp = [&](int lists, const char* type, std::size_t count) {
    std::string text =
        "<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt32\">\n<PolyData>\n"
        "<Piece NumberOfPoints=\"1\" NumberOfVerts=\"" +
        std::to_string(count) +
        "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n"
        "<Points><DataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\" "
        "format=\"ascii\">0 0 0</DataArray></Points>\n";
    for (int n = 0; n < lists; ++n)
      text +=
          "<Verts><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0"
          "</DataArray><DataArray type=\"" +
          std::string(type) + "\" Name=\"offsets\" format=\"appended\" offset=\"0\"/></Verts>\n";
    text += "</Piece></PolyData>\n<AppendedData encoding=\"raw\">\n_";
    const std::uint32_t length = 1U << 20;
    text.append(reinterpret_cast<const char*>(&length), sizeof length);
    return text + zeros + "\n</AppendedData>\n</VTKFile>\n";
  };
  EXPECT_THAT(error_as(".vtp", vtp(1000, "Int64", 1U << 17)),
              HasSubstr("more memory than those of a file of this size"));
  // Cells of one byte are kept as eight.
  EXPECT_THAT(error_as(".vtp", vtp(40, "Int8", 1U << 20)),
              HasSubstr("more memory than those of a file of this size"));
  EXPECT_NO_THROW(read_as(".vtp", vtp(4, "Int64", 1U << 17)));
}

}  // namespace vtp_codec_test
}  // namespace libmap
