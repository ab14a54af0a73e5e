// Counts what a piece of code takes of memory, by operator new and for matrices of OpenCV. It replaces operator new of
// the whole program: include it in one file of a test program only.
#pragma once

#include <atomic>
#include <cstdlib>
#include <new>
#include <opencv2/core.hpp>

namespace railfix::test {

inline std::atomic<bool> counting = false;
inline std::atomic<int> allocations = 0;

class CountingMatAllocator : public cv::MatAllocator {
 public:
  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, size_t* step, cv::AccessFlag flags,
                         cv::UMatUsageFlags usage) const override {
    if (counting) ++allocations;
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
  }
  void deallocate(cv::UMatData* data) const override { cv::Mat::getStdAllocator()->deallocate(data); }
};

/// While it lives, matrices count, too.
class CountMatrices {
 public:
  CountMatrices() { cv::Mat::setDefaultAllocator(&allocator_); }
  ~CountMatrices() { cv::Mat::setDefaultAllocator(cv::Mat::getStdAllocator()); }
  CountMatrices(const CountMatrices&) = delete;
  CountMatrices& operator=(const CountMatrices&) = delete;

 private:
  CountingMatAllocator allocator_;
};

}  // namespace railfix::test

// Not inlined: g++ 12 would take one that is for a mismatch with the other that is not.
[[gnu::noinline]] void* operator new(size_t size, const std::nothrow_t&) noexcept {
  if (railfix::test::counting) ++railfix::test::allocations;
  return std::malloc(size == 0 ? 1 : size);
}
[[gnu::noinline]] void* operator new(size_t size) {
  if (void* memory = operator new(size, std::nothrow)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept {
  std::free(memory);
}
