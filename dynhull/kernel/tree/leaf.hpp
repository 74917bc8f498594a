// A leaf: up to LEAF points in order, and for each side a mask of those on the chain of the leaf's own hull.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "../memory/prefetch.hpp"
#include "../predicates/signs.hpp"

#ifndef DYNHULL_LEAF
#define DYNHULL_LEAF 62  // entries: 1,024 bytes
#endif

namespace dynhull {

constexpr unsigned LEAF = DYNHULL_LEAF;
static_assert(4 <= LEAF && LEAF < 64);                  // one bit of a mask for each entry, and one past the end
constexpr unsigned FILL = LEAF * 26 / 32;               // entries of a leaf built in bulk: fuller ones split at once
constexpr unsigned LOW = std::max(2u, LEAF * 25 / 64);  // a leaf with fewer entries is merged with its neighbour
constexpr unsigned MERGE_STEP = 4;                      // tried at every fourth size: the neighbour may be full
constexpr std::uint32_t NONE = ~std::uint32_t{0};

using Mask = std::uint64_t;
inline Mask bit(unsigned i) { return Mask{1} << i; }
inline Mask below(unsigned i) { return bit(i) - 1; }
inline unsigned lowest(Mask mask) { return static_cast<unsigned>(std::countr_zero(mask)); }
inline bool several(Mask mask) { return (mask & (mask - 1)) != 0; }
inline unsigned highest(Mask mask) { return 63 - static_cast<unsigned>(std::countl_zero(mask)); }

struct Leaf {
  std::uint32_t parent;
  std::uint32_t size;
  Mask chain[2];
  Mask repeated;            // points with more than one copy: the tree counts them
  double x[LEAF], y[LEAF];  // x is infinite past the end: a search ignores the size

  Point operator[](unsigned i) const { return {x[i], y[i]}; }
  Point first() const { return (*this)[0]; }

  void fetch() const {
    for (unsigned i = 0; i < sizeof(Leaf); i += LINE) prefetch(reinterpret_cast<const char*>(this) + i);
  }
  void fetch_x() const {
    for (unsigned i = 0; i < offsetof(Leaf, y); i += LINE) prefetch(reinterpret_cast<const char*>(this) + i);
  }

  // The first of all LEAF entries whose x is not less. Branch-free: halves, and in the end quarters, whose three
  // comparisons are independent.
  template <unsigned REST = LEAF>
  unsigned find_x(double least, std::size_t from = 0) const {
    constexpr unsigned PARTS = REST > 15 ? 2 : 4, PART = REST / PARTS + 1;
    std::size_t parts = 0;
    for (unsigned i = PART; i <= REST; i += PART) parts += x[from + i - 1] < least;
    from += std::min<std::size_t>(parts * PART, REST - (PART - 1));
    if constexpr (PART > 1) return find_x<PART - 1>(least, from);
    return static_cast<unsigned>(from);
  }
  // The first entry not less than p, given the first entry whose x is not less: y decides between equal x.
  unsigned find_y(unsigned from, Point p) const {
    while (from < size && int{x[from] == p.x} + int{y[from] < p.y} > 1) ++from;  // one predictable branch
    return from;
  }
  unsigned find(Point p) const { return find_y(find_x(p.x), p); }
  bool holds(unsigned i, Point p) const { return i < size && (*this)[i] == p; }
  // Whether p is entry i, or belongs there between two entries.
  bool has_place(unsigned i, Point p) const { return 0 < i && i < size && (*this)[i - 1] < p && p <= (*this)[i]; }

  void assign(const Point* points, unsigned count) {
    size = count;
    repeated = 0;
    double least = INFINITE, greatest = -INFINITE;
    for (unsigned i = 0; i < count; ++i) {
      x[i] = points[i].x;
      y[i] = points[i].y;
      least = std::min(least, y[i]);
      greatest = std::max(greatest, y[i]);
    }
    std::fill(x + size, x + LEAF, INFINITE);
    find_chains(greatest - least);
  }

  // Adds p as entry i. Returns the sides on whose chain p is, as bits.
  unsigned add(unsigned i, Point p) {
    std::copy_backward(x + i, x + size, x + size + 1);
    std::copy_backward(y + i, y + size, y + size + 1);
    x[i] = p.x;
    y[i] = p.y;
    ++size;
    repeated = opened(repeated, i);
    unsigned sides = 0;
    for (Side side : SIDES) {
      chain[side] = opened(chain[side], i);
      if (cover(side, i)) sides |= 1u << side;
    }
    return sides;
  }

  // Removes entry i. Returns the sides on whose chain it was, as bits.
  unsigned remove(unsigned i) {
    unsigned sides = 0;
    for (Side side : SIDES)
      if (chain[side] & bit(i)) sides |= 1u << side;
    std::copy(x + i + 1, x + size, x + i);
    std::copy(y + i + 1, y + size, y + i);
    x[--size] = INFINITE;
    repeated = closed(repeated, i);
    for (Side side : SIDES) {
      chain[side] = closed(chain[side], i);
      if (sides & (1u << side) && size > 0) {
        const Mask before = chain[side] & below(i), after = chain[side] & ~below(i);
        const unsigned from = before ? highest(before) : 0, to = after ? lowest(after) : size - 1;
        chain[side] |= scan(side, from, to);
      }
    }
    return sides;
  }

  // The vertices before and after entry i, which is on the chain; infinite at the chain's ends.
  Edge neighbours(Side side, unsigned i) const {
    const Mask before = chain[side] & below(i), after = chain[side] & ~below(i + 1);
    return {before ? (*this)[highest(before)] : LOWEST, after ? (*this)[lowest(after)] : HIGHEST};
  }

  // The strict chain of the entries from..to, as a mask (Andrew 1979).
  Mask scan(Side side, unsigned from, unsigned to) const {
    return scan(side, from, perhaps_vertices(side, from, to), to);
  }
  // The same of `from`, `to` and some entries between them.
  Mask scan(Side side, unsigned from, Mask between, unsigned to) const {
    Mask mask = bit(from);
    unsigned top = from;
    const auto push = [&](unsigned i) {
      while (top > from) {
        const unsigned under = highest(mask & below(top));
        if (turned(side, orientation((*this)[under], (*this)[top], (*this)[i])) < 0) break;
        mask &= ~bit(top);
        top = under;
      }
      mask |= bit(i);
      top = i;
    };
    for (; between; between &= between - 1) push(lowest(between));
    if (to > from) push(to);
    return mask;
  }

 private:
  static Mask opened(Mask mask, unsigned i) { return (mask & below(i)) | (mask & ~below(i)) << 1; }
  static Mask closed(Mask mask, unsigned i) { return (mask & below(i)) | ((mask >> 1) & ~below(i)); }

  // Entries that may be on either chain, as a ring: from left to right above the chord of the ends, then back below it.
  struct Ring {
    static constexpr unsigned MOST = 64;
    unsigned size = 1;
    std::array<std::uint8_t, 2 * MOST + 1> entries;
  };

  // Finds both chains. What is certainly inside the edge between its neighbours in the ring is on neither; rounds of
  // such tests, which do not wait for each other, leave the chains, unless the sign of a turn remains uncertain.
  void find_chains(double height) {
    constexpr unsigned ROUNDS = 8;
    const unsigned last = size - 1;
    const double bound = orientation_bound(x[last] - x[0], height);
    Ring ring = around_chord(bound);
    bool certain;
    unsigned before, round = 0;
    do {
      before = ring.size;
      certain = thin_out(ring, bound);
    } while (ring.size != before && ++round < ROUNDS);
    Mask upper = bit(last), lower = bit(0);
    unsigned i = 0;
    for (; ring.entries[i] != last; ++i) upper |= bit(ring.entries[i]);
    for (; i < ring.size; ++i) lower |= bit(ring.entries[i]);
    const Mask inner = ~(bit(0) | bit(last));
    chain[UPPER] = certain ? upper : scan(UPPER, 0, upper & inner, last);
    chain[LOWER] = certain ? lower : scan(LOWER, 0, lower & inner, last);
  }

  Ring around_chord(double bound) const {
    const unsigned last = size - 1;
    const Point a = (*this)[0], b = (*this)[last];
    Ring ring;
    ring.entries[0] = 0;
    std::array<std::uint8_t, 2 * Ring::MOST> beneath;  // from `first` to the middle
    unsigned first = Ring::MOST;
    for (unsigned i = 1; i < last; ++i) {
      const double above = doubled_area(a, b, (*this)[i]);
      ring.entries[ring.size] = beneath[first - 1] = static_cast<std::uint8_t>(i);
      ring.size += !(-above > bound);
      first -= !(above > bound);
    }
    ring.entries[ring.size] = static_cast<std::uint8_t>(last);
    ring.size += last > 0;
    std::copy_n(&beneath[first], Ring::MOST, &ring.entries[ring.size]);
    ring.size += Ring::MOST - first;
    return ring;
  }

  // Removes what is certainly inside the edge between its neighbours; not an end of the chains, whose neighbours are of
  // both. Returns whether all certainly turn outwards.
  bool thin_out(Ring& ring, double bound) const {
    std::uint8_t* const entries = ring.entries.data();
    entries[ring.size] = 0;
    unsigned kept = 1;
    double least = INFINITE;
    std::uint8_t entry = entries[1];
    Point before = (*this)[0], p = (*this)[entry];
    for (unsigned i = 1; i < ring.size; ++i) {
      const std::uint8_t next = entries[i + 1];
      const double outside = doubled_area(before, (*this)[next], p);
      least = std::min(least, outside);
      entries[kept] = entry;
      kept += !(outside < -bound) | (entry == size - 1);
      before = p;
      p = (*this)[next];
      entry = next;
    }
    ring.size = kept;
    return least > bound;
  }

  // What is not certainly inside a chord, and the entry farthest outside it. Branch-free.
  struct Beyond {
    Mask outside = 0;
    double most = 0;
    unsigned apex = LEAF;  // none

    void add(unsigned i, Chord::Distance distance) {
      outside |= Mask{!distance.certainly_inside()} << i;
      apex = distance.value > most ? i : apex;
      most = std::max(most, distance.value);
    }
  };

  // The entries between two, without those certainly inside the chord or inside the triangle of the chord and the entry
  // farthest outside it. A floating-point filter.
  Mask perhaps_vertices(Side side, unsigned from, unsigned to) const {
    const Chord chord(side, (*this)[from], (*this)[to]);
    Beyond beyond;
    for (unsigned i = from + 1; i < to; ++i) beyond.add(i, chord.distance((*this)[i]));
    const auto [outside, most, apex] = beyond;
    if (!several(outside) || apex == LEAF) return outside;
    const Chord chords[] = {Chord(side, (*this)[apex], (*this)[to]), Chord(side, (*this)[from], (*this)[apex])};
    Mask kept = bit(apex);
    for (Mask rest = outside & ~bit(apex); rest; rest &= rest - 1) {
      const unsigned i = lowest(rest);
      kept |= Mask{!chords[i < apex].distance((*this)[i]).certainly_inside()} << i;
    }
    return kept;
  }

  // Puts entry i on the chain if it is outside, and removes the vertices that it covers.
  bool cover(Side side, unsigned i) {
    const Point p = (*this)[i];
    Mask before = chain[side] & below(i), after = chain[side] & ~below(i + 1);
    if (before && after && turned(side, orientation((*this)[highest(before)], (*this)[lowest(after)], p)) <= 0)
      return false;
    while (several(after)) {
      const unsigned next = lowest(after), beyond = lowest(after & (after - 1));
      if (turned(side, orientation(p, (*this)[next], (*this)[beyond])) < 0) break;
      after &= after - 1;
    }
    while (several(before)) {
      const unsigned last = highest(before), under = highest(before & below(last));
      if (turned(side, orientation((*this)[under], (*this)[last], p)) < 0) break;
      before &= ~bit(last);
    }
    chain[side] = before | bit(i) | after;
    return true;
  }
};

static_assert(LEAF != 62 || sizeof(Leaf) == 1024);

}  // namespace dynhull
