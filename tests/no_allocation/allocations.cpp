#include "tests/no_allocation/allocations.h"

#include <cerrno>
#include <cstddef>

namespace {

// Without constructors, because malloc is called before any of them.
constinit thread_local bool counting = false;
constinit thread_local long allocated = 0;
constinit thread_local std::size_t most = 0;

void note(std::size_t size) {
  if (!counting) return;
  ++allocated;
  if (size > most) most = size;
}

}  // namespace

// glibc's own functions, under the names that it provides for replacements.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(std::size_t size) noexcept;
void* __libc_calloc(std::size_t number, std::size_t size) noexcept;
void* __libc_realloc(void* memory, std::size_t size) noexcept;
void* __libc_memalign(std::size_t alignment, std::size_t size) noexcept;
void __libc_free(void* memory) noexcept;
// NOLINTEND(bugprone-reserved-identifier)

void* malloc(std::size_t size) noexcept {
  note(size);
  return __libc_malloc(size);
}

void* calloc(std::size_t number, std::size_t size) noexcept {
  note(number * size);
  return __libc_calloc(number, size);
}

void* realloc(void* memory, std::size_t size) noexcept {
  note(size);
  return __libc_realloc(memory, size);
}

void free(void* memory) noexcept {
  if (memory != nullptr) note(0);
  __libc_free(memory);
}

void* memalign(std::size_t alignment, std::size_t size) noexcept {
  note(size);
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  note(size);
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) noexcept {
  note(size);
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
}

namespace sprag::test {

CountAllocations::CountAllocations() {
  allocated = 0;
  most = 0;
  counting = true;
}

long CountAllocations::stop() {
  counting = false;
  return allocated;
}

std::size_t CountAllocations::largest() const { return most; }

}  // namespace sprag::test
