// Exact signs of sums of products of doubles: a fixed-point number as wide as the range of exponents.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace dynhull {

// mantissa 2^exponent; the absolute value of the mantissa is 0 or in [0.5, 1).
struct Scaled {
  double mantissa;
  int exponent;
};

// A sum of products of FACTORS doubles each. Every product is an integer times 2^(-1074 FACTORS) and below
// 2^(1024 FACTORS). A limb is 32 bits wide and stored in 64, which leaves room for a sign and
// 2^31 carries; sign() and approximate() propagate them.
template <int FACTORS>
class ExactSum {
 public:
  // Adds a small integer times the product.
  void add(int weight, std::array<double, FACTORS> factors) {
    std::uint32_t product[2 * FACTORS + 1] = {1};
    int position = 0;  // of the product's lowest bit, where bit 0 is 2^(-1074 FACTORS)
    for (int f = 0; f < FACTORS; ++f) {
      const auto bits = std::bit_cast<std::uint64_t>(factors[f]);
      const int exponent = static_cast<int>(bits >> 52) & 0x7ff;
      std::uint64_t mantissa = bits & ((std::uint64_t{1} << 52) - 1);
      if (exponent > 0) {
        mantissa |= std::uint64_t{1} << 52;
        position += exponent - 1;
      }
      if (mantissa == 0) return;
      if (bits >> 63) weight = -weight;
      multiply(product, mantissa);
    }
    std::size_t limb = static_cast<std::size_t>(position) / 32;
    const int shift = position % 32;
    for (std::uint32_t digit : product) {
      const std::uint64_t shifted = std::uint64_t{digit} << shift;
      limbs_[limb] += weight * static_cast<std::int64_t>(shifted & LOW);
      limbs_[++limb] += weight * static_cast<std::int64_t>(shifted >> 32);
    }
  }

  int sign() const {
    std::int64_t carry = 0;
    bool nonzero = false;
    for (std::int64_t limb : limbs_) {
      const std::int64_t value = limb + carry;
      nonzero |= (value & LOW) != 0;
      carry = value >> 32;
    }
    return carry < 0 ? -1 : static_cast<int>(nonzero || carry > 0);
  }

  // The sum within a few units in the last place.
  Scaled approximate() const {
    const int negative = sign() < 0 ? -1 : 1;
    std::uint32_t digits[LIMBS];
    std::int64_t carry = 0;
    for (std::size_t i = 0; i < LIMBS; ++i) {
      const std::int64_t value = negative * limbs_[i] + carry;
      digits[i] = static_cast<std::uint32_t>(value & LOW);
      carry = value >> 32;
    }
    std::size_t top = LIMBS - 1;
    while (top > 2 && digits[top] == 0) --top;
    Scaled result;
    const double value = (digits[top] * 0x1p32 + digits[top - 1]) * 0x1p32 + digits[top - 2];
    result.mantissa = negative * std::frexp(value, &result.exponent);
    result.exponent += 32 * (static_cast<int>(top) - 2) - 1074 * FACTORS;
    return result;
  }

 private:
  static constexpr std::int64_t LOW = 0xffffffff;
  static constexpr std::size_t LIMBS = (2098 * FACTORS) / 32 + 2 * FACTORS + 3;

  static void multiply(std::uint32_t (&product)[2 * FACTORS + 1], std::uint64_t mantissa) {
    const std::uint64_t low = mantissa & LOW, high = mantissa >> 32;
    std::uint64_t carry = 0, previous = 0;
    for (std::uint32_t& digit : product) {
      const std::uint64_t low_part = digit * low;
      const std::uint64_t high_part = previous * high;
      const std::uint64_t sum = (low_part & LOW) + (high_part & LOW) + (carry & LOW);
      carry = (low_part >> 32) + (high_part >> 32) + (carry >> 32) + (sum >> 32);
      previous = digit;
      digit = static_cast<std::uint32_t>(sum);
    }
  }

  std::array<std::int64_t, LIMBS> limbs_{};
};

}  // namespace dynhull
