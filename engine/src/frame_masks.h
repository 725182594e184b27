/// @file Stencil masks of a picture: the share of a beam at each of its samples.
#pragma once

#include <algorithm>
#include <cstddef>

#include "transom/frame.h"

namespace transom {

/// Where samples of a picture are in a mask. Masks are as fine as the samples of edges, or as OpenGL's largest picture
/// allows.
class FrameRenderer::Masks {
 public:
  Masks(const View& view, int edge_samples)
      : width_(view.width),
        samples_(edge_samples),
        scale_(std::clamp(kLargestSide / std::max(view.width, view.height), 1, edge_samples)) {}

  int scale() const { return scale_; }
  /// Of a sample of a pixel; -1: its centre.
  std::size_t index(int pixel, int sample) const {
    const int i = sample < 0 ? samples_ / 2 : sample % samples_, j = sample < 0 ? samples_ / 2 : sample / samples_;
    const int column = pixel % width_ * scale_ + (2 * i + 1) * scale_ / (2 * samples_),
              row = pixel / width_ * scale_ + (2 * j + 1) * scale_ / (2 * samples_);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_ * scale_) + static_cast<std::size_t>(column);
  }

 private:
  static constexpr int kLargestSide = 4096;  // pixels
  int width_, samples_, scale_;
};

}  // namespace transom
