#include "tests/fuzz/vtp_samples.h"

#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataWriter.h>

namespace graspmap_fuzz {

namespace {

vtkNew<vtkPolyData> triangle() {
  vtkNew<vtkPoints> points;
  points->InsertNextPoint(0.0, 0.0, 0.0);
  points->InsertNextPoint(1.0, 0.0, 0.25);
  points->InsertNextPoint(0.0, 1.0, 0.5);
  vtkNew<vtkFloatArray> scores;
  scores->SetName("score");
  for (const double score : {0.0, 0.5, 1.0}) scores->InsertNextValue(static_cast<float>(score));
  vtkNew<vtkCellArray> corners;
  corners->InsertNextCell({0, 1, 2});
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(corners);
  data->GetPointData()->AddArray(scores);
  return data;
}

}  // namespace

std::vector<std::string> vtp_samples() {
  const vtkNew<vtkPolyData> data = triangle();
  std::vector<std::string> files;
  const auto add = [&](const auto& choose) {
    vtkNew<vtkXMLPolyDataWriter> writer;
    writer->SetInputData(data);
    writer->SetCompressorTypeToNone();
    writer->EncodeAppendedDataOff();
    choose(*writer);
    writer->WriteToOutputStringOn();
    writer->Write();
    files.push_back(writer->GetOutputString());
  };
  using Writer = vtkXMLPolyDataWriter;
  add([](Writer& writer) { writer.SetDataModeToAscii(); });
  for (const int compressor : {Writer::NONE, Writer::ZLIB, Writer::LZ4, Writer::LZMA}) {
    add([&](Writer& writer) {
      writer.SetDataModeToBinary();
      writer.SetCompressorType(compressor);
    });
    add([&](Writer& writer) {
      writer.SetDataModeToAppended();
      writer.SetCompressorType(compressor);
      writer.SetHeaderTypeToUInt64();
    });
  }
  add([](Writer& writer) {
    writer.SetDataModeToAppended();
    writer.EncodeAppendedDataOn();
    writer.SetByteOrderToBigEndian();
  });
  return files;
}

}  // namespace graspmap_fuzz
