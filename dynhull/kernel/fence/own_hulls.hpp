// Fences around the subjects' own hull, without the subject: only a vertex that is there once is outside of the hull of
// the others. Such a fence lists who is outside instead of inside.
#pragma once

#include "../hull_tree.hpp"
#include "../query/queries.hpp"
#include "decisions.hpp"

namespace dynhull {

class OwnHulls {
 public:
  OwnHulls(Zoning& zoning, Reports& reports, Decisions& decisions)
      : zoning_(zoning), reports_(reports), decisions_(decisions) {}

  void add_own(const HullTree& tree, std::uint32_t handle, const std::vector<std::uint32_t>* inside) {
    Fence& fence = *zoning_.fences[handle];
    reports_.owners_changed = true;
    fence.area = std::make_shared<const Area>(Area::of_hull(vertices_of(tree), true, fence.area->margin));
    fence.decided = fence.area;
    std::vector<bool> within(zoning_.slots->end(), inside == nullptr);
    for (std::size_t i = 0; inside && i < inside->size(); ++i) within[(*inside)[i]] = true;
    const std::vector<Point> vertices = single_vertices(tree);
    zoning_.slots->for_each([&](std::uint32_t slot) {
      const Point p = (*zoning_.slots)[slot].place;
      if (within[slot] && (inside || !std::binary_search(vertices.begin(), vertices.end(), p))) {
        ++fence.count;
      } else {
        fence.outside.push_back(slot);
        zoning_.members.add(zoning_.subjects[slot].inside, handle);
      }
    });
  }

  static void look_at_own(Fence& fence, const HullTree& tree) {
    auto area = std::make_shared<const Area>(Area::of_hull(vertices_of(tree), true, fence.area->margin));
    fence.area = *area == *fence.decided ? fence.decided : std::move(area);
  }

  // Subjects that were not there are outside at first.
  void list_fresh() {
    for (std::size_t i = 0; i < reports_.changes.size() && !reports_.owners.empty(); ++i) {
      if (!reports_.changes[i].fresh || reports_.changes[i].returned || !reports_.current(i)) continue;
      const std::uint32_t slot = reports_.changes[i].slot;
      for (const std::uint32_t handle : reports_.owners) {
        Fence& fence = *zoning_.fences[handle];
        if (zoning_.members.has(zoning_.subjects[slot].inside, handle) ||
            reports_.was_there(fence, reports_.key_of(slot), true))
          continue;
        fence.outside.push_back(slot);
        zoning_.members.add(zoning_.subjects[slot].inside, handle);
      }
      reports_.changes[i].returned = true;
    }
    for (const std::uint32_t handle : reports_.owners) zoning_.fences[handle]->listed = true;
  }

  template <class SlotsAt>
  void decide_own(std::uint32_t handle, HullTree& tree, SlotsAt slots_at) {
    Fence& fence = *zoning_.fences[handle];
    const std::vector<Point> vertices = single_vertices(tree);
    std::vector<std::uint32_t> at_vertices = slots_at(vertices);
    std::sort(at_vertices.begin(), at_vertices.end());
    const auto is_single = [&](std::uint32_t slot) {
      return std::binary_search(at_vertices.begin(), at_vertices.end(), slot);
    };
    std::vector<std::uint32_t> outside;
    outside.reserve(fence.outside.size() + at_vertices.size());
    std::sort(fence.outside.begin(), fence.outside.end());
    fence.outside.erase(std::unique(fence.outside.begin(), fence.outside.end()), fence.outside.end());
    for (const std::uint32_t slot : fence.outside) {
      if (!zoning_.there(slot) || !zoning_.members.has(zoning_.subjects[slot].inside, handle)) continue;
      if (is_single(slot))
        outside.push_back(slot);
      else
        decisions_.cross(handle, slot, +1, 0);
    }
    for (const std::uint32_t slot : at_vertices) {
      const Point p = (*zoning_.slots)[slot].place;
      if (!zoning_.members.has(zoning_.subjects[slot].inside, handle)) {
        if (is_near_neighbours(fence.area->convex, p, fence.area->margin)) continue;
        bool stays = false;
        double distance = 0;
        tree.without(p, [&] {
          const std::optional<Edge> part = nearest_part(tree.nodes(), p);
          stays = part && compare_distance(p, *part, fence.area->margin) <= 0;
          distance = dynhull::distance(tree.nodes(), p);
        });
        if (stays) continue;
        outside.push_back(slot);
        fence.outside.push_back(slot);  // in case of an exception
        decisions_.cross(handle, slot, -1, distance);
        continue;
      }
      const std::optional<Point> from = decisions_.start(fence, slot);
      if (!fence.cross || !from || *from == p) continue;
      bool meets = false;
      double distance = 0;
      tree.without(p, [&] {
        meets = Area::of_hull(vertices_of(tree), true, 0).meets(*from, p);
        distance = dynhull::distance(tree.nodes(), p);
      });
      if (meets) decisions_.cross(handle, slot, 0, distance);
    }
    fence.outside = std::move(outside);
  }

  // Of some places of subjects, the distance of each to the hull of the others, and which are farther from its boundary
  // than their errors; a place where there is no single subject has the hull of all.
  static void measure_own(HullTree& tree, std::span<const Point> places, double* distances) {
    const Area all = Area::of_hull(vertices_of(tree), true, 0);
    for_each_own(tree, places, [&](std::size_t i, bool alone) {
      distances[i] = alone ? dynhull::distance(tree.nodes(), places[i]) : all.distance(places[i]);
    });
  }
  static void clear_own(HullTree& tree, std::span<const Point> places, double margin, const double* errors,
                        bool* clear) {
    const Area all = Area::of_hull(vertices_of(tree), true, margin);
    for_each_own(tree, places, [&](std::size_t i, bool alone) {
      if (alone && errors[i] > 0) {  // a vertex is outside of the hull of the others
        const std::optional<Edge> part = nearest_part(tree.nodes(), places[i]);
        clear[i] = !part || compare_distance(places[i], *part, margin, errors[i]) > 0;
      } else {
        clear[i] = all.is_clear(places[i], errors[i]);
      }
    });
  }

 private:
  // Calls `visit` with the row of each place, and whether the tree is then without the single subject at a vertex
  // there.
  template <class Visit>
  static void for_each_own(HullTree& tree, std::span<const Point> places, Visit visit) {
    const std::vector<Point> vertices = single_vertices(tree);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (std::binary_search(vertices.begin(), vertices.end(), places[i]))
        tree.without(places[i], [&] { visit(i, true); });
      else
        visit(i, false);
    }
  }

  // In order.
  static std::vector<Point> single_vertices(const HullTree& tree) {
    std::vector<Point> vertices = vertices_of(tree);
    std::erase_if(vertices, [&](Point p) { return tree.count(p) > 1; });
    std::sort(vertices.begin(), vertices.end());
    return vertices;
  }

  // Whether a vertex is so close to the chord of its neighbours that the hull of the others is near without a look.
  static bool is_near_neighbours(const std::vector<Point>& convex, Point p, double margin) {
    const auto vertex = std::find(convex.begin(), convex.end(), p);
    if (vertex == convex.end()) return false;
    const Point before = vertex == convex.begin() ? convex.back() : vertex[-1];
    const Point after = vertex + 1 == convex.end() ? convex.front() : vertex[1];
    return compare_distance(p, nearest_part(p, {before, after}), margin) <= 0;
  }

  Zoning& zoning_;
  Reports& reports_;
  Decisions& decisions_;
};

}  // namespace dynhull
