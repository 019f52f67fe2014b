// VTP as ParaView writes it, and VTP that lies.
#include "libmap/cloud/cloud_io.h"

#include <gmock/gmock.h>

#include <string>

#include "tests/libmap/cloud/cloud_samples.h"
#include "tests/libmap/cloud/given_bytes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace {

namespace fs = std::filesystem;
using graspmap_test::error_as;
using graspmap_test::read_as;
using graspmap_test::read_text;
using graspmap_test::sample_cloud;
using graspmap_test::scratch_folder;
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

}  // namespace
}  // namespace libmap
