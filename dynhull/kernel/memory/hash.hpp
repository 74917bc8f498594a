// Seeded hashes of keys and places. Nobody outside can choose keys that collide, because the seed differs from process
// to process.
//
// The mixing step, a product of 128 bits folded to 64, and the way to read short strings are those of wyhash (Wang Yi
// 2019).
#pragma once

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
  static std::uint32_t of(std::uint64_t key) { return shortened(folded_product(key ^ seed_, ODD[0])); }

  static std::uint32_t of(Point place) {
    const auto x = std::bit_cast<std::uint64_t>(place.x), y = std::bit_cast<std::uint64_t>(place.y);
    return shortened(folded_product(x ^ seed_, std::rotl(y, 32) ^ ODD[0]));
  }

  static std::uint32_t of(std::string_view key) {
    const char* data = key.data();
    const std::size_t size = key.size();
    std::uint64_t state = seed_;
    for (std::size_t rest = size; rest > 16; rest -= 16, data += 16)
      state = folded_product(eight(data) ^ ODD[1], eight(data + 8) ^ state);
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
    return shortened(folded_product(a ^ ODD[0] ^ size, b ^ state));
  }

 private:
  static constexpr std::uint64_t ODD[] = {0xa0761d6478bd642f, 0xe7037ed1a0b428db};

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
  static constexpr std::uint64_t seed_ = DYNHULL_HASH_SEED;  // the fuzzer's, so that a life can be lived again
#else
  static std::uint64_t random_seed() {
    std::random_device entropy;
    return std::uint64_t{entropy()} << 32 | entropy();
  }
  static inline const std::uint64_t seed_ = random_seed();
#endif
};

}  // namespace dynhull
