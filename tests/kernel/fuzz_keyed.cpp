// Random lives of entities under AddressSanitizer and UndefinedBehaviorSanitizer.
//
//     fuzz_keyed [--seconds S] [seed ...]
//
// Without seeds, random ones until the time is up. After every step the key table, the names and the tree are checked
// against a std::map. Some allocations fail on purpose: then everything has to be as it was.
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <string>

#include "../../dynhull/kernel/check.hpp"
#include "../../dynhull/kernel/keyed/entities.hpp"
#include "failing_allocations.hpp"
#include "fuzz_lives.hpp"
#include "packed_keys.hpp"

namespace fuzz_entities {

using namespace dynhull;

struct Entity {
  Point place;
  double time;
};

using Model = std::map<std::string, Entity>;  // integers as eight bytes, the highest first

class Life {
 public:
  explicit Life(std::uint64_t seed)
      : random_(seed),
        strings_(below(2) == 0),
        ordered_(below(3) == 0),
        kind_(below(5)),
        times_(below(4)),
        always_timed_(ordered_ || below(2) == 0),
        keys_(1 + below(below(2) == 0 ? 12 : 800)),
        entities_(std::make_unique<Entities>(strings_, ordered_)) {}

  void live() {
    const int steps = 10 + static_cast<int>(below(60));
    for (int step = 0; step < steps; ++step) {
      ++now_;
      switch (below(13)) {
        case 0: put(1); break;
        case 1: put(below(12)); break;
        case 2: put(below(40)); break;
        case 3: put(below(300)); break;
        case 4: remove(below(20)); break;
        case 5: remove(below(300)); break;
        case 6: expire(); break;
        case 7: evict(); break;
        case 8: below(8) == 0 ? clear() : copy(); break;
        case 9: pack(); break;
        default: name(); break;
      }
      check();
    }
  }

 private:
  std::uint64_t below(std::uint64_t n) { return n > 0 ? random_() % n : 0; }

  std::string key() {
    const std::uint64_t number = below(keys_);
    if (strings_)
      return std::string(1 + number % 9 * 31 % 240, static_cast<char>('a' + number % 3)) + std::to_string(number);
    std::string bytes(8, '\0');
    const std::uint64_t spread = number << (number % 3 * 20);
    for (int i = 0; i < 8; ++i) bytes[static_cast<std::size_t>(i)] = static_cast<char>(spread >> (56 - 8 * i));
    return bytes;
  }
  static std::uint64_t integer(const std::string& key) {
    std::uint64_t number = 0;
    for (const char byte : key) number = number << 8 | static_cast<unsigned char>(byte);
    return number;
  }

  Point point() {
    const auto coordinate = [&] { return static_cast<double>(random_()) * 0x1p-64; };
    switch (kind_) {
      case 0: return {static_cast<double>(below(3)), static_cast<double>(below(3))};
      case 1: return {static_cast<double>(below(1000)), 0};
      case 2: {
        const double x = static_cast<double>(below(1000)) - 500;
        return {x, x * x};
      }
      case 3: {
        const double scale = below(40) == 0 ? 1e300 : 1;
        return {scale * coordinate(), scale * coordinate()};
      }
      default: return {coordinate(), coordinate()};
    }
  }

  // Few times, many, those of a clock with stragglers, and those of a clock that one device has far ahead.
  double time() {
    switch (times_) {
      case 0: return static_cast<double>(below(20));
      case 1: return static_cast<double>(below(1'000'000)) / 7;
      case 2: return static_cast<double>(now_) - (below(8) == 0 ? static_cast<double>(below(40)) : 0);
      default: return static_cast<double>(now_) + (below(50) == 0 ? 1e300 : static_cast<double>(below(100)) / 99);
    }
  }
  // A time before which a part of the entities is.
  double some_time() {
    if (model_.empty() || below(8) == 0) return time();
    const double chosen = std::next(model_.begin(), static_cast<long>(below(model_.size())))->second.time;
    return std::isnan(chosen) ? time() : chosen;
  }

  // Different keys, now and then with one twice.
  std::vector<std::string> batch(std::size_t count) {
    std::set<std::string> keys;
    for (std::size_t i = 0; i < count; ++i) keys.insert(key());
    std::vector<std::string> rows(keys.begin(), keys.end());
    std::shuffle(rows.begin(), rows.end(), random_);
    if (!rows.empty() && below(12) == 0)
      rows.insert(rows.begin() + static_cast<long>(below(rows.size())), rows[below(rows.size())]);
    return rows;
  }

  // Calls `work` with the kernel's form of the keys.
  template <class Work>
  void with_keys(const std::vector<std::string>& rows, Work work) {
    with_packed_keys(strings_, rows, integer, [&](const auto& keys) { with_failures([&] { work(keys); }); });
  }

  // Runs an update, sometimes with too little memory at first.
  template <class Update>
  void with_failures(Update update) {
    if (below(3) == 0) {
      const std::uint64_t changes = tree_.changes();
      allocations_left = static_cast<long>(below(20));
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
      require(tree_.changes() == changes, "a failed allocation changed the hull");
      check();
    }
    update();
  }

  void put(std::size_t most) {
    const std::vector<std::string> rows = batch(most);
    std::vector<Point> places(rows.size());
    std::vector<double> times(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto held = model_.find(rows[i]);
      places[i] = held != model_.end() && below(6) == 0 ? held->second.place : point();
      times[i] = time();
    }
    const bool timed = always_timed_ || below(2) == 0;
    const auto only = static_cast<Only>(below(3));
    Model after = model_;
    Counts expected;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto held = after.find(rows[i]);
      const bool there = held != after.end();
      const Entity entity = {places[i], timed ? times[i] : NO_TIME};
      if ((there && only == Only::ABSENT) || (!there && only == Only::PRESENT))
        ++expected.skipped;
      else if (there && ordered_ && times[i] < held->second.time)
        ++expected.stale;
      else {
        ++(!there ? expected.fresh : held->second.place == places[i] ? expected.unmoved : expected.moved);
        after[rows[i]] = entity;
      }
    }
    try {
      with_keys(rows, [&](const auto& keys) {
        Puts puts(tree_.frame(), places.data(), timed ? times.data() : nullptr, false, rows.size());
        const Counts counts = entities_->put(tree_, keys, puts, only);
        require(counts.fresh == expected.fresh && counts.moved == expected.moved &&
                    counts.unmoved == expected.unmoved && counts.stale == expected.stale &&
                    counts.skipped == expected.skipped,
                "a batch miscounted its rows");
      });
    } catch (const DuplicateKey&) {
      return require(twice(rows), "a key is not there twice");
    }
    require(!twice(rows), "a key twice was not noticed");
    model_ = std::move(after);
  }

  static bool twice(const std::vector<std::string>& rows) {
    return std::set<std::string>(rows.begin(), rows.end()).size() < rows.size();
  }

  void remove(std::size_t most) {
    const std::vector<std::string> rows = batch(most);
    const bool ignore = below(3) != 0;
    std::int64_t there = 0;
    std::size_t missing = rows.size();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (model_.contains(rows[i]))
        ++there;
      else
        missing = std::min(missing, i);
    }
    try {
      with_keys(rows, [&](const auto& keys) {
        require(entities_->remove(tree_, keys, ignore) == there, "a removal miscounted");
      });
    } catch (const DuplicateKey&) {
      return require(twice(rows), "a key is not there twice");
    } catch (const MissingKey& absent) {
      return require(!twice(rows) && !ignore && absent.row == missing, "the wrong key is missing");
    }
    require(!twice(rows) && (ignore || missing == rows.size()), "a bad removal was not noticed");
    for (const std::string& key : rows) model_.erase(key);
  }

  void expire() {
    const double until = std::min(some_time(), some_time());
    std::size_t left = 0;
    with_failures([&] { left = entities_->expire(tree_, until); });
    require(left == std::erase_if(model_, [&](const auto& entry) { return entry.second.time <= until; }),
            "an expiry miscounted");
    if (below(2) == 0) return;
    double least = INFINITE, oldest = NO_TIME;
    for (const auto& [key, entity] : model_)
      if (entity.time < least) least = entity.time;
    with_failures([&] { oldest = entities_->oldest(); });
    require(std::isnan(oldest) ? least == INFINITE : oldest == least, "the oldest time is wrong");
  }

  void evict() {
    const std::size_t count = below(2) == 0 ? below(10) : below(model_.size() + 2);
    std::size_t left = 0;
    with_failures([&] { left = entities_->evict(tree_, count); });
    std::vector<std::pair<double, std::string>> ages;
    for (const auto& [key, entity] : model_) ages.emplace_back(std::isnan(entity.time) ? -INFINITE : entity.time, key);
    std::sort(ages.begin(), ages.end());
    require(left == std::min(count, ages.size()), "an eviction miscounted");
    for (std::size_t i = 0; i < left; ++i) model_.erase(ages[i].second);
  }

  void clear() {
    entities_->clear(tree_);
    model_.clear();
  }

  void copy() {
    auto other = std::make_unique<Entities>(*entities_);
    entities_ = std::move(other);
  }

  void pack() {
    const std::uint64_t changes = tree_.changes(), version = tree_.plane().version();
    const std::vector<Point> vertices = tree_.vertices();
    with_failures([&] { require(entities_->pack(tree_), "entities without an index were not packed"); });
    for (bool packed = true; packed;) {
      if (below(2) == 0) allocations_left = static_cast<long>(below(12));
      try {
        entities_->unpack(tree_);
        packed = false;
      } catch (const std::bad_alloc&) {
      }
      allocations_left = -1;
    }
    require(tree_.changes() == changes && tree_.plane().version() == version, "to be packed counted as a change");
    require(tree_.vertices() == vertices, "entities were unpacked to another hull");
  }

  // Names of the vertices, and of any places.
  void name() {
    std::vector<Point> places = tree_.plane().chain(UPPER), lower = tree_.plane().chain(LOWER);
    places.insert(places.end(), lower.begin(), lower.end());
    for (std::uint64_t i = below(2) * below(5); i > 0; --i) places.push_back(point());
    if (!entities_->named(tree_, places)) with_failures([&] { entities_->name(tree_); });
    require(entities_->named(tree_, places), "vertices without names");
    const std::vector<std::uint32_t> least = entities_->least_at(places);
    std::map<Point, std::string> expected;
    for (const auto& [key, entity] : model_) expected.emplace(entity.place, key);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto entry = expected.find(places[i]);
      require(least[i] == NONE ? entry == expected.end() : entry != expected.end() && key_of(least[i]) == entry->second,
              "a place has another name");
    }
  }

  std::string key_of(std::uint32_t slot) const {
    const Slots& slots = entities_->slots();
    if (strings_) return std::string(slots.arena()[slots[slot].key]);
    std::string bytes(8, '\0');
    for (int i = 0; i < 8; ++i) bytes[static_cast<std::size_t>(i)] = static_cast<char>(slots[slot].key >> (56 - 8 * i));
    return bytes;
  }

  void check() {
    tree_.check();
    entities_->check(tree_);
    require(entities_->size() == model_.size(), "an entity too many or too few");
    auto entry = model_.begin();
    for (const std::uint32_t slot : entities_->slots().in_order()) {
      const Slot& held = entities_->slots()[slot];
      require(key_of(slot) == entry->first && held.place == entry->second.place, "a key or place is off");
      require(std::isnan(held.time) ? std::isnan(entry->second.time) : held.time == entry->second.time,
              "a time is off");
      ++entry;
    }
  }

  static void require(bool holds, const char* message) {
    if (!holds) throw std::logic_error(message);
  }

  std::mt19937_64 random_;
  bool strings_, ordered_;
  std::uint64_t kind_, times_;
  bool always_timed_;
  std::uint64_t keys_;
  FramedTree tree_;
  std::unique_ptr<Entities> entities_;
  Model model_;
  std::uint64_t now_ = 0;
};

int run(int count, char** words) {
  return fuzz_lives(count, words, "lives of entities, leaves of " + std::to_string(LEAF),
                    [](std::uint64_t seed) { Life(seed).live(); });
}

}  // namespace fuzz_entities

#ifndef FUZZ_TOGETHER
int main(int count, char** words) { return fuzz_entities::run(count, words); }
#endif
