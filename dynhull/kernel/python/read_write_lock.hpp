// Many readers or one writer of a hull, among Python threads.
//
// Everything here happens under the GIL, which is what guards the counters: single updates run under it from end to
// end and only look, and a batch notes what it does before it lets go of it. Waiting threads let go of it too. A batch
// of few rows keeps it: to get it back from a busy thread would take longer than the work.
#pragma once

#include <nanobind/nanobind.h>

#include <condition_variable>
#include <limits>
#include <mutex>
#include <optional>

namespace dynhull {

constexpr std::size_t FEW_ROWS = 64, ALL_ROWS = std::numeric_limits<std::size_t>::max();

class ReadWriteLock {
 public:
  // Wait until nobody writes, or until nobody reads or writes.
  void await_readable() {
    if (writing_) wait([this] { return !writing_; });
  }
  void await_writable() {
    if (writing_ || readers_ > 0) await_as_writer([this] { return !writing_ && readers_ == 0; });
  }

  // Before a fork, wait until no batch runs in any hull and let none begin; the child's hulls are whole.
  static void before_fork() {
    ++forking_;
    wait([] { return running_ == 0; });
  }
  static void after_fork_in_parent() {
    --forking_;
    wake();
  }
  static void after_fork_in_child() {
    signal_ = new Signal;  // some thread of the parent may hold the old one
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

  // Readers that come after a waiting writer wait for it, unless it waits in the process that this one was forked from.
  template <class Holds>
  void await_as_writer(Holds holds) {
    if (!writer_waits()) writers_waiting_ = 0;
    process_ = this_process_;
    ++writers_waiting_;
    wait(holds);
    --writers_waiting_;
    wake();  // those who let it go first
  }
  bool writer_waits() const { return writers_waiting_ > 0 && process_ == this_process_; }

  // The mutex is taken before the GIL is let go of, so that no signal is missed, and never held while taking the GIL.
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

  bool writing_ = false;
  int readers_ = 0, writers_waiting_ = 0;
  int process_ = 0;

  static inline Signal* signal_ = new Signal;
  static inline int waiting_ = 0, running_ = 0;
  static inline int forking_ = 0;
  static inline int this_process_ = 0;  // one more in each forked child
};

// A batch that reads, with the GIL let go of.
class ReadLock {
 public:
  explicit ReadLock(ReadWriteLock& lock, std::size_t rows = ALL_ROWS) : lock_(lock) {
    ReadWriteLock::wait([&] { return ReadWriteLock::forking_ == 0 && !lock.writing_ && !lock.writer_waits(); });
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

// A batch that writes, with the GIL let go of.
class WriteLock {
 public:
  explicit WriteLock(ReadWriteLock& lock, std::size_t rows = ALL_ROWS) : lock_(lock) {
    lock.await_as_writer([&] { return ReadWriteLock::forking_ == 0 && !lock.writing_ && lock.readers_ == 0; });
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
