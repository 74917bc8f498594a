// Applying a small batch: one point after the other, in order, and back again where one is missing.
#pragma once

#include "groups.hpp"

namespace dynhull {

class Sequence {
 public:
  std::int64_t distinct_growth = 0;
  bool changed = false;

  // All memory but that for new counts is taken here.
  Sequence(Nodes& nodes, Copies& copies, Groups& groups) : nodes_(nodes), copies_(copies), groups_(groups) {
    nodes.reserve(leaves_needed());
    steps_.reserve(groups.size());
  }

  // Stops where a point is missing, unless missing points are to be ignored. May throw std::bad_alloc.
  void apply(bool ignore_missing) {
    for (std::size_t i = 0; i < groups_.size(); ++i) {
      const std::size_t ahead = i + Groups::LOOKAHEAD;
      if (ahead < groups_.size() && groups_.new_leaf(ahead)) nodes_.leaf(groups_[ahead].leaf).fetch();
      const Point p = groups_[i].p;
      const Place place = find_near(nodes_, groups_[i].leaf, p);
      const Step step = {p, count_of(nodes_, copies_, place), 0};
      take(step, place, groups_.settle(i, step.before));
      if (groups_.first_missing >= 0 && !ignore_missing) return;
    }
  }

  // Undo all steps. Cannot fail.
  void go_back() {
    for (; !steps_.empty(); steps_.pop_back()) {
      const Step& step = steps_.back();
      if (step.before > 1 || step.after > 1) copies_.find(step.p)->second = std::max<std::uint64_t>(step.before, 1);
      set(find(nodes_, step.p), step.p, step.after, step.before);
    }
    drop_room();
  }

  // Entries of one copy were kept for the way back.
  void drop_room() {
    for (Point p : room_) {
      const auto entry = copies_.find(p);
      if (entry != copies_.end() && entry->second == 1) copies_.erase(entry);
    }
    room_.clear();
  }

 private:
  static constexpr std::size_t FAR_AHEAD = 16;

  struct Step {
    Point p;
    std::uint64_t before, after;
  };

  // Leaves more than now, at most. After its first split, a leaf needs half a leaf's worth of inserts for each further
  // one. The way back inserts what was deleted: it splits where leaves were merged, which began with a leaf that was
  // low, or where they had been split.
  std::size_t leaves_needed() const {
    std::size_t needed = 1;
    for (std::size_t from = 0, to; from < groups_.size(); from = to) {
      std::size_t inserts = 0;
      for (to = from; to < groups_.size() && (to == from || !groups_.new_leaf(to)); ++to) {
        inserts += groups_.inserts_of(to);
        if (to + FAR_AHEAD < groups_.size()) prefetch(&nodes_.leaf(groups_[to + FAR_AHEAD].leaf));
      }
      const std::size_t size = nodes_.leaf(groups_[from].leaf).size;
      const std::size_t deletes = groups_[to].first - groups_[from].first - inserts;
      const bool splits = size + inserts > LEAF;
      if (splits && inserts > 0) needed += 1 + inserts / (LEAF / 2);
      if (deletes > 0 && (splits || size < LOW + deletes)) needed += 2 * (1 + deletes / (LEAF / 2));
    }
    return needed;
  }

  void take(Step step, const Place& place, std::uint64_t after) {
    step.after = after;
    if (step.before == after) return;
    if (step.before > 1 || after > 1) {
      room_.push_back(step.p);
      copies_.insert_or_assign(step.p, std::max<std::uint64_t>(after, 1));
    }
    steps_.push_back(step);
    set(place, step.p, step.before, after);
  }

  void set(const Place& place, Point p, std::uint64_t before, std::uint64_t after) {
    if (before == 0) {
      changed |= insert_point(nodes_, place, p) != 0;
      ++distinct_growth;
    } else if (after == 0) {
      changed |= remove_point(nodes_, place, p) != 0;
      --distinct_growth;
    }
    if ((before > 1) != (after > 1) && after > 0) {
      const Place now = before == 0 ? find(nodes_, p) : place;
      Mask& repeated = nodes_.leaf(now.leaf).repeated;
      repeated = after > 1 ? repeated | bit(now.entry) : repeated & ~bit(now.entry);
    }
  }

  Nodes& nodes_;
  Copies& copies_;
  Groups& groups_;
  std::vector<Step> steps_;
  std::vector<Point> room_;
};

}  // namespace dynhull
