// Which points leave a window, and when. The reference in Python, dynhull/_expiry.py, explains tombstones.
#pragma once

#include <set>
#include <stdexcept>

#include "../globe/framed_tree.hpp"
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
  using Entry = Dated;
  static double time(const Dated& item) { return item.time; }
  static Dated entry(const Dated& item) { return item; }
  static Dated item(const Dated& entry) { return entry; }
  static bool current(const Dated&) { return true; }
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
  std::size_t add(FramedTree& tree, const Point* points, const double* times, std::size_t count) {
    Entering entering(*this, tree, points, times, count);
    Leaving leaving(*this);
    leaving.take_until(entering.limit());
    const std::size_t expired_now = leaving.size(), added = entering.size();
    const std::size_t total = tree.size() - expired_now + added;
    const std::size_t surplus = total > max_points_ ? total - max_points_ : 0;
    if (surplus > 0) evict(surplus, entering, leaving);
    wheel_.reserve(entering.others().size());
    apply(tree, leaving, entering);
    entering.commit();
    leaving.commit();
    for (const Dated& item : entering.others()) wheel_.push(item);
    arrivals_ += count;
    now_ = entering.newest();
    expired += expired_now;
    evicted += surplus;
    late += count - added;
    return added;
  }

  // Moves the clock, which does not go back. Returns the number of points that left.
  std::size_t advance(FramedTree& tree, double now) {
    const std::size_t left = expire(tree, limit(now));
    now_ = now;
    return left;
  }

  // Removes the points of this time or before, without moving the clock. Returns their number.
  std::size_t expire(FramedTree& tree, double until) {
    Entering nothing(*this, tree, nullptr, nullptr, 0);
    Leaving leaving(*this);
    leaving.take_until(until);
    apply(tree, leaving, nothing);
    nothing.commit();
    leaving.commit();
    expired += leaving.size();
    return leaving.size();
  }

  // Removes the oldest copy of a point.
  HullTree::Removal remove(FramedTree& tree, Point p) {
    drop_tombstones(tree);
    Tombstones fresh = {{p, arrivals_}};
    const HullTree::Removal removal = tree.remove(p);
    if (removal == HullTree::Removal::MISSING) return removal;
    tombstones_.merge(fresh);
    ++arrivals_;
    return removal;
  }

  // Removes the oldest copies of points as one batch, like HullTree::apply.
  Applied remove(FramedTree& tree, const Point* points, std::size_t count, bool ignore_missing) {
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
  void clear(FramedTree& tree) {
    tree.clear();
    queue_.clear();
    wheel_ = Wheel<Dated, OldestFirst>();
    tombstones_.clear();
  }

  // Fills an empty tree. The items are in order.
  void restore(FramedTree& tree, const Point* points, const double* times, std::size_t count, double now) {
    Queue<Dated> queue;
    queue.reserve(count);
    for (std::size_t i = 0; i < count; ++i) queue[i] = {points[i], times[i], i};
    queue.extend(count);
    tree.fill(points, count);
    queue_ = std::move(queue);
    arrivals_ = count;
    now_ = now;
  }

  // The time of the oldest point; none if there is no point.
  std::optional<double> oldest() {
    Leaving leaving(*this);
    const Dated* const front = leaving.next();
    leaving.commit();  // of items that were deleted
    return front == nullptr ? std::nullopt : std::optional(front->time);
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
      std::erase_if(items, [&](const Dated& item) {
        const auto found = tombstone_of(left, item);
        if (found == left.end()) return false;
        left.erase(found);
        return true;
      });
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
  void check(const FramedTree& tree) const {
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

  // The rows of a batch that are not late. Those that continue the queue are in it at once, and leave it unless they
  // are committed; the others wait.
  class Entering {
   public:
    Entering(Expiry& expiry, const FramedTree& tree, const Point* points, const double* times, std::size_t count)
        : queue_(expiry.queue_), before_(queue_.size()), newest_(expiry.now_) {
      queue_.reserve(count);
      Plain plain;
      bool placed = true;
      double strange = 0;  // becomes NaN with a time that is not finite
      for (std::size_t i = 0; i < count; ++i) {
        const double time = times == nullptr ? expiry.now_ : times[i] + 0.0;
        if (times != nullptr) strange += time - time;
        queue_[before_ + i] = {plain(points[i]), time, expiry.arrivals_ + i};
        placed &= tree.frame().has(queue_[before_ + i].p);
        newest_ = std::max(newest_, time);
      }
      if (!plain.finite() || !placed || strange != 0) throw NotFinite();
      for (std::size_t i = before_; i < before_ + count; ++i) tree.require(queue_[i].p);  // not all reach the tree
      limit_ = expiry.limit(newest_);
      double last = before_ > 0 ? queue_[before_ - 1].time : NEVER;
      std::size_t end = before_;
      for (std::size_t i = before_; i < before_ + count; ++i) {
        const Dated row = queue_[i];
        if (row.time <= limit_) continue;
        if (row.time < last) {
          others_.push_back(row);
          continue;
        }
        last = row.time;
        queue_[end++] = row;
      }
      queue_.extend(end - before_);
    }
    Entering(const Entering&) = delete;
    ~Entering() {
      if (!committed_) queue_.shrink(before_);
    }

    double newest() const { return newest_; }
    double limit() const { return limit_; }
    std::size_t size() const { return queue_.size() - before_ + others().size(); }
    std::size_t before() const { return before_; }  // the size of the queue before
    std::span<const Dated> others() const { return std::span(others_).subspan(evicted_); }

    void sort_others() { std::sort(others_.begin(), others_.end()); }
    void evict_other() { ++evicted_; }
    void commit() { committed_ = true; }

   private:
    Queue<Dated>& queue_;
    std::size_t before_;
    std::vector<Dated> others_;
    std::size_t evicted_ = 0;  // of the others
    double newest_, limit_;
    bool committed_ = false;
  };

  // The first items of the order. They stay, or go back, unless they are committed.
  class Leaving {
   public:
    explicit Leaving(Expiry& expiry) : expiry_(expiry) {}
    Leaving(const Leaving&) = delete;
    ~Leaving() {
      if (!committed_) {
        expiry_.tombstones_.merge(consumed_);
        for (const auto& items : {std::span(from_wheel_), std::span(deleted_from_wheel_)})
          for (const Dated& item : items) expiry_.wheel_.push(item);
      }
      expiry_.wheel_.settle();
    }

    // The oldest item that is not deleted; nullptr if there is none.
    const Dated* next() {
      for (;;) {
        const Dated* const item = first();
        if (item == nullptr || expiry_.tombstones_.empty()) return item;
        const auto found = tombstone_of(expiry_.tombstones_, *item);
        if (found == expiry_.tombstones_.end()) return item;
        if (in_queue(item)) {
          deleted_.push_back(taken_++);
        } else {
          deleted_from_wheel_.push_back(*item);
          expiry_.wheel_.pop_front();
        }
        consumed_.insert(expiry_.tombstones_.extract(found));
      }
    }

    // Takes the item that `next` has returned.
    void take(const Dated* item) {
      if (in_queue(item)) {
        ++taken_;
      } else {
        from_wheel_.push_back(*item);
        expiry_.wheel_.pop_front();
      }
    }

    void take_until(double limit) {
      for (const Dated* item = next(); item != nullptr && item->time <= limit; item = next()) take(item);
    }

    std::size_t size() const { return taken_ - deleted_.size() + from_wheel_.size(); }
    std::size_t taken() const { return taken_; }  // from the queue, with deleted ones

    // Visits the points that were in the tree before the batch, when the queue had this size.
    template <class Visit>
    void for_each(std::size_t before, Visit visit) const {
      auto deleted = deleted_.begin();
      for (std::size_t i = 0; i < std::min(taken_, before); ++i) {
        if (deleted != deleted_.end() && *deleted == i)
          ++deleted;
        else
          visit(expiry_.queue_[i].p);
      }
      for (const Dated& item : from_wheel_) visit(item.p);
    }

    void commit() {
      expiry_.queue_.pop_front(taken_);
      committed_ = true;
    }

   private:
    bool in_queue(const Dated* item) const { return taken_ < expiry_.queue_.size() && item == &expiry_.queue_[taken_]; }

    // The first item of the queue and the wheel.
    const Dated* first() {
      const Dated* const other = expiry_.wheel_.front();
      if (taken_ == expiry_.queue_.size()) return other;
      const Dated* const item = &expiry_.queue_[taken_];
      return other == nullptr || *item < *other ? item : other;
    }

    Expiry& expiry_;
    std::size_t taken_ = 0;
    std::vector<std::size_t> deleted_;  // numbers in the queue
    std::vector<Dated> from_wheel_, deleted_from_wheel_;
    Tombstones consumed_;
    bool committed_ = false;
  };

  static void require(bool holds, const char* message) {
    if (!holds) throw std::logic_error(message);
  }

  // The time of the youngest points that are too old. NaN if age does not matter: no time is at most NaN.
  double limit(double now) const {
    return max_age_ == INFINITE ? std::numeric_limits<double>::quiet_NaN() : horizon(now, max_age_);
  }

  // The oldest of the window and of the entering rows leave.
  static void evict(std::size_t surplus, Entering& entering, Leaving& leaving) {
    entering.sort_others();
    for (; surplus > 0; --surplus) {
      const Dated* const item = leaving.next();
      const bool other = !entering.others().empty() && (item == nullptr || entering.others().front() < *item);
      other ? entering.evict_other() : leaving.take(item);
    }
  }

  void apply(FramedTree& tree, const Leaving& leaving, const Entering& entering) const {
    const std::size_t from = std::max(leaving.taken(), entering.before()), to = queue_.size();
    const std::size_t inserts = to - from + entering.others().size();
    const Scratch<Point> points(inserts + leaving.size());
    Point* next = points.data();
    for (std::size_t i = from; i < to; ++i) *next++ = queue_[i].p;
    for (const Dated& row : entering.others()) *next++ = row.p;
    leaving.for_each(entering.before(), [&](Point p) { *next++ = p; });
    const auto count = static_cast<std::size_t>(next - points.data());
    if (count == 0) return;
    const Scratch<std::int8_t> ops(count);
    std::fill_n(ops.data(), inserts, std::int8_t{1});
    std::fill_n(ops.data() + inserts, count - inserts, std::int8_t{-1});
    const bool alike = inserts == 0 || inserts == count;
    tree.apply({ops.data(), alike ? 0u : 1u}, points.data(), count, false);
  }

  // The tombstone that has taken the oldest item; the end if there is none.
  static Tombstones::const_iterator tombstone_of(const Tombstones& tombstones, const Dated& oldest) {
    const auto found = tombstones.upper_bound({oldest.p, oldest.arrival});
    return found == tombstones.end() || found->p == oldest.p ? found : tombstones.end();
  }

  // Builds the order anew once most of its items are deleted.
  void drop_tombstones(const FramedTree& tree) {
    if (tombstones_.size() <= tree.size() + MOST_TOMBSTONES) return;
    const std::vector<Dated> live = items();
    Queue<Dated> queue;
    queue.reserve(live.size());
    for (std::size_t i = 0; i < live.size(); ++i) queue[i] = live[i];
    queue.extend(live.size());
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
