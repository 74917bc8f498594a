// The pairs of numbers that were given for places. A place has several pairs if it can be written in several ways: 180
// and -180 degrees, any longitude at a pole.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

#include "../keyed/hash.hpp"
#include "../keyed/slot_table.hpp"

namespace dynhull {

class Given {
 public:
  struct Item {
    Point place, pair;
    std::uint64_t copies;
    std::uint64_t before;  // the copies before the batch that is under way; UNTOUCHED if it leaves them alone
  };

  struct Outcome {
    std::int64_t first_missing = -1;  // the row
    std::vector<Point> renamed;       // places that had and have pairs, but another least one; perhaps repeatedly
  };

  std::size_t distinct() const { return table_.size(); }

  std::uint64_t count(Point pair, Point place) const {
    const std::uint32_t slot = find(pair, place, Hash::of(place));
    return slot == NONE ? 0 : items_[slot].copies;
  }

  // The least pair at a place; nothing if there is none.
  std::optional<Point> least(Point place) const {
    return least(place, [](const Item& item) { return item.copies; });
  }

  template <class Visit>
  void for_each(Visit visit) const {
    for (const Item& item : items_)
      if (item.copies > 0) visit(item);
  }

  // Inserts the rows with +1 and deletes those with -1, as a set; `kept` says which rows have an effect. A row that
  // deletes a missing pair has none; unless such rows are ignored, the first one makes the batch change nothing.
  Outcome apply(const std::int8_t* ops, const Point* pairs, const Point* places, std::size_t count, bool ignore_missing,
                bool* kept) {
    Outcome outcome;
    outcome.renamed.reserve(count);
    std::vector<std::uint32_t> tags(count);
    make_room(count);
    for (std::size_t i = 0; i < count; ++i) {
      tags[i] = Hash::of(places[i]);
      table_.fetch(tags[i]);
    }
    // From here on nothing throws.
    for (std::size_t i = 0; i < count; ++i) {
      if (ops[i] <= 0) continue;
      std::uint32_t slot = find(pairs[i], places[i], tags[i]);
      if (slot == NONE) slot = create(pairs[i], places[i], tags[i]);
      ++touched(slot).copies;
      kept[i] = true;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (ops[i] >= 0) continue;
      const std::uint32_t slot = find(pairs[i], places[i], tags[i]);
      kept[i] = slot != NONE && items_[slot].copies > 0;
      if (kept[i])
        --touched(slot).copies;
      else if (outcome.first_missing < 0)
        outcome.first_missing = static_cast<std::int64_t>(i);
    }
    if (outcome.first_missing >= 0 && !ignore_missing)
      for (const std::uint32_t slot : touched_) items_[slot].copies = items_[slot].before;
    else
      for (const std::uint32_t slot : touched_) note_renamed(items_[slot], outcome.renamed);
    for (const std::uint32_t slot : touched_) settle(slot);
    touched_.clear();
    return outcome;
  }

  void clear() { *this = Given(); }

  std::size_t bytes() const {
    return table_.bytes() + items_.capacity() * sizeof(Item) + (free_.capacity() + touched_.capacity()) * 4;
  }

 private:
  static constexpr std::uint64_t UNTOUCHED = ~std::uint64_t{0};

  std::uint32_t find(Point pair, Point place, std::uint32_t tag) const {
    const std::uint32_t at =
        table_.find(tag, [&](std::uint32_t slot) { return items_[slot].pair == pair && items_[slot].place == place; });
    return at == NONE ? NONE : table_.slot(at);
  }

  template <class Copies>
  std::optional<Point> least(Point place, Copies copies) const {
    std::optional<Point> found;
    const std::uint32_t tag = Hash::of(place);
    for (std::uint32_t at = table_.first(tag); at != NONE; at = table_.next(at, tag)) {
      const Item& item = items_[table_.slot(at)];
      if (item.place == place && copies(item) > 0 && (!found || item.pair < *found)) found = item.pair;
    }
    return found;
  }

  template <class Vector>
  static void make_room(Vector& vector, std::size_t extra) {
    const std::size_t needed = vector.size() + extra;
    if (needed > vector.capacity()) vector.reserve(std::max(needed, vector.capacity() + vector.capacity() / 2));
  }

  void make_room(std::size_t count) {
    table_.reserve(count);
    make_room(items_, count);
    make_room(touched_, count);
    if (free_.capacity() < items_.capacity()) free_.reserve(items_.capacity());
  }

  std::uint32_t create(Point pair, Point place, std::uint32_t tag) {
    std::uint32_t slot = static_cast<std::uint32_t>(items_.size());
    if (free_.empty()) {
      items_.push_back({});
    } else {
      slot = free_.back();
      free_.pop_back();
    }
    items_[slot] = {place, pair, 0, UNTOUCHED};
    table_.insert(tag, slot);
    return slot;
  }

  Item& touched(std::uint32_t slot) {
    Item& item = items_[slot];
    if (item.before == UNTOUCHED) {
      item.before = item.copies;
      touched_.push_back(slot);
    }
    return item;
  }

  void note_renamed(const Item& item, std::vector<Point>& renamed) const {
    if ((item.before == 0) == (item.copies == 0)) return;
    const std::optional<Point> now = least(item.place);
    const std::optional<Point> then =
        least(item.place, [](const Item& each) { return each.before == UNTOUCHED ? each.copies : each.before; });
    if (now && then && !(*now == *then)) renamed.push_back(item.place);
  }

  void settle(std::uint32_t slot) {
    Item& item = items_[slot];
    item.before = UNTOUCHED;
    if (item.copies > 0) return;
    table_.erase(table_.find(Hash::of(item.place), [slot](std::uint32_t other) { return other == slot; }));
    free_.push_back(slot);
  }

  SlotTable table_;
  std::vector<Item> items_;
  std::vector<std::uint32_t> free_, touched_;
};

}  // namespace dynhull
