// What a cache line costs that is not in a core's own cache: the bound of one core on large trees.
//
//     c++ -std=c++20 -O2 benchmarks/lines.cpp -o build/lines && build/lines [MB ...]
//
// Visits all lines of a block in random order: chained, where each line says which one is next, as in a single update;
// and ahead, where the next lines are known and prefetched, as in a sorted batch. Medians of 5, ns a line.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <random>
#include <vector>

namespace {

struct alignas(64) Line {
  std::uint32_t next;
};

template <class Work>
double median_ns(std::size_t lines, Work work) {
  std::vector<double> times;
  for (int i = 0; i < 5; ++i) {
    const auto began = std::chrono::steady_clock::now();
    work();
    times.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - began).count());
  }
  std::sort(times.begin(), times.end());
  return times[2] / static_cast<double>(lines);
}

}  // namespace

int main(int count, char** words) {
  std::vector<double> sizes;
  for (int i = 1; i < count; ++i) sizes.push_back(std::atof(words[i]));
  if (sizes.empty()) sizes = {0.3, 2.7, 27, 270};
  for (double megabytes : sizes) {
    std::vector<Line> block(static_cast<std::size_t>(megabytes * 1e6 / sizeof(Line)));
    std::vector<std::uint32_t> order(block.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), std::mt19937_64(1));
    for (std::size_t i = 0; i < order.size(); ++i) block[order[i]].next = order[(i + 1) % order.size()];
    volatile std::uint64_t sink = 0;
    const double chained = median_ns(block.size(), [&] {
      std::uint32_t at = 0;
      for (std::size_t i = 0; i < block.size(); ++i) at = block[at].next;
      sink = at;
    });
    const double ahead = median_ns(block.size(), [&] {
      constexpr std::size_t LOOKAHEAD = 12;
      std::uint64_t sum = 0;
      for (std::size_t i = 0; i < order.size(); ++i) {
        __builtin_prefetch(&block[order[std::min(i + LOOKAHEAD, order.size() - 1)]]);
        sum += block[order[i]].next;
      }
      sink = sum;
    });
    std::printf("%6.1f MB: chained %6.1f ns, ahead %5.1f ns\n", megabytes, chained, ahead);
  }
}
