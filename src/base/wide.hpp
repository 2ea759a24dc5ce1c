// Loops over many doubles, compiled for wider registers as well.
//
// Which version is called is decided when the program starts. Products and sums are rounded
// separately in both, so that both return the same bits.
#pragma once

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define RICOCHET_WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define RICOCHET_WIDE
#endif
