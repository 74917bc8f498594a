// Random lives of windows and wheels under AddressSanitizer and UndefinedBehaviorSanitizer.
//
//     fuzz_window [--seconds S] [seed ...]
//
// Without seeds, random ones until the time is up. A window is checked against a vector that is searched from one end
// to the other; some allocations fail on purpose: then tree and window have to be as they were. A wheel holds numbers
// of slots whose times grow meanwhile, as a window of keys does.
#include <random>

#include "../../dynhull/kernel/check.hpp"
#include "../../dynhull/kernel/window/expiry.hpp"
#include "failing_allocations.hpp"
#include "fuzz_lives.hpp"

namespace fuzz_windows {

using namespace dynhull;

void require(bool holds, const char* message) {
  if (!holds) throw std::logic_error(message);
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}
  std::uint64_t below(std::uint64_t n) { return n > 0 ? bits_() % n : 0; }

 private:
  std::mt19937_64 bits_;
};

class WindowLife {
 public:
  explicit WindowLife(std::uint64_t seed)
      : random_(seed),
        spread_(random_.below(4)),
        max_age_(random_.below(4) == 0 ? INFINITE : static_cast<double>(1 + random_.below(300)) * step()),
        max_points_(max_age_ == INFINITE || random_.below(2) == 0 ? 1 + random_.below(400) : Expiry::ANY_NUMBER),
        expiry_(max_age_, max_points_) {}

  void live() {
    const std::uint64_t steps = 10 + random_.below(60);
    for (std::uint64_t step = 0; step < steps; ++step) {
      switch (random_.below(8)) {
        case 0: advance(); break;
        case 1: remove(); break;
        case 2: remove_many(); break;
        case 3: random_.below(20) == 0 ? clear() : copy(); break;
        case 4: expire_until(); break;
        default: add(random_.below(random_.below(4) == 0 ? 600 : 40)); break;
      }
      check();
    }
  }

 private:
  // Whole numbers, close to each other, subnormal, or far apart.
  double step() const {
    constexpr double STEPS[] = {1, 0x1p-52, 5e-324, 1e303};
    return STEPS[spread_];
  }

  double time() {
    const double base = spread_ == 1 ? 1 : 0;
    const std::uint64_t back = random_.below(3) == 0 ? random_.below(random_.below(8) == 0 ? 500 : 40) : 0;
    return base + (static_cast<double>(clock_) - static_cast<double>(back)) * step();
  }

  Point point() { return {static_cast<double>(random_.below(12)), static_cast<double>(random_.below(12))}; }

  bool too_old(double time) const { return max_age_ != INFINITE && time <= horizon(now_, max_age_); }

  std::uint64_t expire() {
    return std::erase_if(model_, [&](const Dated& item) { return too_old(item.time); });
  }

  // Runs an update, sometimes with too little memory at first.
  template <class Update>
  void with_failures(Update update) {
    if (random_.below(3) == 0) {
      const std::uint64_t changes = tree_.changes();
      allocations_left = static_cast<long>(random_.below(14));
      bool failed = false;
      try {
        update();
      } catch (const std::bad_alloc&) {
        failed = true;
      }
      allocations_left = -1;
      if (!failed) return;
      require(tree_.changes() == changes, "a failed allocation changed the hull");
      check();
    }
    update();
  }

  void add(std::size_t count) {
    std::vector<Point> points;
    std::vector<double> times;
    const bool dated = max_age_ != INFINITE || random_.below(4) != 0;
    for (std::size_t i = 0; i < count; ++i) {
      clock_ += random_.below(3) == 0 ? random_.below(4) : 0;
      points.push_back(point());
      times.push_back(dated ? time() : now_);
    }
    std::size_t added = 0;
    with_failures([&] { added = expiry_.add(tree_, points.data(), dated ? times.data() : nullptr, points.size()); });
    for (double time : times) now_ = std::max(now_, time);
    expired_ += expire();
    std::size_t expected = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (too_old(times[i])) continue;
      ++expected;
      model_.push_back({points[i], times[i], arrivals_ + i});
    }
    arrivals_ += count;
    late_ += count - expected;
    for (; model_.size() > max_points_; ++evicted_) model_.erase(std::min_element(model_.begin(), model_.end()));
    require(added == expected, "the number of points added is wrong");
  }

  void advance() {
    clock_ += random_.below(random_.below(4) == 0 ? 400 : 20);
    const double to = std::max(now_, time());
    std::size_t left = 0;
    with_failures([&] { left = expiry_.advance(tree_, to); });
    now_ = to;
    const std::uint64_t expected = expire();
    expired_ += expected;
    require(left == expected, "the number of points that left is wrong");
  }

  void expire_until() {
    const double until = time();
    std::size_t left = 0;
    with_failures([&] { left = expiry_.expire(tree_, until); });
    const std::uint64_t expected = std::erase_if(model_, [&](const Dated& item) { return item.time <= until; });
    expired_ += expected;
    require(left == expected, "the number of points that expired is wrong");
  }

  bool take(Point p) {
    auto oldest = model_.end();
    for (auto item = model_.begin(); item != model_.end(); ++item)
      if (item->p == p && (oldest == model_.end() || *item < *oldest)) oldest = item;
    if (oldest == model_.end()) return false;
    model_.erase(oldest);
    return true;
  }

  void remove() {
    const Point p = point();
    HullTree::Removal removal{};
    with_failures([&] { removal = expiry_.remove(tree_, p); });
    require((removal == HullTree::Removal::MISSING) == !take(p), "a delete found what is not there, or did not find");
  }

  void remove_many() {
    std::vector<Point> points(random_.below(60));
    for (Point& p : points) p = point();
    const bool ignore = random_.below(2) == 0;
    const std::vector<Dated> before = model_;
    std::int64_t rows = 0, missing = -1;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (take(points[i]))
        ++rows;
      else if (missing < 0)
        missing = static_cast<std::int64_t>(i);
    }
    if (missing >= 0 && !ignore) model_ = before, rows = 0;
    const std::vector<Dated> after = std::exchange(model_, before);
    Applied applied{};
    with_failures([&] { applied = expiry_.remove(tree_, points.data(), points.size(), ignore); });
    model_ = after;
    require(applied.rows == rows && applied.first_missing == missing, "a batch miscounted its rows");
  }

  void clear() {
    expiry_.clear(tree_);
    model_.clear();
  }

  void copy() {
    std::vector<Point> points;
    std::vector<double> times;
    for (const Dated& item : expiry_.items()) {
      points.push_back(item.p);
      times.push_back(item.time);
    }
    Expiry other = expiry_;
    if (random_.below(2) == 0)
      with_failures([&] {
        FramedTree empty;
        other = Expiry(max_age_, max_points_);
        other.restore(empty, points.data(), times.data(), points.size(), now_);
      });
    other.expired = expired_;
    other.evicted = evicted_;
    other.late = late_;
    expiry_ = std::move(other);
  }

  void check() {
    tree_.check();
    expiry_.check(tree_);
    std::vector<Dated> expected = model_;
    std::sort(expected.begin(), expected.end());
    const std::vector<Dated> items = expiry_.items();
    require(items.size() == expected.size(), "a point is missing");
    for (std::size_t i = 0; i < items.size(); ++i)
      require(items[i].p == expected[i].p && items[i].time == expected[i].time, "a point or its time is off");
    require(expiry_.now() == now_, "the clock is off");
    require(expiry_.expired == expired_ && expiry_.evicted == evicted_ && expiry_.late == late_, "a total is off");
    if (random_.below(4) > 0) return;
    const std::optional<double> oldest = expiry_.oldest();
    require(oldest == (expected.empty() ? std::nullopt : std::optional(expected.front().time)), "the oldest is wrong");
  }

  Random random_;
  std::uint64_t spread_;
  double max_age_;
  std::size_t max_points_;
  std::uint64_t clock_ = 0, arrivals_ = 0, expired_ = 0, evicted_ = 0, late_ = 0;
  double now_ = Expiry::NEVER;
  FramedTree tree_;
  Expiry expiry_;
  std::vector<Dated> model_;
};

class WheelLife {
 public:
  explicit WheelLife(std::uint64_t seed) : random_(seed), wheel_(BySlot{&times_}) {}

  void live() {
    const std::uint64_t steps = 10 + random_.below(40);
    for (std::uint64_t step = 0; step < steps; ++step) {
      if (random_.below(2) == 0) push(random_.below(80));
      grow();
      const double until = base_ + static_cast<double>(random_.below(random_.below(10) == 0 ? 3000 : 100));
      if (random_.below(2) == 0) random_.below(2) == 0 ? pop_until(until) : take_until(until);
      std::size_t visited = 0;
      wheel_.for_each([&](std::uint32_t) { ++visited; });
      require(visited == present_.size() && wheel_.size() == visited, "an item is missing");
    }
    pop_until(INFINITE);
    require(present_.empty(), "an item was lost");
  }

 private:
  struct BySlot {
    const std::vector<double>* times;
    struct Entry {
      double time;
      std::uint32_t slot;
    };
    double time(std::uint32_t slot) const { return (*times)[slot]; }
    Entry entry(std::uint32_t slot) const { return {time(slot), slot}; }
    static std::uint32_t item(const Entry& entry) { return entry.slot; }
    bool current(const Entry& entry) const { return time(entry.slot) == entry.time; }
    static bool before(const Entry& a, const Entry& b) { return a.slot < b.slot; }
  };

  void push(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) times_.push_back(base_ + static_cast<double>(random_.below(2000)));
    while (true) {
      allocations_left = static_cast<long>(random_.below(4));
      try {
        wheel_.reserve(count);
        break;
      } catch (const std::bad_alloc&) {
      }
    }
    allocations_left = -1;
    for (std::size_t i = 0; i < count; ++i) {
      present_.push_back(static_cast<std::uint32_t>(times_.size() - count + i));
      wheel_.push(present_.back());
    }
  }

  void grow() {
    for (std::size_t i = 0; i < present_.size() / 4; ++i)
      times_[present_[random_.below(present_.size())]] += static_cast<double>(random_.below(300));
  }

  void pop_until(double time) {
    for (;;) {
      allocations_left = static_cast<long>(random_.below(3));
      const BySlot::Entry* front = nullptr;
      try {
        front = wheel_.front();
      } catch (const std::bad_alloc&) {
        allocations_left = -1;
        front = wheel_.front();
      }
      allocations_left = -1;
      require((front == nullptr) == present_.empty(), "the wheel is empty, or is not");
      if (front == nullptr || front->time > time) break;
      const auto least = std::min_element(present_.begin(), present_.end(), [&](std::uint32_t a, std::uint32_t b) {
        return times_[a] == times_[b] ? a < b : times_[a] < times_[b];
      });
      require(front->slot == *least, "the first item is not the oldest");
      present_.erase(least);
      wheel_.pop_front();
    }
    if (time < INFINITE) base_ = std::max(base_, time);
  }

  void take_until(double time) {
    std::vector<std::uint32_t> taken;
    wheel_.take_until(time, [&](std::uint32_t slot) { taken.push_back(slot); });
    std::sort(taken.begin(), taken.end());
    std::vector<std::uint32_t> due;
    std::erase_if(present_, [&](std::uint32_t slot) {
      if (times_[slot] > time) return false;
      due.push_back(slot);
      return true;
    });
    std::sort(due.begin(), due.end());
    require(taken == due, "other items were taken than those that are old");
    base_ = std::max(base_, time);
  }

  Random random_;
  std::vector<double> times_;
  std::vector<std::uint32_t> present_;
  double base_ = 0;
  Wheel<std::uint32_t, BySlot> wheel_;
};

int run(int count, char** words) {
  return fuzz_lives(count, words, "lives of windows, leaves of " + std::to_string(LEAF), [](std::uint64_t seed) {
    WindowLife(seed).live();
    WheelLife(seed).live();
  });
}

}  // namespace fuzz_windows

#ifndef FUZZ_TOGETHER
int main(int count, char** words) { return fuzz_windows::run(count, words); }
#endif
