#include "libmap/cloud/vtp_codec.h"

#include <vtkCellArray.h>
#include <vtkCellArrayIterator.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkTriangleFilter.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>

#include <algorithm>
#include <array>
#include <clocale>
#include <cmath>
#include <cstring>
#include <limits>
#include <locale>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <utility>

#include "libmap/cloud/vtp_checks.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

// Takes the first thing that VTK says.
class ListeningWindow : public vtkOutputWindow {
 public:
  static ListeningWindow* New();
  vtkTypeMacro(ListeningWindow, vtkOutputWindow);
  void DisplayText(const char* text) override {
    // VTK writes the ranges of arrays as information keys, and cannot read back one that is NaN.
    if (said_.empty() && std::strstr(text, "InformationKey") == nullptr) said_ = text;
  }
  void DisplayErrorText(const char* text) override { DisplayText(text); }
  void DisplayWarningText(const char* text) override { DisplayText(text); }
  void DisplayGenericWarningText(const char* text) override { DisplayText(text); }
  void DisplayDebugText(const char*) override {}
  const std::string& said() const { return said_; }

 private:
  std::string said_;
};
vtkStandardNewMacro(ListeningWindow)

    // While it lives, VTK's messages go here, and its numbers do not follow the locale. One at a
    // time: a program has one locale, and VTK one output window.
    class VtkMessages {
 public:
  VtkMessages()
      : lock_(mutex()),
        before_(vtkOutputWindow::GetInstance()),
        verbosity_before_(vtkLogger::GetCurrentVerbosityCutoff()),
        c_locale_before_(std::setlocale(LC_NUMERIC, nullptr)),
        locale_before_(std::locale::global(std::locale::classic())) {
    vtkOutputWindow::SetInstance(window_);
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
  }
  ~VtkMessages() {
    std::locale::global(locale_before_);
    std::setlocale(LC_NUMERIC, c_locale_before_.c_str());
    vtkLogger::SetStderrVerbosity(verbosity_before_);
    vtkOutputWindow::SetInstance(before_);
  }
  VtkMessages(const VtkMessages&) = delete;
  VtkMessages& operator=(const VtkMessages&) = delete;

  // Throws Error with the first message, without addresses and source lines.
  void require_none() const {
    const std::string& said = window_->said();
    if (said.empty()) return;
    const std::size_t address_end = said.find("): ");
    std::string reason = address_end == std::string::npos ? said : said.substr(address_end + 3);
    reason = std::string(trim(reason.substr(0, reason.find('\n'))));
    throw Error("VTK cannot read it: " + reason.substr(0, 200));
  }

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  std::lock_guard<std::mutex> lock_;
  vtkSmartPointer<vtkOutputWindow> before_;
  vtkLogger::Verbosity verbosity_before_;
  std::string c_locale_before_;
  std::locale locale_before_;
  vtkNew<ListeningWindow> window_;
};

StoredType stored_type(int vtk_type) {
  switch (vtk_type) {
    case VTK_CHAR:
    case VTK_SIGNED_CHAR:
      return StoredType::int8;
    case VTK_UNSIGNED_CHAR:
      return StoredType::uint8;
    case VTK_SHORT:
      return StoredType::int16;
    case VTK_UNSIGNED_SHORT:
      return StoredType::uint16;
    case VTK_INT:
      return StoredType::int32;
    case VTK_UNSIGNED_INT:
      return StoredType::uint32;
    case VTK_FLOAT:
      return StoredType::float32;
    case VTK_DOUBLE:
      return StoredType::float64;
    case VTK_LONG:
    case VTK_LONG_LONG:
    case VTK_ID_TYPE:
      return StoredType::int64;
    case VTK_UNSIGNED_LONG:
    case VTK_UNSIGNED_LONG_LONG:
      return StoredType::uint64;
    default:
      throw Error("an array of a number type that is not known");
  }
}

int vtk_type_of(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
      return VTK_SIGNED_CHAR;
    case ScalarType::uint8:
      return VTK_UNSIGNED_CHAR;
    case ScalarType::int16:
      return VTK_SHORT;
    case ScalarType::uint16:
      return VTK_UNSIGNED_SHORT;
    case ScalarType::int32:
      return VTK_INT;
    case ScalarType::uint32:
      return VTK_UNSIGNED_INT;
    case ScalarType::float32:
      return VTK_FLOAT;
    case ScalarType::float64:
      return VTK_DOUBLE;
  }
  return VTK_DOUBLE;
}

// The parts' names of an array: colours and normals get the names that a cloud's columns have.
std::vector<std::string> part_names(vtkDataArray& array, const vtkDataArray* normals,
                                    std::size_t index) {
  const auto parts = static_cast<std::size_t>(array.GetNumberOfComponents());
  const std::string name = array.GetName() != nullptr && *array.GetName() != '\0'
                               ? array.GetName()
                               : "array_" + std::to_string(index);
  if (parts == 3 && (&array == normals || name == "Normals")) return {"nx", "ny", "nz"};
  const bool is_color = name == "rgb" || name == "RGB" || name == "rgba" || name == "RGBA" ||
                        name == "Colors" || name == "colors";
  if (is_color && parts == 3) return {"red", "green", "blue"};
  if (is_color && parts == 4) return {"red", "green", "blue", "alpha"};
  if (parts == 1) return {name};
  std::vector<std::string> names;
  for (std::size_t i = 0; i < parts; ++i) names.push_back(name + "_" + std::to_string(i));
  return names;
}

void add_array(vtkDataArray& array, const std::vector<std::string>& names, ColumnSet& set) {
  const StoredType type = stored_type(array.GetDataType());
  const std::size_t size = size_of(type);
  if (static_cast<std::size_t>(array.GetNumberOfTuples()) != set.rows)
    throw Error("an array of another length than the data",
                {.file = {},
                 .field = "array " + names.front().substr(0, 40),
                 .value = std::to_string(array.GetNumberOfTuples()),
                 .bound = std::to_string(set.rows)});
  const auto* first =
      set.rows == 0 ? nullptr : static_cast<const std::byte*>(array.GetVoidPointer(0));
  for (std::size_t i = 0; i < names.size(); ++i)
    set.columns.push_back({names[i], scalar_type_of(type), type,
                           first == nullptr ? nullptr : first + i * size, names.size() * size,
                           false});
}

void add_arrays(vtkDataSetAttributes& data, ColumnSet& set, std::vector<std::string>& skipped) {
  for (int i = 0; i < data.GetNumberOfArrays(); ++i) {
    vtkDataArray* const array = data.GetArray(i);
    if (array == nullptr) {
      const char* const name = data.GetAbstractArray(i)->GetName();
      skipped.push_back(std::string("array of text ") + (name == nullptr ? "" : name));
    } else {
      add_array(*array, part_names(*array, data.GetNormals(), static_cast<std::size_t>(i)), set);
    }
  }
}

// VTK checks neither offsets nor corners.
void require_cells(vtkCellArray* cells, vtkIdType points, const std::string& what) {
  if (cells == nullptr) return;
  vtkDataArray* const offsets = cells->GetOffsetsArray();
  const vtkIdType corners = cells->GetConnectivityArray()->GetNumberOfTuples();
  const vtkIdType ends = offsets->GetNumberOfTuples();
  const Error broken("the " + what + " are broken: a corner is no point, or an offset is wrong");
  double before = 0.0;
  for (vtkIdType i = 0; i < ends; ++i) {
    const double offset = offsets->GetComponent(i, 0);
    if (offset < before || offset > static_cast<double>(corners) || (i == 0 && offset != 0.0))
      throw broken;
    before = offset;
  }
  for (vtkIdType i = 0; i < corners; ++i) {
    const double corner = cells->GetConnectivityArray()->GetComponent(i, 0);
    if (corner < 0.0 || corner >= static_cast<double>(points)) throw broken;
  }
}

vtkSmartPointer<vtkPolyData> read_poly_data(const std::string& bytes) {
  const VtkMessages messages;
  const std::uint64_t points = require_sane_vtp(bytes);
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->ReadFromInputStringOn();
  reader->SetInputString(bytes);
  reader->Update();
  messages.require_none();
  vtkSmartPointer<vtkPolyData> data = reader->GetOutput();
  if (data == nullptr || reader->GetErrorCode() != 0) throw Error("VTK cannot read it");
  // Of some files VTK reads nothing, without a word.
  if (static_cast<std::uint64_t>(data->GetNumberOfPoints()) != points)
    throw Error("VTK cannot read all of it", {.file = {},
                                              .field = "points",
                                              .value = std::to_string(data->GetNumberOfPoints()),
                                              .bound = std::to_string(points)});
  return data;
}

void require_sane_data(vtkPolyData& data) {
  const vtkIdType points = data.GetNumberOfPoints();
  require_cells(data.GetVerts(), points, "vertex cells");
  require_cells(data.GetLines(), points, "lines");
  require_cells(data.GetPolys(), points, "polygons");
  require_cells(data.GetStrips(), points, "triangle strips");
  for (int i = 0; i < data.GetCellData()->GetNumberOfArrays(); ++i)
    if (data.GetCellData()->GetAbstractArray(i)->GetNumberOfTuples() != data.GetNumberOfCells())
      throw Error("a cell array has another length than the cells");
}

// The polygons alone, as triangles, with their cell data.
vtkSmartPointer<vtkPolyData> triangles_only(vtkPolyData& data) {
  vtkNew<vtkTriangleFilter> filter;
  filter->SetInputData(&data);
  filter->PassVertsOff();
  filter->PassLinesOff();
  filter->Update();
  return filter->GetOutput();
}

void add_triangles(vtkPolyData& data, GeometryColumns& content) {
  const auto iterator = vtk::TakeSmartPointer(data.GetPolys()->NewIterator());
  for (iterator->GoToFirstCell(); !iterator->IsDoneWithTraversal(); iterator->GoToNextCell()) {
    vtkIdType corners = 0;
    const vtkIdType* ids = nullptr;
    iterator->GetCurrentCell(corners, ids);
    if (corners != 3) throw Error("a polygon has less than three corners");
    content.face_of_triangle.push_back(static_cast<std::uint32_t>(content.triangles.size()));
    content.triangles.push_back({static_cast<std::uint32_t>(ids[0]),
                                 static_cast<std::uint32_t>(ids[1]),
                                 static_cast<std::uint32_t>(ids[2])});
  }
}

std::shared_ptr<const void> keep(const vtkSmartPointer<vtkPolyData>& data) {
  return std::make_shared<vtkSmartPointer<vtkPolyData>>(data);
}

std::optional<Pose> viewpoint_of(vtkPolyData& data) {
  vtkDataArray* const array = data.GetFieldData()->GetArray("viewpoint");
  if (array == nullptr || array->GetNumberOfValues() != 7) return std::nullopt;
  std::array<double, 7> v{};
  for (int i = 0; i < 7; ++i) {
    const int parts = array->GetNumberOfComponents();
    v[static_cast<std::size_t>(i)] = array->GetComponent(i / parts, i % parts);
    if (!std::isfinite(v[static_cast<std::size_t>(i)])) return std::nullopt;
  }
  const Eigen::Quaterniond rotation(v[3], v[4], v[5], v[6]);
  if (!(rotation.norm() > 0.0)) return std::nullopt;
  return make_pose({v[0], v[1], v[2]}, rotation);
}

FileEncoding encoding_of(std::string_view bytes) {
  const std::string_view xml = bytes.substr(0, bytes.find("<AppendedData"));
  if (xml.find("compressor=") != std::string_view::npos) return FileEncoding::binary_compressed;
  const bool ascii = xml.find("format=\"ascii\"") != std::string_view::npos;
  return ascii ? FileEncoding::ascii : FileEncoding::binary;
}

GeometryFileInfo info_of(vtkPolyData& data, const std::string& bytes) {
  GeometryFileInfo info;
  info.format = "vtp";
  info.encoding = encoding_of(bytes);
  info.big_endian = bytes.substr(0, 1000).find("\"BigEndian\"") != std::string::npos;
  info.bytes = bytes.size();
  info.points = static_cast<std::uint64_t>(data.GetNumberOfPoints());
  info.faces = static_cast<std::uint64_t>(data.GetNumberOfPolys() + data.GetNumberOfStrips());
  const auto add = [&info](vtkDataArray& array, const std::string& name) {
    info.fields.push_back({name, scalar_type_of(stored_type(array.GetDataType())),
                           static_cast<std::size_t>(array.GetNumberOfComponents())});
  };
  if (info.points > 0) add(*data.GetPoints()->GetData(), "Points");
  for (int i = 0; i < data.GetPointData()->GetNumberOfArrays(); ++i)
    if (vtkDataArray* const array = data.GetPointData()->GetArray(i))
      add(*array, array->GetName() == nullptr ? "" : array->GetName());
  if (data.GetNumberOfLines() > 0) info.skipped.push_back("lines");
  return info;
}

// Columns of one type as an array with a part for each.
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

void set_cells(const VtpContent& content, vtkPolyData& data) {
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
  const Eigen::Quaterniond q(viewpoint.rotation());
  const Eigen::Vector3d t = viewpoint.translation();
  vtkNew<vtkDoubleArray> array;
  array->SetName("viewpoint");
  for (const double number : {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()})
    array->InsertNextValue(number);
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

GeometryFileInfo vtp_info(const std::string& bytes) {
  const vtkSmartPointer<vtkPolyData> data = read_poly_data(bytes);
  require_sane_data(*data);
  return info_of(*data, bytes);
}

GeometryColumns decode_vtp(const std::string& bytes) {
  const vtkSmartPointer<vtkPolyData> data = read_poly_data(bytes);
  require_sane_data(*data);
  GeometryColumns content;
  content.info = info_of(*data, bytes);
  content.viewpoint = viewpoint_of(*data);
  content.vertices.rows = content.info.points;
  if (content.info.points > 0)
    add_array(*data->GetPoints()->GetData(), {"x", "y", "z"}, content.vertices);
  else
    for (const char* const axis : {"x", "y", "z"})
      content.vertices.add_numbers(axis, ScalarType::float64);
  add_arrays(*data->GetPointData(), content.vertices, content.info.skipped);
  content.vertices.storage.push_back(keep(data));
  if (content.info.faces == 0) return content;
  if (content.info.points > std::numeric_limits<std::uint32_t>::max())
    throw Error("too many vertices for a mesh");
  const VtkMessages messages;
  const vtkSmartPointer<vtkPolyData> triangles = triangles_only(*data);
  messages.require_none();
  add_triangles(*triangles, content);
  content.faces.rows = content.triangles.size();
  add_arrays(*triangles->GetCellData(), content.faces, content.info.skipped);
  content.faces.storage.push_back(keep(triangles));
  return content;
}

void encode_vtp(const VtpContent& content, FileEncoding encoding, std::ostream& out) {
  vtkNew<vtkPolyData> data;
  set_points(*content.vertices, *data);
  set_arrays(*content.vertices, *data->GetPointData());
  set_cells(content, *data);
  if (content.faces != nullptr) set_arrays(*content.faces, *data->GetCellData());
  if (content.viewpoint != nullptr) set_viewpoint(*content.viewpoint, *data);

  const VtkMessages messages;
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
  if (writer->Write() != 1) throw Error("VTK cannot write it", {}, ErrorKind::failed);
  messages.require_none();
  out << writer->GetOutputString();
}

}  // namespace libmap
