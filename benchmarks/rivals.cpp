// Rivals in C++: reads commands and points from standard input, prints processor seconds.
//
//     window n k      n points, then k more: insert one and delete the oldest, k times: std::set and CGAL's Delaunay
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

static void window(const std::vector<Point>& points, std::size_t n, std::size_t k) {
  std::set<Point> ordered(points.begin(), points.begin() + static_cast<long>(n));
  report("std::set", 2 * k, [&] {
    for (std::size_t i = 0; i < k; ++i) {
      ordered.insert(points[n + i]);
      ordered.erase(points[i]);
    }
  });
#ifdef WITH_CGAL
  if (n > MOST_FOR_SLOW) return;
  const std::size_t few = std::min<std::size_t>(k, 2000);
  CGAL::Delaunay_triangulation_2<Kernel> triangulation;
  std::vector<CgalPoint> start;
  for (std::size_t i = 0; i < n; ++i) start.emplace_back(points[i].first, points[i].second);
  triangulation.insert(start.begin(), start.end());
  std::vector<decltype(triangulation)::Vertex_handle> handles;
  for (std::size_t i = 0; i < few; ++i) handles.push_back(triangulation.nearest_vertex(start[i]));
  report("CGAL Delaunay_triangulation_2", 2 * few, [&] {
    for (std::size_t i = 0; i < few; ++i) {
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
