// An index of fences as a Python object. Arguments are those that dynhull/_fence_index.py has checked.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "keyed.hpp"

namespace dynhull {

// New bytes, not initialised.
class NewBytes {
 public:
  explicit NewBytes(std::size_t size)
      : bytes_(nb::steal(PyBytes_FromStringAndSize(nullptr, static_cast<Py_ssize_t>(size)))) {
    if (!bytes_.is_valid()) throw nb::python_error();
  }
  char* data() const { return PyBytes_AS_STRING(bytes_.ptr()); }
  const nb::object& bytes() const { return bytes_; }

 private:
  nb::object bytes_;
};

class FenceIndex {
  template <class Work>
  auto alone(std::size_t rows, Work work) {
    return hull_->alone(rows, [&](Entities&, FramedTree&) { return work(*fences_); });
  }

 public:
  // `latitude`: sine and cosine of that of the centre, where distances are in metres.
  FenceIndex(KeyedHull& hull, std::optional<std::pair<double, double>> latitude) : hull_(&hull) {
    const auto metres = latitude ? std::make_shared<const Metres>(latitude->first, latitude->second) : nullptr;
    hull_->alone(ALL_ROWS, [&](Entities& entities, FramedTree&) {
      auto fences = std::make_unique<Fences>(entities.slots(), metres);
      if (entities.attach(*fences)) fences_ = std::move(fences);
    });
    if (!fences_) throw nb::value_error("subjects has an index of fences already: detach it first");
  }
  FenceIndex(const FenceIndex&) = delete;
  ~FenceIndex() { detach(); }

  void detach() {
    if (!std::exchange(attached_, false)) return;
    hull_->alone(0, [](Entities& entities, FramedTree&) { entities.detach(); });
  }

  std::size_t size() {
    return alone(0, [](Fences& fences) { return fences.size(); });
  }
  bool has(std::int64_t fence) {
    return alone(0, [&](Fences& fences) { return fences.has(fence); });
  }
  std::int64_t count(std::int64_t fence) {
    return alone(0, [&](Fences& fences) { return fences.count(fence); });
  }
  double margin(std::int64_t fence) {
    return alone(0, [&](Fences& fences) { return fences.area(fence)->margin; });
  }

  void set_polygons(std::int64_t fence, const nb::list& polygons, bool closed, double margin, bool cross,
                    const nb::object& inside) {
    std::vector<Polygon> all;
    for (const nb::handle polygon : polygons) {
      std::vector<std::vector<Point>> rings;
      for (const nb::handle ring : nb::cast<nb::list>(polygon)) {
        const Rows rows = nb::cast<Rows>(ring);
        rings.emplace_back(points_of(rows), points_of(rows) + rows.shape(0));
      }
      all.emplace_back(rings);
    }
    set(fence, Area::of_polygons(std::move(all), closed, margin), cross, false, inside);
  }
  void set_circle(std::int64_t fence, double x, double y, double radius, bool closed, double margin, bool cross,
                  const nb::object& inside) {
    set(fence, Area::of_disk({x, y}, radius, closed, margin), cross, false, inside);
  }
  void set_hull(std::int64_t fence, const Rows& vertices, bool closed, double margin, bool cross, bool without_self,
                const nb::object& inside) {
    std::vector<Point> corners(points_of(vertices), points_of(vertices) + vertices.shape(0));
    if (without_self) corners.clear();  // those of the hull itself
    set(fence, Area::of_hull(std::move(corners), closed, margin), cross, without_self, inside);
  }

  nb::object drop(std::int64_t fence) {
    return packed(alone(ALL_ROWS, [&](Fences& fences) { return fences.drop(fence); }));
  }
  nb::object inside(std::int64_t fence) {
    return packed(alone(ALL_ROWS, [&](Fences& fences) { return fences.inside(fence); }));
  }

  // The distances of some places to the area; around the subjects' own hull, to that of the others.
  nb::object distances(std::int64_t fence, const Rows& places) {
    const std::size_t count = places.shape(0);
    const Point* points = points_of(places);
    const Output<double> distances(count);
    measure(
        fence, count, [&](HullTree& tree, double) { OwnHulls::measure_own(tree, {points, count}, distances.data()); },
        [&](const Area& area) {
          for (std::size_t i = 0; i < count; ++i) distances.data()[i] = area.distance(points[i]);
        });
    return nb::cast(distances.array());
  }

  // Which of some places are farther than their errors from the boundary; around the subjects' own hull likewise.
  nb::object clear(std::int64_t fence, const Rows& places, const Doubles& errors) {
    const std::size_t count = places.shape(0);
    const Point* points = points_of(places);
    const Output<bool> clear(count);
    measure(
        fence, count,
        [&](HullTree& tree, double margin) {
          OwnHulls::clear_own(tree, {points, count}, margin, errors.data(), clear.data());
        },
        [&](const Area& area) {
          for (std::size_t i = 0; i < count; ++i) clear.data()[i] = area.is_clear(points[i], errors.data()[i]);
        });
    return nb::cast(clear.array());
  }

  // Lets keys that were removed from the hull of another index and are new here have moved. Returns which rows have.
  // The hulls are locked one after the other.
  nb::object carry(FenceIndex& source, const nb::object& keys) {
    const auto checked = hull_->given_keys(keys);
    const GivenKeys& given = checked.second;
    const Output<bool> carried(given.size());
    std::fill_n(carried.data(), given.size(), false);
    std::vector<std::string> names;
    given.with(hull_->strings(), [&](const auto& batch) {
      for (std::size_t row = 0; row < batch.size(); ++row) names.emplace_back(batch.bytes_of(row));
    });
    auto departures = source.alone(names.size(), [&](Fences& fences) { return fences.departures(names); });
    if (departures.empty()) return nb::cast(carried.array());
    Departures arrived;
    hull_->alone(names.size(), [&](Entities& entities, FramedTree&) {
      std::vector<std::size_t> rows;
      std::vector<Arrival> arrivals;
      given.with(hull_->strings(), [&](const auto& batch) {
        entities.find(batch, [&](std::size_t row, std::uint32_t, std::uint32_t slot) {
          const auto departure = departures.find(names[row]);
          if (slot == NONE || departure == departures.end()) return;
          rows.push_back(row);
          arrivals.push_back({slot, &departure->second});
        });
      });
      arrived.reserve(arrivals.size());
      const std::vector<bool> fresh = fences_->arrive(arrivals);
      for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!fresh[i]) continue;
        carried.data()[rows[i]] = true;
        arrived.insert(departures.extract(names[rows[i]]));
      }
    });
    source.alone(names.size(), [&](Fences& fences) { fences.give(arrived); });
    return nb::cast(carried.array());
  }

  // The columns in one, the lengths of keys that are strings, or None, and the keys; None if there are no rows.
  nb::object take() {
    std::size_t work = 0;
    const bool idle = alone(0, [&](Fences& fences) {
      work = fences.work();
      if (fences.idle()) fences.rest();
      return fences.idle();
    });
    if (idle) return nb::none();
    const Crossings crossings =
        hull_->alone(work, [&](Entities& entities, FramedTree& tree) { return entities.take(tree, *fences_); });
    if (crossings.rows.empty()) return nb::none();
    const std::size_t count = crossings.rows.size();
    const NewBytes columns(count * (sizeof(std::int64_t) + 2 * sizeof(Point) + sizeof(double) + 2));
    auto* const fences = reinterpret_cast<std::int64_t*>(columns.data());
    auto* const points = reinterpret_cast<Point*>(fences + count);
    Point* const previous = points + count;
    auto* const distances = reinterpret_cast<double*>(previous + count);
    auto* const changes = reinterpret_cast<std::int8_t*>(distances + count);
    auto* const causes = reinterpret_cast<std::uint8_t*>(changes + count);
    std::size_t size = 0;
    for (const Crossing& row : crossings.rows) size += hull_->strings() ? row.length : sizeof row.key;
    const NewBytes keys(size), lengths(hull_->strings() ? count : 0);
    beside_others(count, [&] {
      char* key = keys.data();
      for (std::size_t i = 0; i < count; ++i) {
        const Crossing& row = crossings.rows[i];
        fences[i] = row.fence;
        points[i] = row.now;
        previous[i] = row.before;
        distances[i] = row.distance;
        changes[i] = row.change;
        causes[i] = row.cause;
        if (hull_->strings()) {
          lengths.data()[i] = static_cast<char>(row.length);
          key = std::copy_n(crossings.strings.data() + row.key, row.length, key);
        } else {
          std::memcpy(key, &row.key, sizeof row.key);
          key += sizeof row.key;
        }
      }
    });
    return nb::make_tuple(columns.bytes(), hull_->strings() ? lengths.bytes() : nb::none(), keys.bytes());
  }

  void check() {
    alone(ALL_ROWS, [](Fences& fences) { fences.check(); });
  }
  std::size_t memory() {
    return alone(0, [](Fences& fences) { return fences.bytes(); });
  }

 private:
  // Measures rows by `own`, with the tree and the margin, around the subjects' own hull, else by `other`, with the
  // area.
  template <class Own, class Other>
  void measure(std::int64_t fence, std::size_t rows, Own own, Other other) {
    std::shared_ptr<const Area> area;
    const bool is_own = alone(0, [&](Fences& fences) {
      area = fences.area(fence);
      return fences.is_own(fence);
    });
    if (is_own)
      hull_->alone(ALL_ROWS, [&](Entities&, FramedTree& tree) { own(tree.plane(), area->margin); });
    else
      beside_others(rows, [&] { other(*area); });
  }

  void set(std::int64_t fence, Area area, bool cross, bool own, const nb::object& keys) {
    std::optional<std::vector<std::uint32_t>> inside;
    if (!keys.is_none()) {
      inside = hull_->slots_of(keys);
      std::sort(inside->begin(), inside->end());
      inside->erase(std::unique(inside->begin(), inside->end()), inside->end());
    }
    hull_->alone(ALL_ROWS, [&](Entities&, FramedTree& tree) {
      fences_->set(tree.plane(), fence, std::move(area), cross, own, inside ? &*inside : nullptr);
    });
  }

  nb::object packed(const Crossings& crossings) const {
    KeyList keys(hull_->strings());
    beside_others(crossings.rows.size(), [&] {
      for (const Crossing& row : crossings.rows) hull_->strings() ? keys.add(crossings.string(row)) : keys.add(row.key);
    });
    return keys.packed();
  }

  // Runs work that needs no Python without the GIL, unless it is little.
  template <class Work>
  static void beside_others(std::size_t rows, Work work) {
    std::optional<nb::gil_scoped_release> released;
    if (rows > FEW_ROWS) released.emplace();
    work();
  }

  KeyedHull* hull_;  // kept alive by the Python object
  bool attached_ = true;
  std::unique_ptr<Fences> fences_;
};

}  // namespace dynhull
