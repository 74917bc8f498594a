// FramedTree: a multiset of points in a frame, and its convex hull. In the plane it is a HullTree. On the globe its
// points are pairs of degrees; a HullTree holds their projections, and `Given` the pairs of each. The reference in
// Python is dynhull/_globe_tree.py.
#pragma once

#include "../check.hpp"
#include "../hull_tree.hpp"
#include "given.hpp"

namespace dynhull {

// If an update throws, nothing has changed. Updates throw NotFinite for a point that is not finite, or has no place in
// the frame.
class FramedTree {
 public:
  using Removal = HullTree::Removal;

  FramedTree() = default;
  explicit FramedTree(HullTree plane) : plane_(std::move(plane)) {}
  explicit FramedTree(Frame frame) : frame_(std::move(frame)) {}

  const Frame& frame() const { return frame_; }
  const HullTree& plane() const { return plane_; }  // of the places
  HullTree& plane() { return plane_; }

  std::uint64_t changes() const { return plane_.changes; }
  void set_changes(std::uint64_t changes) { plane_.changes = changes; }
  std::size_t size() const { return plane_.size(); }
  std::size_t distinct() const { return frame_.on_globe() ? given_.distinct() : plane_.distinct(); }

  std::uint64_t count(Point p) const {
    if (!frame_.on_globe()) return plane_.count(p);
    const std::optional<Point> place = frame_(p);
    return place ? given_.count(p, *place) : 0;
  }

  void clear() {
    plane_.clear();
    given_ = Given();
  }

  // Throws NotFinite for a point that an update leaves out, if it would refuse it.
  void require(Point p) const {
    if (frame_.on_globe() && !frame_(p)) throw NotFinite();
  }

  // Like those of HullTree.
  bool insert(Point p) {
    if (!frame_.on_globe()) return plane_.insert(p);
    constexpr std::int8_t INSERT = 1;
    const std::uint64_t before = changes();
    apply({&INSERT, 0}, &p, 1, false);
    return changes() > before;
  }
  Removal remove(Point p) {
    if (!frame_.on_globe()) return plane_.remove(p);
    constexpr std::int8_t DELETE = -1;
    const std::uint64_t before = changes();
    if (apply({&DELETE, 0}, &p, 1, false).first_missing >= 0) return Removal::MISSING;
    return changes() > before ? Removal::HULL_CHANGED : Removal::HULL_STANDS;
  }
  Applied apply(Ops ops, const Point* points, std::size_t count, bool ignore_missing,
                std::optional<bool> together = {}) {
    if (!frame_.on_globe()) return plane_.apply(ops, points, count, ignore_missing, together);
    const Scratch<Point> pairs(count), places(count);
    const Scratch<std::int8_t> signs(count);
    project(ops, points, count, pairs, places, signs);
    const Scratch<bool> kept(count);
    Given::Batch batch(given_, signs.data(), pairs.data(), places.data(), count, kept.data());
    if (batch.first_missing >= 0 && !ignore_missing) return {0, batch.first_missing};
    for (std::size_t i = 0, to = 0; i < count && batch.rows < count; ++i) {
      places[to] = places[i];
      signs[to] = signs[i];
      to += kept[i];
    }
    const std::uint64_t before = changes();
    plane_.apply({signs.data(), ops.step}, places.data(), batch.rows, false, together);
    if (changes() == before && batch.renames(frame_, [&](Point place) { return is_vertex(place); })) ++plane_.changes;
    batch.commit();
    return {static_cast<std::int64_t>(batch.rows), batch.first_missing};
  }

  // Fills an empty tree.
  void fill(const Point* points, std::size_t count) {
    constexpr std::int8_t INSERT = 1;
    if (count > 0) apply({&INSERT, 0}, points, count, false);
  }

  // Makes the points of an empty tree choose the projection. It goes again, unless `keep` is called.
  class Choice {
   public:
    Choice(FramedTree& tree, const std::optional<Gnomonic>& chosen)
        : tree_(tree), chosen_(chosen && tree.frame_.on_globe() && !tree.frame_.projection()) {
      if (chosen_) tree.frame_.set_projection(chosen);
    }
    Choice(const Choice&) = delete;
    ~Choice() {
      if (chosen_) tree_.frame_.set_projection({});
    }
    void keep() { chosen_ = false; }

   private:
    FramedTree& tree_;
    bool chosen_;
  };

  // Projects all points anew. Throws NotFinite if one of them has no place then.
  void recenter(const Gnomonic& projection) {
    FramedTree other(Frame::globe(projection));
    std::vector<Point> points;
    points.reserve(size());
    for_each([&](Point p, std::uint64_t copies) { points.insert(points.end(), copies, p); });
    other.fill(points.data(), points.size());
    const std::uint64_t before = changes();
    const bool differs = vertices() != other.vertices();
    frame_.set_projection(projection);
    given_ = std::move(other.given_);
    plane_.become(std::move(other.plane_));
    set_changes(before + differs);
  }

  // Lets go of all points, which `take_back` brings again: then it is as if nothing had happened.
  void set_aside() {
    plane_.set_aside();
    given_ = Given();
  }
  // Throws before anything changes.
  void take_back(const Point* points, std::size_t count) {
    if (!frame_.on_globe()) return plane_.take_back(HullTree(points, count));
    FramedTree same{Frame(frame_)};
    same.fill(points, count);
    given_ = std::move(same.given_);
    plane_.take_back(std::move(same.plane_));
  }

  // The vertices of points that `take_back` would bring.
  std::vector<Point> vertices_aside(const Point* points, std::size_t count) const {
    FramedTree same{Frame(frame_)};
    same.take_back(points, count);
    return same.vertices();
  }

  // Visits every distinct point in order, with its number of copies.
  template <class Visit>
  void for_each(Visit visit) const {
    if (!frame_.on_globe()) return plane_.for_each(visit);
    std::vector<std::pair<Point, std::uint64_t>> pairs;
    pairs.reserve(distinct());
    given_.for_each([&](Point pair, std::uint64_t copies) { pairs.emplace_back(pair, copies); });
    std::sort(pairs.begin(), pairs.end());
    for (const auto& [pair, copies] : pairs) visit(pair, copies);
  }

  // Counter-clockwise from the least; of several points at one place the least.
  std::vector<Point> vertices(std::size_t expected = 0) const {
    std::vector<Point> vertices = vertices_of(plane_, expected);
    if (!frame_.on_globe()) return vertices;
    for (Point& p : vertices) p = given_at(p);
    std::rotate(vertices.begin(), std::min_element(vertices.begin(), vertices.end()), vertices.end());
    return vertices;
  }

  // The least point at a place that has one.
  Point given_at(Point place) const { return frame_.on_globe() ? given_.least(place, frame_).value() : place; }

  bool is_vertex(Point place) const {
    const Ref root = plane_.nodes().root;
    return root != NONE &&
           (on_chain(plane_.nodes(), root, UPPER, place) || on_chain(plane_.nodes(), root, LOWER, place));
  }

  // Throws std::logic_error if an invariant is broken.
  void check() const {
    const Check checked(plane_);
    if (!frame_.on_globe()) return;
    given_.check(frame_);
    std::vector<Point> places;
    given_.for_each([&](Point pair, std::uint64_t copies) { places.insert(places.end(), copies, *frame_(pair)); });
    std::sort(places.begin(), places.end());
    auto next = places.begin();
    plane_.for_each([&](Point p, std::uint64_t copies) {
      for (; copies > 0; --copies)
        if (next == places.end() || !(*next++ == p)) throw std::logic_error("a place without its pair");
    });
    if (next != places.end()) throw std::logic_error("a pair without its place");
  }

  std::size_t used_bytes() const { return plane_.used_bytes() + given_.bytes(); }
  std::size_t reserved_bytes() const { return plane_.reserved_bytes() + given_.bytes(); }

 private:
  // Copies the points first, so that other threads may change them.
  void project(Ops ops, const Point* points, std::size_t count, const Scratch<Point>& pairs,
               const Scratch<Point>& places, const Scratch<std::int8_t>& signs) const {
    constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
    Plain plain;
    bool placed = true;
    for (std::size_t i = 0; i < count; ++i) {
      pairs[i] = plain(points[i]);
      signs[i] = ops.deletes(i) ? -1 : 1;
      placed &= frame_.has(pairs[i]);
    }
    if (!plain.finite() || !placed) throw NotFinite();
    const Scratch<bool> near(count);
    if (frame_.projection())
      (*frame_.projection())(pairs.data(), count, places.data(), near.data());
    else
      std::fill_n(near.data(), count, false);
    for (std::size_t i = 0; i < count; ++i) {
      if (near[i]) continue;
      if (signs[i] > 0) throw NotFinite();
      places[i] = {NOWHERE, NOWHERE};
    }
  }

  Frame frame_;
  HullTree plane_;
  Given given_;
};

}  // namespace dynhull
