// An index for many point locations between two changes of the hull: both chains in flat arrays with a grid in x, and
// boxes that settle most of the points inside and outside.
#pragma once

#include <memory>
#include <span>

#include "../hull_tree.hpp"
#include "../static/inner_boxes.hpp"
#include "../static/outer_bounds.hpp"
#include "queries.hpp"

namespace dynhull {

class LocateIndex {
 public:
  static constexpr std::uint64_t FIRST_PAYS = 200;  // of so many queries, whatever the hull

  bool fresh(const HullTree& tree) const { return version_ == tree.version(); }

  // Whether the number of queries since the hull's last change pays for a refresh. The chains cost about as much as one
  // query for each vertex, the boxes as much as BOXES_PAY queries.
  bool stale(const HullTree& tree, std::uint64_t queries) const {
    return fresh(tree) ? !boxes_ && queries > BOXES_PAY : queries > vertices_ / 20 + FIRST_PAYS;
  }

  // O(h log n).
  void refresh(const HullTree& tree, std::uint64_t queries) {
    version_ = STALE;
    usable_ = false;
    boxes_.reset();
    for (Side side : SIDES) chain_[side] = tree.chain(side);
    const std::size_t longest = std::max(chain_[UPPER].size(), chain_[LOWER].size());
    vertices_ = chain_[UPPER].size() + chain_[LOWER].size();
    if (longest > 1 && longest < CELLS_LIMIT) lay_grid(2 * longest + 64);
    if (queries > BOXES_PAY) boxes_ = std::make_unique<Boxes>(chain_[LOWER], chain_[UPPER]);
    version_ = tree.version();
  }

  // +1 inside, 0 on the boundary, -1 outside. Copies the points first, so that other threads may change them; false if
  // one is not finite.
  bool locate(const HullTree& tree, const Point* points, std::size_t count, std::int8_t* where) const {
    Plain plain;
    for (std::size_t from = 0; from < count && plain.finite(); from += BLOCK) {
      const std::size_t here = std::min(BLOCK, count - from);
      Point block[BLOCK];
      for (std::size_t i = 0; i < here; ++i) block[i] = plain(points[from + i]);
      if (plain.finite()) locate_block(tree, block, here, where + from);
    }
    return plain.finite();
  }

 private:
  static constexpr std::uint64_t STALE = ~std::uint64_t{0};
  static constexpr std::uint64_t BOXES_PAY = 10'000;
  static constexpr std::size_t BLOCK = 32;  // queries whose memory accesses overlap
  static constexpr std::size_t CELLS_LIMIT = std::size_t{1} << 30;
  static constexpr std::uint32_t SCAN = 8;  // cells with at most this many vertices are searched linearly

  // For each side the number of vertices in the cells before this one.
  struct Cell {
    std::uint32_t before[2];
  };

  struct Boxes {
    Boxes(std::span<const Point> lower, std::span<const Point> upper) : inner(lower, upper), outer(lower, upper) {}
    InnerBoxes inner;
    OuterBounds outer;
  };

  void lay_grid(std::size_t cells) {
    least_ = chain_[UPPER].front().x;
    greatest_ = chain_[UPPER].back().x;
    scale_ = static_cast<double>(cells - 1) / (greatest_ - least_);
    if (!(scale_ > 0 && scale_ < INFINITE)) return;
    grid_.assign(cells + 1, Cell{{0, 0}});
    for (Side side : SIDES) {
      for (Point p : chain_[side]) ++grid_[cell(p.x) + 1].before[side];
      for (std::size_t c = 1; c <= cells; ++c) grid_[c].before[side] += grid_[c - 1].before[side];
    }
    usable_ = true;
  }

  std::size_t cell(double x) const { return static_cast<std::size_t>((x - least_) * scale_); }

  void locate_block(const HullTree& tree, const Point* points, std::size_t count, std::int8_t* where) const {
    std::uint8_t rest[BLOCK];  // the undecided queries
    std::size_t no_box = 0, left_over = 0;
    for (std::size_t i = 0; i < count; ++i) {
      where[i] = 1;
      rest[no_box] = static_cast<std::uint8_t>(i);
      no_box += !(boxes_ && boxes_->inner.holds(points[i]));
    }
    std::size_t cells[BLOCK];
    std::uint32_t left[BLOCK][2];
    for (std::size_t k = 0; k < no_box; ++k) {
      const Point p = points[rest[k]];
      const bool out = (usable_ & either(p.x < least_, greatest_ < p.x)) | (boxes_ && boxes_->outer.leave_out(p));
      const bool within = usable_ & (p.x > least_) & (p.x < greatest_) & !out;
      where[rest[k]] = static_cast<std::int8_t>(1 - 2 * out);
      cells[left_over] = within ? cell(p.x) : NOWHERE;
      prefetch(grid_.data() + (within ? cells[left_over] : 0));
      rest[left_over] = rest[k];
      left_over += !out;
    }
    for (std::size_t k = 0; k < left_over; ++k) {
      if (cells[k] == NOWHERE) continue;
      for (Side side : SIDES) {
        left[k][side] = std::max(grid_[cells[k]].before[side], 1u) - 1;
        prefetch(chain_[side].data() + left[k][side]);
      }
    }
    for (std::size_t k = 0; k < left_over; ++k) {
      const Point p = points[rest[k]];
      const int found = cells[k] == NOWHERE ? 0 : filter(p, cells[k], left[k]);
      where[rest[k]] = static_cast<std::int8_t>(found != 0 ? found : dynhull::locate(tree.nodes(), p).where);
    }
  }

  // +1 inside, -1 outside, 0 if floating point does not decide it.
  int filter(Point p, std::size_t cell, const std::uint32_t (&left)[2]) const {
    int inside = 1;
    for (Side side : SIDES) {
      const Point* chain = chain_[side].data();
      std::uint32_t i = left[side];
      const std::uint32_t end = grid_[cell + 1].before[side];
      if (end - i > SCAN) {
        const Point* after = std::upper_bound(chain + i, chain + end, p.x, [](double x, Point q) { return x < q.x; });
        i = static_cast<std::uint32_t>(after - chain) - 1;
      } else {
        while (chain[i + 1].x <= p.x) ++i;
      }
      if (!(chain[i].x < p.x)) return 0;
      const int turn = turned(side, orientation_filter(chain[i], chain[i + 1], p));
      if (turn > 0) return -1;
      inside = std::min(inside, -turn);
    }
    return inside;
  }

  static constexpr std::size_t NOWHERE = ~std::size_t{0};

  std::vector<Point> chain_[2];
  std::vector<Cell> grid_;
  std::unique_ptr<const Boxes> boxes_;
  double least_ = 0, greatest_ = 0, scale_ = 0;
  std::size_t vertices_ = 0;
  std::uint64_t version_ = STALE;
  bool usable_ = false;
};

}  // namespace dynhull
