/// @file Shaders of surfaces and volumes: positions alone, of which some are at infinity.
#include "volume_program.h"

#include <array>
#include <string>
#include <utility>

#include "transom/gl_context.h"

namespace transom {

namespace {

constexpr const char* kVertexShader = R"(#version 330 core
layout(location = 0) in vec4 position;  // w = 0: a direction, the point at infinity
uniform mat4 clip_from_world;
void main() {
  gl_Position = clip_from_world * position;
  // Depth clamp is wanted beyond the farthest depth only. Nearer than the nearest one it would divide by a w of almost
  // nothing, and the depth interpolated across such a triangle is noise.
  gl_ClipDistance[0] = gl_Position.z + gl_Position.w;
}
)";
constexpr const char* kFragmentShader = "#version 330 core\nvoid main() {}\n";

GLuint compile_shader(const GladGLContext& gl, GLenum kind, const char* source) {
  const GLuint shader = gl.CreateShader(kind);
  gl.ShaderSource(shader, 1, &source, nullptr);
  gl.CompileShader(shader);
  GLint compiled = 0;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled) return shader;
  std::array<char, 1024> log{};
  gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
  gl.DeleteShader(shader);
  throw GlError(std::string("Shadow volumes: a shader does not compile: ") + log.data());
}

}  // namespace

GLuint link_volume_program(const GladGLContext& gl) {
  const GLuint program = gl.CreateProgram();
  for (const auto& [kind, source] : {std::pair<GLenum, const char*>{GL_VERTEX_SHADER, kVertexShader},
                                     std::pair<GLenum, const char*>{GL_FRAGMENT_SHADER, kFragmentShader}}) {
    const GLuint shader = compile_shader(gl, kind, source);
    gl.AttachShader(program, shader);
    gl.DeleteShader(shader);
  }
  gl.LinkProgram(program);
  GLint linked = 0;
  gl.GetProgramiv(program, GL_LINK_STATUS, &linked);
  if (!linked) throw GlError("Shadow volumes: the shader program does not link");
  return program;
}

}  // namespace transom
