// Work on several threads. Each process has one team of helpers: it starts with the first work that is large enough,
// and helps one caller at a time. Who finds it busy works alone, so callers never wait for each other.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>

#ifdef __linux__
#include <sched.h>
#endif
#if defined(__unix__) || defined(__APPLE__)
#include <pthread.h>
#include <time.h>
#define DYNHULL_HAS_FORK
#endif

#ifndef DYNHULL_ROWS_A_THREAD
#define DYNHULL_ROWS_A_THREAD 512
#endif

namespace dynhull {

// Tells the processor that the thread waits for a few cycles.
inline void pause() {
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__i386__))
  __builtin_ia32_pause();
#elif defined(__GNUC__) && defined(__aarch64__)
  asm volatile("yield");
#else
  std::this_thread::yield();
#endif
}

// The helpers of this process. They claim the tasks of a run one by one, as the caller does: a helper that comes late
// finds nothing left, and the caller waits only for tasks that a helper has begun.
class Team {
 public:
  static constexpr unsigned MOST = 64;  // threads, the caller included

  // How many threads a call may use, the caller's included; 0 for one on each processor available to the process, but
  // none beside the caller's for some time after helpers came late: then others use the processors. `beside`: so may
  // what is not of the call's own work, in one more thread, where the limit is one.
  static void set_limit(unsigned threads, bool beside = false) {
    limit_ = threads;
    beside_ = beside;
  }
  static unsigned limit() {
    const unsigned set = limit_;
    return std::min(set > 0 ? set : processors(), MOST);
  }
  static bool beside() { return beside_ && limit_ == 1; }

  // The team, for this caller alone, with this number of helpers, or fewer if they cannot start. Null if another caller
  // has it, or if there is no memory for it.
  static Team* taken(unsigned helpers) {
    Team* const team = of_this_process();
    if (team == nullptr || team->taken_.exchange(true)) return nullptr;
    if ((limit_ == 0 || beside()) && team->alone_ > 0) {
      --team->alone_;
      team->give_back();
      return nullptr;
    }
    team->start(helpers);
    if (team->asleep_ > 0) team->wake(helpers);
    return team;
  }
  void give_back() { taken_ = false; }
  unsigned helpers() const { return helpers_; }

  using Work = void (*)(void* context, std::size_t task);  // must not throw

  // Calls `work` once with each of the tasks 0, 1, ..., and returns when all are done.
  void run(std::size_t tasks, Work work, void* context) {
    work_ = work;
    context_ = context;
    done_ = 0;
    displaced_ = false;
    open_ = (open_ >> ROUND << ROUND) + (std::uint64_t{1} << ROUND) + (std::uint64_t{tasks} << TASKS);
    if (asleep_ > 0) wake(helpers_);
    const auto began = Clock::now();
    work_on([] {});
    const auto worked = Clock::now();
    await(tasks);
    note_wait(worked - began, Clock::now() - worked);
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr auto WHILE_TAKEN = std::chrono::microseconds(200);
  static constexpr auto AFTERWARDS = std::chrono::microseconds(20);  // about what it costs to wake a thread
  static constexpr unsigned FIRST_ALONE = 16, LONGEST_ALONE = 255;   // calls

  // How long the calling thread has waited for a processor since this was made; also counts its work on systems that do
  // not tell the two apart.
  class Displacement {
   public:
    Clock::duration operator()() const { return Clock::now() - began_ - (worked() - before_); }

   private:
    static Clock::duration worked() {
#ifdef DYNHULL_HAS_FORK
      timespec spent;
      if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &spent) == 0)
        return std::chrono::seconds(spent.tv_sec) + std::chrono::nanoseconds(spent.tv_nsec);
#endif
      return {};
    }

    Clock::time_point began_ = Clock::now();
    Clock::duration before_ = worked();
  };

  // The fields of open_: the number of the run, its tasks, and how many of them are claimed.
  static constexpr unsigned ROUND = 32, TASKS = 16;
  static std::size_t tasks(std::uint64_t open) { return open >> TASKS & 0xffff; }
  static std::size_t claimed(std::uint64_t open) { return open & 0xffff; }

  static unsigned processors() {
#ifdef __linux__
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0) return static_cast<unsigned>(CPU_COUNT(&set));
#endif
    return std::max(std::thread::hardware_concurrency(), 1u);
  }

  static Team* of_this_process() {
    Team* team = current_;
    if (team != nullptr) return team;
    Team* const fresh = new (std::nothrow) Team;
    if (fresh == nullptr) return nullptr;
#ifdef DYNHULL_HAS_FORK
    // A forked child has none of these threads: it forgets the team, whose locks may be held, and makes its own.
    [[maybe_unused]] static const int registered = pthread_atfork(nullptr, nullptr, [] { current_ = nullptr; });
#endif
    if (current_.compare_exchange_strong(team, fresh)) return fresh;
    delete fresh;
    return team;
  }

  void start(unsigned helpers) {
    try {
      for (; helpers_ < helpers; ++helpers_) std::thread([this] { help(); }).detach();
    } catch (const std::system_error&) {  // no thread available
    } catch (const std::bad_alloc&) {
    }
  }

  [[noreturn]] void help() {
    const auto opens = [this] { return is_open(); };
    for (;;) {
      if (!spins_until(opens, AFTERWARDS) && !(taken_ && spins_until(opens, WHILE_TAKEN))) sleep();
      const Displacement displacement;
      work_on([&] {
        if (displacement() > WHILE_TAKEN) displaced_ = true;
      });
    }
  }

  void await(std::size_t tasks) {
    const auto all_done = [&] { return done_ == tasks; };
    if (spins_until(all_done, WHILE_TAKEN)) return;
    std::unique_lock lock(mutex_);
    waits_ = true;
    finished_.wait(lock, all_done);
    waits_ = false;
  }

  // More than twice as many calls alone each time that helpers are late: on a busy machine nearly all calls are. Where
  // helpers had a processor all the time, a long wait only shows that the tasks were uneven.
  void note_wait(Clock::duration worked, Clock::duration waited) {
    const bool late = displaced_ && waited > worked + WHILE_TAKEN;
    late_ = late ? std::min(2 * late_ + FIRST_ALONE, LONGEST_ALONE) : late_ / 2;
    if (late) alone_ = late_;
  }

  bool is_open() const {
    const std::uint64_t open = open_;
    return claimed(open) < tasks(open);
  }

  // Calls `after_each` after each task's work, before it counts as done.
  template <class After>
  void work_on(After after_each) {
    for (std::uint64_t open = open_; claimed(open) < tasks(open);) {
      if (!open_.compare_exchange_weak(open, open + 1)) continue;
      work_(context_, claimed(open));
      after_each();
      if (++done_ == tasks(open) && waits_) {
        const std::lock_guard lock(mutex_);
        finished_.notify_one();
      }
      open = open_;
    }
  }

  template <class Ready>
  static bool spins_until(Ready ready, Clock::duration most) {
    constexpr int A_LOOK = 32;  // pauses between two looks at the clock
    const auto end = Clock::now() + most;
    do {
      for (int i = 0; i < A_LOOK; ++i) {
        if (ready()) return true;
        pause();
      }
    } while (Clock::now() < end);
    return false;
  }

  void sleep() {
    std::unique_lock lock(mutex_);
    ++asleep_;
    const std::uint64_t calls = calls_;
    called_.wait(lock, [&] { return calls_ != calls || is_open(); });
    --asleep_;
  }

  void wake(unsigned helpers) {
    {
      const std::lock_guard lock(mutex_);
      ++calls_;
    }
    for (unsigned i = 0; i < helpers; ++i) called_.notify_one();
  }

  static inline std::atomic<unsigned> limit_ = 0;
  static inline std::atomic<bool> beside_ = false;
  static inline std::atomic<Team*> current_ = nullptr;  // never deleted: its threads run until the process ends

  std::atomic<bool> taken_ = false;
  unsigned helpers_ = 0;
  unsigned late_ = 0, alone_ = 0;  // calls to be made alone: when helpers were last late, and now

  alignas(64) std::atomic<std::uint64_t> open_ = 0;
  Work work_ = nullptr;
  void* context_ = nullptr;
  alignas(64) std::atomic<std::size_t> done_ = 0;
  std::atomic<bool> waits_ = false;      // the caller sleeps
  std::atomic<bool> displaced_ = false;  // a helper had to wait for a processor in this run

  alignas(64) std::mutex mutex_;
  std::condition_variable called_, finished_;
  std::atomic<unsigned> asleep_ = 0;
  std::uint64_t calls_ = 0;
};

// The calling thread, and with it helpers for as long as this lives: up to `wanted` threads together.
class Threads {
 public:
  explicit Threads(std::size_t wanted) { take(std::min<std::size_t>(wanted, Team::limit())); }
  // Two, if there may be one for work beside the calling thread's own.
  struct Beside {};
  explicit Threads(Beside) { take(Team::beside() ? 2 : 1); }
  Threads(const Threads&) = delete;
  ~Threads() {
    if (team_ != nullptr) team_->give_back();
  }

  unsigned count() const { return count_; }

  // Calls `work` with each of the tasks 0, 1, ..., at most 65,535, at the same time if there are helpers. If one
  // throws, the others may not be called; throws the first exception once none runs.
  template <class Work>
  void run(std::size_t tasks, Work work) {
    if (count_ < 2 || tasks < 2) {
      for (std::size_t task = 0; task < tasks; ++task) work(task);
      return;
    }
    Guarded<Work> guarded{work};
    team_->run(tasks, &Guarded<Work>::call, &guarded);
    if (guarded.error) std::rethrow_exception(guarded.error);
  }

 private:
  template <class Work>
  struct Guarded {
    Work& work;
    std::atomic<bool> failed = false;
    std::exception_ptr error = nullptr;

    static void call(void* context, std::size_t task) {
      auto& self = *static_cast<Guarded*>(context);
      if (self.failed) return;
      try {
        self.work(task);
      } catch (...) {
        if (!self.failed.exchange(true)) self.error = std::current_exception();
      }
    }
  };

  void take(std::size_t wanted) {
    if (wanted < 2) return;
    const auto threads = static_cast<unsigned>(wanted);
    team_ = Team::taken(threads - 1);
    if (team_ != nullptr) count_ = std::min(threads, 1 + team_->helpers());
  }

  Team* team_ = nullptr;
  unsigned count_ = 1;
};

// How many threads are worth starting for a batch of `rows`, and for a pass over `points`.
constexpr std::size_t ROWS_A_THREAD = DYNHULL_ROWS_A_THREAD;
inline std::size_t threads_for_batch(std::size_t rows) { return rows / ROWS_A_THREAD; }
inline std::size_t threads_for(std::size_t points) { return points / (32 * ROWS_A_THREAD); }

// Calls `work` with ranges that make up 0..count, on several threads if `count` is large enough.
template <class Work>
void for_ranges(std::size_t count, std::size_t a_thread, Work work) {
  Threads threads(count / a_thread);
  const std::size_t ranges = threads.count() > 1 ? 4 * threads.count() : 1;
  threads.run(ranges, [&](std::size_t i) { work(count * i / ranges, count * (i + 1) / ranges); });
}

}  // namespace dynhull
