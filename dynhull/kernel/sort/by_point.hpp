// Stable sort of rows by their point.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <utility>

#include "columns.hpp"

namespace dynhull {

// A row of a batch: a point and a number that sorting carries along.
struct Row {
  Point p;
  std::int64_t row;
};

inline Point point(Point p) { return p; }
inline Point point(const Row& row) { return row.p; }

// O(n) for rows that are almost in order.
template <class R>
void insertion_sort(R* first, R* last) {
  for (R* next = first + (first < last); next < last; ++next) {
    const R row = *next;
    R* gap = next;
    for (; gap > first && point(row) < point(gap[-1]); --gap) *gap = gap[-1];
    *gap = row;
  }
}

// The least and the greatest coordinate of some rows.
struct Range {
  double least = INFINITE, greatest = -INFINITE;

  template <double Point::* AXIS, class R>
  static Range of(const R* rows, std::size_t count) {
    Range range;
    for (std::size_t i = 0; i < count; ++i) range.add(point(rows[i]).*AXIS);
    return range;
  }
  void add(double value) {
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
};

// Stable radix sort by a key of two digits.
template <class R, class Key>
[[gnu::noinline]] void counting_sort(R* rows, R* scratch, std::size_t count, unsigned digit, Key key) {
  constexpr unsigned MOST = 11;
  std::array<std::uint32_t, 1 << MOST> low, high;  // counts of each digit, then the place of its next row
  const std::uint32_t digits = std::uint32_t{1} << digit;
  std::fill_n(low.begin(), digits, 0);
  std::fill_n(high.begin(), digits, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t k = key(rows[i]);
    ++low[k % digits];
    ++high[k / digits];
  }
  std::uint32_t low_sum = 0, high_sum = 0;
  for (std::uint32_t i = 0; i < digits; ++i) {
    low_sum += std::exchange(low[i], low_sum);
    high_sum += std::exchange(high[i], high_sum);
  }
  for (std::size_t i = 0; i < count; ++i) scratch[low[key(rows[i]) % digits]++] = rows[i];
  for (std::size_t i = 0; i < count; ++i) rows[high[key(scratch[i]) / digits]++] = scratch[i];
}

template <class R>
void sort_by_point(R* rows, R* scratch, std::size_t count);

// Finishes rows that are sorted by key: sorts each run of equal keys that is out of order. False if one run is more
// than half of the rows.
template <class R, class Key>
bool sort_runs(R* rows, R* scratch, std::size_t count, Key key) {
  for (std::size_t i = 1; i < count; ++i) {
    if (!(point(rows[i]) < point(rows[i - 1]))) continue;
    const std::uint32_t k = key(rows[i]);
    std::size_t from = i - 1;
    while (from > 0 && key(rows[from - 1]) == k) --from;
    while (i < count && key(rows[i]) == k) ++i;
    if (i - from > count / 2) return false;
    sort_by_point(rows + from, scratch + from, i - from);
  }
  return true;
}

// Sorts by one coordinate, ties by point. False if the coordinates are too unevenly spread.
template <double Point::* AXIS, class R>
bool sort_along(R* rows, R* scratch, std::size_t count, Range range) {
  constexpr unsigned MOST = 11, SPARE = 6;
  const unsigned digit = std::min<unsigned>((std::bit_width(count) + SPARE) / 2, MOST);
  const Columns columns(range.least, range.greatest, 1u << (2 * digit));
  if (!columns.usable()) return false;
  const auto key = [columns](const R& row) { return columns(point(row).*AXIS); };
  counting_sort(rows, scratch, count, digit, key);
  return sort_runs(rows, scratch, count, key);
}

// Stable sort by point. Two counting passes over x, mapped affinely to many more keys than rows, leave few runs of
// equal keys. Long runs (clusters, columns) are mapped again or sorted by comparison. O(n) on most inputs, O(n log n)
// on all.
template <class R>
void sort_by_point(R* rows, R* scratch, std::size_t count) {
  constexpr std::size_t SMALL = 24;
  if (count < SMALL) return insertion_sort(rows, rows + count);
  std::size_t in_order = 1;
  while (in_order < count && point(rows[in_order - 1]) <= point(rows[in_order])) ++in_order;
  if (in_order == count) return;
  const Range range = Range::of<&Point::x>(rows, count);
  const bool done = range.least < range.greatest
                        ? sort_along<&Point::x>(rows, scratch, count, range)
                        : sort_along<&Point::y>(rows, scratch, count, Range::of<&Point::y>(rows, count));
  if (!done) std::stable_sort(rows, rows + count, [](const R& a, const R& b) { return point(a) < point(b); });
}

}  // namespace dynhull
