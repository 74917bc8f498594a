// Which points leave a window, and when. The reference in Python, dynhull/_expiry.py, explains tombstones.
#pragma once

#include <set>
#include <stdexcept>

#include "../hull_tree.hpp"
#include "horizon.hpp"
#include "queue.hpp"
#include "wheel.hpp"

namespace dynhull {

// A point with its time, and the number of arrivals before it.
struct Dated {
  Point p;
  double time;
  std::uint64_t arrival;
};

inline bool operator<(const Dated& a, const Dated& b) {
  return a.time == b.time ? a.arrival < b.arrival : a.time < b.time;
}

struct OldestFirst {
  static double time(const Dated& item) { return item.time; }
  static bool before(const Dated& a, const Dated& b) { return a.arrival < b.arrival; }
};

// The order in which the points of a tree leave it, and the clock that makes them leave. Points that arrive in order of
// time wait in a queue, others in a wheel. If an update throws, nothing has changed, neither here nor in the tree.
class Expiry {
 public:
  static constexpr double NEVER = -INFINITE;  // the time of a point that came before any time was known
  static constexpr std::size_t ANY_NUMBER = ~std::size_t{0};

  std::uint64_t expired = 0, evicted = 0, late = 0;

  Expiry() = default;
  Expiry(double max_age, std::size_t max_points) : max_age_(max_age), max_points_(max_points) {}

  double max_age() const { return max_age_; }  // infinite if age does not matter
  std::size_t max_points() const { return max_points_; }
  double now() const { return now_; }

  // Adds the points that are not late and removes those that are too old or too many, as one batch. Copies points and
  // times first, so that other threads may change them; throws NotFinite if one is not finite. Without times, every
  // point has the time `now`. Returns the number of points added.
  std::size_t add(HullTree& tree, const Point* points, const double* times, std::size_t count) {
    Entering entering(*this, points, times, count);
    Leaving leaving(*this);
    leaving.take_until(entering.limit());
    const std::size_t expired_now = leaving.size();
    const std::size_t added = entering.size();
    const std::size_t total = tree.size() - expired_now + added;
    const std::size_t surplus = total > max_points_ ? total - max_points_ : 0;
    if (surplus > 0) evict(surplus, entering, leaving);
    queue_.reserve(entering.in_order().size());
    wheel_.reserve(entering.others().size());
    apply(tree, leaving.items(), entering.in_order(), entering.others());
    leaving.commit();
    for (const Dated& item : entering.in_order()) queue_.push_back(item);
    for (const Dated& item : entering.others()) wheel_.push(item);
    arrivals_ += count;
    now_ = entering.newest();
    expired += expired_now;
    evicted += surplus;
    late += count - added;
    return added;
  }

  // Moves the clock, which does not go back. Returns the number of points that left.
  std::size_t advance(HullTree& tree, double now) {
    const std::size_t left = expire(tree, limit(now));
    now_ = now;
    return left;
  }

  // Removes the points of this time or before, without moving the clock. Returns their number.
  std::size_t expire(HullTree& tree, double until) {
    Leaving leaving(*this);
    leaving.take_until(until);
    apply(tree, leaving.items(), {}, {});
    leaving.commit();
    expired += leaving.size();
    return leaving.size();
  }

  // Removes the oldest copy of a point.
  HullTree::Removal remove(HullTree& tree, Point p) {
    drop_tombstones(tree);
    Tombstones fresh = {{p, arrivals_}};
    const HullTree::Removal removal = tree.remove(p);
    if (removal == HullTree::Removal::MISSING) return removal;
    tombstones_.merge(fresh);
    ++arrivals_;
    return removal;
  }

  // Removes the oldest copies of points as one batch, like HullTree::apply.
  Applied remove(HullTree& tree, const Point* points, std::size_t count, bool ignore_missing) {
    constexpr std::int8_t DELETE = -1;
    drop_tombstones(tree);
    const Scratch<Point> rows(count), sorted(count);
    Plain plain;
    for (std::size_t i = 0; i < count; ++i) sorted[i] = rows[i] = plain(points[i]);
    if (!plain.finite()) throw NotFinite();
    std::sort(sorted.data(), sorted.data() + count);
    Tombstones fresh;
    std::uint64_t arrivals = arrivals_;
    for (std::size_t i = 0, first = 0; i < count; ++i) {
      if (!(sorted[i] == sorted[first])) first = i;
      if (i - first < tree.count(sorted[i])) fresh.insert({sorted[i], arrivals++});
    }
    const Applied applied = tree.apply({&DELETE, 0}, rows.data(), count, ignore_missing);
    if (applied.first_missing >= 0 && !ignore_missing) return applied;
    tombstones_.merge(fresh);
    arrivals_ = arrivals;
    return applied;
  }

  // Removes every point. The clock and the totals stay.
  void clear(HullTree& tree) {
    tree.clear();
    queue_.clear();
    wheel_ = Wheel<Dated, OldestFirst>();
    tombstones_.clear();
  }

  // Fills an empty tree. The items are in order.
  void restore(HullTree& tree, const Point* points, const double* times, std::size_t count, double now) {
    Queue<Dated> queue;
    queue.reserve(count);
    for (std::size_t i = 0; i < count; ++i) queue.push_back({points[i], times[i], i});
    tree = HullTree(points, count);
    queue_ = std::move(queue);
    arrivals_ = count;
    now_ = now;
  }

  // The oldest item; nullptr if there is none.
  const Dated* front() {
    for (;;) {
      const Dated* const item = first();
      if (item == nullptr || tombstones_.empty() || !consume(tombstones_, *item)) return item;
      pop(item);
    }
  }

  // The items of the points in the tree, oldest first. O(n log n).
  std::vector<Dated> items() const {
    std::vector<Dated> items;
    items.reserve(queue_.size() + wheel_.size());
    for (std::size_t i = 0; i < queue_.size(); ++i) items.push_back(queue_[i]);
    wheel_.for_each([&](const Dated& item) { items.push_back(item); });
    if (wheel_.size() > 0) std::sort(items.begin(), items.end());
    if (!tombstones_.empty()) {
      Tombstones left = tombstones_;
      std::erase_if(items, [&](const Dated& item) { return consume(left, item); });
    }
    return items;
  }

  // Whether more than `few` points may have to leave when the clock is at `now`.
  bool many_due(double now, std::size_t few) const { return many_until(limit(std::max(now, now_)), few); }

  // Whether more than `few` points may have this time or an earlier one.
  bool many_until(double until, std::size_t few) const {
    return wheel_.size() > few || (queue_.size() > few && queue_[few].time <= until);
  }

  // Throws std::logic_error if an invariant is broken.
  void check(const HullTree& tree) const {
    require(queue_.size() + wheel_.size() == tree.size() + tombstones_.size(),
            "an item without a point, or the reverse");
    require(tree.size() <= max_points_, "more points than are allowed");
    for (std::size_t i = 1; i < queue_.size(); ++i) require(queue_[i - 1] < queue_[i], "a queue out of order");
    std::vector<Dated> items = this->items();
    for (const Dated& item : items) {
      require(!(item.time <= limit(now_)), "a point that is too old");
      require(item.time <= now_, "a point that is later than now");
    }
    std::sort(items.begin(), items.end(), [](const Dated& a, const Dated& b) { return a.p < b.p; });
    auto next = items.begin();
    tree.for_each([&](Point p, std::uint64_t copies) {
      for (; copies > 0; --copies) require(next != items.end() && (next++)->p == p, "a point without its item");
    });
    require(next == items.end(), "an item without its point");
  }

 private:
  // A point of which the oldest copy was deleted, and the number of arrivals at that time.
  struct Tombstone {
    Point p;
    std::uint64_t arrivals;
    bool operator<(const Tombstone& other) const { return p == other.p ? arrivals < other.arrivals : p < other.p; }
  };
  using Tombstones = std::set<Tombstone>;

  static constexpr std::size_t MOST_TOMBSTONES = 1024;  // beyond the number of points

  // The rows of a batch that are not late: those that continue the queue, and others.
  class Entering {
   public:
    Entering(const Expiry& expiry, const Point* points, const double* times, std::size_t count)
        : rows_(count), others_(count), newest_(expiry.now_) {
      Plain plain;
      double strange = 0;  // becomes NaN with a time that is not finite
      for (std::size_t i = 0; i < count; ++i) {
        const double time = times == nullptr ? expiry.now_ : times[i] + 0.0;
        if (times != nullptr) strange += time - time;
        rows_[i] = {plain(points[i]), time, expiry.arrivals_ + i};
        newest_ = std::max(newest_, time);
      }
      if (!plain.finite() || strange != 0) throw NotFinite();
      limit_ = expiry.limit(newest_);
      double last = expiry.queue_.empty() ? NEVER : expiry.queue_.back().time;
      for (std::size_t i = 0; i < count; ++i) {
        const Dated row = rows_[i];
        if (row.time <= limit_) continue;
        if (row.time >= last) {
          last = row.time;
          rows_[in_order_end_++] = row;
        } else {
          others_[others_end_++] = row;
        }
      }
    }

    double newest() const { return newest_; }
    double limit() const { return limit_; }
    std::size_t size() const { return in_order().size() + others().size(); }
    std::span<const Dated> in_order() const { return {rows_.data() + in_order_, rows_.data() + in_order_end_}; }
    std::span<const Dated> others() const { return {others_.data() + other_, others_.data() + others_end_}; }

    // For `front` and `pop_front`.
    void sort_others() { std::sort(others_.data() + other_, others_.data() + others_end_); }

    // The oldest row; nullptr if there is none.
    const Dated* front() const {
      if (in_order().empty()) return others().empty() ? nullptr : &others().front();
      return others().empty() || in_order().front() < others().front() ? &in_order().front() : &others().front();
    }
    void pop_front() { ++(front() == &rows_[in_order_] ? in_order_ : other_); }

   private:
    Scratch<Dated> rows_, others_;
    std::size_t in_order_ = 0, in_order_end_ = 0, other_ = 0, others_end_ = 0;
    double newest_, limit_;
  };

  // Items taken from the front of the order. They go back unless they are committed.
  class Leaving {
   public:
    explicit Leaving(Expiry& expiry) : expiry_(expiry) {}
    Leaving(const Leaving&) = delete;
    ~Leaving() {
      if (committed_) return;
      for (auto item = items_.rbegin(); item != items_.rend(); ++item) expiry_.queue_.push_front(*item);
    }

    void take(const Dated* front) {
      items_.push_back(*front);
      expiry_.pop(front);
    }
    void take_until(double limit) {
      for (const Dated* front = next(); front != nullptr && front->time <= limit; front = next()) take(front);
    }

    // The oldest item of the order. Makes room for it: all items may go back to the queue.
    const Dated* next() {
      const Dated* const front = expiry_.front();
      if (front != nullptr && expiry_.in_wheel(front)) expiry_.queue_.reserve(items_.size() + 1);
      return front;
    }

    void commit() { committed_ = true; }
    std::size_t size() const { return items_.size(); }
    std::span<const Dated> items() const { return items_; }

   private:
    Expiry& expiry_;
    std::vector<Dated> items_;
    bool committed_ = false;
  };

  static void require(bool holds, const char* message) {
    if (!holds) throw std::logic_error(message);
  }

  // The time of the youngest points that are too old. NaN if age does not matter: no time is at most NaN.
  double limit(double now) const {
    return max_age_ == INFINITE ? std::numeric_limits<double>::quiet_NaN() : horizon(now, max_age_);
  }

  // The first item of the queue and the wheel.
  const Dated* first() {
    const Dated* const other = wheel_.front();
    if (queue_.empty()) return other;
    return other == nullptr || queue_.front() < *other ? &queue_.front() : other;
  }
  bool in_wheel(const Dated* first) const { return queue_.empty() || first != &queue_.front(); }
  void pop(const Dated* first) { in_wheel(first) ? wheel_.pop_front() : queue_.pop_front(); }

  // The oldest of the window and of the entering rows leave.
  void evict(std::size_t surplus, Entering& entering, Leaving& leaving) {
    entering.sort_others();
    for (; surplus > 0; --surplus) {
      const Dated *const old = leaving.next(), *const fresh = entering.front();
      if (old != nullptr && (fresh == nullptr || *old < *fresh))
        leaving.take(old);
      else
        entering.pop_front();
    }
  }

  static void apply(HullTree& tree, std::span<const Dated> leaving, std::span<const Dated> in_order,
                    std::span<const Dated> others) {
    const std::size_t inserts = in_order.size() + others.size(), count = leaving.size() + inserts;
    if (count == 0) return;
    const Scratch<Point> points(count);
    const Scratch<std::int8_t> ops(count);
    Point* next = points.data();
    for (const auto& rows : {in_order, others, leaving})
      for (const Dated& row : rows) *next++ = row.p;
    std::fill_n(ops.data(), inserts, std::int8_t{1});
    std::fill_n(ops.data() + inserts, leaving.size(), std::int8_t{-1});
    const bool alike = inserts == 0 || leaving.empty();
    tree.apply({ops.data(), alike ? 0u : 1u}, points.data(), count, false);
  }

  // Whether a tombstone has taken the oldest item; the tombstone goes with it.
  static bool consume(Tombstones& tombstones, const Dated& oldest) {
    const auto found = tombstones.upper_bound({oldest.p, oldest.arrival});
    if (found == tombstones.end() || !(found->p == oldest.p)) return false;
    tombstones.erase(found);
    return true;
  }

  // Builds the order anew once most of its items are deleted.
  void drop_tombstones(const HullTree& tree) {
    if (tombstones_.size() <= tree.size() + MOST_TOMBSTONES) return;
    Queue<Dated> queue;
    queue.reserve(tree.size());
    for (const Dated& item : items()) queue.push_back(item);
    queue_ = std::move(queue);
    wheel_ = Wheel<Dated, OldestFirst>();
    tombstones_.clear();
  }

  double max_age_ = INFINITE, now_ = NEVER;
  std::size_t max_points_ = ANY_NUMBER;
  std::uint64_t arrivals_ = 0;  // and deletes
  Queue<Dated> queue_;
  Wheel<Dated, OldestFirst> wheel_;
  Tombstones tombstones_;
};

}  // namespace dynhull
