// Entities: points with a key and a time each. The reference in Python is dynhull/_entities.py.
//
// A batch of puts is one batch of the hull tree: the old places go, the new ones come. It runs in this order: find the
// keys, make room, enter the new keys, exchange places and times with the batch's rows, apply the tree's batch, and
// then what cannot fail. Whatever is refused or fails before that end is undone. A slot whose key the batch has found
// bears a mark instead of its time, which finds a key that comes twice.
#pragma once

#include <memory>
#include <optional>

#include "../fence/fences.hpp"
#include "ages.hpp"
#include "keys.hpp"
#include "names.hpp"
#include "packed.hpp"
#include "puts.hpp"

namespace dynhull {

enum class Only { ALL, ABSENT, PRESENT };

struct DuplicateKey {};  // thrown if a batch holds a key twice

struct MissingKey {  // thrown if a batch removes a key that is not there
  std::size_t row;
};

class Entities {
 public:
  const bool ordered;

  Entities(bool strings, bool ordered) : ordered(ordered), slots_(strings) {}
  Entities(const Entities& other)
      : ordered(other.ordered), slots_(other.slots_), table_(other.table_), whole_(other.whole_) {}

  const Slots& slots() const { return slots_; }
  std::size_t size() const { return slots_.size(); }

  // Visits the rows of a batch in order, with the tag and the slot of their key, or NONE.
  template <class Keys, class Visit>
  void find(const Keys& keys, Visit visit) const {
    std::uint32_t tags[TOGETHER], entries[TOGETHER];
    for (std::size_t from = 0; from < keys.size(); from += TOGETHER) {
      const std::size_t count = std::min(TOGETHER, keys.size() - from);
      for (std::size_t i = 0; i < count; ++i) table_.fetch(tags[i] = keys.tag(from + i));
      for (std::size_t i = 0; i < count; ++i) {
        entries[i] = table_.first(tags[i]);
        if (entries[i] != NONE) prefetch(&slots_[table_.slot(entries[i])]);
      }
      for (std::size_t i = 0; i < count; ++i)
        if (entries[i] != NONE) keys.fetch(slots_.arena(), slots_[table_.slot(entries[i])].key);
      for (std::size_t i = 0; i < count; ++i) {
        const auto same = [&](std::uint32_t slot) { return keys.same(slots_.arena(), from + i, slots_[slot].key); };
        std::uint32_t entry = entries[i];
        while (entry != NONE && !same(table_.slot(entry))) entry = table_.next(entry, tags[i]);
        visit(from + i, tags[i], entry != NONE ? table_.slot(entry) : NONE);
      }
    }
  }

  // Tells an index of fences of every change from now on, if there is no other. Not copied.
  bool attach(Fences& fences) {
    if (reports_ != nullptr) return false;
    reports_ = &fences.reports();
    fences_ = &fences;
    return true;
  }
  void detach() { reports_ = nullptr; }

  // Puts and removes do not reach the tree until `build`, which is asked nothing before: of several batches it is built
  // once. To be called before the first entity of a plane. Makes room for that many entities: to grow takes new memory
  // for what is there already.
  void put_off(std::size_t room) {
    slots_.reserve(room, 0);
    table_.reserve(room);
    whole_ = false;
  }
  void build(FramedTree& tree) {
    if (whole_) return;
    rebuild(tree);
    whole_ = true;
  }
  bool is_put_off() const { return !whole_; }

  // Throws DuplicateKey; then, and after every other exception, nothing has changed.
  template <class Keys>
  Counts put(FramedTree& tree, const Keys& keys, Puts& puts, Only only) {
    const std::size_t count = keys.size();
    Counts counts;
    const Changes changes(whole_ ? 2 * count : 0);
    Batch<Keys> batch(*this, keys);
    const bool beside = whole_ && reports_ && Team::beside() && count >= MANY && fences_->at_rest();
    if (reports_) reports_->make_room(count);
    if (only != Only::ALL || ordered)
      for (std::size_t i = 0; i < count; ++i) tree.require(puts.place(i));
    std::size_t change = 0;
    for (std::size_t i = 0; i < count; ++i) {
      Found& row = batch[i];
      if (i + LOOKAHEAD < count) prefetch(&slots_[batch[i + LOOKAHEAD].slot]);
      if (row.entered ? only == Only::PRESENT : only == Only::ABSENT) {
        ++counts.skipped;
        batch.leave(row);
      } else if (ordered && !row.entered && puts.time(i) < row.time) {
        ++counts.stale;
        batch.leave(row);
      } else {
        Slot& slot = slots_[row.slot];
        slot.time = puts.time(i);
        std::swap(slot.place, puts.place(i));
        row.moved = row.entered || !(slot.place == puts.place(i));
        ++(row.entered ? counts.fresh : row.moved ? counts.moved : counts.unmoved);
        if (!whole_) continue;
        if (row.moved && !row.entered) changes.set(change++, -1, puts.place(i));
        if (row.moved) changes.set(change++, +1, slot.place);
      }
    }
    const auto report = [&] { report_moved(batch, puts, changes, count); };
    try {
      beside ? apply_beside(tree, changes, change, counts, report) : apply(tree, changes, change, counts);
    } catch (...) {
      for (std::size_t i = 0; i < count; ++i)
        if (batch[i].slot != NONE) slots_[batch[i].slot].place = puts.place(i);
      throw;
    }
    batch.commit();
    if (reports_ && !beside) report();
    rename([&] { rename_moved(batch, puts, changes, count); });
    if (ages_) age(batch, count);
    return counts;
  }

  // Returns the number of entities removed. Throws DuplicateKey, and MissingKey unless missing keys are ignored.
  template <class Keys>
  std::int64_t remove(FramedTree& tree, const Keys& keys, bool ignore_missing) {
    const Changes changes(whole_ ? keys.size() : 0);
    Batch<Keys> batch(*this, keys);
    std::size_t change = 0;
    for (std::size_t i = 0; i < keys.size(); ++i) {
      if (!batch[i].entered) {
        if (whole_) changes.set(change, -1, slots_[batch[i].slot].place);
        ++change;
        continue;
      }
      if (!ignore_missing) throw MissingKey{i};
      batch.leave(batch[i]);
    }
    const auto slot = [&](std::size_t i) { return batch[i].slot; };
    make_room_to_leave(keys.size(), slot);
    if (whole_) changes.apply(tree, change, false);
    batch.commit();
    for (std::size_t i = 0; ages_ && i < keys.size(); ++i)
      if (batch[i].slot != NONE) ages_->remove(batch[i].time);
    forget(keys.size(), slot, REMOVED);
    return static_cast<std::int64_t>(change);
  }

  // Removes all entities with a time of at most `until`. Returns their number. The first call of `expire`, `evict` or
  // `oldest` is O(n), and each that follows when most of the entities have left or memory did not suffice.
  std::size_t expire(FramedTree& tree, double until) {
    return remove_oldest(tree, [until](Ages& ages, auto& taken) { ages.take_until(until, taken); });
  }
  // Removes the `count` oldest entities: those without a time first, ties by key. Returns their number.
  std::size_t evict(FramedTree& tree, std::size_t count) {
    return remove_oldest(tree, [count](Ages& ages, auto& taken) { ages.take_oldest(count, taken); });
  }
  // The least time; NO_TIME if no entity has one.
  double oldest() {
    if (!ages_) ages_ = std::make_unique<Ages>(slots_);
    return ages_->oldest();
  }

  void clear(FramedTree& tree) {
    Entities empty(slots_.strings(), ordered);
    if (reports_) {
      reports_->make_room_to_leave(slots_.size(), slots_.arena().living());
      slots_.for_each([&](std::uint32_t slot) { reports_->left(slot, REMOVED); });
    }
    tree.clear();
    std::swap(slots_, empty.slots_);
    table_.swap(empty.table_);
    names_.reset();
    ages_.reset();
  }

  // Holds the entities in the least memory, without a tree, until `unpack`; nothing else may be asked meanwhile. False
  // while it tells an index of its changes, which knows the slots, and before it is built. Both throw before anything
  // changes.
  bool pack(FramedTree& tree) {
    if (reports_ != nullptr || !whole_) return false;
    Packed packed(slots_);
    packed_ = std::move(packed);
    slots_ = Slots(slots_.strings());
    table_ = SlotTable();
    names_.reset();
    ages_.reset();
    tree.set_aside();
    return true;
  }
  void unpack(FramedTree& tree) {
    Slots slots(slots_.strings());
    SlotTable table;
    packed_.unpack(slots, table);
    const Scratch<Point> places(slots.size());
    for (std::uint32_t slot = 0; slot < slots.end(); ++slot) places[slot] = slots[slot].place;
    tree.take_back(places.data(), slots.size());
    std::swap(slots_, slots);
    table_.swap(table);
    packed_ = Packed();
  }
  // What `pack` would hold, and for a new one to hold it: `unpack` comes next.
  Packed packed() const { return Packed(slots_); }
  void hold(Packed packed) { packed_ = std::move(packed); }
  // The vertices while it is packed, which it stays.
  std::vector<Point> packed_vertices(const FramedTree& tree) const {
    const Scratch<Point> places(packed_.size());
    packed_.places(places.data());
    return tree.vertices_aside(places.data(), packed_.size());
  }

  // Whether the names of all these places that are vertices are known. If not, `name` makes them known.
  bool named(const FramedTree& tree, std::span<const Point> places) const {
    return names_ && names_->current(tree, places);
  }
  void forget_names() { names_.reset(); }
  void name(const FramedTree& tree) { names_ = std::make_unique<Names>(tree, slots_); }

  // What has crossed the fences of an index since the last time.
  Crossings take(FramedTree& tree, Fences& fences) {
    return fences.take(tree.plane(), [&](const std::vector<Point>& places) {
      if (!named(tree, places)) name(tree);
      return least_at(places);
    });
  }

  // The slot of the least key at each place, or NONE, once they are named.
  std::vector<std::uint32_t> least_at(std::span<const Point> places) const { return names_->least_at(slots_, places); }

  // Throws std::logic_error unless the tree has the entities' points, and every key and name is found.
  void check(const FramedTree& tree) const {
    const auto require = [](bool holds, const char* message) {
      if (!holds) throw std::logic_error(message);
    };
    std::vector<Point> places;
    std::size_t bytes = 0;
    slots_.for_each([&](std::uint32_t slot) {
      if (slots_.strings()) bytes += Arena::length(slots_[slot].key);
      places.push_back(slots_[slot].place);
      require(entry_of(slot) != NONE, "a key that is not found");
      require(!is_marked(slots_[slot].time), "a mark that was not taken away");
    });
    require(places.size() == slots_.size() && table_.size() == slots_.size(), "a lost slot or key");
    require(bytes == slots_.arena().living(), "garbage miscounted");
    std::sort(places.begin(), places.end());
    auto place = places.begin();
    tree.for_each([&](Point p, std::uint64_t copies) {
      for (; copies > 0; --copies) require(place != places.end() && *place++ == p, "a point without its entity");
    });
    require(place == places.end(), "an entity without its point");
    if (names_) names_->check(slots_);
    if (ages_) ages_->check();
  }

  std::size_t bytes() const {
    return packed_.bytes() + slots_.bytes() + table_.bytes() + (names_ ? names_->bytes() : 0) +
           (ages_ ? ages_->bytes() : 0);
  }

 private:
  static constexpr std::size_t TOGETHER = 16;             // keys whose cache misses overlap
  static constexpr std::size_t LOOKAHEAD = 16;            // rows whose slot, or entry, is being prefetched
  static constexpr std::size_t MANY = 2 * ROWS_A_THREAD;  // rows worth another thread for the index
  static constexpr std::size_t MOST = 3;  // of so many slots one moves from which on the tree is built anew

  // A NaN that is the time of no entity.
  static constexpr std::uint64_t MARK = 0x7ff8000000000001;
  static bool is_marked(double time) { return std::bit_cast<std::uint64_t>(time) == MARK; }

  // A row of a batch: the slot of its key, NONE if the row changes nothing, and the slot's time before.
  struct Found {
    double time;
    std::uint32_t slot, tag;
    bool entered;  // by this batch
    bool moved;
  };

  // Finds all keys of a batch, and enters those that are not there. Undoes that in the end, unless it was committed.
  template <class Keys>
  class Batch {
   public:
    Batch(Entities& entities, const Keys& keys) : entities_(entities), rows_(keys.size()) {
      try {
        find(keys);
        enter(keys);
      } catch (...) {
        undo();
        throw;
      }
    }
    Batch(const Batch&) = delete;
    ~Batch() { undo(); }

    Found& operator[](std::size_t row) { return rows_[row]; }

    // Leaves the entity of a row as it was before.
    void leave(Found& row) {
      if (row.slot == NONE) return;
      if (row.entered)
        entities_.forget(row.slot, row.tag);
      else
        entities_.slots_[row.slot].time = row.time;
      row = {NO_TIME, NONE, 0, false, false};
    }

    void commit() { found_ = 0; }

   private:
    void find(const Keys& keys) {
      entities_.find(keys, [&](std::size_t row, std::uint32_t tag, std::uint32_t slot) {
        double time = NO_TIME;
        if (slot == NONE) {
          ++absent_;
          bytes_ += keys.bytes(row);
        } else {
          time = std::exchange(entities_.slots_[slot].time, std::bit_cast<double>(MARK));
          if (is_marked(time)) throw DuplicateKey();
        }
        rows_[row] = {time, slot, tag, false, false};
        found_ = row + 1;
      });
    }

    void enter(const Keys& keys) {
      if (absent_ == 0) return;
      if (entities_.slots_.reserve(absent_, bytes_)) entities_.ages_.reset();
      entities_.table_.reserve(absent_);
      for (std::size_t i = 0; i < keys.size(); ++i) {
        if (i + LOOKAHEAD < keys.size()) entities_.table_.fetch(rows_[i + LOOKAHEAD].tag);
        if (rows_[i].slot != NONE) continue;
        const auto same = [&](std::uint32_t slot) {
          return keys.same(entities_.slots_.arena(), i, entities_.slots_[slot].key);
        };
        if (entities_.table_.find(rows_[i].tag, same) != NONE) throw DuplicateKey();
        rows_[i].slot = entities_.slots_.take(keys, i);
        rows_[i].entered = true;
        entities_.table_.insert(rows_[i].tag, rows_[i].slot);
      }
    }

    void undo() {
      for (std::size_t i = 0; i < found_; ++i) leave(rows_[i]);
    }

    Entities& entities_;
    Scratch<Found> rows_;
    std::size_t found_ = 0, absent_ = 0, bytes_ = 0;
  };

  std::uint32_t entry_of(std::uint32_t slot) const {
    return table_.find(slots_.tag(slot), [slot](std::uint32_t other) { return other == slot; });
  }
  void forget(std::uint32_t slot, std::uint32_t tag) {
    table_.erase(table_.find(tag, [slot](std::uint32_t other) { return other == slot; }));
    slots_.give_back(slot);
  }
  // For `forget` of the same slots.
  template <class SlotOf>
  void make_room_to_leave(std::size_t count, SlotOf slot) {
    if (!reports_) return;
    std::size_t bytes = 0;
    for (std::size_t i = 0; slots_.strings() && i < count; ++i)
      if (slot(i) != NONE) bytes += Arena::length(slots_[slot(i)].key);
    reports_->make_room_to_leave(count, bytes);
  }
  // Forgets entities that the tree does not hold any more; `slot` may return NONE.
  template <class SlotOf>
  void forget(std::size_t count, SlotOf slot, Cause cause) {
    for (std::size_t i = 0; reports_ && i < count; ++i)
      if (slot(i) != NONE) reports_->left(slot(i), cause);
    rename([&] {
      for (std::size_t i = 0; i < count; ++i)
        if (slot(i) != NONE) names_->remove(slot(i), slots_[slot(i)].place);
    });
    for (std::size_t i = 0; i < count; ++i)
      if (slot(i) != NONE) forget(slot(i), slots_.tag(slot(i)));
  }

  // Applies the rows of a batch of puts to the tree. If it moves most entities, a new tree of all of them takes less.
  void apply(FramedTree& tree, const Changes& changes, std::size_t count, const Counts& counts) const {
    if (!whole_) return;
    if (static_cast<std::size_t>(counts.moved) * MOST < slots_.end() || counts.moved == 0 || tree.frame().on_globe())
      return changes.apply(tree, count, counts.moved == 0);
    rebuild(tree);
  }

  // The same, and reports who has moved; the index finds who crosses, on another thread if there is one.
  template <class Report>
  void apply_beside(FramedTree& tree, const Changes& changes, std::size_t count, const Counts& counts,
                    Report report) const {
    try {
      Threads(Threads::Beside()).run(2, [&](std::size_t task) {
        if (task == 0) return apply(tree, changes, count, counts);
        report();
        fences_->look_ahead();
      });
    } catch (...) {
      fences_->forget_ahead();
      throw;
    }
  }

  void rebuild(FramedTree& tree) const {
    const Scratch<Point> places(slots_.size());
    std::size_t next = 0;
    slots_.for_each([&](std::uint32_t slot) { places[next++] = slots_[slot].place; });
    tree.plane().replace(places.data(), next);
  }

  template <class Rows>
  void report_moved(Rows& batch, Puts& puts, const Changes& changes, std::size_t count) {
    std::size_t change = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (i + LOOKAHEAD < count && batch[i + LOOKAHEAD].slot != NONE) reports_->fetch(batch[i + LOOKAHEAD].slot);
      if (!batch[i].moved) continue;
      change += !batch[i].entered;
      const Point now = changes.place(change++);
      if (batch[i].entered)
        reports_->appeared(batch[i].slot);
      else
        reports_->moved(batch[i].slot, puts.place(i), now);
    }
  }

  template <class Rows>
  void rename_moved(Rows& batch, Puts& puts, const Changes& changes, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      if (batch[i].moved && !batch[i].entered) names_->remove(batch[i].slot, puts.place(i));
    std::size_t change = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (!batch[i].moved) continue;
      change += !batch[i].entered;
      names_->add(slots_, batch[i].slot, changes.place(change++));
    }
  }

  // Updates the names. If memory does not suffice they are dropped, and made anew by who asks for them.
  template <class Update>
  void rename(Update update) {
    if (!names_) return;
    try {
      update();
    } catch (const std::bad_alloc&) {
      names_.reset();
    }
  }

  // Updates the order of times. If memory does not suffice it is dropped, like the names.
  template <class Rows>
  void age(Rows& batch, std::size_t count) {
    try {
      ages_->reserve(count);
    } catch (const std::bad_alloc&) {
      return ages_.reset();
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (batch[i].slot == NONE) continue;
      if (batch[i].entered)
        ages_->push(batch[i].slot);
      else
        ages_->put(batch[i].slot, batch[i].time);
    }
    if (ages_->stale()) ages_.reset();
  }

  template <class Take>
  std::size_t remove_oldest(FramedTree& tree, Take take) {
    if (!ages_) ages_ = std::make_unique<Ages>(slots_);
    std::vector<Ages::Taken> taken;
    try {
      take(*ages_, taken);
      const Changes changes(taken.size());
      for (std::size_t i = 0; i < taken.size(); ++i) changes.set(i, -1, slots_[taken[i].slot].place);
      make_room_to_leave(taken.size(), [&](std::size_t i) { return taken[i].slot; });
      changes.apply(tree, taken.size(), false);
    } catch (...) {
      for (const Ages::Taken& each : taken) slots_[each.slot].time = each.time;
      ages_.reset();
      throw;
    }
    for (const Ages::Taken& each : taken) ages_->remove(each.time);
    forget(taken.size(), [&](std::size_t i) { return taken[i].slot; }, EXPIRED);
    return taken.size();
  }

  Slots slots_;
  SlotTable table_;
  Packed packed_;
  bool whole_ = true;  // whether the tree has what the slots have
  std::unique_ptr<Names> names_;
  std::unique_ptr<Ages> ages_;  // none until the oldest are asked for
  Reports* reports_ = nullptr;  // none, or those of the index that is attached
  Fences* fences_ = nullptr;    // that index
};

}  // namespace dynhull
