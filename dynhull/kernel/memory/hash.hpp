// Seeded hashes of keys and places. Nobody outside can choose keys that collide, because the seeds differ from process
// to process. There is one on each side of a product: who knows one side can make it zero, whatever is on the other.
//
// The mixing step, a product of 128 bits folded to 64, and the way to read short strings are those of wyhash (Wang Yi
// 2019).
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <random>
#include <string_view>

#if defined(_MSC_VER)
#include <intrin.h>
#endif

#include "../predicates/point.hpp"

namespace dynhull {

inline std::uint64_t folded_product(std::uint64_t a, std::uint64_t b) {
#if defined(__SIZEOF_INT128__)
  __extension__ using Wide = unsigned __int128;
  const Wide product = static_cast<Wide>(a) * b;
  return static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64);
#elif defined(_MSC_VER)
  return (a * b) ^ __umulh(a, b);
#else
#error "a 64-bit compiler is needed"
#endif
}

class Hash {
 public:
  static std::uint32_t of(std::uint64_t key) { return shortened(folded_product(key ^ seeds_[0], seeds_[1])); }

  static std::uint32_t of(Point place) {
    const auto x = std::bit_cast<std::uint64_t>(place.x), y = std::bit_cast<std::uint64_t>(place.y);
    return shortened(folded_product(x ^ seeds_[0], std::rotl(y, 32) ^ seeds_[1]));
  }

  static std::uint32_t of(std::string_view key) {
    const char* data = key.data();
    const std::size_t size = key.size();
    std::uint64_t state = seeds_[0];
    for (std::size_t rest = size; rest > 16; rest -= 16, data += 16)
      state = folded_product(eight(data) ^ seeds_[2], eight(data + 8) ^ state);
    const char* const end = key.data() + size;
    std::uint64_t a = 0, b = 0;
    if (size >= 16) {
      a = eight(end - 16);
      b = eight(end - 8);
    } else if (size >= 8) {
      a = eight(data);
      b = eight(end - 8);
    } else if (size >= 4) {
      a = four(data);
      b = four(end - 4);
    } else if (size > 0) {
      a = byte(data) << 16 | byte(data + size / 2) << 8 | byte(end - 1);
    }
    return shortened(folded_product(a ^ seeds_[1] ^ size, b ^ state));
  }

 private:
  using Seeds = std::array<std::uint64_t, 3>;

  static std::uint64_t eight(const char* data) {
    std::uint64_t value;
    std::memcpy(&value, data, sizeof value);
    return value;
  }
  static std::uint64_t four(const char* data) {
    std::uint32_t value;
    std::memcpy(&value, data, sizeof value);
    return value;
  }
  static std::uint64_t byte(const char* data) { return static_cast<unsigned char>(*data); }

  static std::uint32_t shortened(std::uint64_t hash) { return static_cast<std::uint32_t>(hash ^ (hash >> 32)); }

#ifdef DYNHULL_HASH_SEED
  // The fuzzer's, so that a life can be lived again.
  static constexpr Seeds seeds_ = {DYNHULL_HASH_SEED, 0xa0761d6478bd642f, 0xe7037ed1a0b428db};
#else
  static Seeds random_seeds() {
    std::random_device entropy;
    Seeds seeds;
    for (std::uint64_t& seed : seeds) seed = std::uint64_t{entropy()} << 32 | entropy() | 1;
    return seeds;
  }
  static inline const Seeds seeds_ = random_seeds();
#endif
};

// For the tables of the standard library, whose own hash has a seed that everybody knows.
struct HashOfKey {
  std::size_t operator()(std::string_view key) const { return Hash::of(key); }
};

}  // namespace dynhull
