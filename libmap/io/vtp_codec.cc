#include "libmap/io/vtp_codec.h"

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkXMLPolyDataWriter.h>

#include <array>
#include <clocale>
#include <cmath>
#include <cstring>
#include <locale>
#include <mutex>

#include "libmap/core/error.h"

namespace libmap {
namespace {

// Sets the classic locale for VTK's numbers. Only one object at a time: a process has one locale.
class ClassicLocale {
 public:
  ClassicLocale()
      : lock_(mutex()),
        c_locale_before_(std::setlocale(LC_NUMERIC, nullptr)),
        locale_before_(std::locale::global(std::locale::classic())) {}
  ~ClassicLocale() {
    std::locale::global(locale_before_);
    std::setlocale(LC_NUMERIC, c_locale_before_.c_str());
  }
  ClassicLocale(const ClassicLocale&) = delete;
  ClassicLocale& operator=(const ClassicLocale&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  std::lock_guard<std::mutex> lock_;
  std::string c_locale_before_;
  std::locale locale_before_;
};

int vtk_type_of(ScalarType type) {
  constexpr std::array types = {VTK_SIGNED_CHAR, VTK_UNSIGNED_CHAR, VTK_SHORT, VTK_UNSIGNED_SHORT,
                                VTK_INT,         VTK_UNSIGNED_INT,  VTK_FLOAT, VTK_DOUBLE};
  return types[static_cast<std::size_t>(type)];
}

// Returns columns of one type as an array with one component per column.
vtkSmartPointer<vtkDataArray> make_array(const std::vector<Column>& columns, std::size_t rows,
                                         const std::string& name) {
  vtkSmartPointer<vtkDataArray> array =
      vtk::TakeSmartPointer(vtkDataArray::CreateDataArray(vtk_type_of(columns.front().type)));
  array->SetName(name.c_str());
  array->SetNumberOfComponents(static_cast<int>(columns.size()));
  array->SetNumberOfTuples(static_cast<vtkIdType>(rows));
  std::string packed;
  append_records(columns, 0, rows, false, packed);
  if (!packed.empty()) std::memcpy(array->GetVoidPointer(0), packed.data(), packed.size());
  return array;
}

void set_arrays(const ColumnSet& set, vtkDataSetAttributes& data) {
  const auto take = [&set](std::size_t i, std::array<const char*, 3> names) {
    std::vector<Column> parts;
    for (std::size_t k = 0; k < 3 && i + k < set.columns.size(); ++k)
      if (set.columns[i + k].name == names[k]) parts.push_back(set.columns[i + k]);
    return parts.size() == 3 ? parts : std::vector<Column>();
  };
  for (std::size_t i = 0; i < set.columns.size(); ++i) {
    if (!take(i, {"x", "y", "z"}).empty()) {
      i += 2;
    } else if (const auto normals = take(i, {"nx", "ny", "nz"}); !normals.empty()) {
      data.SetNormals(make_array(normals, set.rows, "Normals"));
      i += 2;
    } else if (const auto colors = take(i, {"red", "green", "blue"}); !colors.empty()) {
      data.AddArray(make_array(colors, set.rows, "rgb"));
      i += 2;
    } else {
      data.AddArray(make_array({set.columns[i]}, set.rows, set.columns[i].name));
    }
  }
}

void set_points(const ColumnSet& set, vtkPolyData& data) {
  vtkNew<vtkPoints> points;
  points->SetData(make_array({*set.find("x"), *set.find("y"), *set.find("z")}, set.rows, "Points"));
  data.SetPoints(points);
}

void set_cells(const GeometryContent& content, vtkPolyData& data) {
  vtkNew<vtkCellArray> cells;
  if (content.triangles == nullptr) {
    for (std::size_t i = 0; i < content.vertices->rows; ++i)
      cells->InsertNextCell({static_cast<vtkIdType>(i)});
    data.SetVerts(cells);
    return;
  }
  for (const Triangle& triangle : *content.triangles)
    cells->InsertNextCell({vtkIdType{triangle[0]}, vtkIdType{triangle[1]}, vtkIdType{triangle[2]}});
  data.SetPolys(cells);
}

void set_viewpoint(const Pose& viewpoint, vtkPolyData& data) {
  if (viewpoint.matrix().isIdentity(0.0)) return;
  vtkNew<vtkDoubleArray> array;
  array->SetName("viewpoint");
  for (const double number : viewpoint_numbers(viewpoint)) array->InsertNextValue(number);
  data.GetFieldData()->AddArray(array);
}

bool all_finite(const ColumnSet* set) {
  if (set == nullptr) return true;
  bool finite = true;
  for (const Column& column : set->columns)
    for_each_value(column, set->rows, [&](std::size_t, double value) {
      finite = finite && std::isfinite(as_type(value, column.type));
    });
  return finite;
}

}  // namespace

void encode_vtp(const GeometryContent& content, FileEncoding encoding, std::ostream& out) {
  vtkNew<vtkPolyData> data;
  set_points(*content.vertices, *data);
  set_arrays(*content.vertices, *data->GetPointData());
  set_cells(content, *data);
  if (content.faces != nullptr) set_arrays(*content.faces, *data->GetCellData());
  if (content.viewpoint != nullptr) set_viewpoint(*content.viewpoint, *data);

  const ClassicLocale locale;
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(data);
  writer->WriteToOutputStringOn();
  writer->SetHeaderTypeToUInt64();
  if (encoding == FileEncoding::ascii && all_finite(content.vertices) &&
      all_finite(content.faces)) {
    writer->SetDataModeToAscii();
  } else {
    writer->SetDataModeToAppended();
    writer->EncodeAppendedDataOff();
  }
  if (encoding != FileEncoding::binary_compressed) writer->SetCompressorTypeToNone();
  if (writer->Write() != 1) throw Error("VTK cannot write the file", {}, ErrorKind::failed);
  out << writer->GetOutputString();
}

}  // namespace libmap
