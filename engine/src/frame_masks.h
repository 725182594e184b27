/// @file Stencil masks of a picture: the share of a beam at each of its samples.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>

#include "transom/frame.h"

namespace transom {

/// Where samples of a picture are in a mask. Masks are as fine as the samples of edges, or as OpenGL's largest picture
/// allows, and of a range of its pixels.
class FrameRenderer::Masks {
 public:
  /// range: of the picture's pixels.
  Masks(const View& view, int edge_samples, VolumeRange range)
      : width_(view.width),
        samples_(edge_samples),
        scale_(std::clamp(kLargestVolumePicture / std::max(view.width, view.height), 1, edge_samples)),
        range_(std::move(range)) {}

  int scale() const { return scale_; }
  /// The range in pixels of masks.
  VolumeRange range() const {
    return {scale_ * range_.left, scale_ * range_.top, scale_ * range_.right, scale_ * range_.bottom, range_.boxes};
  }
  bool is_empty() const { return range_.left >= range_.right; }
  bool holds(int x, int y) const {
    return x >= range_.left && x < range_.right && y >= range_.top && y < range_.bottom;
  }
  /// Of a sample of a pixel in the range; BeamPoint::kCentre: its centre.
  std::size_t index(int pixel, int sample) const {
    const int i = sample < 0 ? samples_ / 2 : sample % samples_, j = sample < 0 ? samples_ / 2 : sample / samples_;
    const int column = (pixel % width_ - range_.left) * scale_ + (2 * i + 1) * scale_ / (2 * samples_),
              row = (pixel / width_ - range_.top) * scale_ + (2 * j + 1) * scale_ / (2 * samples_);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(range_.width() * scale_) +
           static_cast<std::size_t>(column);
  }
  /// Whether shares differ in a pixel of the range or in the squares around it: light that ends between the outermost
  /// ones of the pixel and the next ones may end in the pixel.
  bool light_ends_at(int x, int y, std::span<const float> shares) const {
    const int left = (x - range_.left) * scale_, top = (y - range_.top) * scale_, width = range_.width() * scale_,
              height = range_.height() * scale_;
    const int first = std::max(left - 1, 0), last = std::min(left + scale_ + 1, width);
    const auto row = [&](int j) {
      return shares.subspan(
          static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(first),
          static_cast<std::size_t>(last - first));
    };
    const float own = row(top)[static_cast<std::size_t>(left - first)];
    for (int j = std::max(top - 1, 0); j < std::min(top + scale_ + 1, height); ++j)
      for (const float share : row(j))
        if (share != own) return true;
    return false;
  }

 private:
  int width_, samples_, scale_;
  VolumeRange range_;
};

}  // namespace transom
