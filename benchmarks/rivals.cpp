// Rivals in C++: reads commands and points from standard input, prints processor seconds.
//
//     window n k      n points, then k more: insert one and delete the oldest: std::set, CGAL's Delaunay, two stacks
//     static n        the hull of n points at once
//
// Points follow as doubles. Prints "name seconds" for each rival, per update or per hull.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <iterator>
#include <set>
#include <string>
#include <utility>
#include <vector>

#if __has_include(<CGAL/Exact_predicates_inexact_constructions_kernel.h>)
#define WITH_CGAL 1
#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/ch_graham_andrew.h>
#include <CGAL/convex_hull_2.h>
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using CgalPoint = Kernel::Point_2;
#endif

#if __has_include(<convexHull2d/quickHull/hull.h>)
#define WITH_PARGEO 1
#include <convexHull2d/quickHull/hull.h>
#include <pargeo/point.h>
#endif

using Point = std::pair<double, double>;

[[maybe_unused]] constexpr std::size_t MOST_FOR_SLOW = 1'000'000;  // points

static double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

template <class Work>
static void report(const char* name, std::size_t times, Work work) {
  const double began = seconds();
  work();
  std::printf("%s %.9g\n", name, (seconds() - began) / static_cast<double>(times));
  std::fflush(stdout);
}

// The two chains of the hull of points that only come, and go in the reverse order of their coming. Predicates are
// rounded.
class StackedHull {
 public:
  void push(Point p, bool undoable) {
    if (undoable) steps_.push_back({p, covered_.size(), {false, false}});
    for (int side : {0, 1}) {
      std::set<Point>& chain = chains_[side];
      const auto next = chain.lower_bound(p);
      if (next != chain.end() && *next == p) continue;
      const bool inside = next != chain.end() && next != chain.begin() && turn(side, *std::prev(next), p, *next) <= 0;
      if (inside) continue;
      const auto at = chain.insert(next, p);
      while (std::next(at) != chain.end() && std::next(at, 2) != chain.end() &&
             turn(side, p, *std::next(at), *std::next(at, 2)) <= 0)
        cover(side, std::next(at), undoable);
      while (at != chain.begin() && std::prev(at) != chain.begin() &&
             turn(side, *std::prev(at, 2), *std::prev(at), p) <= 0)
        cover(side, std::prev(at), undoable);
      if (undoable) steps_.back().joined[side] = true;
    }
  }
  void pop() {
    const Step step = steps_.back();
    steps_.pop_back();
    for (int side : {0, 1})
      if (step.joined[side]) chains_[side].erase(step.p);
    for (; covered_.size() > step.covered; covered_.pop_back())
      chains_[covered_.back().first].insert(covered_.back().second);
  }
  void clear() {
    for (int side : {0, 1}) chains_[side].clear();
  }
  bool empty() const { return steps_.empty(); }
  const std::set<Point>& chain(int side) const { return chains_[side]; }

 private:
  struct Step {
    Point p;
    std::size_t covered;  // before it
    bool joined[2];
  };

  // Positive if b is outside the line from a to c.
  static double turn(int side, Point a, Point b, Point c) {
    const double left = (b.first - a.first) * (c.second - a.second) - (b.second - a.second) * (c.first - a.first);
    return side == 0 ? left : -left;
  }
  void cover(int side, std::set<Point>::iterator vertex, bool undoable) {
    if (undoable) covered_.push_back({side, *vertex});
    chains_[side].erase(vertex);
  }

  std::set<Point> chains_[2];  // lower, upper
  std::vector<Step> steps_;
  std::vector<std::pair<int, Point>> covered_;
};

// A window by two stacks, as in sliding-window aggregation (Tangwongsan, Hirzel, Schneider, "In-order sliding-window
// aggregation in worst-case constant time", arXiv:2009.13768): new points are pushed on one; the oldest is popped from
// the other, which takes over all points of the first, newest first, when it is empty. The two hulls are not merged.
class TwoStacks {
 public:
  void add(Point p) {
    new_.push_back(p);
    of_new_.push(p, false);
  }
  void drop_oldest() {
    if (of_old_.empty()) {
      for (; !new_.empty(); new_.pop_back()) of_old_.push(new_.back(), true);
      of_new_.clear();
    }
    of_old_.pop();
  }
  const StackedHull& of_old() const { return of_old_; }
  const StackedHull& of_new() const { return of_new_; }

 private:
  std::vector<Point> new_;
  StackedHull of_old_, of_new_;
};

static void window(const std::vector<Point>& points, std::size_t n, std::size_t k) {
  std::set<Point> ordered(points.begin(), points.begin() + static_cast<long>(n));
  report("std::set", 2 * k, [&] {
    for (std::size_t i = 0; i < k; ++i) {
      ordered.insert(points[n + i]);
      ordered.erase(points[i]);
    }
  });
  if (n > MOST_FOR_SLOW) return;
  TwoStacks stacks;
  for (std::size_t i = 0; i < n; ++i) stacks.add(points[i]);
  report("two stacks of hulls, not merged", 2 * n, [&] {  // so often that each point changes stacks once
    for (std::size_t i = 0; i < n; ++i) {
      stacks.add(points[(n + i) % points.size()]);
      stacks.drop_oldest();
    }
  });
#ifdef WITH_CGAL
  const std::size_t few = std::min<std::size_t>(k, 2000);
  CGAL::Delaunay_triangulation_2<Kernel> triangulation;
  std::vector<CgalPoint> start;
  for (std::size_t i = 0; i < n; ++i) start.emplace_back(points[i].first, points[i].second);
  triangulation.insert(start.begin(), start.end());
  std::vector<decltype(triangulation)::Vertex_handle> handles;  // of different points: a triangulation has no copies
  std::set<decltype(triangulation)::Vertex_handle> known;
  for (std::size_t i = 0; i < few; ++i)
    if (const auto vertex = triangulation.nearest_vertex(start[i]); known.insert(vertex).second)
      handles.push_back(vertex);
  report("CGAL Delaunay_triangulation_2", 2 * handles.size(), [&] {
    for (std::size_t i = 0; i < handles.size(); ++i) {
      triangulation.insert(CgalPoint(points[n + i].first, points[n + i].second));
      triangulation.remove(handles[i]);
    }
  });
#endif
}

static void hulls([[maybe_unused]] const std::vector<Point>& points) {
#ifdef WITH_CGAL
  std::vector<CgalPoint> input, output;
  for (auto [x, y] : points) input.emplace_back(x, y);
  report("CGAL convex_hull_2", 1, [&] { CGAL::convex_hull_2(input.begin(), input.end(), std::back_inserter(output)); });
  report("CGAL ch_graham_andrew", 1,
         [&] { CGAL::ch_graham_andrew(input.begin(), input.end(), std::back_inserter(output)); });
#endif
#ifdef WITH_PARGEO
  auto rows = parlay::tabulate(points.size(), [&](std::size_t i) {
    pargeo::point<2> row;
    row[0] = points[i].first;
    row[1] = points[i].second;
    return row;
  });
  pargeo::hull2d::quickHull::compute(parlay::make_slice(rows));  // starts its threads
  report("ParGeo quickHull", 1, [&] { pargeo::hull2d::quickHull::compute(parlay::make_slice(rows)); });
#endif
}

int main(int count, char** words) {
  const std::string command = count > 2 ? words[1] : "";
  const std::size_t n = count > 2 ? std::stoul(words[2]) : 0, k = count > 3 ? std::stoul(words[3]) : 0;
  std::vector<Point> points(n + k);
  for (Point& p : points)
    if (std::fread(&p, sizeof p, 1, stdin) != 1) return 1;
  if (command == "window")
    window(points, n, k);
  else
    hulls(points);
}
