// Loops over many doubles, compiled for wider registers as well.
//
// Which of the two is called is settled when the program starts. Products and sums are rounded one
// by one in both, so that they have the same bits.
#pragma once

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define RICOCHET_WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define RICOCHET_WIDE
#endif
