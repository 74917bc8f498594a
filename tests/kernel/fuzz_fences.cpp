// Random lives of an index of fences under AddressSanitizer and UndefinedBehaviorSanitizer.
//
//     fuzz_fences [--seconds S] [seed ...]
//
// Without seeds, random ones until the time is up. Two hulls with an index each live the same life; in one of them some
// allocations fail on purpose: then everything has to be as it was. Who is inside is compared with a model that looks
// at every subject for every fence, except around the subjects' own hull. In every fourth life keys go over between
// hulls. In every fifth four, what batches cross is found beside them in the frail hull, and after them in the other.
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>

#include "../../dynhull/kernel/keyed/entities.hpp"
#include "failing_allocations.hpp"
#include "fuzz_lives.hpp"
#include "packed_keys.hpp"

namespace fuzz_fences {

using namespace dynhull;

void require(bool holds, const char* message) {
  if (!holds) throw std::logic_error(message);
}

using Rings = std::vector<std::vector<Point>>;

const std::vector<std::vector<Rings>> SHAPES = {
    {{{{0, 0}, {5, 1}, {2, 4}}}},
    {{{{0, 0}, {4, 0}, {4, 4}, {0, 4}}}},
    {{{{0, 0}, {6, 0}, {6, 6}, {0, 6}, {0, 4}, {4, 4}, {4, 2}, {0, 2}}}},
    {{{{0, 0}, {6, 0}, {6, 6}, {0, 6}}, {{2, 2}, {2, 4}, {4, 4}, {4, 2}}}},
    {{{{0, 0}, {6, 0}, {6, 6}, {0, 6}}, {{0, 3}, {3, 4}, {3, 2}}}},  // a hole that touches
    {{{{0, 0}, {4, 0}, {4, 4}, {0, 4}}}, {{{2, 2}, {6, 2}, {6, 6}, {2, 6}}}},
    {{{{0, 0}, {4, 0}, {4, 4}, {0, 4}}}, {{{4, 0}, {6, 0}, {6, 4}, {4, 4}}}},
};

// An entity of the model: its place, and its time.
std::uint64_t number_of(const std::string& key) { return std::stoull(key); }

struct Entity {
  Point place;
  double time;
};
struct Modelled {
  Area area;
  bool own, cross;
  std::set<std::string> inside;  // when it was last decided
};
// What a hull answers, in a form that two of them share.
using Row = std::tuple<std::int64_t, std::string, int, int, std::array<std::uint64_t, 5>>;

// Whether a subject is inside, given whether it was.
bool stays(const Area& area, Point p, bool was) {
  if (area.holds(p)) return true;
  if (!was || area.margin == 0) return false;
  if (area.where(p) == 0) return true;
  if (area.kind == Area::Kind::DISK) return compare_distance(p, area.center, area.radius, area.margin) <= 0;
  bool near = false;
  area.for_each_edge([&](Edge edge) { near = near || compare_distance(p, nearest_part(p, edge), area.margin) <= 0; });
  return near;
}

// A hull and its index.
struct Indexed {
  explicit Indexed(bool strings) : entities(strings, false) { restart(); }

  void restart() {
    fences = std::make_unique<Fences>(entities.slots());
    entities.detach();
    entities.attach(*fences);
  }
  std::vector<Row> rows_of(const Crossings& crossings) const {
    std::vector<Row> rows;
    for (const Crossing& row : crossings.rows) {
      const auto bits = [](double value) {
        return std::isnan(value) ? ~std::uint64_t{0} : std::bit_cast<std::uint64_t>(value);
      };
      rows.emplace_back(
          row.fence, entities.slots().strings() ? std::string(crossings.string(row)) : std::to_string(row.key),
          row.change, row.cause,
          std::array{bits(row.now.x), bits(row.now.y), bits(row.before.x), bits(row.before.y), bits(row.distance)});
    }
    return rows;
  }
  std::vector<Row> take() {
    const Crossings crossings = entities.take(tree, *fences);
    allocations_left = -1;
    return rows_of(crossings);
  }
  std::vector<std::string> inside(std::int64_t fence) {
    std::vector<std::string> keys;
    for (const Row& row : rows_of(fences->inside(fence))) keys.push_back(std::get<1>(row));
    return keys;
  }

  Entities entities;
  FramedTree tree;
  std::unique_ptr<Fences> fences;
};

class Life {
 public:
  explicit Life(std::uint64_t seed)
      : random_(seed),
        strings_(below(2) == 0),
        kind_(below(4)),
        keys_(1 + below(below(2) == 0 ? 12 : 600)),
        numbers_(1 + below(below(2) == 0 ? 4 : 40)),
        frail_(strings_),
        sound_(strings_) {}

  void live() {
    const int steps = 10 + static_cast<int>(below(80));
    for (int step = 0; step < steps; ++step) {
      switch (below(12)) {
        case 0: put(below(300)); break;
        case 1:
        case 2: put(below(12)); break;
        case 3: remove(below(below(2) == 0 ? 4 : 100)); break;
        case 4: expire(); break;
        case 5:
        case 6:
        case 7: set(); break;
        case 8: below(4) == 0 ? drop() : put(1); break;
        case 9: below(20) == 0 ? clear() : look(); break;
        default: take();
      }
    }
    take();
    look();
  }

 private:
  std::uint64_t below(std::uint64_t n) { return n > 0 ? random_() % n : 0; }
  double fraction() { return static_cast<double>(random_()) * 0x1p-64; }

  std::string key() {
    const std::string number = std::to_string(below(keys_));
    return strings_ ? std::string(1 + number.size() * 31 % 240, 'k') + number : number;
  }

  // On a small grid, anywhere, near the grid, or in clusters.
  Point point() {
    const auto on_grid = [&] { return static_cast<double>(below(13)); };
    switch (kind_) {
      case 0: return {on_grid(), on_grid()};
      case 1: return {12 * fraction(), 12 * fraction()};
      case 2:
        return {on_grid() + 0x1p-40 * static_cast<double>(below(3)),
                on_grid() - 0x1p-40 * static_cast<double>(below(3))};
      default: return {static_cast<double>(below(3)) * 4 + 0.1 * fraction(), 6 + 0.1 * fraction()};
    }
  }
  Point near(Point p) { return {p.x + 0.2 * (fraction() - 0.5), p.y + 0.2 * (fraction() - 0.5)}; }

  // Runs an update of the frail hull, sometimes with too little memory at first.
  template <class Update>
  void with_failures(Update update, bool changes_nothing = true) {
    if (below(3) == 0) {
      allocations_left = static_cast<long>(below(below(2) == 0 ? 20 : 300));
      bool failed = false;
      try {
        update();
      } catch (const std::bad_alloc&) {
        failed = true;
      } catch (...) {
        allocations_left = -1;
        throw;
      }
      allocations_left = -1;
      if (!failed) return;
      if (changes_nothing) compare();
    }
    update();
  }
  // An update of both.
  template <class Update>
  void both(Update update) {
    with_failures([&] { update(frail_); });
    if (ahead_) Team::set_limit(1);
    update(sound_);
    if (ahead_) Team::set_limit(1, true);
  }

  template <class Work>
  void with_keys(const std::vector<std::string>& rows, Work work) {
    with_packed_keys(strings_, rows, number_of,
                     [&](const auto& keys) { both([&](Indexed& hull) { work(hull, keys); }); });
  }
  std::vector<std::string> some_keys(std::size_t count) {
    std::set<std::string> keys;
    for (std::size_t i = 0; i < count; ++i) keys.insert(key());
    return {keys.begin(), keys.end()};
  }

  void put(std::size_t most) {
    const std::vector<std::string> rows = some_keys(most);
    std::vector<Point> places;
    std::vector<double> times;
    for (const std::string& key : rows) {
      const auto held = model_.find(key);
      places.push_back(held != model_.end() && below(3) != 0 ? near(held->second.place) : point());
      times.push_back(static_cast<double>(below(100)));
      model_[key] = {places.back(), times.back()};
    }
    with_keys(rows, [&](Indexed& hull, const auto& keys) {
      Puts puts(hull.tree.frame(), places.data(), times.data(), false, rows.size());
      hull.entities.put(hull.tree, keys, puts, Only::ALL);
    });
  }
  void remove(std::size_t most) {
    const std::vector<std::string> rows = some_keys(most);
    with_keys(rows, [&](Indexed& hull, const auto& keys) { hull.entities.remove(hull.tree, keys, true); });
    for (const std::string& key : rows) model_.erase(key);
  }
  void expire() {
    const double until = static_cast<double>(below(20));
    both([&](Indexed& hull) { hull.entities.expire(hull.tree, until); });
    std::erase_if(model_, [&](const auto& entry) { return entry.second.time <= until; });
  }
  void clear() {
    both([&](Indexed& hull) { hull.entities.clear(hull.tree); });
    model_.clear();
  }

  Area area() {
    const bool closed = below(2) == 0;
    const double margin = below(3) == 0 ? fraction() * static_cast<double>(below(3)) : 0;
    const Point center = point();
    if (below(4) == 0) return Area::of_disk(center, static_cast<double>(below(4)) * fraction(), closed, margin);
    if (below(4) == 0) {
      HullTree corners;
      std::vector<Point> points;
      std::vector<std::int8_t> ops(below(30), 1);
      for (std::size_t i = 0; i < ops.size(); ++i) points.push_back(point());
      corners.apply({ops.data(), 0u}, points.data(), points.size(), false);
      return Area::of_hull(vertices_of(corners), closed, margin);
    }
    std::vector<Polygon> polygons;
    if (below(2) == 0) {
      Rings rings(1);
      const std::uint64_t corners = 3 + below(40);
      for (std::uint64_t k = 0; k < corners; ++k) {
        const double angle = 6.28 * static_cast<double>(k) / static_cast<double>(corners),
                     radius = 0.5 + 3 * fraction();
        rings[0].push_back({center.x + radius * std::cos(angle), center.y + radius * std::sin(angle)});
      }
      polygons.emplace_back(rings);
    } else {
      const double scale = std::ldexp(1, static_cast<int>(below(4)) - 2);
      for (Rings rings : SHAPES[below(SHAPES.size())]) {
        for (std::vector<Point>& ring : rings)
          for (Point& corner : ring)
            corner = {std::floor(center.x) + scale * corner.x, std::floor(center.y) + scale * corner.y};
        polygons.emplace_back(rings);
      }
    }
    return Area::of_polygons(std::move(polygons), closed, margin);
  }

  void set() {
    const auto number = static_cast<std::int64_t>(below(numbers_));
    const bool own = below(8) == 0 && !ahead_, cross = below(3) == 0 && !ahead_;
    const Area chosen = own ? Area::of_hull({}, true, 0.1 + fraction()) : area();
    const auto entry = fences_.find(number);
    const bool given = below(8) == 0;
    const std::vector<std::string> inside = given ? some_keys(below(30)) : std::vector<std::string>();
    if (entry != fences_.end() && entry->second.own) {
      const std::vector<std::string> keys = sound_.inside(number);
      entry->second.inside = {keys.begin(), keys.end()};
    }
    both([&](Indexed& hull) {
      std::vector<std::uint32_t> slots;
      hull.entities.slots().for_each([&](std::uint32_t slot) {
        if (std::binary_search(inside.begin(), inside.end(), key_of(hull, slot))) slots.push_back(slot);
      });
      hull.fences->set(hull.tree.plane(), number, chosen, cross, own, given ? &slots : nullptr);
    });
    const bool fresh = entry == fences_.end() || given;
    Modelled& fence = fences_[number];
    fence = {chosen, own, cross, fresh ? std::set<std::string>() : std::move(fence.inside)};
    if (!fresh) return;
    for (const auto& [key, entity] : model_)
      if (given ? std::binary_search(inside.begin(), inside.end(), key) : chosen.holds(entity.place))
        fence.inside.insert(key);
  }
  void drop() {
    if (fences_.empty()) return;
    const auto entry = std::next(fences_.begin(), static_cast<long>(below(fences_.size())));
    both([&](Indexed& hull) { hull.fences->drop(entry->first); });
    fences_.erase(entry);
  }

  void take() {
    std::vector<Row> frail;
    with_failures([&] { frail = frail_.take(); }, false);  // what has been decided, the next call returns
    const std::vector<Row> sound = sound_.take();
    require(frail == sound, "crossings differ after a failed allocation");
    std::set<std::tuple<std::int64_t, std::string, int>> found, expected;
    for (const Row& row : sound)
      if (const auto& [fence, key, change, cause, numbers] = row; change != 0 && !fences_.at(fence).own)
        found.emplace(fence, key, change);
    for (auto& [number, fence] : fences_) {
      if (fence.own) continue;
      std::set<std::string> now;
      for (const auto& [key, entity] : model_)
        if (stays(fence.area, entity.place, fence.inside.contains(key))) now.insert(key);
      for (const std::string& key : now)
        if (!fence.inside.contains(key)) expected.emplace(number, key, +1);
      for (const std::string& key : fence.inside)
        if (!now.contains(key)) expected.emplace(number, key, -1);
      fence.inside = std::move(now);
    }
    require(found == expected, "crossings differ from the model");
    sound_.fences->check();
    frail_.fences->check();
    compare_with_model();
  }

  // Both hulls report the same, and as the model: at any time, the state of the last decision.
  void compare() {
    require(frail_.fences->size() == sound_.fences->size(), "a failed allocation changed the fences");
    for (const auto& [number, fence] : fences_) {
      require(frail_.fences->count(number) == sound_.fences->count(number), "a failed allocation changed a count");
      require(frail_.inside(number) == sound_.inside(number), "a failed allocation changed who is inside");
    }
    frail_.fences->check();
  }
  void compare_with_model() {
    for (const auto& [number, fence] : fences_) {
      const std::vector<std::string> keys = sound_.inside(number);
      require(keys.size() == static_cast<std::size_t>(sound_.fences->count(number)), "a count is off");
      if (fence.own) continue;
      require(std::set<std::string>(keys.begin(), keys.end()) == fence.inside, "who is inside differs from the model");
    }
  }
  void look() {
    compare();
    compare_with_model();
  }

  static std::string key_of(const Indexed& hull, std::uint32_t slot) {
    const Slots& slots = hull.entities.slots();
    return slots.strings() ? std::string(slots.arena()[slots[slot].key]) : std::to_string(slots[slot].key);
  }

  std::mt19937_64 random_;
  bool strings_;
  std::uint64_t kind_, keys_, numbers_;
  bool ahead_ = Team::beside();
  Indexed frail_, sound_;
  std::map<std::string, Entity> model_;
  std::map<std::int64_t, Modelled> fences_;
};

// Keys that go over between two hulls, whose indexes have some of their fences in common.
class Transfers {
 public:
  explicit Transfers(std::uint64_t seed)
      : random_(seed),
        strings_(below(2) == 0),
        keys_(1 + below(below(2) == 0 ? 12 : 300)),
        sides_{Side(strings_), Side(strings_)} {}

  void live() {
    for (std::uint64_t round = 3 + below(30); round > 0; --round) {
      if (below(3) == 0) set();
      change();
      carry(0, 1);
      carry(1, 0);
      for (Side& side : sides_) take(side);
    }
  }

 private:
  // A hull, its index, and what both should have.
  struct Side {
    explicit Side(bool strings) : hull(strings) {}
    Indexed hull;
    std::map<std::string, Point> before, now;  // as of the last decision, and since then
    std::map<std::int64_t, Area> areas;
    std::map<std::int64_t, std::set<std::string>> inside;
    std::set<std::string> removed, carried;  // since then
  };

  std::uint64_t below(std::uint64_t n) { return n > 0 ? random_() % n : 0; }
  std::string key() {
    const std::string number = std::to_string(below(keys_));
    return strings_ ? "k" + number : number;
  }
  Point point() { return {static_cast<double>(below(13)), static_cast<double>(below(13))}; }

  // A fence of one hull or of both.
  void set() {
    const auto number = static_cast<std::int64_t>(below(6));
    const double margin = below(3) == 0 ? static_cast<double>(below(3)) : 0;
    const Area area = Area::of_disk(point(), static_cast<double>(below(6)), below(2) == 0, margin);
    for (Side& side : sides_) {
      if (below(4) == 0) continue;
      if (side.areas.contains(number)) side.hull.fences->drop(number);
      side.hull.fences->set(side.hull.tree.plane(), number, area, false, false, nullptr);
      side.areas.insert_or_assign(number, area);
      std::set<std::string>& inside = side.inside[number];
      inside.clear();
      for (const auto& [key, place] : side.now)
        if (area.holds(place)) inside.insert(key);
    }
  }

  // Each key changes at most once in each hull, mostly so that it goes over.
  void change() {
    std::set<std::string> chosen;
    for (std::uint64_t count = below(20); count > 0; --count) chosen.insert(key());
    for (const std::string& key : chosen)
      for (Side& side : sides_) {
        const bool there = side.now.contains(key);
        if (below(6) == 0) continue;
        if (there && below(4) != 0) {
          with_packed_keys(strings_, {key}, number_of,
                           [&](const auto& keys) { side.hull.entities.remove(side.hull.tree, keys, true); });
          side.now.erase(key);
          side.removed.insert(key);
        } else {
          const Point place = point();
          const double time = 0;
          with_packed_keys(strings_, {key}, number_of, [&](const auto& keys) {
            Puts puts(side.hull.tree.frame(), &place, &time, false, 1);
            side.hull.entities.put(side.hull.tree, keys, puts, Only::ALL);
          });
          side.now[key] = place;
        }
      }
  }

  // As the binding does it.
  void carry(int from, int to) {
    Side &source = sides_[from], &target = sides_[to];
    std::set<std::string> asked;
    for (std::uint64_t count = below(2 * keys_); count > 0; --count) asked.insert(key());
    const std::vector<std::string> rows(asked.begin(), asked.end());
    std::set<std::string> carried;
    with_packed_keys(strings_, rows, number_of, [&](const auto& keys) {
      std::vector<std::string> names;
      for (std::size_t row = 0; row < keys.size(); ++row) names.emplace_back(keys.bytes_of(row));
      Departures departures = source.hull.fences->departures(names), arrived;
      std::vector<std::size_t> found;
      std::vector<Arrival> arrivals;
      target.hull.entities.find(keys, [&](std::size_t row, std::uint32_t, std::uint32_t slot) {
        const auto departure = departures.find(names[row]);
        if (slot == NONE || departure == departures.end()) return;
        found.push_back(row);
        arrivals.push_back({slot, &departure->second});
      });
      const std::vector<bool> fresh = target.hull.fences->arrive(arrivals);
      for (std::size_t i = 0; i < found.size(); ++i) {
        if (!fresh[i]) continue;
        carried.insert(rows[found[i]]);
        arrived.insert(departures.extract(names[found[i]]));
      }
      source.hull.fences->give(arrived);
    });
    std::set<std::string> expected;
    for (const std::string& key : rows)
      if (source.removed.contains(key) && source.before.contains(key) && target.now.contains(key) &&
          !target.before.contains(key))
        expected.insert(key);
    require(carried == expected, "other keys go over than in the model");
    for (auto& [number, inside] : source.inside) {
      const auto there = target.inside.find(number);
      if (there == target.inside.end()) continue;
      for (const std::string& key : expected)
        if (inside.erase(key) > 0) there->second.insert(key);
    }
    target.carried.insert(expected.begin(), expected.end());
  }

  void take(Side& side) {
    std::set<std::tuple<std::int64_t, std::string, int>> found, expected;
    for (const Row& row : side.hull.take()) found.emplace(std::get<0>(row), std::get<1>(row), std::get<2>(row));
    for (auto& [number, inside] : side.inside) {
      std::set<std::string> now;
      for (const auto& [key, place] : side.now)
        if (stays(side.areas.at(number), place, inside.contains(key))) now.insert(key);
      for (const std::string& key : now) {
        if (!inside.contains(key)) expected.emplace(number, key, +1);
        if (inside.contains(key) && side.carried.contains(key)) expected.emplace(number, key, 2);
      }
      for (const std::string& key : inside)
        if (!now.contains(key)) expected.emplace(number, key, -1);
      inside = std::move(now);
      const std::vector<std::string> keys = side.hull.inside(number);
      require(std::set<std::string>(keys.begin(), keys.end()) == inside, "who is inside differs from the model");
    }
    require(found == expected, "crossings of keys that go over differ from the model");
    side.hull.fences->check();
    side.before = side.now;
    side.removed.clear();
    side.carried.clear();
  }

  std::mt19937_64 random_;
  bool strings_;
  std::uint64_t keys_;
  std::array<Side, 2> sides_;
};

int run(int count, char** words) {
  return fuzz_lives(count, words, "lives of fences, leaves of " + std::to_string(LEAF), [](std::uint64_t seed) {
    const auto kind = static_cast<unsigned>(seed / 4 % 5);
    Team::set_limit(1 + kind % 4, kind == 4);
    if (seed % 4 == 3)
      Transfers(seed).live();
    else
      Life(seed).live();
  });
}

}  // namespace fuzz_fences

#ifndef FUZZ_TOGETHER
int main(int count, char** words) { return fuzz_fences::run(count, words); }
#endif
