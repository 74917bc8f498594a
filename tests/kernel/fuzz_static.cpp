// Random inputs for the static hulls under AddressSanitizer and UndefinedBehaviorSanitizer.
//
//     fuzz_static [--seconds S] [seed ...]
//
// Without seeds, random ones until the time is up. Every hull, with the filter and two threads on and off, and Chan's,
// must equal that of a std::set and a monotone chain. Some allocations fail on purpose.
#include <atomic>
#include <cstdlib>
#include <random>
#include <set>

#include "../../dynhull/kernel/static/chan.hpp"
#include "../../dynhull/kernel/static/static_hull.hpp"
#include "fuzz_lives.hpp"

namespace {

std::atomic<long> allocations_left = -1;  // until one fails; negative: none does

[[gnu::noinline]] void* allocate(std::size_t size) {
  const bool fails = allocations_left >= 0 && allocations_left-- == 0;
  void* memory = fails ? nullptr : std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

[[gnu::noinline]] void* operator new(std::size_t size) { return allocate(size); }
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept try {
  return allocate(size);
} catch (const std::bad_alloc&) {
  return nullptr;
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

using namespace dynhull;

using Vertices = std::vector<Point>;

void require(bool holds, const char* message) {
  if (!holds) throw std::logic_error(message);
}

Vertices expected_of(const Vertices& points) {
  const std::set<Point> distinct(points.begin(), points.end());
  Vertices memory(2 * distinct.size());
  Chain lower(memory.data()), upper(memory.data() + distinct.size());
  for (auto p = distinct.begin(); p != distinct.end(); ++p) lower.push({p->x + 0.0, p->y + 0.0});
  for (auto p = distinct.rbegin(); p != distinct.rend(); ++p) upper.push({p->x + 0.0, p->y + 0.0});
  Vertices vertices(lower.begin(), lower.end());
  if (vertices.size() > 1) vertices.insert(vertices.end(), upper.begin() + 1, upper.end() - 1);
  return vertices;
}

bool same(const Vertices& p, const Vertices& q) {
  return p.size() == q.size() && (p.empty() || std::memcmp(p.data(), q.data(), p.size() * sizeof(Point)) == 0);
}

class Input {
 public:
  explicit Input(std::uint64_t seed) : random_(seed), kind_(below(9)), spread_(std::exp2(below(40))) {}

  void run() {
    const std::size_t count = below(4) == 0 ? below(6000) : below(60);
    Vertices points(count);
    for (Point& p : points) p = count > 0 && below(16) == 0 ? points[below(count)] : point();
    if (below(8) == 0) std::sort(points.begin(), points.end());
    const Vertices expected = expected_of(points);
    for (int choice = 0; choice < 4; ++choice) {
      const StaticOptions options = {choice % 2 == 1, choice / 2 == 1};
      with_failures([&] {
        const StaticHull hull = static_hull(points.data(), count, options);
        const Vertices vertices(hull.vertices().begin(), hull.vertices().end());
        require(hull.finite() && same(vertices, expected), "a static hull is wrong");
      });
    }
    for (Point& p : points) p = {p.x + 0.0, p.y + 0.0};
    with_failures([&] {
      const Chan chan(points.data(), count);
      require(same(chan.vertices, expected), "Chan's hull is wrong");
      std::uint64_t guess = 2;
      for (const Chan::Round& round : chan.rounds) {
        require(round.guess == guess && round.groups == (count + guess - 1) / guess, "a round is another");
        require(round.closed == (expected.size() <= guess), "a round closed too late or too early");
        require(round.steps == std::min<std::uint64_t>(expected.size(), guess), "a round took other steps");
        guess *= guess;
      }
      require((count == 0) == chan.rounds.empty() && (count == 0 || chan.rounds.back().closed), "rounds are missing");
    });
    if (count == 0) return;
    static const double NOT_FINITE[] = {NAN, INFINITY, -INFINITY};
    (below(2) == 0 ? points[below(count)].x : points[below(count)].y) = NOT_FINITE[below(3)];
    for (int choice = 0; choice < 4; ++choice) {
      const StaticOptions options = {choice % 2 == 1, choice / 2 == 1};
      require(!static_hull(points.data(), count, options).finite(), "a coordinate that is not finite was not found");
    }
  }

 private:
  std::uint64_t below(std::uint64_t n) { return random_() % n; }
  double unit() { return static_cast<double>(random_()) * 0x1p-64; }

  double coordinate() {
    static const double EXTREME[] = {0.0,    -0.0,    5e-324,  -5e-324, 1e-323, 2.2250738585072014e-308,
                                     1e-160, -1e-160, 1.0,     -3.0,    9e15,   1e160,
                                     -1e160, 1.7e308, -1.7e308};
    switch (kind_) {
      case 0: return static_cast<double>(below(4));
      case 1: return static_cast<double>(below(40)) - 20;
      case 2: return 0.5 + static_cast<double>(below(9)) * 0x1p-53;
      case 3: return EXTREME[below(std::size(EXTREME))];
      case 4: {
        const std::uint64_t bits = random_();
        double value;
        std::memcpy(&value, &bits, sizeof value);
        return std::isfinite(value) ? value : -0.0;
      }
      case 5: return 0.85e308 * (static_cast<double>(below(3)) - 1 + unit() / spread_);  // clusters, as wide as can be
      default: return 5 + unit() / spread_;
    }
  }

  Point point() {
    if (kind_ == 7) {  // near a circle
      const double angle = 8 * unit();
      return {std::cos(angle), std::sin(angle)};
    }
    if (kind_ == 8) {  // near a line
      const double x = unit();
      return {x, 3 * x + static_cast<double>(below(3)) * 0x1p-52};
    }
    const double x = coordinate();
    return {x, coordinate()};
  }

  // Sometimes with too little memory at first.
  template <class Action>
  void with_failures(Action action) {
    if (below(4) == 0) {
      allocations_left = static_cast<long>(below(20));
      try {
        action();
      } catch (const std::bad_alloc&) {
      }
      allocations_left = -1;
    }
    action();
  }

  std::mt19937_64 random_;
  std::uint64_t kind_;
  double spread_;
};

}  // namespace

int main(int count, char** words) {
  return fuzz_lives(count, words, "inputs", [](std::uint64_t seed) { Input(seed).run(); });
}
