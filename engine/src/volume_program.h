/// @file The shader program that draws the depth of surfaces and shadow volumes.
#pragma once

#include <glad/gl.h>

namespace transom {

/// A program that puts vertices at `clip_from_world` times themselves and colours nothing. Throws GlError if OpenGL
/// does not take it.
GLuint link_volume_program(const GladGLContext& gl);

}  // namespace transom
