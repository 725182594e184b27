/// @file OSMesa and EGL, opened by name at run time. Their few constants and functions are declared here, so that
/// neither headers nor libraries of OpenGL are needed to build. [OSMesa: GL/osmesa.h; EGL 1.4, EGL_EXT_platform_base,
/// EGL_MESA_platform_surfaceless, EGL_KHR_create_context]
#include "transom/gl_context.h"

#include <dlfcn.h>
#include <glad/gl.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <span>

namespace transom {

class GlContext::Platform {
 public:
  virtual ~Platform() = default;
  /// Binds the context to the calling thread, or (false) leaves the thread without one. False when the library refuses.
  virtual bool make_current(bool current) = 0;
  virtual GLADapiproc function(const char* name) = 0;
  virtual std::string name() const = 0;
};

namespace {

constexpr int kMajorVersion = 3;
constexpr int kMinorVersion = 3;

struct Library {
  void* handle = nullptr;
  std::string name;
};

/// The first of the libraries that loads. Never unloaded, see GlContext. Throws GlError with the loader's words.
Library open_library(std::span<const char* const> names) {
  std::string failures;
  for (const char* name : names) {
    if (void* handle = dlopen(name, RTLD_NOW | RTLD_LOCAL)) return {handle, name};
    const char* reason = dlerror();
    failures += (failures.empty() ? "" : "; ") + std::string(reason ? reason : name);
  }
  throw GlError(failures);
}

template <typename Function>
Function* symbol(const Library& library, const char* name) {
  if (void* address = dlsym(library.handle, name)) return reinterpret_cast<Function*>(address);
  throw GlError(library.name + " has no " + name);
}

std::string hexadecimal(int number) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "0x%X", static_cast<unsigned>(number));
  return text.data();
}

/// Mesa's off-screen library: the context draws into memory that we own; here a token buffer, since all drawing goes to
/// framebuffer objects.
class OsmesaPlatform final : public GlContext::Platform {
 public:
  OsmesaPlatform()
      : library_(open_library(kLibraries)),
        make_current_(symbol<MakeCurrent>(library_, "OSMesaMakeCurrent")),
        destroy_(symbol<Destroy>(library_, "OSMesaDestroyContext")),
        function_(symbol<GetProcAddress>(library_, "OSMesaGetProcAddress")) {
    constexpr int kFormat = 0x22, kRgba = 0x1908, kProfile = 0x33, kCoreProfile = 0x34, kMajor = 0x36, kMinor = 0x37;
    constexpr std::array attributes{kFormat, kRgba,         kProfile, kCoreProfile, kMajor, kMajorVersion,
                                    kMinor,  kMinorVersion, 0};
    context_ = symbol<Create>(library_, "OSMesaCreateContextAttribs")(attributes.data(), nullptr);
    if (!context_) throw GlError(library_.name + " gave no OpenGL 3.3 core context");
  }
  ~OsmesaPlatform() override { destroy_(context_); }
  OsmesaPlatform(const OsmesaPlatform&) = delete;
  OsmesaPlatform& operator=(const OsmesaPlatform&) = delete;

  bool make_current(bool current) override {
    if (!current) return make_current_(nullptr, nullptr, 0, 0, 0) != 0;
    return make_current_(context_, buffer_.data(), GL_UNSIGNED_BYTE, kBufferSide, kBufferSide) != 0;
  }
  GLADapiproc function(const char* name) override { return function_(name); }
  std::string name() const override { return "OSMesa (" + library_.name + ")"; }

 private:
  using Create = void*(const int*, void*);
  using MakeCurrent = unsigned char(void*, void*, unsigned, int, int);
  using Destroy = void(void*);
  using GetProcAddress = GLADapiproc(const char*);
  static constexpr std::array kLibraries{"libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"};
  static constexpr int kBufferSide = 16;

  Library library_;
  MakeCurrent* make_current_;
  Destroy* destroy_;
  GetProcAddress* function_;
  void* context_ = nullptr;
  std::array<std::uint8_t, std::size_t{4} * kBufferSide * kBufferSide> buffer_{};
};

/// EGL on Mesa's surfaceless platform: no window system, no device file, no surface.
class EglPlatform final : public GlContext::Platform {
 public:
  EglPlatform()
      : library_(open_library(kLibraries)),
        bind_api_(symbol<BindApi>(library_, "eglBindAPI")),
        make_current_(symbol<MakeCurrent>(library_, "eglMakeCurrent")),
        destroy_(symbol<Destroy>(library_, "eglDestroyContext")),
        function_(symbol<GetProcAddress>(library_, "eglGetProcAddress")) {
    constexpr unsigned kPlatformSurfaceless = 0x31DD;
    const auto get_display = reinterpret_cast<GetDisplay*>(function_("eglGetPlatformDisplayEXT"));
    if (!get_display) throw GlError(library_.name + " has no eglGetPlatformDisplayEXT");
    display_ = get_display(kPlatformSurfaceless, nullptr, nullptr);
    if (!display_) fail("eglGetPlatformDisplayEXT(surfaceless)");
    if (!symbol<Initialize>(library_, "eglInitialize")(display_, nullptr, nullptr)) fail("eglInitialize");
    if (!bind_api_(kOpenGlApi)) fail("eglBindAPI(OpenGL)");

    constexpr int kSurfaceType = 0x3033, kRenderableType = 0x3040, kOpenGlBit = 0x8, kNone = 0x3038;
    constexpr std::array config_attributes{kSurfaceType, 0, kRenderableType, kOpenGlBit, kNone};
    void* config = nullptr;
    int config_count = 0;
    if (!symbol<ChooseConfig>(library_, "eglChooseConfig")(display_, config_attributes.data(), &config, 1,
                                                           &config_count) ||
        config_count == 0) {
      fail("eglChooseConfig(OpenGL)");
    }
    constexpr int kMajor = 0x3098, kMinor = 0x30FB, kProfileMask = 0x30FD, kCoreProfile = 0x1;
    constexpr std::array context_attributes{kMajor,       kMajorVersion, kMinor, kMinorVersion,
                                            kProfileMask, kCoreProfile,  kNone};
    context_ = symbol<Create>(library_, "eglCreateContext")(display_, config, nullptr, context_attributes.data());
    if (!context_) fail("eglCreateContext(OpenGL 3.3 core)");
  }
  // The display is the process's, shared by all contexts: it is not terminated.
  ~EglPlatform() override { destroy_(display_, context_); }
  EglPlatform(const EglPlatform&) = delete;
  EglPlatform& operator=(const EglPlatform&) = delete;

  bool make_current(bool current) override {
    // Which API a thread speaks is the thread's own state, and releasing concerns that API only.
    return bind_api_(kOpenGlApi) && make_current_(display_, nullptr, nullptr, current ? context_ : nullptr);
  }
  GLADapiproc function(const char* name) override { return function_(name); }
  std::string name() const override { return "EGL surfaceless (" + library_.name + ")"; }

 private:
  using GetDisplay = void*(unsigned, void*, const int*);
  using Initialize = unsigned(void*, int*, int*);
  using BindApi = unsigned(unsigned);
  using ChooseConfig = unsigned(void*, const int*, void**, int, int*);
  using Create = void*(void*, void*, void*, const int*);
  using MakeCurrent = unsigned(void*, void*, void*, void*);
  using Destroy = unsigned(void*, void*);
  using GetProcAddress = GLADapiproc(const char*);
  static constexpr std::array kLibraries{"libEGL.so.1"};
  static constexpr unsigned kOpenGlApi = 0x30A2;

  [[noreturn]] void fail(const std::string& step) const {
    throw GlError(library_.name + ": " + step + " failed, EGL error " +
                  hexadecimal(symbol<int()>(library_, "eglGetError")()));
  }

  Library library_;
  BindApi* bind_api_;
  MakeCurrent* make_current_;
  Destroy* destroy_;
  GetProcAddress* function_;
  void* display_ = nullptr;
  void* context_ = nullptr;
};

GLADapiproc load_function(void* platform, const char* name) {
  return static_cast<GlContext::Platform*>(platform)->function(name);
}

std::string text_of(const GladGLContext& gl, GLenum what) {
  const GLubyte* text = gl.GetString(what);
  return text ? reinterpret_cast<const char*>(text) : "unknown";
}

}  // namespace

GlContext::GlContext(Backend backend) : functions_(std::make_unique<GladGLContext>()) {
  std::string failures;
  const auto attempt = [&]<typename Candidate>(Backend kind, const char* label) {
    if (platform_ || (backend != Backend::kAuto && backend != kind)) return;
    try {
      platform_ = std::make_unique<Candidate>();
      const Scope scope(*this);
      if (!gladLoadGLContextUserPtr(functions_.get(), load_function, platform_.get()) || !functions_->VERSION_3_3) {
        throw GlError("the context lacks OpenGL 3.3");
      }
      backend_ = kind;
      name_ =
          platform_->name() + ", OpenGL " + text_of(*functions_, GL_VERSION) + ", " + text_of(*functions_, GL_RENDERER);
    } catch (const GlError& error) {
      platform_.reset();
      failures += std::string("\n  ") + label + ": " + error.what();
    }
  };
  attempt.operator()<OsmesaPlatform>(Backend::kOsmesa, "OSMesa");
  attempt.operator()<EglPlatform>(Backend::kEgl, "EGL surfaceless");
  if (!platform_) {
    throw GlError("No OpenGL 3.3 core context without a screen. Tried:" + failures +
                  "\nInstall libOSMesa (Debian 12: libosmesa6) or Mesa's EGL (libegl1 and libgl1-mesa-dri), "
                  "or use shadow rays instead of shadow volumes.");
  }
}

GlContext::~GlContext() = default;

GlContext::Scope::Scope(const GlContext& context) : context_(context) {
  if (!context_.platform_->make_current(true)) {
    throw GlError(context_.platform_->name() + ": the context cannot be made current; is another thread using it?");
  }
}

GlContext::Scope::~Scope() {
  context_.platform_->make_current(false);
}

}  // namespace transom
