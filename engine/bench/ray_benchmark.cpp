// How many rays a second this machine can trace at best: Embree alone, sixteen rays at a time, in a furnished room.
// The engine's ray phases are set against it (harness/transom/machine_limits.py).
#include <benchmark/benchmark.h>
#if TRANSOM_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

namespace {

constexpr int kFurniture = 80;     // boxes of twelve triangles: about as many triangles as the offices have
constexpr int kPackets = 1 << 12;  // of sixteen rays, traced again and again

// A stream of numbers in [0, 1)  [Knuth's MMIX generator].
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  float next() {
    state_ = state_ * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<float>(state_ >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_;
};

struct Box {
  float low[3], high[3];
};

// A room of 8 x 6 x 3 m with boxes on its floor.
std::vector<Box> furnished_room() {
  std::vector<Box> boxes{{{0, 0, 0}, {8, 6, 3}}};
  Random random(1);
  for (int i = 0; i < kFurniture; ++i) {
    const float x = 7 * random.next(), y = 5 * random.next();
    boxes.push_back({{x, y, 0}, {x + 0.1f + random.next(), y + 0.1f + random.next(), 0.2f + 1.5f * random.next()}});
  }
  return boxes;
}

class RayTracer {
 public:
  RayTracer() : device_(rtcNewDevice(nullptr)), scene_(rtcNewScene(device_)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    for (const Box& box : furnished_room()) add(box);
    rtcCommitScene(scene_);
  }
  ~RayTracer() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  RayTracer(const RayTracer&) = delete;
  RayTracer& operator=(const RayTracer&) = delete;

  void intersect(RTCRayHit16& rays) const {
    alignas(64) static constexpr int kAll[16] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
#if TRANSOM_EMBREE_MAJOR >= 4
    rtcIntersect16(kAll, scene_, &rays, nullptr);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect16(kAll, scene_, &context, &rays);
#endif
  }

 private:
  void add(const Box& box) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 8));
    for (int corner = 0; corner < 8; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        vertices[3 * corner + axis] = (corner >> axis) & 1 ? box.high[axis] : box.low[axis];
    auto* indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), 12));
    constexpr unsigned kSides[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1},
                                       {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    for (int side = 0; side < 6; ++side)
      for (int half = 0; half < 2; ++half) {
        indices[6 * side + 3 * half] = kSides[side][0];
        indices[6 * side + 3 * half + 1] = kSides[side][1 + half];
        indices[6 * side + 3 * half + 2] = kSides[side][2 + half];
      }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }

  RTCDevice device_;
  RTCScene scene_;
};

// Packets of rays from one point each into its upper hemisphere, by the cosine: what form factors ask for.
std::vector<RTCRayHit16> hemisphere_packets(std::uint64_t seed) {
  std::vector<RTCRayHit16> packets(kPackets);
  Random random(seed);
  for (RTCRayHit16& packet : packets) {
    const float x = 8 * random.next(), y = 6 * random.next(), z = 2 * random.next() + 0.01f;
    for (int lane = 0; lane < 16; ++lane) {
      const float share = random.next(), azimuth = 2 * std::numbers::pi_v<float> * random.next();
      const float radius = std::sqrt(share);
      packet.ray.org_x[lane] = x;
      packet.ray.org_y[lane] = y;
      packet.ray.org_z[lane] = z;
      packet.ray.dir_x[lane] = radius * std::cos(azimuth);
      packet.ray.dir_y[lane] = radius * std::sin(azimuth);
      packet.ray.dir_z[lane] = std::sqrt(1 - share);
      packet.ray.tnear[lane] = 1e-4f;
      packet.ray.time[lane] = 0;
      packet.ray.mask[lane] = ~0u;
      packet.ray.flags[lane] = 0;
    }
  }
  return packets;
}

void hemisphere_rays(benchmark::State& state) {
  static const RayTracer tracer;
  std::vector<RTCRayHit16> packets = hemisphere_packets(static_cast<std::uint64_t>(state.thread_index()) + 1);
  for (auto _ : state) {
    for (RTCRayHit16& packet : packets) {
      for (int lane = 0; lane < 16; ++lane) {
        packet.ray.tfar[lane] = std::numeric_limits<float>::infinity();
        packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
        packet.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
      }
      tracer.intersect(packet);
    }
    benchmark::DoNotOptimize(packets.data());
  }
  state.SetItemsProcessed(state.iterations() * kPackets * 16);
}
BENCHMARK(hemisphere_rays)->UseRealTime()->ThreadPerCpu()->MinTime(0.3);

}  // namespace
