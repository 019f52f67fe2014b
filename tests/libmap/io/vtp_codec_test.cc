// VTP, which is written only, read by VTK.
#include "libmap/io/vtp_codec.h"
#include <gtest/gtest.h>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkXMLPolyDataReader.h>

#include <clocale>
#include <cmath>
#include <limits>
#include <locale>
#include <string>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/libmap/io/cloud_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace vtp_codec_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_text;
using graspmap_test::sample_cloud;
using graspmap_test::scratch_folder;

constexpr FileEncoding encodings[] = {FileEncoding::ascii, FileEncoding::binary,
                                      FileEncoding::binary_compressed};

fs::path write(const PointCloud& cloud, FileEncoding encoding) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, cloud, {.encoding = encoding});
  return path;
}

vtkSmartPointer<vtkPolyData> read(const fs::path& path) {
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(path.c_str());
  reader->Update();
  return reader->GetOutput();
}

double value(vtkDataArray* array, std::size_t row, int part = 0) {
  return array->GetComponent(static_cast<vtkIdType>(row), part);
}

void expect_fields(const std::vector<ScalarField>& fields, vtkFieldData& data) {
  constexpr int types[] = {VTK_SIGNED_CHAR, VTK_UNSIGNED_CHAR, VTK_SHORT, VTK_UNSIGNED_SHORT,
                           VTK_INT,         VTK_UNSIGNED_INT,  VTK_FLOAT, VTK_DOUBLE};
  for (const ScalarField& field : fields) {
    vtkDataArray* const array = data.GetArray(field.name.c_str());
    ASSERT_NE(array, nullptr) << field.name;
    EXPECT_EQ(array->GetDataType(), types[static_cast<int>(field.type)]) << field.name;
    for (std::size_t n = 0; n < field.values.size(); ++n)
      ASSERT_EQ(value(array, n), field.values[n]) << field.name << " " << n;
  }
}

TEST(VtpFiles, HoldTheCloud) {
  const PointCloud cloud = sample_cloud(257);
  for (const FileEncoding encoding : encodings) {
    const fs::path path = write(cloud, encoding);
    const auto data = read(path);
    ASSERT_EQ(data->GetNumberOfPoints(), 257);
    EXPECT_EQ(data->GetNumberOfVerts(), 257) << "ParaView shows cells";
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_EQ(data->GetPoint(static_cast<vtkIdType>(n))[axis], cloud.positions[n][axis]);
        ASSERT_EQ(value(data->GetPointData()->GetNormals(), n, axis),
                  static_cast<double>(cloud.normals[n][axis]));
      }
      ASSERT_EQ(value(data->GetPointData()->GetArray("rgb"), n, 2), cloud.colors[n][2]);
    }
    expect_fields(cloud.fields, *data->GetPointData());
    vtkDataArray* const viewpoint = data->GetFieldData()->GetArray("viewpoint");
    ASSERT_EQ(viewpoint->GetNumberOfValues(), 7);
    EXPECT_EQ(value(viewpoint, 0), cloud.viewpoint.translation().x());
    const std::string bytes = read_text(path);
    EXPECT_EQ(bytes.find("format=\"ascii\"") != std::string::npos, encoding == FileEncoding::ascii);
    EXPECT_EQ(bytes.find("compressor=") != std::string::npos,
              encoding == FileEncoding::binary_compressed);
  }
}

TEST(VtpFiles, HoldTheMesh) {
  TriangleMesh mesh;
  mesh.vertices = {{500000.123456789, 0, 0}, {500001, 0, 0}, {500000, 1, 0}, {500000, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}};
  mesh.face_fields = graspmap_test::sample_fields(3);
  for (const FileEncoding encoding : encodings) {
    const fs::path path = scratch_folder() / "mesh.vtp";
    write_mesh(path, mesh, {.encoding = encoding});
    const auto data = read(path);
    EXPECT_EQ(data->GetPoint(0)[0], 500000.123456789);
    ASSERT_EQ(data->GetNumberOfPolys(), 3);
    for (vtkIdType t = 0; t < 3; ++t)
      for (vtkIdType k = 0; k < 3; ++k)
        EXPECT_EQ(data->GetPolys()->GetConnectivityArray()->GetComponent(3 * t + k, 0),
                  mesh.triangles[static_cast<std::size_t>(t)][static_cast<std::size_t>(k)]);
    expect_fields(mesh.face_fields, *data->GetCellData());
  }
}

TEST(VtpFiles, EmptyOnesAndNumbersThatAreNotFinite) {
  for (const FileEncoding encoding : encodings) {
    EXPECT_EQ(read(write(sample_cloud(0), encoding))->GetNumberOfPoints(), 0);
    PointCloud cloud;
    cloud.positions = {{1, 2, 3}, {4, 5, 6}};
    cloud.add_field("score", ScalarType::float32).values = {
        std::numeric_limits<double>::quiet_NaN(), 0.25};
    const auto data = read(write(cloud, encoding));
    EXPECT_TRUE(std::isnan(value(data->GetPointData()->GetArray("score"), 0)));
    EXPECT_EQ(value(data->GetPointData()->GetArray("score"), 1), 0.25);
  }
}

TEST(VtpFiles, SameBytesTwiceAndUnderAnyLocale) {
  class CommaPoint : public std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const PointCloud cloud = sample_cloud(2000);
  for (const FileEncoding encoding : encodings) {
    const std::string usual = read_text(write(cloud, encoding));
    EXPECT_EQ(read_text(write(cloud, encoding)), usual);
    const std::locale before = std::locale::global(std::locale(std::locale(), new CommaPoint));
    std::setlocale(LC_ALL, "de_DE.UTF-8");
    const fs::path path = write(cloud, encoding);
    std::setlocale(LC_ALL, "C");
    std::locale::global(before);
    EXPECT_EQ(read_text(path), usual);
  }
}

TEST(VtpFiles, CannotBeWrittenToAFolder) {
  const fs::path folder = scratch_folder() / "folder.vtp";
  fs::create_directories(folder);
  EXPECT_TRUE(is_error(error_of([&] { write_cloud(folder, sample_cloud(2)); }),
                       {.file = folder, .kind = ErrorKind::failed}));
}

TEST(VtpFiles, AreNotRead) {
  const fs::path path = write(sample_cloud(3), FileEncoding::binary);
  for (const Error& error :
       {error_of([&] { read_cloud(path); }), error_of([&] { read_cloud_info(path); }),
        error_of([&] { read_mesh(path); }), error_of([&] { file_kind(path); })}) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    EXPECT_EQ(error.context().file, path.string());
    EXPECT_TRUE(is_error(error, {.file = "cloud.vtp"}));
  }
}

}  // namespace vtp_codec_test
}  // namespace libmap
