// HullTree: a multiset of points and its convex hull. The reference in Python, dynhull/_tree.py, explains the
// algorithm.
//
// Reading order: predicates/ (exact signs), tree/ (leaves, bridges, single updates), batch/ (many updates at once),
// this file, query/. globe/ takes places on the globe to the plane, keyed/ names points by keys, fence/ compares them
// with areas, window/ has the order in which points expire. sort/ and memory/ serve them, static/ has the hulls of
// fixed points, python/ the bindings.
#pragma once

#include <optional>

#include "batch/parts.hpp"
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
    Threads threads(threads_for(size_));
    nodes_ = built(threads, points.data(), points.size(), points.repeated(), [&] {
      const std::span<const Repeated> repeated = points.repeated();
      const auto point = [&](std::size_t i) { return points.data()[repeated[i].number]; };
      copies_.reserve(repeated.size());
      for (std::size_t i = 0; i < repeated.size(); ++i) {
        if (i + LOOKAHEAD < repeated.size()) copies_.fetch(point(i + LOOKAHEAD));
        copies_.set(point(i), 0, repeated[i].copies);
      }
    });
  }

  std::size_t size() const { return size_; }
  std::size_t distinct() const { return distinct_; }
  std::uint64_t version() const { return version_; }  // increases with every change of the hull
  const Nodes& nodes() const { return nodes_; }
  const Copies& copies() const { return copies_; }

  std::uint64_t count(Point p) const {
    const Place place = find(nodes_, p);
    return place.there ? count(p, place) : 0;
  }

  void clear() {
    if (nodes_.root == NONE) return;
    Nodes empty;
    nodes_ = std::move(empty);
    copies_ = Copies();
    size_ = distinct_ = 0;
    changed();
  }

  // True if the hull changed.
  bool insert(Point p) {
    nodes_.reserve(1);
    const Place place = find(nodes_, p);
    if (place.there) {
      const std::uint64_t before = count(p, place);
      copies_.reserve(1);
      copies_.set(p, before, before + 1);
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
    if (const std::uint64_t before = count(p, place); before > 1) {
      copies_.set(p, before, before - 1);
      mark(place, before > 2);
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
    Threads threads(threads_for_batch(count));
    if (threads.count() > 1) {
      const std::vector<Point> cuts = cuts_of(nodes_, points, count, threads.count());
      if (!cuts.empty()) {
        BatchInParts batch(threads, cuts, nodes_, copies_, ops, points, count, together);
        return commit(threads, batch.plans(), ignore_missing, together, [&](std::size_t extra_leaves) {
          nodes_.reserve(extra_leaves);
          recount(batch.plans());
          return batch.apply();
        });
      }
    }
    const Scratch<Row> rows(count);
    copy_rows(ops, points, count, [next = rows.data()](Point) mutable { return next++; });
    Plan plan(nodes_, copies_, rows.data(), count);
    Plan* const plans[] = {&plan};
    return commit(threads, plans, ignore_missing, together,
                  [&](std::size_t extra_leaves) { return apply(plan, extra_leaves, together); });
  }

  // Takes points in place of all of its own: as a new tree, but that it counts the change. Throws before anything
  // changes.
  void replace(const Point* points, std::size_t count) {
    HullTree fresh(points, count);
    fresh.changes = changes;
    fresh.version_ = version_;
    if (chain(UPPER) != fresh.chain(UPPER) || chain(LOWER) != fresh.chain(LOWER)) fresh.changed();
    *this = std::move(fresh);
  }

  // Takes over the points of another tree.
  void become(HullTree other) {
    other.changes = changes;
    other.version_ = version_;
    other.changed();
    *this = std::move(other);
  }

  // Lets go of all points, which `take_back` brings again: then it is as if nothing had happened.
  void set_aside() {
    nodes_ = Nodes();
    copies_ = Copies();
    size_ = distinct_ = 0;
  }
  void take_back(HullTree same) {
    same.changes = changes;
    same.version_ = version_;
    *this = std::move(same);
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
    add_chain(side, points);
    return points;
  }
  void add_chain(Side side, std::vector<Point>& points) const {
    collect(nodes_, nodes_.root, side, LOWEST, HIGHEST, points);
  }

  std::size_t used_bytes() const { return nodes_.used_bytes(); }
  std::size_t reserved_bytes() const { return nodes_.reserved_bytes(); }

 private:
  static constexpr std::size_t LOOKAHEAD = 16;  // points whose number of copies is being prefetched

  // Inserts the first points of an empty tree.
  Applied fill(const Point* points, std::size_t count) {
    const Distinct distinct(points, count);
    if (!distinct.finite()) throw NotFinite();
    become(HullTree(distinct));
    return {static_cast<std::int64_t>(count), -1};
  }

  using Plans = std::span<Plan* const>;  // of the parts of a batch, in order

  // Checks the plans and makes room for copies; `apply` gets the number of leaves to make room for, changes the tree
  // and returns whether the hull changed. If that throws, nothing has changed.
  template <class Apply>
  Applied commit(Threads& threads, Plans plans, bool ignore_missing, std::optional<bool> together, Apply apply) {
    Applied applied{0, -1};
    std::int64_t growth = 0, distinct_growth = 0;
    std::size_t inserts = 0, changes = 0, extra_leaves = 0, more_repeated = 0;
    for (const Plan* plan : plans) {
      applied.rows += plan->rows_applied;
      if (plan->first_missing >= 0 && (applied.first_missing < 0 || plan->first_missing < applied.first_missing))
        applied.first_missing = plan->first_missing;
      growth += plan->growth;
      distinct_growth += plan->distinct_growth();
      inserts += plan->inserts;
      changes += plan->changes().size();
      extra_leaves += plan->extra_leaves;
      for (const Recount& entry : plan->recounts) more_repeated += entry.before < 2;
    }
    if (applied.first_missing >= 0 && !ignore_missing) return {0, applied.first_missing};
    const bool anew = nodes_.root == NONE || (inserts >= distinct_ && together.value_or(true));
    copies_.reserve(more_repeated);
    if (changes == 0)
      recount(plans);
    else if (anew ? rebuild(threads, plans) : apply(extra_leaves))
      changed();
    size_ += growth;
    distinct_ += distinct_growth;
    for (const Plan* plan : plans)
      for (const Recount& entry : plan->recounts)
        if (entry.before == 0 && entry.after > 1) mark(find(nodes_, entry.p), true);
    return applied;
  }

  // True if the hull changed.
  bool apply(Plan& plan, std::size_t extra_leaves, std::optional<bool> together) {
    Plan* const plans[] = {&plan};
    bool changed = false;
    const auto reached = [&](const Change&, unsigned) { changed = true; };
    nodes_.reserve(extra_leaves);
    const std::size_t changes = plan.changes().size();
    if (together.value_or(plan.crowded())) {
      DividedBatch batch(nodes_, plan.changes());
      recount(plans);
      batch.apply(0, changes, reached);
    } else {
      recount(plans);
      apply_in_order(nodes_, plan.changes(), nodes_.leaf_count() / (changes + 1), reached);
    }
    return changed;
  }

  bool changed() {
    ++changes;
    ++version_;
    return true;
  }

  // The tree of sorted distinct points; calls `beside` meanwhile.
  template <class Beside>
  static Nodes built(Threads& threads, const Point* points, std::size_t count, std::span<const Repeated> repeated,
                     Beside beside) {
    Nodes nodes;
    if (count == 0) return nodes;
    BuildingSite site(count);
    nodes.reserve(leaves_for(count));
    const Building building(nodes, points, count, site);
    nodes.root = building.tree(threads, beside);
    for (const Repeated& point : repeated) building.mark_repeated(point.number);
    return nodes;
  }

  // Marks in its leaf whether a point is repeated.
  void mark(const Place& place, bool repeated) {
    Mask& marks = nodes_.leaf(place.leaf).repeated;
    marks = repeated ? marks | bit(place.entry) : marks & ~bit(place.entry);
  }

  // Applies a batch as large as the tree: merges it with the points and builds a new tree.
  bool rebuild(Threads& threads, Plans plans) {
    std::vector<Point> old, merged;
    old.reserve(distinct_);
    for_each([&](Point p, std::uint64_t) { old.push_back(p); });
    std::size_t most = distinct_;
    for (const Plan* plan : plans) most += plan->inserts;
    merged.reserve(most);
    auto next = old.begin();
    for (const Plan* plan : plans) {
      for (const Change& change : plan->changes()) {
        while (next != old.end() && *next < change.p) merged.push_back(*next++);
        if (change.insert)
          merged.push_back(change.p);
        else
          ++next;
      }
    }
    merged.insert(merged.end(), next, old.end());
    const std::vector<Point> before[] = {chain(UPPER), chain(LOWER)};
    Nodes fresh = built(threads, merged.data(), merged.size(), {}, [] {});
    std::vector<Point> after[2];
    for (Side side : SIDES) collect(fresh, fresh.root, side, LOWEST, HIGHEST, after[side]);
    recount(plans);
    nodes_ = std::move(fresh);
    copies_.for_each([&](Point p) { mark(find(nodes_, p), true); });
    return before[UPPER] != after[UPPER] || before[LOWER] != after[LOWER];
  }

  // Updates the numbers of copies, for which there is room. To be called before the changes are applied, once nothing
  // can fail any more; new points are marked afterwards.
  void recount(Plans plans) {
    for (const Plan* plan : plans) {
      const std::vector<Recount>& recounts = plan->recounts;
      for (std::size_t i = 0; i < recounts.size(); ++i) {
        if (i + LOOKAHEAD < recounts.size()) copies_.fetch(recounts[i + LOOKAHEAD].p);
        const Recount& entry = recounts[i];
        copies_.set(entry.p, entry.before, entry.after);
        if (entry.before > 0 && entry.after > 0) mark(entry.place, entry.after > 1);
      }
    }
  }

  // The number of copies of a point that is there.
  std::uint64_t count(Point p, const Place& place) const {
    return nodes_.leaf(place.leaf).repeated & bit(place.entry) ? copies_[p] : 1;
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
      visit(leaf[i], leaf.repeated & bit(i) ? copies_[leaf[i]] : std::uint64_t{1});
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

// Both chains of a tree likewise; with memory for about so many vertices, it is asked for once.
inline std::vector<Point> vertices_of(const HullTree& tree, std::size_t expected = 0) {
  std::vector<Point> ring;
  ring.reserve(expected > 0 ? expected + 8 : 0);
  tree.add_chain(LOWER, ring);
  const std::size_t lower = ring.size();
  tree.add_chain(UPPER, ring);
  if (ring.size() <= lower + 2) {
    ring.resize(lower);
    return ring;
  }
  std::reverse(ring.begin() + lower, ring.end());
  ring.pop_back();
  ring.erase(ring.begin() + lower);
  return ring;
}

}  // namespace dynhull
