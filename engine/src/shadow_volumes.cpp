/// @file Stencil shadow volumes: depth of what is seen, then for each kind of caster the volume's faces beyond it,
/// counted.
#include "transom/shadow_volumes.h"

#include <glad/gl.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/type_ptr.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "shadow_casters.h"
#include "transom/error.h"
#include "volume_program.h"
#include "volume_projection.h"

namespace transom {

namespace {

/// Volumes are drawn a little farther away than the surfaces, so that a surface stays in front of the sides of its own
/// volume when the sun grazes it: a share of the depth's slope (corners snap to 1/256 pixel) and steps of the depth
/// buffer. More would move shadow edges where a side is seen nearly edge-on, since its slope is steep.
constexpr float kOffsetSlopeShare = 1.0F / 512;
constexpr float kOffsetDepthSteps = 2;

bool is_finite(glm::dvec3 v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void check_camera(const VolumeCamera& camera) {
  if (camera.width < 1 || camera.height < 1 || camera.width > kLargestVolumePicture ||
      camera.height > kLargestVolumePicture) {
    throw InputError("Shadow volumes: a picture of " + std::to_string(camera.width) + " x " +
                     std::to_string(camera.height) + " pixels is outside 1.." + std::to_string(kLargestVolumePicture));
  }
  if (!(camera.vertical_fov_rad > 0 && camera.vertical_fov_rad < std::numbers::pi)) {
    throw InputError("Shadow volumes: a vertical field of view of " + std::to_string(camera.vertical_fov_rad) +
                     " rad is outside 0..pi");
  }
  const glm::dvec3 side = glm::cross(camera.target - camera.position, camera.up);
  if (!is_finite(camera.position) || !is_finite(side) || !(glm::length(side) > 0)) {
    throw InputError("Shadow volumes: the camera's position, target and up do not span a picture");
  }
}

void check_range(const VolumeRange& range, const VolumeCamera& camera) {
  if (range.left < 0 || range.top < 0 || range.left >= range.right || range.top >= range.bottom ||
      range.right > camera.width || range.bottom > camera.height)
    throw InputError("Shadow volumes: the range is empty or reaches beyond the picture");
}

std::size_t pixel_count(const VolumeRange& range) {
  return range.pixel_count();
}

}  // namespace

struct VolumeCasters::Prepared {
  Prepared(std::vector<glm::vec3> points, std::span<const glm::uvec3> triangles, bool are_solids)
      : vertices(std::move(points)),
        casters(vertices, weld_vertices(vertices), triangles,
                are_solids ? CasterCount::kSolidsOnce : CasterCount::kEveryTriangle) {}
  std::vector<glm::vec3> vertices;
  ShadowCasters casters;
};

VolumeCasters::VolumeCasters(std::vector<glm::vec3> vertices, std::span<const glm::uvec3> triangles, bool are_solids)
    : prepared_(std::make_unique<Prepared>(std::move(vertices), triangles, are_solids)) {}
VolumeCasters::~VolumeCasters() = default;
VolumeCasters::VolumeCasters(VolumeCasters&&) noexcept = default;

class ShadowVolumes::Impl {
 public:
  Impl(GlContext& context, std::span<const glm::vec3> vertices, std::span<const glm::uvec3> opaque_triangles,
       std::span<const std::vector<glm::uvec3>> opening_triangles_by_group);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  BeamMask render(const VolumeCamera& camera, glm::dvec3 direction_to_sun, const VolumeRange& range);
  std::vector<std::uint8_t> count(const VolumeCamera& camera, glm::dvec3 direction_to_source,
                                  const std::vector<glm::vec3>& vertices, const ShadowCasters& casters,
                                  const VolumeRange& range);
  int pass_count() const { return pass_count_; }

 private:
  struct Opening {
    ShadowCasters casters;
    std::vector<glm::vec3> corners;
  };

  void create_objects();
  void delete_objects();
  void resize(int width, int height);
  glm::dvec3 begin(const VolumeCamera& camera, glm::dvec3 direction_to_sun, const VolumeRange& range);
  void draw_visible_depth(const VolumeCamera& camera);
  void upload(GLuint array, GLuint buffer, const std::vector<glm::vec3>& vertices, glm::dvec3 sun, GLenum use) const;
  void check_errors();
  bool light_reaches_picture(std::span<const glm::vec3> corners, glm::dvec3 direction_to_sun) const;
  std::vector<std::uint8_t> count_crossings(const VolumeTriangles& volume, const VolumeRange& range);
  std::vector<std::uint8_t> read_stencil(const VolumeRange& range) const;
  void draw(std::size_t first, std::size_t count) const;

  GlContext& context_;
  const GladGLContext& gl_;
  std::vector<glm::vec3> vertices_;
  std::vector<glm::uvec3> opaque_triangles_;
  std::vector<std::uint32_t> welded_;
  std::optional<ShadowCasters> opaque_casters_;
  std::vector<Opening> openings_;

  GLuint program_ = 0, vertex_array_ = 0, vertex_buffer_ = 0, surface_buffer_ = 0, volume_buffer_ = 0;
  GLuint other_array_ = 0, other_buffer_ = 0;  // of casters that are not the scene's
  GLuint framebuffer_ = 0, depth_stencil_ = 0;
  GLint clip_from_world_location_ = -1;

  VolumeCamera camera_;  // whose depth the framebuffer holds; width 0: none yet
  glm::dmat4 clip_from_world_{1};
  int pass_count_ = 0;
};

ShadowVolumes::Impl::Impl(GlContext& context, std::span<const glm::vec3> vertices,
                          std::span<const glm::uvec3> opaque_triangles,
                          std::span<const std::vector<glm::uvec3>> opening_triangles_by_group)
    : context_(context), gl_(context.functions()), vertices_(vertices.begin(), vertices.end()) {
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (!is_finite(vertices[i])) throw InputError("Shadow volumes: vertex " + std::to_string(i) + " is not finite");
  }
  const auto check_indices = [&](std::span<const glm::uvec3> triangles) {
    for (const glm::uvec3& triangle : triangles) {
      const std::uint32_t largest = std::max({triangle.x, triangle.y, triangle.z});
      if (largest >= vertices.size()) {
        throw InputError("Shadow volumes: a triangle names vertex " + std::to_string(largest) + " of " +
                         std::to_string(vertices.size()));
      }
    }
  };
  check_indices(opaque_triangles);
  welded_ = weld_vertices(vertices);
  for (const glm::uvec3& t : opaque_triangles) opaque_triangles_.emplace_back(welded_[t.x], welded_[t.y], welded_[t.z]);
  opaque_casters_.emplace(vertices, welded_, opaque_triangles, CasterCount::kSolidsOnce);
  for (const std::vector<glm::uvec3>& triangles : opening_triangles_by_group) {
    check_indices(triangles);
    Opening opening{ShadowCasters(vertices, welded_, triangles, CasterCount::kEveryTriangle), {}};
    for (const glm::uvec3& t : triangles)
      opening.corners.insert(opening.corners.end(), {vertices[t.x], vertices[t.y], vertices[t.z]});
    openings_.push_back(std::move(opening));
  }
  const GlContext::Scope scope(context_);
  try {
    create_objects();
  } catch (...) {
    delete_objects();
    throw;
  }
}

ShadowVolumes::Impl::~Impl() {
  try {
    const GlContext::Scope scope(context_);
    delete_objects();
  } catch (const GlError&) {
    // The context is busy in another thread, against its rules: its objects go when the context goes.
  }
}

void ShadowVolumes::Impl::create_objects() {
  program_ = link_volume_program(gl_);
  clip_from_world_location_ = gl_.GetUniformLocation(program_, "clip_from_world");

  gl_.GenVertexArrays(1, &other_array_);
  gl_.GenBuffers(1, &other_buffer_);
  gl_.GenVertexArrays(1, &vertex_array_);
  gl_.GenBuffers(1, &vertex_buffer_);
  upload(vertex_array_, vertex_buffer_, vertices_, glm::dvec3(0), GL_STATIC_DRAW);  // the sun is set by each render

  gl_.GenBuffers(1, &surface_buffer_);
  gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, surface_buffer_);
  gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(opaque_triangles_.size() * sizeof(glm::uvec3)),
                 opaque_triangles_.data(), GL_STATIC_DRAW);
  gl_.GenBuffers(1, &volume_buffer_);
  gl_.GenFramebuffers(1, &framebuffer_);
  gl_.GenRenderbuffers(1, &depth_stencil_);
}

// Vertices and, after them, the point at infinity away from the sun.
void ShadowVolumes::Impl::upload(GLuint array, GLuint buffer, const std::vector<glm::vec3>& vertices, glm::dvec3 sun,
                                 GLenum use) const {
  std::vector<glm::vec4> positions;
  positions.reserve(vertices.size() + 1);
  for (const glm::vec3& vertex : vertices) positions.emplace_back(vertex, 1.0F);
  positions.emplace_back(-sun, 0.0F);
  gl_.BindVertexArray(array);
  gl_.BindBuffer(GL_ARRAY_BUFFER, buffer);
  gl_.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(positions.size() * sizeof(glm::vec4)), positions.data(), use);
  gl_.EnableVertexAttribArray(0);
  gl_.VertexAttribPointer(0, 4, GL_FLOAT, GL_FALSE, sizeof(glm::vec4), nullptr);
}

void ShadowVolumes::Impl::delete_objects() {
  gl_.DeleteProgram(program_);
  for (const GLuint array : {vertex_array_, other_array_}) gl_.DeleteVertexArrays(1, &array);
  for (const GLuint buffer : {vertex_buffer_, surface_buffer_, volume_buffer_, other_buffer_})
    gl_.DeleteBuffers(1, &buffer);
  gl_.DeleteFramebuffers(1, &framebuffer_);
  gl_.DeleteRenderbuffers(1, &depth_stencil_);
}

void ShadowVolumes::Impl::resize(int width, int height) {
  GLint largest_side = 0;
  gl_.GetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &largest_side);
  if (std::max(width, height) > largest_side) {
    throw InputError("Shadow volumes: " + context_.name() + " draws up to " + std::to_string(largest_side) +
                     " pixels a side");
  }
  gl_.BindRenderbuffer(GL_RENDERBUFFER, depth_stencil_);
  gl_.RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH24_STENCIL8, width, height);
  gl_.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_STENCIL_ATTACHMENT, GL_RENDERBUFFER, depth_stencil_);
  gl_.DrawBuffer(GL_NONE);
  gl_.ReadBuffer(GL_NONE);
  if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw GlError("Shadow volumes: " + context_.name() + " has no depth (24 bits) with stencil (8 bits)");
  }
}

/// Base pass: depth of the surfaces seen through each pixel's centre. Glass writes none.
void ShadowVolumes::Impl::draw_visible_depth(const VolumeCamera& camera) {
  clip_from_world_ = volume_clip_from_world(camera, vertices_, opaque_triangles_);
  gl_.UniformMatrix4fv(clip_from_world_location_, 1, GL_FALSE, glm::value_ptr(glm::mat4(clip_from_world_)));
  gl_.DepthMask(GL_TRUE);
  gl_.Disable(GL_STENCIL_TEST);
  gl_.Disable(GL_POLYGON_OFFSET_FILL);
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
  gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, surface_buffer_);
  draw(0, 3 * opaque_triangles_.size());
  ++pass_count_;
}

/// False when no visible surface can lie in the light that comes through the opening: the light misses the picture's
/// pyramid, or every surface is on the sun's side of the opening.
bool ShadowVolumes::Impl::light_reaches_picture(std::span<const glm::vec3> corners, glm::dvec3 direction_to_sun) const {
  const glm::dmat4 rows = glm::transpose(clip_from_world_);
  for (const glm::dvec4& plane : {rows[3] + rows[0], rows[3] - rows[0], rows[3] + rows[1], rows[3] - rows[1]}) {
    const bool is_outside = glm::dot(glm::dvec3(plane), -direction_to_sun) <= 0 &&
                            std::all_of(corners.begin(), corners.end(),
                                        [&](glm::vec3 corner) { return glm::dot(plane, glm::dvec4(corner, 1)) < 0; });
    if (is_outside) return false;
  }
  const auto height = [&](std::uint32_t v) { return glm::dot(glm::dvec3(vertices_[v]), direction_to_sun); };
  double top = -std::numeric_limits<double>::infinity();
  for (const glm::vec3& corner : corners) top = std::max(top, glm::dot(glm::dvec3(corner), direction_to_sun));
  return std::any_of(opaque_triangles_.begin(), opaque_triangles_.end(), [&](const glm::uvec3& t) {
    return std::min({height(t.x), height(t.y), height(t.z)}) < top;
  });
}

/// One stencil pass: how many of the volume's casters lie between each visible point and the sun, modulo 256.
///
/// Counted beyond the visible point (z-fail), which stays right with the camera inside a volume: each of the volume's
/// faces that the depth test hides adds one if it is left through (back) and takes one if it is entered through
/// (front). Depth clamp keeps the faces that reach beyond the farthest depth; what is nearer than the nearest surface
/// hides behind none. A cap at the very depth of the visible surface fails the test "less" and so counts as beyond: a
/// lit surface does not shadow itself. [Everitt & Kilgard 2002]
std::vector<std::uint8_t> ShadowVolumes::Impl::count_crossings(const VolumeTriangles& volume,
                                                               const VolumeRange& range) {
  gl_.DepthMask(GL_FALSE);
  gl_.Enable(GL_STENCIL_TEST);
  gl_.Enable(GL_POLYGON_OFFSET_FILL);
  gl_.PolygonOffset(kOffsetSlopeShare, kOffsetDepthSteps);
  gl_.StencilMask(0xFF);
  gl_.StencilFunc(GL_ALWAYS, 0, 0xFF);
  gl_.StencilOpSeparate(GL_FRONT, GL_KEEP, GL_DECR_WRAP, GL_KEEP);
  gl_.StencilOpSeparate(GL_BACK, GL_KEEP, GL_INCR_WRAP, GL_KEEP);
  gl_.Clear(GL_STENCIL_BUFFER_BIT);

  gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, volume_buffer_);
  gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(volume.indices.size() * sizeof(std::uint32_t)),
                 volume.indices.data(), GL_STREAM_DRAW);
  gl_.FrontFace(GL_CW);
  draw(0, volume.clockwise_count);
  gl_.FrontFace(GL_CCW);
  draw(volume.clockwise_count, volume.indices.size() - volume.clockwise_count);
  ++pass_count_;
  return read_stencil(range);
}

std::vector<std::uint8_t> ShadowVolumes::Impl::read_stencil(const VolumeRange& range) const {
  const auto width = static_cast<std::size_t>(range.width()), height = static_cast<std::size_t>(range.height());
  std::vector<std::uint8_t> stencil(width * height);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl_.ReadPixels(range.left, camera_.height - range.bottom, range.width(), range.height(), GL_STENCIL_INDEX,
                 GL_UNSIGNED_BYTE, stencil.data());
  for (std::size_t y = 0; y < height / 2; ++y) {  // OpenGL's first row is the bottom one
    const auto row = [&](std::size_t i) { return stencil.begin() + static_cast<std::ptrdiff_t>(i * width); };
    std::swap_ranges(row(y), row(y + 1), row(height - 1 - y));
  }
  return stencil;
}

void ShadowVolumes::Impl::draw(std::size_t first, std::size_t count) const {
  if (count == 0) return;
  gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(count), GL_UNSIGNED_INT,
                   reinterpret_cast<const void*>(first * sizeof(std::uint32_t)));
}

// Makes the context ready to count, with the depth of what the camera sees; gives the unit direction to the sun.
glm::dvec3 ShadowVolumes::Impl::begin(const VolumeCamera& camera, glm::dvec3 direction_to_sun,
                                      const VolumeRange& range) {
  check_camera(camera);
  check_range(range, camera);
  if (!is_finite(direction_to_sun) || !(glm::length(direction_to_sun) > 0)) {
    throw InputError("Shadow volumes: the direction to the sun is not a direction");
  }
  pass_count_ = 0;
  gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  gl_.Viewport(0, 0, camera.width, camera.height);
  gl_.UseProgram(program_);
  gl_.BindVertexArray(vertex_array_);
  gl_.Disable(GL_SCISSOR_TEST);
  gl_.Enable(GL_DEPTH_TEST);
  gl_.DepthFunc(GL_LESS);
  gl_.Enable(GL_DEPTH_CLAMP);
  gl_.Enable(GL_CLIP_DISTANCE0);
  gl_.Disable(GL_CULL_FACE);
  gl_.FrontFace(GL_CCW);
  if (camera != camera_) {
    const bool is_resized = camera.width != camera_.width || camera.height != camera_.height;
    camera_.width = 0;  // until it has been drawn
    if (is_resized) resize(camera.width, camera.height);
    draw_visible_depth(camera);
    camera_ = camera;
  }
  gl_.Enable(GL_SCISSOR_TEST);
  gl_.Scissor(range.left, camera.height - range.bottom, range.width(), range.height());
  return glm::normalize(direction_to_sun);
}

void ShadowVolumes::Impl::check_errors() {
  const GLenum error = gl_.GetError();
  if (error == GL_NO_ERROR) return;
  camera_.width = 0;
  throw GlError("Shadow volumes: OpenGL error " + std::to_string(error) + " on " + context_.name());
}

std::vector<std::uint8_t> ShadowVolumes::Impl::count(const VolumeCamera& camera, glm::dvec3 direction_to_source,
                                                     const std::vector<glm::vec3>& vertices,
                                                     const ShadowCasters& casters, const VolumeRange& range) {
  const GlContext::Scope scope(context_);
  const glm::dvec3 source = begin(camera, direction_to_source, range);
  const VolumeTriangles volume =
      casters.volume(source, static_cast<std::uint32_t>(vertices.size()), vertices, ShadedPoints(source, range.boxes));
  if (volume.empty() || !light_reaches_picture(vertices, source))
    return std::vector<std::uint8_t>(pixel_count(range), 0);
  upload(other_array_, other_buffer_, vertices, source, GL_STREAM_DRAW);
  std::vector<std::uint8_t> counted = count_crossings(volume, range);
  check_errors();
  return counted;
}

BeamMask ShadowVolumes::Impl::render(const VolumeCamera& camera, glm::dvec3 direction_to_sun,
                                     const VolumeRange& range) {
  const GlContext::Scope scope(context_);
  const glm::dvec3 sun = begin(camera, direction_to_sun, range);
  const glm::vec4 infinity(-sun, 0);
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertex_buffer_);
  gl_.BufferSubData(GL_ARRAY_BUFFER, static_cast<GLintptr>(vertices_.size() * sizeof(glm::vec4)), sizeof(glm::vec4),
                    glm::value_ptr(infinity));

  const ShadedPoints points(sun, range.boxes);
  const auto count = [&](const ShadowCasters& casters) {
    const VolumeTriangles volume = casters.volume(sun, static_cast<std::uint32_t>(vertices_.size()), vertices_, points);
    return volume.empty() ? std::vector<std::uint8_t>(pixel_count(range), 0) : count_crossings(volume, range);
  };
  BeamMask mask{range.width(), range.height(), count(*opaque_casters_), {}};
  for (std::uint8_t& pixel : mask.shadowed) pixel = pixel != 0;
  for (const Opening& opening : openings_) {
    mask.crossings.push_back(light_reaches_picture(opening.corners, sun)
                                 ? count(opening.casters)
                                 : std::vector<std::uint8_t>(pixel_count(range), 0));
  }
  check_errors();
  return mask;
}

ShadowVolumes::ShadowVolumes(GlContext& context, std::span<const glm::vec3> vertices,
                             std::span<const glm::uvec3> opaque_triangles,
                             std::span<const std::vector<glm::uvec3>> opening_triangles_by_group)
    : impl_(std::make_unique<Impl>(context, vertices, opaque_triangles, opening_triangles_by_group)) {}

ShadowVolumes::~ShadowVolumes() = default;

BeamMask ShadowVolumes::render(const VolumeCamera& camera, glm::dvec3 direction_to_sun) {
  check_camera(camera);
  return render(camera, direction_to_sun, {0, 0, camera.width, camera.height, {}});
}

BeamMask ShadowVolumes::render(const VolumeCamera& camera, glm::dvec3 direction_to_sun, const VolumeRange& range) {
  return impl_->render(camera, direction_to_sun, range);
}

std::vector<std::uint8_t> ShadowVolumes::count(const VolumeCamera& camera, glm::dvec3 direction_to_source,
                                               const VolumeCasters& casters, const VolumeRange& range) {
  return impl_->count(camera, direction_to_source, casters.prepared_->vertices, casters.prepared_->casters, range);
}

int ShadowVolumes::pass_count() const {
  return impl_->pass_count();
}

}  // namespace transom
