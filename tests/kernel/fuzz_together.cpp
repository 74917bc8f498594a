// All fuzzers with allocations that fail, as one program: they have much of the kernel in common, which is compiled
// once.
//
//     fuzz_together points|entities|windows|fences [--seconds S] [seed ...]
#define FUZZ_TOGETHER
#include "fuzz.cpp"
#include "fuzz_fences.cpp"
#include "fuzz_keyed.cpp"
#include "fuzz_window.cpp"

int main(int count, char** words) {
  const std::string what = count > 1 ? words[1] : "";
  --count, ++words;
  if (what == "points") return fuzz_points::run(count, words);
  if (what == "entities") return fuzz_entities::run(count, words);
  if (what == "windows") return fuzz_windows::run(count, words);
  if (what == "fences") return fuzz_fences::run(count, words);
  std::printf("no fuzzer '%s'\n", what.c_str());
  return 2;
}
