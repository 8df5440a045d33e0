#pragma once

// LIGHTKILN_CLONES before a function compiles it for several instruction sets; the loader takes the
// best that the processor has. All give the same bits: nothing is contracted (-ffp-contract=off).
//
// The function that chooses runs before ThreadSanitizer's own runtime does and must not be
// instrumented, which GCC 12 cannot be told: that build has the one version.

#if defined(__SANITIZE_THREAD__)
#define LIGHTKILN_CLONES
#else
#define LIGHTKILN_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#endif
