// Work shared by two threads.
#pragma once

#include <future>
#include <system_error>
#include <thread>

namespace dynhull {

// Whether the number of points pays for a second thread.
inline bool two_threads_for(std::size_t points) {
  constexpr std::size_t MANY = std::size_t{1} << 17;
  return points >= MANY && std::thread::hardware_concurrency() > 1;
}

// Runs both, concurrently if `threads` and a thread can be started.
template <class First, class Second>
void both(bool threads, First first, Second second) {
  std::future<void> other;
  if (threads) try {
      other = std::async(std::launch::async, second);
    } catch (const std::system_error&) {  // no thread available
    }
  first();
  other.valid() ? other.get() : second();
}

}  // namespace dynhull
