// Two threads for one piece of work.
#pragma once

#include <future>
#include <system_error>
#include <thread>

namespace dynhull {

inline bool several_processors() { return std::thread::hardware_concurrency() > 1; }

// Run both, at the same time where asked to and possible.
template <class First, class Second>
void both(bool threads, First first, Second second) {
  std::future<void> other;
  if (threads) try {
      other = std::async(std::launch::async, second);
    } catch (const std::system_error&) {  // no thread to be had
    }
  first();
  other.valid() ? other.get() : second();
}

}  // namespace dynhull
