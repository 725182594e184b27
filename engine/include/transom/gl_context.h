/// @file An OpenGL context without a screen, found at run time: nothing of OpenGL is needed to build the engine.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

struct GladGLContext;  // the loaded functions of one context: engine/src/gl/glad/gl.h

namespace transom {

/// Which library draws without a screen.
enum class GlBackend {
  kAuto,    ///< OSMesa, else EGL
  kOsmesa,  ///< libOSMesa: Mesa's software renderer alone. Gone from Mesa 25.1 on.
  kEgl,     ///< libEGL with the surfaceless platform: whatever driver the machine has, software included
};

/// OpenGL cannot be had, or failed. The text lists what was tried and what each attempt met.
class GlError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An OpenGL 3.3 core context (or later) that draws into framebuffer objects only.
///
/// Any thread may use it, but one at a time: bind it with a Scope, which also makes it current in the calling thread.
/// The back end's library stays loaded until the process ends: Mesa does not survive being unloaded.
class GlContext {
 public:
  using Backend = GlBackend;

  /// Throws GlError when no back end of the kind asked for gives a context.
  explicit GlContext(Backend backend = Backend::kAuto);
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  /// Back end, OpenGL version and renderer, for people: "OSMesa (libOSMesa.so.8), 4.5 (Core Profile) Mesa ..., llvmpipe
  /// ...".
  const std::string& name() const { return name_; }
  Backend backend() const { return backend_; }

  /// The functions of this context. Call them only inside a Scope.
  const GladGLContext& functions() const { return *functions_; }

  /// Makes the context current in this thread for as long as the scope lives.
  class Scope {
   public:
    explicit Scope(const GlContext& context);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    const GlContext& context_;
  };

  /// One back end's context, unbound; implemented once for each library.
  class Platform;

 private:
  std::unique_ptr<Platform> platform_;
  std::unique_ptr<GladGLContext> functions_;
  Backend backend_ = Backend::kAuto;
  std::string name_;
};

}  // namespace transom
