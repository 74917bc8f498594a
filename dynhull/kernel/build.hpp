// Building from sorted points, and sorting them.
#pragma once

#include <memory>
#include <vector>

#include "shape.hpp"

namespace dynhull {

// Rows sort by their point, equal points by row number: a row has `p` and `row`.
struct Row {
  Point p;
  std::int64_t row;
};
inline bool operator<(const Row& a, const Row& b) { return a.p < b.p || (a.p == b.p && a.row < b.row); }

constexpr std::size_t SMALL_SORT = 16 * LEAF;  // below this many rows, comparisons are faster than counting

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

// Stable sort by point. Two counting passes over x, mapped affinely to 22 bits, leave short runs for insertion sort;
// long runs of almost equal x (clusters, columns) are mapped again, or compared. O(n) on most inputs, O(n log n) on all.
template <class R>
void sort_by_point(R* rows, R* scratch, std::size_t count) {
  constexpr unsigned DIGIT = 11, BUCKETS = 1u << DIGIT;
  const auto by_point = [](const R& a, const R& b) { return a.p < b.p; };
  if (count < SMALL_SORT) {
    if (count < 32)
      insertion_sort(rows, rows + count);
    else
      std::stable_sort(rows, rows + count, by_point);
    return;
  }
  double least = rows[0].p.x, greatest = least;
  bool sorted = true;
  for (std::size_t i = 1; i < count; ++i) {
    least = std::min(least, rows[i].p.x);
    greatest = std::max(greatest, rows[i].p.x);
    sorted &= rows[i - 1].p <= rows[i].p;
  }
  if (sorted) return;
  const double scale = (BUCKETS * BUCKETS - 1) / (greatest - least);
  if (!(scale > 0 && scale < INFINITE)) {  // one column, or a width beyond every double
    std::stable_sort(rows, rows + count, by_point);
    return;
  }
  // Monotone in x, whatever the rounding.
  const auto key = [=](const R& row) { return static_cast<std::uint32_t>((row.p.x - least) * scale); };
  std::vector<std::uint32_t> low(BUCKETS), high(BUCKETS);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t k = key(rows[i]);
    ++low[k % BUCKETS];
    ++high[k / BUCKETS];
  }
  std::uint32_t low_sum = 0, high_sum = 0;
  for (unsigned b = 0; b < BUCKETS; ++b) {
    low_sum += std::exchange(low[b], low_sum);
    high_sum += std::exchange(high[b], high_sum);
  }
  for (std::size_t i = 0; i < count; ++i) scratch[low[key(rows[i]) % BUCKETS]++] = rows[i];
  for (std::size_t i = 0; i < count; ++i) rows[high[key(scratch[i]) / BUCKETS]++] = scratch[i];
  for (std::size_t from = 0, to; from < count; from = to) {
    const std::uint32_t k = key(rows[from]);
    for (to = from + 1; to < count && key(rows[to]) == k;) ++to;
    if (to - from > 1 && to - from < count)
      sort_by_point(rows + from, scratch + from, to - from);
    else if (to - from == count)
      std::stable_sort(rows, rows + count, by_point);
  }
}

// A balanced tree over leaves first..last.
inline Ref balanced(Nodes& nodes, const Ref* first, const Ref* last) {
  if (last - first == 1) return *first;
  const Ref* middle = first + (last - first) / 2;
  const Ref v = nodes.take_node();
  nodes.link(v, 0, balanced(nodes, first, middle));
  nodes.link(v, 1, balanced(nodes, middle, last));
  nodes.node(v).separator = nodes.leaf(*middle).first();
  refresh(nodes, v);
  return v;
}

inline std::size_t leaves_for(std::size_t points) { return points <= LEAF ? 1 : (points + FILL - 1) / FILL; }

// A detached subtree over sorted distinct points; `leaves` has room for leaves_for(count) of them, and so have nodes.
inline Ref build(Nodes& nodes, const Point* points, std::size_t count, Ref* leaves) {
  const std::size_t parts = leaves_for(count);
  for (std::size_t i = 0; i < parts; ++i) {
    const std::size_t from = count * i / parts, to = count * (i + 1) / parts;
    leaves[i] = nodes.take_leaf();
    nodes.leaf(leaves[i]).assign(points + from, static_cast<unsigned>(to - from));
  }
  return balanced(nodes, leaves, leaves + parts);
}

}  // namespace dynhull
