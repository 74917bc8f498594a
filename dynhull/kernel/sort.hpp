// Sorting rows by their point.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "leaf.hpp"
#include "threads.hpp"

namespace dynhull {

// A row of a batch. What is sorted has its point in `p`, and equal points stay in the order in which they were.
struct Row {
  Point p;
  std::int64_t row;
};

constexpr std::size_t SMALL_SORT = 32;       // below, insertion sort
constexpr std::size_t ONE_PASS = 64 * LEAF;  // below, one counting pass instead of two

// Insertion sort: linear for rows that are almost in order.
template <class R>
void insertion_sort(R* first, R* last) {
  for (R* next = first + (first < last); next < last; ++next) {
    const R row = *next;
    R* gap = next;
    for (; gap > first && row.p < gap[-1].p; --gap) *gap = gap[-1];
    *gap = row;
  }
}

// Scatter by a key below `buckets`, stably.
template <class R, class Key>
void counting_pass(const R* rows, R* target, std::size_t count, std::size_t buckets, Key key) {
  std::vector<std::uint32_t> next(buckets);
  for (std::size_t i = 0; i < count; ++i) ++next[key(rows[i])];
  std::uint32_t sum = 0;
  for (std::uint32_t& start : next) sum += std::exchange(start, sum);
  for (std::size_t i = 0; i < count; ++i) target[next[key(rows[i])]++] = rows[i];
}

template <class R>
void sort_by_point(R* rows, R* scratch, std::size_t count);

// Rows whose keys grow, from rows whose keys only never fall: the few runs of one key that are out of order are sorted.
// False where most have one key.
template <class R, class Key>
bool sort_runs(R* rows, R* scratch, std::size_t count, Key key) {
  for (std::size_t i = 1; i < count; ++i) {
    if (!(rows[i].p < rows[i - 1].p)) continue;
    const std::uint32_t k = key(rows[i]);
    std::size_t from = i - 1;
    while (from > 0 && key(rows[from - 1]) == k) --from;
    while (i < count && key(rows[i]) == k) ++i;
    if (i - from > count / 2) return false;
    sort_by_point(rows + from, scratch + from, i - from);
  }
  return true;
}

// Stable sort by point. Counting passes over x, mapped affinely to more keys than there are rows, leave few runs of
// equal keys; long ones (clusters, columns) are mapped again, or compared. O(n) on most inputs, O(n log n) on all.
template <class R>
void sort_by_point(R* rows, R* scratch, std::size_t count) {
  if (count < SMALL_SORT) return insertion_sort(rows, rows + count);
  const auto compare = [=] { std::stable_sort(rows, rows + count, [](const R& a, const R& b) { return a.p < b.p; }); };
  double least = rows[0].p.x, greatest = least;
  bool sorted = true;
  for (std::size_t i = 1; i < count; ++i) {
    least = std::min(least, rows[i].p.x);
    greatest = std::max(greatest, rows[i].p.x);
    sorted &= rows[i - 1].p <= rows[i].p;
  }
  if (sorted) return;
  constexpr std::size_t DIGIT = 11;
  const std::size_t keys = count < ONE_PASS ? std::bit_ceil(count) : std::size_t{1} << (2 * DIGIT);
  const double scale = static_cast<double>(keys - 1) / (greatest - least);
  if (!(scale > 0 && scale < INFINITE)) return compare();  // one column, or a width beyond every double
  const auto key = [=](const R& row) {                     // monotone in x, whatever the rounding
    return static_cast<std::uint32_t>(static_cast<std::int32_t>((row.p.x - least) * scale));
  };
  if (count < ONE_PASS) {
    counting_pass(rows, scratch, count, keys, key);
    std::copy_n(scratch, count, rows);
  } else {
    constexpr std::uint32_t BUCKETS = 1u << DIGIT;
    counting_pass(rows, scratch, count, BUCKETS, [=](const R& row) { return key(row) % BUCKETS; });
    counting_pass(scratch, rows, count, BUCKETS, [=](const R& row) { return key(row) / BUCKETS; });
  }
  if (!sort_runs(rows, scratch, count, key)) compare();
}

// The same by two threads: each sorts a half, then they merge the halves, one from the least to the middle, the other
// from there. Returns which of the two places the result is in.
template <class R>
R* sort_in_two(R* rows, R* scratch, std::size_t count) {
  const std::size_t half = count / 2;
  R *const right = rows + half, *const end = rows + count;
  both(true, [&] { sort_by_point(rows, scratch, half); }, [&] { sort_by_point(right, scratch + half, count - half); });
  const auto less = [](const R& a, const R& b) { return a.p < b.p; };
  R* const left_cut = rows + half / 2;
  R* const right_cut = std::lower_bound(right, end, *left_cut, less);
  both(
      true, [&] { std::merge(rows, left_cut, right, right_cut, scratch, less); },
      [&] { std::merge(left_cut, right, right_cut, end, scratch + (left_cut - rows) + (right_cut - right), less); });
  return scratch;
}

}  // namespace dynhull
