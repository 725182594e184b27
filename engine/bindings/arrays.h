// Arrays between Python and C++.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <glm/glm.hpp>
#include <tuple>
#include <utility>
#include <vector>

namespace transom {

template <typename T, typename... Shape>
using In = nanobind::ndarray<const T, Shape..., nanobind::c_contig, nanobind::device::cpu>;

// An array that owns `values` (moved, not copied) and shows them with the given shape.
template <typename Scalar, typename Value, typename Memory>
nanobind::ndarray<nanobind::numpy, Scalar> to_array(std::vector<Value, Memory>&& values,
                                                    std::vector<std::size_t> shape) {
  using Values = std::vector<Value, Memory>;
  auto* kept = new Values(std::move(values));
  nanobind::capsule owner(kept, [](void* p) noexcept { delete static_cast<Values*>(p); });
  return nanobind::ndarray<nanobind::numpy, Scalar>(kept->data(), shape.size(), shape.data(), owner);
}

template <typename Value, typename Array>
std::vector<Value> to_vector(const Array& array) {
  const auto* begin = reinterpret_cast<const Value*>(array.data());
  return std::vector<Value>(begin, begin + array.size() * sizeof(*array.data()) / sizeof(Value));
}

inline glm::vec3 vector_of(std::tuple<float, float, float> v) {
  return {std::get<0>(v), std::get<1>(v), std::get<2>(v)};
}

}  // namespace transom
