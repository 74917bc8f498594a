// A read-write lock for Python threads: many readers or one writer of a hull, in the order in which they came, so that
// neither a writer that never pauses keeps readers out, nor readers a writer.
//
// The GIL guards the lock's counters. A single update holds the GIL throughout and only waits for the lock; a batch
// takes the lock, then releases the GIL. Waiting threads release the GIL too. A batch of few rows keeps it, because
// taking it back from a busy thread would take longer than the work.
#pragma once

#include <nanobind/nanobind.h>

#include <condition_variable>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>

namespace dynhull {

constexpr std::size_t FEW_ROWS = 64, ALL_ROWS = std::numeric_limits<std::size_t>::max();

class ReadWriteLock {
 public:
  // Wait until there is no writer, or until there is neither reader nor writer.
  void await_readable() {
    await_settled();
    use();
  }
  void await_writable() {
    if (writing_ || readers_ > 0) await_turn([this] { return !writing_ && readers_ == 0; });
    use();
  }
  // The same for what a hull that is put away still has.
  void await_settled() {
    if (writing_) await_turn([this] { return !writing_; });
  }

  using TakeOut = void (*)(void* hull);

  // Whether anybody reads, writes or waits.
  bool busy() const { return writing_ || readers_ > 0 || arrived_ != entered_; }
  bool put_away() const { return take_out_ != nullptr; }
  // Whether anybody has used the hull since the last call.
  bool used() { return std::exchange(used_, false); }
  // Has who uses the hull next take it out first, before anybody else does.
  void put_away(void* hull, TakeOut take_out) {
    hull_ = hull;
    take_out_ = take_out;
  }

  // Before a fork, waits until no batch runs in any hull and lets none start, so that the child's hulls are whole.
  static void before_fork() {
    ++forking_;
    wait([] { return running_ == 0; });
  }
  static void after_fork_in_parent() {
    --forking_;
    wake();
  }
  static void after_fork_in_child() {
    signal_ = new Signal;  // a thread of the parent may hold the old mutex
    waiting_ = 0;
    ++this_process_;
    forking_ = 0;
  }

 private:
  friend class ReadLock;
  friend class WriteLock;

  struct Signal {
    std::mutex mutex;
    std::condition_variable changed;
  };

  // Waits until all who came before have entered and the hull is free.
  template <class Free>
  void await_turn(Free free) {
    if (process_ != this_process_) {  // who waited, waits in the process from which this one was forked
      process_ = this_process_;
      arrived_ = entered_ = 0;
    }
    const std::uint64_t turn = arrived_++;
    wait([&] { return entered_ == turn && free(); });
    ++entered_;
    wake();
  }

  // Takes the mutex before releasing the GIL, so that no signal is missed, and never holds it while taking the GIL.
  template <class Holds>
  static void wait(Holds holds) {
    while (!holds()) {
      ++waiting_;
      {
        std::unique_lock lock(signal_->mutex);
        nanobind::gil_scoped_release release;
        signal_->changed.wait(lock);
        lock.unlock();
      }
      --waiting_;
    }
  }

  static void wake() {
    if (waiting_ == 0) return;
    const std::lock_guard lock(signal_->mutex);
    signal_->changed.notify_all();
  }

  // Needs the GIL. If it throws, the hull stays put away, and nobody has entered.
  void use() {
    used_ = true;
    if (take_out_ == nullptr) return;
    take_out_(hull_);
    take_out_ = nullptr;
  }

  bool writing_ = false, used_ = false;
  int readers_ = 0;
  std::uint64_t arrived_ = 0, entered_ = 0;
  int process_ = 0;  // in which the turns were counted
  void* hull_ = nullptr;
  TakeOut take_out_ = nullptr;

  static inline Signal* signal_ = new Signal;
  static inline int waiting_ = 0, running_ = 0;
  static inline int forking_ = 0;
  static inline int this_process_ = 0;  // incremented in each forked child
};

// Held by a batch that reads, without the GIL if it has many rows.
class ReadLock {
 public:
  explicit ReadLock(ReadWriteLock& lock, std::size_t rows = ALL_ROWS) : lock_(lock) {
    lock.await_turn([&] { return ReadWriteLock::forking_ == 0 && !lock.writing_; });
    lock.use();
    ++lock.readers_;
    ++ReadWriteLock::running_;
    if (rows > FEW_ROWS) release_.emplace();
  }
  ~ReadLock() {
    release_.reset();
    --lock_.readers_;
    --ReadWriteLock::running_;
    ReadWriteLock::wake();
  }
  ReadLock(const ReadLock&) = delete;

 private:
  ReadWriteLock& lock_;
  std::optional<nanobind::gil_scoped_release> release_;
};

// Held by a batch that writes, without the GIL if it has many rows.
class WriteLock {
 public:
  explicit WriteLock(ReadWriteLock& lock, std::size_t rows = ALL_ROWS) : lock_(lock) {
    lock.await_turn([&] { return ReadWriteLock::forking_ == 0 && !lock.writing_ && lock.readers_ == 0; });
    lock.use();
    lock.writing_ = true;
    ++ReadWriteLock::running_;
    if (rows > FEW_ROWS) release_.emplace();
  }
  ~WriteLock() {
    release_.reset();
    lock_.writing_ = false;
    --ReadWriteLock::running_;
    ReadWriteLock::wake();
  }
  WriteLock(const WriteLock&) = delete;

 private:
  ReadWriteLock& lock_;
  std::optional<nanobind::gil_scoped_release> release_;
};

}  // namespace dynhull
