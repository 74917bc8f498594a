// Random lives of a hull under AddressSanitizer and UndefinedBehaviorSanitizer.
//
//     fuzz [--seconds S] [seed ...]
//
// Without seeds, random ones until the time is up. After every step the tree is checked against its definitions, and
// its points and `changed` flags against a std::map and a monotone chain, and queries are asked of the tree and, by
// their definitions, of the monotone chain. Some allocations fail on purpose: then the
// hull has to be as it was. Compile with -DDYNHULL_LEAF=4 to split, merge and rotate all the time.
#include <cstring>
#include <map>
#include <random>

#include "../../dynhull/kernel/check.hpp"
#include "../../dynhull/kernel/query/layers.hpp"
#include "../../dynhull/kernel/query/queries.hpp"
#include "failing_allocations.hpp"
#include "fuzz_lives.hpp"

namespace fuzz_points {

using namespace dynhull;

using Model = std::map<Point, std::uint64_t>;

std::vector<Point> chain_of(const Model& model, Side side) {
  std::vector<Point> chain;
  for (const auto& [p, copies] : model) {
    while (chain.size() > 1 && turned(side, orientation(chain[chain.size() - 2], chain.back(), p)) >= 0)
      chain.pop_back();
    chain.push_back(p);
  }
  return chain;
}

class Life {
 public:
  explicit Life(std::uint64_t seed) : random_(seed), kind_(below(8)), calm_(below(3) == 0) {
    Team::set_limit(1 + static_cast<unsigned>(seed % 4));
  }

  void live() {
    const int steps = 10 + static_cast<int>(below(60));
    for (int step = 0; step < steps; ++step) {
      switch (below(calm_ ? 3 : 8)) {
        case 0: insert(); break;
        case 1: remove(); break;
        case 2: remove_vertex(); break;
        case 3: batch(below(12), below(3)); break;
        case 4: batch(below(40), below(3)); break;
        case 5: batch(below(200), below(3)); break;
        case 6: batch(model_.size() / 2 + below(50), 1); break;
        default: below(30) == 0 ? clear() : copy(); break;
      }
      check();
      for (int i = 0; i < 3; ++i) ask();
    }
  }

 private:
  std::uint64_t below(std::uint64_t n) { return n > 0 ? random_() % n : 0; }

  double coordinate() {
    static const double EXTREME[] = {0.0,    5e-324,  -5e-324, 1e-323,  2.2250738585072014e-308,
                                     1e-160, -1e-160, 1.0,     -3.0,    9e15,
                                     1e160,  -1e160,  1.7e308, -1.7e308};
    switch (kind_) {
      case 0: return static_cast<double>(below(4));
      case 1: return static_cast<double>(below(40)) - 20;
      case 2: return 0.5 + static_cast<double>(below(9)) * 0x1p-53;
      case 3: return EXTREME[below(std::size(EXTREME))];
      case 4: {
        const std::uint64_t bits = random_();
        double value;
        std::memcpy(&value, &bits, sizeof value);
        return std::isfinite(value) ? value + 0.0 : 1.0;
      }
      default: return static_cast<double>(random_()) * 0x1p-64;
    }
  }

  Point point() {
    if (kind_ == 6) {  // near a circle
      const double angle = static_cast<double>(random_()) * 0x1p-61;
      return {std::cos(angle), std::sin(angle)};
    }
    if (kind_ == 7) {  // a parabola, all of them vertices
      const double x = static_cast<double>(below(100000)) - 50000;
      return {x, x * x};
    }
    const double x = coordinate();
    return {x, coordinate()};
  }

  Point present() {
    const Point near = point();
    auto it = model_.lower_bound(near);
    if (it == model_.end()) it = model_.begin();
    return it->first;
  }

  // Run an update, sometimes with too little memory at first.
  template <class Update>
  void with_failures(Update update) {
    if (below(4) == 0) {
      const std::vector<Point> before[] = {tree_.chain(UPPER), tree_.chain(LOWER)};
      const std::uint64_t changes = tree_.changes;
      allocations_left = static_cast<long>(below(12));
      bool failed = false;
      try {
        update();
      } catch (const std::bad_alloc&) {
        failed = true;
      }
      allocations_left = -1;
      if (!failed) return;
      require(tree_.changes == changes && tree_.chain(UPPER) == before[UPPER] && tree_.chain(LOWER) == before[LOWER],
              "a failed allocation changed the hull");
      check();
    }
    update();
  }

  void insert() {
    const Point p = below(4) == 0 && !model_.empty() ? present() : point();
    with_failures([&] { changed_ = tree_.insert(p); });
    ++model_[p];
    expect_change();
  }

  void remove(Point p) {
    const bool there = model_.contains(p);
    const HullTree::Removal removal = tree_.remove(p);
    require((removal == HullTree::Removal::MISSING) == !there, "a delete found what is not there, or did not find");
    changed_ = removal == HullTree::Removal::HULL_CHANGED;
    take(p);
    expect_change();
  }
  void remove() { remove(model_.empty() || below(8) == 0 ? point() : present()); }
  void remove_vertex() {
    if (model_.empty()) return;
    const std::vector<Point> chain = tree_.chain(below(2) == 0 ? UPPER : LOWER);
    remove(chain[below(chain.size())]);
  }

  void take(Point p) {
    const auto it = model_.find(p);
    if (it != model_.end() && --it->second == 0) model_.erase(it);
  }

  // `mood`: 0 only deletes, 1 both, 2 only inserts.
  void batch(std::size_t count, std::uint64_t mood) {
    std::vector<std::int8_t> ops(count);
    std::vector<Point> points(count);
    const bool strip = below(3) == 0 && !model_.empty();
    auto walk = model_.begin();
    if (strip) std::advance(walk, static_cast<long>(below(model_.size())));
    for (std::size_t i = 0; i < count; ++i) {
      ops[i] = mood == 0 || (mood == 1 && below(2) == 0) ? -1 : 1;
      if (strip && walk != model_.end()) {
        points[i] = (walk++)->first;
        if (ops[i] > 0 && kind_ >= 5) points[i].y += 0x1p-20;
      } else {
        points[i] = model_.empty() || (ops[i] > 0 ? below(8) != 0 : below(16) == 0) ? point() : present();
      }
    }
    const bool ignore = below(2) == 0;
    // The model: what is inserted comes first.
    Model after = model_;
    std::int64_t applied = static_cast<std::int64_t>(count), missing = -1;
    for (std::size_t i = 0; i < count; ++i)
      if (ops[i] > 0) ++after[points[i]];
    for (std::size_t i = 0; i < count; ++i) {
      if (ops[i] > 0) continue;
      const auto it = after.find(points[i]);
      if (it != after.end()) {
        if (--it->second == 0) after.erase(it);
        continue;
      }
      --applied;
      if (missing < 0) missing = static_cast<std::int64_t>(i);
    }
    const std::uint64_t changes = tree_.changes;
    Applied result{};
    const bool alike =
        count > 0 && std::count(ops.begin(), ops.end(), ops[0]) == static_cast<std::ptrdiff_t>(ops.size());
    const Ops given = {ops.data(), alike ? 0u : 1u};
    const std::optional<bool> ways[] = {{}, false, true};
    const std::optional<bool> together = ways[below(std::size(ways))];
    with_failures([&] { result = tree_.apply(given, points.data(), count, ignore, together); });
    if (missing >= 0 && !ignore)
      applied = 0;
    else
      model_ = std::move(after);
    require(result.rows == applied && result.first_missing == missing, "a batch miscounted its rows");
    require(tree_.changes - changes <= 1, "a batch counted as several changes");
    changed_ = tree_.changes > changes;
    expect_change();
  }

  void clear() {
    changed_ = !model_.empty();
    tree_.clear();
    model_.clear();
    expect_change();
  }

  void copy() {
    std::vector<Point> points;
    for (const auto& [p, copies] : model_) points.insert(points.end(), copies, p);
    std::shuffle(points.begin(), points.end(), random_);
    HullTree other(points.data(), points.size());
    other.changes = tree_.changes;
    tree_ = std::move(other);
  }

  void expect_change() {
    std::vector<Point> now[] = {chain_of(model_, UPPER), chain_of(model_, LOWER)};
    for (Side side : SIDES) require(tree_.chain(side) == now[side], "the hull is wrong");
    require(changed_ == (now[UPPER] != chains_[UPPER] || now[LOWER] != chains_[LOWER]), "`changed` is wrong");
    for (Side side : SIDES) chains_[side] = std::move(now[side]);
  }

  void check() {
    const Check checked(tree_);
    auto expected = model_.begin();
    tree_.for_each([&](Point p, std::uint64_t copies) {
      require(expected != model_.end() && expected->first == p && expected->second == copies,
              "a point or count is off");
      ++expected;
    });
    require(expected == model_.end(), "a point is missing");
  }

  // Counter-clockwise: each vertex and the next.
  std::vector<Edge> edges() const {
    std::vector<Point> around = chains_[LOWER];
    if (chains_[UPPER].size() > 2) around.insert(around.end(), chains_[UPPER].rbegin() + 1, chains_[UPPER].rend() - 1);
    std::vector<Edge> edges;
    for (std::size_t i = 0; i < around.size(); ++i) edges.push_back({around[i], around[(i + 1) % around.size()]});
    return edges;
  }

  // Any point, or one that the hull has, or one beside it.
  Point question() {
    Point p = below(2) == 0 || model_.empty() ? point() : present();
    if (below(2) == 0) p.x = std::nextafter(p.x, below(2) == 0 ? 1e300 : -1e300) + 0.0;
    if (below(2) == 0) p.y = std::nextafter(p.y, below(2) == 0 ? 1e300 : -1e300) + 0.0;
    return p;
  }

  void ask() {
    const Point p = question(), q = question();
    const std::vector<Edge> around = edges();
    ask_about_point(p, around);
    if (!(p == q)) ask_about_line(p, q, around);
    if (around.empty() || p == Point{0, 0}) return;
    Point best = around[0].a;
    for (const Edge& edge : around) {
      const int sign = direction_sign(p, best, edge.a);
      if (sign > 0 || (sign == 0 && edge.a < best)) best = edge.a;
    }
    require(support(tree_.nodes(), p) == best, "support is wrong");
    if (below(8) == 0) peel();
  }

  static std::vector<Point> ring_of(const Model& model) {
    std::vector<Point> ring = chain_of(model, LOWER);
    const std::vector<Point> upper = chain_of(model, UPPER);
    if (upper.size() > 2) ring.insert(ring.end(), upper.rbegin() + 1, upper.rend() - 1);
    return ring;
  }
  static void add_area(ExactSum<2>& doubled, int sign, const std::vector<Point>& ring) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Point p = ring[i], q = ring[(i + 1) % ring.size()];
      doubled.add(sign, {p.x, q.y});
      doubled.add(-sign, {p.y, q.x});
    }
  }

  void peel() {
    const std::size_t most = 1 + below(8);
    std::vector<std::vector<Point>> layers;
    std::vector<double> areas;
    with_failures([&] { layers = layers_of(tree_, most); });
    with_failures([&] { areas = influence_of(tree_); });
    Model rest = model_;
    for (const std::vector<Point>& layer : layers) {
      require(layer == ring_of(rest), "a layer is wrong");
      for (Point p : layer) rest.erase(p);
    }
    require(layers.size() == most || rest.empty(), "a layer is missing");
    const std::vector<Point> ring = ring_of(model_);
    require(areas.size() == ring.size(), "a vertex has no influence");
    if (ring.empty()) return;
    const std::size_t i = below(ring.size());
    Model without = model_;
    without.erase(ring[i]);
    ExactSum<2> doubled;
    add_area(doubled, +1, ring);
    add_area(doubled, -1, ring_of(without));
    require(areas[i] == half_of(doubled), "an influence is wrong");
  }

  void ask_about_point(Point p, const std::vector<Edge>& around) {
    const bool flat = around.size() < 3;
    int where = flat ? -1 : 1;
    double shortest = INFINITE;
    for (const auto& [a, b] : around) {
      const int turn = orientation(a, b, p);
      if (!flat) where = std::min(where, turn);
      if (p == a || (turn == 0 && dot_sign(a, p, p, b) > 0)) {
        shortest = 0;
        if (flat) where = 0;
      } else if (dot_sign(a, p, a, b) <= 0) {
        shortest = std::min(shortest, distance_exact(p, a));
      } else if (dot_sign(b, p, b, a) > 0) {
        shortest = std::min(shortest, distance_to_line_exact(p, a, b));
      }
    }
    require(dynhull::locate(tree_.nodes(), p).where == where, "a location is wrong");
    require(distance(tree_.nodes(), p) == (where < 0 ? shortest : 0), "a distance is wrong");
    const std::optional<Edge> seen = tangents(tree_.nodes(), p);
    require(seen.has_value() == (where < 0 && !around.empty()), "tangents of the wrong points");
    if (!seen) return;
    for (const Edge& edge : around) {
      const int left = orientation(p, seen->a, edge.a), right = orientation(p, seen->b, edge.a);
      require(left <= 0 && right >= 0, "the hull leaves its tangents");
      require((left != 0 || dot_sign(edge.a, seen->a, p, seen->a) >= 0) &&
                  (right != 0 || dot_sign(edge.a, seen->b, p, seen->b) >= 0),
              "a tangent does not end at the farther vertex");
    }
  }

  void ask_about_line(Point p, Point q, const std::vector<Edge>& around) {
    std::vector<Point> met;  // two at most, as no vertex lies between its neighbours
    const auto meets = [&](Point at) {
      if (std::find(met.begin(), met.end(), at) == met.end()) met.push_back(at);
    };
    for (const auto& [a, b] : around) {
      const int at_a = orientation(p, q, a), at_b = orientation(p, q, b);
      if (at_a == 0) meets(a);
      if (at_a * at_b < 0) meets({intersection_exact(p, q, a, b, a.x, b.x), intersection_exact(p, q, a, b, a.y, b.y)});
    }
    const std::optional<Edge> ends = intersect_line(tree_.nodes(), p, q), back = intersect_line(tree_.nodes(), q, p);
    require(ends.has_value() == !met.empty(), "a line misses, or does not");
    if (!ends) return;
    require(back->a == ends->b && back->b == ends->a, "a line is not the same from its other end");
    require(p.x < q.x ? ends->a.x <= ends->b.x : p.x > q.x ? ends->a.x >= ends->b.x : true, "a line is the wrong way");
    for (Point end : {ends->a, ends->b})
      require(std::find(met.begin(), met.end(), end) != met.end(), "a line meets the hull elsewhere");
    for (Point end : met) require(end == ends->a || end == ends->b, "a line has an end that is not there");
  }

  static void require(bool holds, const char* message) {
    if (!holds) throw std::logic_error(message);
  }

  std::mt19937_64 random_;
  std::uint64_t kind_;
  bool calm_;
  bool changed_ = false;
  HullTree tree_;
  Model model_;
  std::vector<Point> chains_[2];
};

int run(int count, char** words) {
  return fuzz_lives(count, words, "lives, leaves of " + std::to_string(LEAF),
                    [](std::uint64_t seed) { Life(seed).live(); });
}

}  // namespace fuzz_points

#ifndef FUZZ_TOGETHER
int main(int count, char** words) { return fuzz_points::run(count, words); }
#endif
