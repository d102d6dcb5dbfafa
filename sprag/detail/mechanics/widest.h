// SPRAG_WIDEST before a function: it is compiled for wider registers as well, and what the
// processor has is chosen when the program is loaded. The same roundings, since nothing is fused.
// Sanitizers do not work with functions that are chosen then.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SPRAG_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SPRAG_WIDEST
#endif
