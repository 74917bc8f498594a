// HullTree: a multiset of points and its convex hull. The reference in Python, dynhull/_tree.py, explains the
// algorithm.
//
// Reading order: predicates/ (exact signs), tree/ (leaves, bridges, single updates), batch/ (many updates at once),
// this file, query/. globe/ takes places on the globe to the plane, keyed/ names points by keys, fence/ compares them
// with areas, window/ has the order in which points expire. sort/ and memory/ serve them, static/ has the hulls of
// fixed points, python/ the bindings.
#pragma once

#include <optional>

#include "batch/divide.hpp"
#include "batch/in_order.hpp"
#include "sort/distinct.hpp"

namespace dynhull {

struct Applied {
  std::int64_t rows;
  std::int64_t first_missing;
};

// Callers ensure that the coordinates of single points are finite and that no zero is negative. If an update throws,
// nothing has changed.
class HullTree {
 public:
  std::uint64_t changes = 0;

  HullTree() = default;
  HullTree(const Point* points, std::size_t count) : HullTree(Distinct(points, count)) {}
  explicit HullTree(const Distinct& points) : size_(points.count()), distinct_(points.size()) {
    const auto build = [&] { nodes_ = built(points.data(), points.size(), points.repeated()); };
    const auto note_copies = [&] {
      copies_.reserve(points.repeated().size());
      for (const auto& [number, copies] : points.repeated()) copies_.emplace(points.data()[number], copies);
    };
    both(two_threads_for(size_), build, note_copies);
  }

  std::size_t size() const { return size_; }
  std::size_t distinct() const { return distinct_; }
  std::uint64_t version() const { return version_; }  // increases with every change of the hull
  const Nodes& nodes() const { return nodes_; }
  const Copies& copies() const { return copies_; }

  std::uint64_t count(Point p) const {
    const Place place = find(nodes_, p);
    if (!place.there) return 0;
    return nodes_.leaf(place.leaf).repeated & bit(place.entry) ? copies_.find(p)->second : 1;
  }

  void clear() {
    if (nodes_.root == NONE) return;
    Nodes empty;
    nodes_ = std::move(empty);
    copies_.clear();
    size_ = distinct_ = 0;
    changed();
  }

  // True if the hull changed.
  bool insert(Point p) {
    nodes_.reserve(1);
    const Place place = find(nodes_, p);
    if (place.there) {
      ++copies_.try_emplace(p, 1).first->second;
      mark(place, true);
      ++size_;
      return false;
    }
    ++size_;
    ++distinct_;
    return insert_point(nodes_, place, p) != 0 && changed();
  }

  enum class Removal { MISSING, HULL_STANDS, HULL_CHANGED };

  Removal remove(Point p) {
    const Place place = find(nodes_, p);
    if (!place.there) return Removal::MISSING;
    --size_;
    if (nodes_.leaf(place.leaf).repeated & bit(place.entry)) {
      const auto entry = copies_.find(p);
      if (--entry->second == 1) {
        copies_.erase(entry);
        mark(place, false);
      }
      return Removal::HULL_STANDS;
    }
    --distinct_;
    if (remove_point(nodes_, place, p) == 0) return Removal::HULL_STANDS;
    changed();
    return Removal::HULL_CHANGED;
  }

  // Inserts the rows with +1 and deletes those with -1, as a set. If a row deletes a missing point, nothing is applied,
  // unless `ignore_missing`. `together` chooses divide and conquer or one change after the other; by default the batch
  // decides. Copies the points first, so that other threads may change them; throws NotFinite if one is not finite.
  Applied apply(Ops ops, const Point* points, std::size_t count, bool ignore_missing,
                std::optional<bool> together = {}) {
    if (count > 0 && nodes_.root == NONE && ops.all_insert()) return fill(points, count);
    Groups groups(ops, points, count);
    groups.descend(nodes_);
    Plan plan(nodes_, copies_, groups);
    if (groups.first_missing >= 0 && !ignore_missing) return {0, groups.first_missing};
    make_room_for_copies(plan);
    try {
      if (apply(plan, together)) changed();
    } catch (...) {
      drop_room_for_copies();
      throw;
    }
    size_ += groups.growth;
    distinct_ += 2 * plan.inserts - plan.changes().size();
    for (const Recount& entry : plan.recounts)
      if (entry.before == 0 && entry.after > 1) mark(find(nodes_, entry.p), true);
    return {groups.rows_applied, groups.first_missing};
  }

  // Takes over the points of another tree.
  void become(HullTree other) {
    other.changes = changes;
    other.version_ = version_;
    other.changed();
    *this = std::move(other);
  }

  // Calls `work` while a point that is there once is away.
  template <class Work>
  void without(Point p, Work work) {
    nodes_.reserve(1);
    remove_point(nodes_, find(nodes_, p), p);
    const auto put_back = [&] { insert_point(nodes_, find(nodes_, p), p); };
    try {
      work();
    } catch (...) {
      put_back();
      throw;
    }
    put_back();
  }

  // Visits every distinct point in order, with its number of copies.
  template <class Visit>
  void for_each(Visit visit) const {
    visit_points(nodes_.root, visit);
  }

  // The vertices of one side, left to right. O(h log n).
  std::vector<Point> chain(Side side) const {
    std::vector<Point> points;
    collect(nodes_, nodes_.root, side, LOWEST, HIGHEST, points);
    return points;
  }

  std::size_t used_bytes() const { return nodes_.used_bytes(); }
  std::size_t reserved_bytes() const { return nodes_.reserved_bytes(); }

 private:
  // Inserts the first points of an empty tree.
  Applied fill(const Point* points, std::size_t count) {
    const Distinct distinct(points, count);
    if (!distinct.finite()) throw NotFinite();
    become(HullTree(distinct));
    return {static_cast<std::int64_t>(count), -1};
  }

  // True if the hull changed.
  bool apply(const Plan& plan, std::optional<bool> together) {
    if (plan.changes().empty()) return recount(plan), false;
    const bool as_large = plan.inserts >= distinct_;
    if (nodes_.root != NONE && !together.value_or(as_large || plan.crowded())) {
      nodes_.reserve(plan.extra_leaves);
      recount(plan);
      return apply_in_order(nodes_, plan.changes());
    }
    if (as_large) return rebuild(plan);
    nodes_.reserve(plan.extra_leaves);
    DividedBatch commit(nodes_, plan);
    recount(plan);
    return commit.apply();
  }

  bool changed() {
    ++changes;
    ++version_;
    return true;
  }

  static Nodes built(const Point* points, std::size_t count, std::span<const Repeated> repeated = {}) {
    Nodes nodes;
    if (count == 0) return nodes;
    std::vector<Ref> refs(2 * leaves_for(count));
    nodes.reserve(leaves_for(count));
    const Building building(nodes, points, count, refs.data());
    nodes.root = building.tree(two_threads_for(count));
    for (const Repeated& point : repeated) building.mark_repeated(point.number);
    return nodes;
  }

  // Marks in its leaf whether a point is repeated.
  void mark(const Place& place, bool repeated) {
    Mask& marks = nodes_.leaf(place.leaf).repeated;
    marks = repeated ? marks | bit(place.entry) : marks & ~bit(place.entry);
  }

  // Applies a batch as large as the tree: merges it with the points and builds a new tree.
  bool rebuild(const Plan& plan) {
    std::vector<Point> merged;
    merged.reserve(distinct_ + plan.inserts);
    auto next = plan.changes().begin();
    const auto last = plan.changes().end();
    for_each([&](Point p, std::uint64_t) {
      for (; next != last && next->p < p; ++next) merged.push_back(next->p);
      if (next != last && next->p == p)
        ++next;  // removed
      else
        merged.push_back(p);
    });
    for (; next != last; ++next) merged.push_back(next->p);
    const std::vector<Point> before[] = {chain(UPPER), chain(LOWER)};
    Nodes fresh = built(merged.data(), merged.size());
    std::vector<Point> after[2];
    for (Side side : SIDES) collect(fresh, fresh.root, side, LOWEST, HIGHEST, after[side]);
    recount(plan);
    nodes_ = std::move(fresh);
    for (const auto& [p, copies] : copies_) {
      const Place place = find(nodes_, p);
      if (copies > 1 && place.there) mark(place, true);
    }
    return before[UPPER] != after[UPPER] || before[LOWER] != after[LOWER];
  }

  // Allocates entries so that recount() cannot fail. An entry of one is only room.
  void make_room_for_copies(Plan& plan) {
    try {
      for (Recount& entry : plan.recounts)
        if (entry.copies == nullptr) entry.copies = &copies_.try_emplace(entry.p, 1).first->second;
    } catch (...) {
      drop_room_for_copies();
      throw;
    }
  }
  void drop_room_for_copies() {
    std::erase_if(copies_, [](const auto& entry) { return entry.second == 1; });
  }

  // Updates the numbers of copies. To be called before the changes are applied, once nothing can fail any more; new
  // points are marked afterwards.
  void recount(const Plan& plan) {
    for (const Recount& entry : plan.recounts) {
      if (entry.after > 1)
        *entry.copies = entry.after;
      else
        copies_.erase(entry.p);
      if (entry.before > 0 && entry.after > 0) mark(entry.place, entry.after > 1);
    }
  }

  template <class Visit>
  void visit_points(Ref tree, Visit& visit) const {
    if (tree == NONE) return;
    if (!is_leaf(tree)) {
      for (Ref child : nodes_.node(tree).child) visit_points(child, visit);
      return;
    }
    const Leaf& leaf = nodes_.leaf(tree);
    for (unsigned i = 0; i < leaf.size; ++i)
      visit(leaf[i], leaf.repeated & bit(i) ? copies_.find(leaf[i])->second : std::uint64_t{1});
  }

  Nodes nodes_;
  Copies copies_;
  std::size_t size_ = 0, distinct_ = 0;
  std::uint64_t version_ = 0;
};

// Both chains as one ring, counter-clockwise from the least.
inline std::vector<Point> ring_of(std::vector<Point> lower, const std::vector<Point>& upper) {
  if (upper.size() > 2) lower.insert(lower.end(), upper.rbegin() + 1, upper.rend() - 1);
  return lower;
}

inline std::vector<Point> vertices_of(const HullTree& tree) { return ring_of(tree.chain(LOWER), tree.chain(UPPER)); }

}  // namespace dynhull
