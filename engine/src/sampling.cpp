#include "transom/sampling.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <utility>
#include <vector>

namespace transom {
namespace {

constexpr int kDimensions = 4;

struct Polynomial {
  int degree;
  std::uint32_t coefficients;
  std::array<std::uint32_t, 3> initial;
};

// Joe & Kuo 2008, "new-joe-kuo-6": dimensions 2 to 4. Dimension 1 is van der Corput's sequence.
constexpr std::array<Polynomial, kDimensions - 1> kPolynomials{Polynomial{1, 0, {1, 0, 0}}, Polynomial{2, 1, {1, 3, 0}},
                                                               Polynomial{3, 1, {1, 3, 1}}};

constexpr auto make_directions() {
  std::array<std::array<std::uint32_t, 32>, kDimensions> directions{};
  for (int bit = 0; bit < 32; ++bit) directions[0][bit] = 1u << (31 - bit);
  for (int d = 1; d < kDimensions; ++d) {
    const Polynomial& p = kPolynomials[d - 1];
    for (int bit = 0; bit < 32; ++bit) {
      if (bit < p.degree) {
        directions[d][bit] = p.initial[bit] << (31 - bit);
        continue;
      }
      std::uint32_t v = directions[d][bit - p.degree];
      v ^= v >> p.degree;
      for (int k = 1; k < p.degree; ++k)
        if ((p.coefficients >> (p.degree - 1 - k)) & 1u) v ^= directions[d][bit - k];
      directions[d][bit] = v;
    }
  }
  return directions;
}

constexpr auto kDirections = make_directions();

std::uint32_t reverse_bits(std::uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Hash that mixes only from low bits to high ones, so that on reversed bits it is an Owen scrambling [Burley 2020].
std::uint32_t owen_scramble(std::uint32_t x, std::uint32_t seed) {
  x = reverse_bits(x);
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return reverse_bits(x);
}

std::uint32_t plain_coordinate(std::uint32_t index, int dimension) {
  std::uint32_t x = 0;
  for (int bit = 0; index != 0; ++bit, index >>= 1)
    if (index & 1u) x ^= kDirections[dimension][bit];
  return x;
}

// The first points without scrambling: most receivers use no more.
constexpr std::uint32_t kTabulated = 4096;
const auto kTable = [] {
  std::array<std::array<std::uint32_t, kDimensions>, kTabulated> table{};
  for (std::uint32_t i = 0; i < kTabulated; ++i)
    for (int d = 0; d < kDimensions; ++d) table[i][d] = plain_coordinate(i, d);
  return table;
}();

std::uint32_t scrambled(std::uint32_t index, int dimension, std::uint32_t seed) {
  const std::uint32_t plain = index < kTabulated ? kTable[index][dimension] : plain_coordinate(index, dimension);
  return owen_scramble(plain, seed);
}

float in_unit_interval(std::uint32_t x) {
  return std::min(static_cast<float>(x) * 0x1p-32f, 0x1.fffffep-1f);
}

float coordinate(std::uint32_t index, int dimension, std::uint32_t seed) {
  return in_unit_interval(scrambled(index, dimension, seed));
}

// Sine and cosine of an angle up to a quarter of pi either way, to the last digit or so, without a branch
// [Moshier 1992, Cephes: sinf, cosf].
void small_sine_and_cosine(float angle, float& sine, float& cosine) {
  const float z = angle * angle;
  sine = ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * angle + angle;
  cosine = ((2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z - 0.5f * z + 1;
}

}  // namespace

double scrambled_coordinate(std::uint32_t index, std::uint32_t seed) {
  const std::uint32_t shuffled = owen_scramble(index, seed);
  return owen_scramble(reverse_bits(shuffled), seed * 0x9e3779b9u + 1) / 4294967296.0;
}

SobolSequence::SobolSequence(std::uint32_t seed) {
  for (std::uint64_t d = 0; d < kDimensions; ++d) seeds_[d] = hash_seed(seed, d);
}

glm::vec2 SobolSequence::point2(std::uint32_t index) const {
  return {coordinate(index, 0, seeds_[0]), coordinate(index, 1, seeds_[1])};
}

glm::vec4 SobolSequence::point4(std::uint32_t index) const {
  return {coordinate(index, 0, seeds_[0]), coordinate(index, 1, seeds_[1]), coordinate(index, 2, seeds_[2]),
          coordinate(index, 3, seeds_[3])};
}

void SobolSequence::points2(const std::uint32_t (&indices)[kPointsAtOnce], float (&x)[kPointsAtOnce],
                            float (&y)[kPointsAtOnce]) const {
  std::uint32_t plain[2][kPointsAtOnce];
  for (std::size_t k = 0; k < kPointsAtOnce; ++k)
    for (int d = 0; d < 2; ++d)
      plain[d][k] = indices[k] < kTabulated ? kTable[indices[k]][d] : plain_coordinate(indices[k], d);
  for (std::size_t k = 0; k < kPointsAtOnce; ++k) x[k] = in_unit_interval(owen_scramble(plain[0][k], seeds_[0]));
  for (std::size_t k = 0; k < kPointsAtOnce; ++k) y[k] = in_unit_interval(owen_scramble(plain[1][k], seeds_[1]));
}

glm::ivec2 SobolSequence::cell2(std::uint32_t index, int bits) const {
  if (bits == 0) return {0, 0};
  return {scrambled(index, 0, seeds_[0]) >> (32 - bits), scrambled(index, 1, seeds_[1]) >> (32 - bits)};
}

int coherent_bits(int count) {
  const std::uint32_t size = std::bit_ceil(static_cast<std::uint32_t>(std::max(count, 1)));
  int bits = 0;  // cells of about sixteen points
  while ((16u << (2 * (bits + 1))) <= size) ++bits;
  return bits;
}

const std::vector<std::uint32_t>& coherent_order(int count) {
  static std::mutex mutex;
  static std::map<std::uint32_t, std::vector<std::uint32_t>> orders;
  const std::lock_guard lock(mutex);
  const std::uint32_t size = std::bit_ceil(static_cast<std::uint32_t>(std::max(count, 1)));
  std::vector<std::uint32_t>& order = orders[size];
  if (!order.empty()) return order;
  const int bits = coherent_bits(count);
  std::vector<std::pair<std::uint64_t, std::uint32_t>> by_cell;
  for (std::uint32_t index = 0; index < size; ++index) {
    std::uint64_t interleaved = 0;
    for (int bit = 1; bit <= bits; ++bit)
      for (const int dimension : {0, 1})
        interleaved = 2 * interleaved + ((plain_coordinate(index, dimension) >> (32 - bit)) & 1u);
    by_cell.push_back({interleaved, index});
  }
  std::sort(by_cell.begin(), by_cell.end());
  for (const auto& [cell, index] : by_cell) order.push_back(index);
  return order;
}

glm::vec2 sample_disc(glm::vec2 u) {
  const glm::vec2 p = 2.f * u - 1.f;
  if (p.x == 0 && p.y == 0) return {0, 0};
  constexpr float kQuarterPi = std::numbers::pi_v<float> / 4;
  if (std::abs(p.x) > std::abs(p.y)) {
    const float phi = kQuarterPi * (p.y / p.x);
    return p.x * glm::vec2(std::cos(phi), std::sin(phi));
  }
  const float phi = kQuarterPi * (p.x / p.y);
  return p.y * glm::vec2(std::sin(phi), std::cos(phi));
}

// All are found, whatever the number of those asked for: one loop of known length, without branches. The disc is that
// of sample_disc.
void sample_hemisphere(const SobolSequence& points, std::span<const std::uint32_t> indices, const glm::mat3& frame,
                       Directions& directions) {
  constexpr float kQuarterPi = std::numbers::pi_v<float> / 4;
  std::uint32_t padded[kPointsAtOnce] = {};
  std::copy(indices.begin(), indices.end(), padded);
  float u[kPointsAtOnce], v[kPointsAtOnce];
  points.points2(padded, u, v);
  for (std::size_t k = 0; k < kPointsAtOnce; ++k) {
    const float px = 2 * u[k] - 1, py = 2 * v[k] - 1;
    const bool is_wide = std::abs(px) > std::abs(py);
    const float longer = is_wide ? px : py, shorter = is_wide ? py : px;
    float sine, cosine;
    small_sine_and_cosine(longer == 0 ? 0.f : kQuarterPi * (shorter / longer), sine, cosine);
    const float x = longer * (is_wide ? cosine : sine), y = longer * (is_wide ? sine : cosine);
    const float z = std::sqrt(std::max(0.f, 1 - x * x - y * y));
    directions.x[k] = frame[0].x * x + frame[1].x * y + frame[2].x * z;
    directions.y[k] = frame[0].y * x + frame[1].y * y + frame[2].y * z;
    directions.z[k] = frame[0].z * x + frame[1].z * y + frame[2].z * z;
  }
}

glm::vec3 sample_cosine_hemisphere(glm::vec2 u) {
  const glm::vec2 d = sample_disc(u);
  return {d, std::sqrt(std::max(0.f, 1 - glm::dot(d, d)))};
}

glm::mat3 frame_from_normal(glm::vec3 n) {
  const float sign = std::copysign(1.f, n.z);
  const float a = -1 / (sign + n.z);
  const float b = n.x * n.y * a;
  return {{1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

glm::vec2 sample_triangle(glm::vec2 u) {
  const float root = std::sqrt(u.x);
  return {root * (1 - u.y), root * u.y};
}

SphericalTriangle::SphericalTriangle(glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) : a_(a), b_(b) {
  const glm::dvec3 ab = glm::cross(a, b), bc = glm::cross(b, c), ca = glm::cross(c, a);
  if (glm::dot(ab, ab) == 0 || glm::dot(bc, bc) == 0 || glm::dot(ca, ca) == 0) return;
  const auto angle = [](glm::dvec3 u, glm::dvec3 v) {
    return std::atan2(glm::length(glm::cross(u, v)), glm::dot(u, v));
  };
  alpha_ = angle(ab, -ca);
  sin_alpha_ = std::sin(alpha_);
  cos_alpha_ = std::cos(alpha_);
  towards_c_ = glm::normalize(c - glm::dot(c, a) * a);
  const double beta = angle(bc, -ab), gamma = angle(ca, -bc);
  solid_angle_ = std::max(0.0, alpha_ + beta + gamma - std::numbers::pi);
  cos_c_ = glm::dot(a, b);
}

glm::dvec3 SphericalTriangle::sample(glm::dvec2 u) const {
  // Sub-triangle with corner a, side towards b, and u.x of the area; then a point on the arc to its third corner.
  const double area = u.x * solid_angle_;
  const double s = std::sin(area - alpha_), t = std::cos(area - alpha_);
  const double p = t - cos_alpha_, q = s + sin_alpha_ * cos_c_;
  const double denominator = (q * s + p * t) * sin_alpha_;
  const double k = denominator == 0 ? 1.0 : std::clamp(((q * t - p * s) * cos_alpha_ - q) / denominator, -1.0, 1.0);
  const glm::dvec3 third = k * a_ + std::sqrt(1 - k * k) * towards_c_;
  const double z = 1 - u.y * (1 - glm::dot(third, b_));
  const glm::dvec3 across = third - glm::dot(third, b_) * b_;
  const double length = glm::length(across);
  if (length == 0) return b_;
  return z * b_ + std::sqrt(std::max(0.0, 1 - z * z)) / length * across;
}

}  // namespace transom
