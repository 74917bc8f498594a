// The command line of the fuzzers: lives with the given seeds, or with random seeds for some seconds.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <random>
#include <string>
#include <vector>

// Calls `live` with each seed; an exception is a fault, and ends the run with the seed that repeats it. Returns the
// exit code. `what` names the lives in the last line.
template <class Live>
int fuzz_lives(int count, char** words, const std::string& what, Live live) {
  const auto survives = [&](std::uint64_t seed) {
    try {
      live(seed);
      return true;
    } catch (const std::exception& error) {
      std::printf("seed %llu: %s\n", static_cast<unsigned long long>(seed), error.what());
      return false;
    }
  };
  double seconds = 10;
  std::vector<std::uint64_t> seeds;
  for (int i = 1; i < count; ++i) {
    if (std::strcmp(words[i], "--seconds") == 0 && i + 1 < count)
      seconds = std::atof(words[++i]);
    else
      seeds.push_back(std::strtoull(words[i], nullptr, 10));
  }
  for (std::uint64_t seed : seeds)
    if (!survives(seed)) return 1;
  if (!seeds.empty()) return 0;
  std::random_device entropy;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  unsigned lives = 0;
  for (; std::chrono::steady_clock::now() < end; ++lives)
    if (!survives((std::uint64_t{entropy()} << 32) | entropy())) return 1;
  std::printf("%u %s\n", lives, what.c_str());
  return 0;
}
