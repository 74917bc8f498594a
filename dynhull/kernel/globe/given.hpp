// The pairs of numbers that were given for places on the globe, found by their place. A place has several pairs if it
// can be written in several ways: 180 and -180 degrees, any longitude at a pole.
#pragma once

#include <stdexcept>
#include <vector>

#include "../keyed/slot_table.hpp"
#include "../memory/hash.hpp"
#include "../memory/pool.hpp"
#include "../memory/scratch.hpp"
#include "frame.hpp"

namespace dynhull {

class Given {
  struct Item {
    Point pair;
    std::uint64_t copies;   // 0 in an item that is free
    std::uint32_t touched;  // its number among the items that the present batch has touched, if that one agrees
  };
  static_assert(sizeof(Item) == 32);

  struct Touched {
    Point place;
    std::uint64_t before;  // the number of copies
    std::uint32_t slot, tag;
    bool crowded;  // whether another pair may be at this place
    bool gone;     // whether no copy is left
  };

 public:
  // Inserts the rows with +1 and deletes those with -1, as a set; `kept` says which rows have an effect: all, but those
  // that delete a missing pair. Undone in the end, unless it was committed.
  class Batch {
   public:
    std::int64_t first_missing = -1;
    std::size_t rows = 0;  // that have an effect

    Batch(Given& given, const std::int8_t* ops, const Point* pairs, const Point* places, std::size_t count, bool* kept)
        : given_(given), touched_(count) {
      const Scratch<std::uint32_t> tags(count);
      given.table_.reserve(count);
      given.items_.reserve(count);
      for (std::size_t i = 0; i < count; ++i) tags[i] = Hash::of(places[i]);
      // From here on nothing throws.
      const auto inserts = [&](std::size_t i) { return ops[i] > 0; };
      for_each(tags, count, inserts, [&](std::size_t i) {
        std::uint32_t slot = given.find(pairs[i], tags[i]);
        if (slot == NONE) slot = given.create(pairs[i], tags[i]);
        ++given.items_[slot].copies;
        if (Touched* const first = touch(slot, tags[i], places[i])) first->before = given.items_[slot].copies - 1;
        kept[i] = true;
        ++rows;
      });
      const auto deletes = [&](std::size_t i) { return ops[i] < 0; };
      for_each(tags, count, deletes, [&](std::size_t i) {
        const std::uint32_t slot = given.find(pairs[i], tags[i]);
        kept[i] = slot != NONE && given.items_[slot].copies > 0;
        if (kept[i]) {
          Item& item = given.items_[slot];
          --item.copies;
          if (Touched* const first = touch(slot, tags[i], places[i])) first->before = item.copies + 1;
          touched_[item.touched].gone = item.copies == 0;
          ++rows;
        } else if (first_missing < 0) {
          first_missing = static_cast<std::int64_t>(i);
        }
      });
    }
    Batch(const Batch&) = delete;
    ~Batch() {
      for (std::size_t i = 0; !committed_ && i < size_; ++i) {
        given_.items_[touched_[i].slot].copies = touched_[i].before;
        touched_[i].gone = touched_[i].before == 0;
      }
      for (std::size_t i = 0; i < size_; ++i) {
        if (i + LOOKAHEAD < size_ && touched_[i + LOOKAHEAD].gone) given_.table_.fetch(touched_[i + LOOKAHEAD].tag);
        if (touched_[i].gone) given_.forget(touched_[i].slot, touched_[i].tag);
      }
    }

    // Whether a place that satisfies `wanted` had and has pairs, but another least one now.
    template <class Wanted>
    bool renames(const Frame& frame, Wanted wanted) const {
      for (std::size_t i = 0; i < size_; ++i) {
        if (!touched_[i].crowded) continue;
        const auto copies_now = [](std::uint32_t, const Item& item) { return item.copies; };
        const auto copies_before = [&](std::uint32_t slot, const Item& item) {
          return has_touched(slot, item) ? touched_[item.touched].before : item.copies;
        };
        const std::optional<Point> now = given_.least(touched_[i].place, frame, copies_now);
        const std::optional<Point> then = given_.least(touched_[i].place, frame, copies_before);
        if (now && then && !(*now == *then) && wanted(touched_[i].place)) return true;
      }
      return false;
    }

    void commit() { committed_ = true; }

   private:
    static constexpr std::size_t LOOKAHEAD = 12;  // rows whose items are being prefetched; their tags twice as far

    template <class Wanted, class Visit>
    void for_each(const Scratch<std::uint32_t>& tags, std::size_t count, Wanted wanted, Visit visit) {
      for (std::size_t i = 0; i < count; ++i) {
        if (i + 2 * LOOKAHEAD < count && wanted(i + 2 * LOOKAHEAD)) given_.table_.fetch(tags[i + 2 * LOOKAHEAD]);
        if (i + LOOKAHEAD < count && wanted(i + LOOKAHEAD)) {
          const std::uint32_t at = given_.table_.first(tags[i + LOOKAHEAD]);
          if (at != NONE) prefetch(&given_.items_[given_.table_.slot(at)]);
        }
        if (wanted(i)) visit(i);
      }
    }

    bool has_touched(std::uint32_t slot, const Item& item) const {
      return item.touched < size_ && touched_[item.touched].slot == slot;
    }

    // The record of an item that this batch had not touched before; nullptr for others.
    Touched* touch(std::uint32_t slot, std::uint32_t tag, Point place) {
      Item& item = given_.items_[slot];
      if (has_touched(slot, item)) return nullptr;
      item.touched = static_cast<std::uint32_t>(size_);
      touched_[size_] = {place, 0, slot, tag, !given_.alone(tag), false};
      return &touched_[size_++];
    }

    Given& given_;
    Scratch<Touched> touched_;
    std::size_t size_ = 0;
    bool committed_ = false;
  };

  std::size_t distinct() const { return table_.size(); }

  std::uint64_t count(Point pair, Point place) const {
    const std::uint32_t slot = find(pair, Hash::of(place));
    return slot == NONE ? 0 : items_[slot].copies;
  }

  // The least pair at a place; nothing if there is none.
  std::optional<Point> least(Point place, const Frame& frame) const {
    return least(place, frame, [](std::uint32_t, const Item& item) { return item.copies; });
  }

  // Visits the different pairs in any order, with their numbers of copies.
  template <class Visit>
  void for_each(Visit visit) const {
    for (std::uint32_t slot = 0; slot < items_.end(); ++slot)
      if (items_[slot].copies > 0) visit(items_[slot].pair, items_[slot].copies);
  }

  // Throws std::logic_error unless every pair is found by its place.
  void check(const Frame& frame) const {
    std::size_t pairs = 0;
    for_each([&](Point pair, std::uint64_t copies) {
      const std::optional<Point> place = frame(pair);
      if (!place || count(pair, *place) != copies) throw std::logic_error("a pair that is not found");
      ++pairs;
    });
    if (pairs != distinct() || pairs != items_.used()) throw std::logic_error("a lost pair");
  }

  std::size_t bytes() const { return table_.bytes() + items_.reserved_bytes(); }

 private:
  // A pair always has the same place, so that places need no comparison.
  std::uint32_t find(Point pair, std::uint32_t tag) const {
    const std::uint32_t at = table_.find(tag, [&](std::uint32_t slot) { return items_[slot].pair == pair; });
    return at == NONE ? NONE : table_.slot(at);
  }

  // Whether at most one pair has this tag.
  bool alone(std::uint32_t tag) const {
    const std::uint32_t at = table_.first(tag);
    return at == NONE || table_.next(at, tag) == NONE;
  }

  template <class Copies>
  std::optional<Point> least(Point place, const Frame& frame, Copies copies) const {
    std::optional<Point> found;
    const std::uint32_t tag = Hash::of(place);
    for (std::uint32_t at = table_.first(tag); at != NONE; at = table_.next(at, tag)) {
      const Item& item = items_[table_.slot(at)];
      if (copies(table_.slot(at), item) > 0 && (!found || item.pair < *found) && frame(item.pair) == place)
        found = item.pair;
    }
    return found;
  }

  std::uint32_t create(Point pair, std::uint32_t tag) {
    const std::uint32_t slot = items_.take();
    items_[slot] = {pair, 0, NONE};
    table_.insert(tag, slot);
    return slot;
  }

  void forget(std::uint32_t slot, std::uint32_t tag) {
    table_.erase(table_.find(tag, [slot](std::uint32_t other) { return other == slot; }));
    items_[slot].copies = 0;
    items_.give_back(slot);
  }

  SlotTable table_;
  Pool<Item> items_;
};

}  // namespace dynhull
