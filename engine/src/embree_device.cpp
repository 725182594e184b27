#include "embree_device.h"

#include <stdexcept>
#include <string>

namespace transom {
namespace {

void report_error(void*, RTCError code, const char* text) {
  throw std::runtime_error("Embree error " + std::to_string(static_cast<int>(code)) + ": " + (text ? text : ""));
}

}  // namespace

RTCDevice shared_device() {
  static const RTCDevice device = [] {
    RTCDevice made = rtcNewDevice(nullptr);
    if (!made) throw std::runtime_error("Embree cannot start: rtcNewDevice failed");
    rtcSetDeviceErrorFunction(made, report_error, nullptr);
    return made;
  }();
  return device;
}

}  // namespace transom
