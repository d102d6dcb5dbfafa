// SPRAG_WIDEST before a function compiles it for wider registers as well; the variant for the
// processor is selected when the program is loaded. All variants round alike, since no operations
// are fused. Sanitizers do not support functions that are selected at load time.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SPRAG_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SPRAG_WIDEST
#endif
