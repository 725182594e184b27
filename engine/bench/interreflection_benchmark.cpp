// What it costs to find interreflection, by how the operator is held: a dense inverse, sparse sweeps over patches, or
// the engine's own cycles. Patches on the walls of an empty box with 512 sampled rays each, reflectances as in offices.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>

#include "transom/interreflection.h"
#include "transom/sampling.h"

namespace transom {
namespace {

constexpr int kRays = 512;
constexpr double kTolerance = 2.5e-4;
constexpr glm::vec3 kSize{8, 6, 3};

struct Box {
  SparseRows exchange, none;
  std::vector<glm::vec3> reflectance, emitted, direct;
  std::vector<float> areas;
  std::vector<PatchPlace> places;
  std::vector<int> sunlit;

  explicit Box(int wanted) {
    const float edge =
        std::sqrt(2 * (kSize.x * kSize.y + kSize.y * kSize.z + kSize.z * kSize.x) / static_cast<float>(wanted));
    const glm::ivec3 count(glm::ceil(kSize / edge));
    int first[6], total = 0;
    for (int side = 0; side < 6; ++side) {
      first[side] = total;
      const int axis = side / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (int j = 0; j < count[v]; ++j)
        for (int i = 0; i < count[u]; ++i) {
          PatchPlace place;
          place.position[axis] = side % 2 ? kSize[axis] : 0;
          place.position[u] = (static_cast<float>(i) + 0.5f) * kSize[u] / static_cast<float>(count[u]);
          place.position[v] = (static_cast<float>(j) + 0.5f) * kSize[v] / static_cast<float>(count[v]);
          place.normal[axis] = side % 2 ? -1.f : 1.f;
          places.push_back(place);
          areas.push_back(kSize[u] * kSize[v] / static_cast<float>(count[u] * count[v]));
          reflectance.push_back(axis == 2 ? (side % 2 ? glm::vec3(0.8f) : glm::vec3(0.36f, 0.27f, 0.18f))
                                          : glm::vec3(0.64f, 0.62f, 0.58f));
        }
      total += count[u] * count[v];
    }
    emitted.assign(places.size(), glm::vec3(0));
    direct.assign(places.size(), glm::vec3(200));
    for (std::size_t i = 0; i < direct.size(); i += 37) {  // sun
      direct[i] = glm::vec3(30000);
      sunlit.push_back(static_cast<int>(i));
    }
    for (std::size_t i = 0; i < places.size(); ++i) exchange.append(row(i, count, first));
    make_reciprocal(exchange, areas, std::vector<float>(places.size(), 1.f));
    none.begin.assign(places.size() + 1, 0);
  }

  // With the likeness that an even sky's light allows.
  Interreflection prepared() const {
    Interreflection interreflection(exchange, none, reflectance, areas, places);
    std::vector<glm::vec3> irradiance;
    interreflection.solve({emitted, std::vector<glm::vec3>(places.size(), glm::vec3(200))}, 1e-3, 1000, irradiance);
    std::vector<float> smooth;
    for (std::size_t i = 0; i < places.size(); ++i) smooth.push_back(reflectance[i].y * irradiance[i].y);
    interreflection.prepare({&smooth, 1});
    return interreflection;
  }

  std::vector<Share> row(std::size_t i, glm::ivec3 count, const int* first) const {
    const SobolSequence points(hash_seed(1, i));
    const glm::mat3 frame = frame_from_normal(places[i].normal);
    std::vector<Share> shares;
    for (std::uint32_t k = 0; k < kRays; ++k) {
      const glm::vec3 d = frame * sample_cosine_hemisphere(points.point2(k)), p = places[i].position;
      int axis = 0;
      float nearest = 1e30f;
      for (int a = 0; a < 3; ++a) {
        const float t = d[a] > 0 ? (kSize[a] - p[a]) / d[a] : d[a] < 0 ? -p[a] / d[a] : 1e30f;
        if (t > 1e-6f && t < nearest) {
          nearest = t;
          axis = a;
        }
      }
      const int side = 2 * axis + (d[axis] > 0), u = (axis + 1) % 3, v = (axis + 2) % 3;
      const glm::vec3 hit = p + nearest * d;
      const auto cell = [&](int a) {
        return std::clamp(static_cast<int>(hit[a] / kSize[a] * static_cast<float>(count[a])), 0, count[a] - 1);
      };
      shares.push_back({first[side] + cell(v) * count[u] + cell(u), 1.f / kRays});
    }
    merge_shares(shares);
    return shares;
  }
};

void count_patches(benchmark::State& state, const Box& box) {
  state.counters["patches"] = static_cast<double>(box.areas.size());
}

// The engine's cycles, prepared.
void BM_Cycles(benchmark::State& state) {
  const Box box(static_cast<int>(state.range(0)));
  const Interreflection prepared = box.prepared();
  std::vector<glm::vec3> irradiance;
  int cycles = 0;
  for (auto _ : state)
    cycles = prepared.solve({box.emitted, box.direct, false, box.sunlit}, kTolerance, 1000, irradiance);
  state.counters["cycles"] = cycles;
  count_patches(state, box);
}
BENCHMARK(BM_Cycles)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Arg(30000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

// What the engine prepares for them.
void BM_PrepareCycles(benchmark::State& state) {
  const Box box(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(box.prepared().cluster_count());
  count_patches(state, box);
}
BENCHMARK(BM_PrepareCycles)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Arg(30000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->Iterations(3);

// Gauss and Seidel's sweeps over sparse rows until the change is below the tolerance.
void BM_Sweeps(benchmark::State& state) {
  const Box box(static_cast<int>(state.range(0)));
  const std::size_t n = box.areas.size();
  int sweeps = 0;
  for (auto _ : state) {
    std::vector<glm::vec4> radiosity(n);
    for (std::size_t i = 0; i < n; ++i) radiosity[i] = glm::vec4(box.reflectance[i] * box.direct[i], 0);
    double change = 1, total = 0;
    for (sweeps = 0; change > kTolerance * total; ++sweeps) {
      change = total = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const glm::vec3 e = box.direct[i] + glm::vec3(box.exchange.dot(i, radiosity));
        const glm::vec4 next(box.reflectance[i] * e, 0);
        for (int c = 0; c < 3; ++c) {
          change += box.areas[i] * std::abs(next[c] - radiosity[i][c]);
          total += box.areas[i] * next[c];
        }
        radiosity[i] = next;
      }
    }
    benchmark::DoNotOptimize(radiosity.data());
  }
  state.counters["sweeps"] = sweeps;
  count_patches(state, box);
}
BENCHMARK(BM_Sweeps)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Arg(30000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

// The product alone of a dense inverse, or of two factors of a given rank, for one reflectance that serves all
// channels.
void dense_product(benchmark::State& state, std::size_t rows, std::size_t columns, bool and_back) {
  std::vector<float> matrix(rows * columns, 1e-3f);
  std::vector<glm::vec4> in(columns, glm::vec4(1)), out(rows);
  const auto multiply = [&](const std::vector<glm::vec4>& x, std::vector<glm::vec4>& y) {
    const std::size_t width = x.size();
    for (std::size_t i = 0; i < y.size(); ++i) {
      glm::vec4 sum(0);
      for (std::size_t k = 0; k < width; ++k) sum += matrix[i * width + k] * x[k];
      y[i] = sum;
    }
  };
  for (auto _ : state) {
    multiply(in, out);
    if (and_back) multiply(out, in);
    benchmark::DoNotOptimize(out.data());
  }
  state.counters["megabytes"] = static_cast<double>(rows * columns * sizeof(float) * (and_back ? 2 : 1)) / 1e6;
}

void BM_DenseInverse(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  dense_product(state, n, n, false);
}
BENCHMARK(BM_DenseInverse)->Arg(1000)->Arg(3000)->Arg(10000)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

void BM_LowRank(benchmark::State& state) {
  dense_product(state, static_cast<std::size_t>(state.range(0)), 320, true);
}
BENCHMARK(BM_LowRank)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Arg(30000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace transom
