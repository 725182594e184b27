// Packets of rays from the camera; what they meet behind panes is traced on by itself.
#include "view_rays.h"

#include <algorithm>

namespace transom {
namespace {

constexpr int kMaximumCrossings = 16;  // openings looked through, one behind another

// Names what a ray has met: a side of a face, the sky or the ground, and how many openings are in front of it.
std::int64_t name_of(const Seen& seen) {
  const std::int64_t surface =
      seen.hit.face >= 0 ? 2 * std::int64_t{seen.hit.face} + seen.hit.side + 2 : (seen.direction.z < 0 ? 1 : 0);
  return surface * (kMaximumCrossings + 2) + seen.crossings;
}

}  // namespace

// Whether a ray goes on beyond what it has met: an opening that can be looked through.
bool CameraTracer::passes(std::size_t ray, Seen& here, std::vector<SeenPane>* panes) const {
  if (here.hit.face < 0) return false;
  const Face& face = engine_.faces().faces[here.hit.face];
  const int opening = engine_.scene().materials[face.material].opening;
  if (opening < 0) return false;
  if (panes && engine_.reflectance(here.hit.face, here.hit.side) != glm::vec3(0)) panes->push_back({ray, here});
  if (const Panel* panel = engine_.panels().at(here.hit.face)) {  // nothing is seen through it
    here.panel_bin = here.hit.side == 1 ? engine_.panels().bin(*panel, -here.direction) : -1;
    here.ends_at_panel = true;
    return false;
  }
  here.through *= engine_.scene().openings[opening].transmittance_at(glm::dot(face.normal, here.direction));
  ++here.crossings;
  return true;
}

void CameraTracer::trace(glm::vec2 corner, std::span<const glm::vec2> places, std::span<Seen> seen,
                         std::vector<SeenPane>* panes) {
  const std::size_t count = places.size();
  if (panes) panes->clear();
  active_.clear();
  rays_.clear();
  for (std::vector<float>* list : {&x_, &y_, &z_}) list->resize(count);
  hits_.resize(count);
  camera_.directions(corner, places, x_.data(), y_.data(), z_.data());
  engine_.rays().intersect_from(origin_, x_.data(), y_.data(), z_.data(), RayScene::What::kAll, hits_);
  const auto go_on_from = [&](std::size_t i) {
    active_.push_back(i);
    rays_.push_back({origin_, seen[i].direction, seen[i].hit.t + engine_.faces().ray_offset()});
  };
  for (std::size_t i = 0; i < count; ++i) {
    seen[i] = {hits_[i], 1, 0, {x_[i], y_[i], z_[i]}};
    if (passes(i, seen[i], panes)) go_on_from(i);
  }
  for (int crossing = 1; crossing <= kMaximumCrossings && !active_.empty(); ++crossing) {
    hits_.resize(active_.size());
    engine_.rays().intersect(RayScene::What::kAll, rays_, hits_, RayScene::Order::kCoherent);
    before_.swap(active_);
    active_.clear();
    rays_.clear();
    for (std::size_t k = 0; k < before_.size(); ++k) {
      Seen& here = seen[before_[k]];
      here.hit = hits_[k];
      if (passes(before_[k], here, panes)) go_on_from(before_[k]);
    }
  }
  for (const std::size_t i : active_) seen[i].through = 0;  // too many panes: dark
}

std::span<const PixelParts::Part> PixelParts::tell_apart(std::span<const Seen> coarse, std::span<const Seen> finer) {
  names_.clear();
  part_at_.clear();
  for (std::size_t k = 0; k < finer.size(); ++k) {
    const std::int64_t name = name_of(finer[k]);
    const std::size_t part = part_of(name);
    if (part == names_.size()) {
      names_.push_back(name);
      if (parts_.size() < names_.size()) parts_.emplace_back();
      parts_[part].samples.clear();
      parts_[part].places.clear();
    }
    parts_[part].places.push_back(static_cast<int>(k));
    part_at_.push_back(part);
  }
  find_whole_places();
  for (std::size_t k = 0; k < coarse.size(); ++k) {
    const std::size_t part = part_of(name_of(coarse[k]));
    if (part < names_.size()) parts_[part].samples.push_back({&coarse[k], place_in_masks(part, static_cast<int>(k))});
  }
  for (std::size_t part = 0; part < names_.size(); ++part)
    if (parts_[part].samples.empty())
      parts_[part].samples.push_back(
          {&finer[static_cast<std::size_t>(parts_[part].places.front())], place_in_masks(part, 0)});
  return {parts_.data(), names_.size()};
}

std::size_t PixelParts::part_of(std::int64_t name) const {
  return static_cast<std::size_t>(std::find(names_.begin(), names_.end(), name) - names_.begin());
}

// By place of the coarser grid: the part that is all that is seen around it, so that the middle of its square, where
// masks are drawn, sees it too; kNone where there are several.
void PixelParts::find_whole_places() {
  whole_.clear();
  for (int place = 0; place < s_ * s_; ++place) {
    const int first = (place / s_ * kFiner) * kFiner * s_ + place % s_ * kFiner;
    const std::size_t part = part_at_[static_cast<std::size_t>(first)];
    bool is_whole = true;
    for (int j = 0; j < kFiner; ++j)
      for (int i = 0; i < kFiner; ++i) {
        const int sample = first + j * kFiner * s_ + i;
        is_whole &= part_at_[static_cast<std::size_t>(sample)] == part;
      }
    whole_.push_back(is_whole ? part : kNone);
  }
}

// A place in masks that sees a part: the own one, or another.
int PixelParts::place_in_masks(std::size_t part, int own) const {
  if (whole_[static_cast<std::size_t>(own)] == part) return own;
  const auto place = std::find(whole_.begin(), whole_.end(), part);
  return place == whole_.end() ? BeamPoint::kNotInMasks : static_cast<int>(place - whole_.begin());
}

}  // namespace transom
