// JSON conversion (nlohmann) of Eigen vectors, matrices (by columns), poses and boxes, and of
// Errors (only what()), for JSON files of tile stores. Finite numbers are preserved bit for bit.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libmap/core/error.h"

namespace nlohmann {

template <typename Scalar, int rows, int columns>
struct adl_serializer<Eigen::Matrix<Scalar, rows, columns>> {
  using Matrix = Eigen::Matrix<Scalar, rows, columns>;
  template <typename Json>
  static void to_json(Json& json, const Matrix& matrix) {
    json = std::vector<Scalar>(matrix.data(), matrix.data() + matrix.size());
  }
  template <typename Json>
  static void from_json(const Json& json, Matrix& matrix) {
    const auto numbers = json.template get<std::array<Scalar, std::size_t{rows} * columns>>();
    matrix = Eigen::Map<const Matrix>(numbers.data());
  }
};

template <>
struct adl_serializer<Eigen::Isometry3d> {
  template <typename Json>
  static void to_json(Json& json, const Eigen::Isometry3d& pose) {
    json = Eigen::Matrix4d(pose.matrix());
  }
  template <typename Json>
  static void from_json(const Json& json, Eigen::Isometry3d& pose) {
    pose.matrix() = json.template get<Eigen::Matrix4d>();
  }
};

template <>
struct adl_serializer<Eigen::AlignedBox3d> {
  template <typename Json>
  static void to_json(Json& json, const Eigen::AlignedBox3d& box) {
    json = {{"min", Eigen::Vector3d(box.min())}, {"max", Eigen::Vector3d(box.max())}};
  }
  template <typename Json>
  static void from_json(const Json& json, Eigen::AlignedBox3d& box) {
    box = {json.at("min").template get<Eigen::Vector3d>(),
           json.at("max").template get<Eigen::Vector3d>()};
  }
};

template <>
struct adl_serializer<libmap::Error> {
  static void to_json(json& text, const libmap::Error& error) { text = error.what(); }
  static libmap::Error from_json(const json& text) {
    return libmap::Error(text.get<std::string>());
  }
};

}  // namespace nlohmann
