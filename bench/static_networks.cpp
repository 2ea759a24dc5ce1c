// Compiled for x86-64-v3 if the compiler has it. Nothing here may have a name with which the linker
// could merge it into another file.
#include "static_networks.hpp"

#include "networks.hpp"

namespace ricochet::bench {

template <Activation activation, class T, std::size_t... Hidden>
void StaticNetwork<activation, T, Hidden...>::each(const Mlp& mlp, const T* in, std::size_t samples,
                                                   T* out)
{
    for (std::size_t i = 0; i < samples; ++i) mlp.forward(in + 4 * i, out + i);
}

template <Activation activation, class T, std::size_t... Hidden>
void StaticNetwork<activation, T, Hidden...>::chain(const Mlp& mlp, T* x, std::size_t n)
{
    T y = 0;
    for (std::size_t i = 0; i < n; ++i) {
        mlp.forward(x, &y);
        next_inputs(y, x);
        asm volatile("" : : "r"(x) : "memory");  // the inputs pass through memory
    }
}

#define RICOCHET_STATIC_NETWORKS(...)                             \
    template struct StaticNetwork<Activation::relu, __VA_ARGS__>; \
    template struct StaticNetwork<Activation::tanh, __VA_ARGS__>;

RICOCHET_STATIC_NETWORKS(float, 8)
RICOCHET_STATIC_NETWORKS(float, 16)
RICOCHET_STATIC_NETWORKS(float, 16, 16)
RICOCHET_STATIC_NETWORKS(float, 16, 16, 16, 16, 16)
RICOCHET_STATIC_NETWORKS(float, 64, 64)
RICOCHET_STATIC_NETWORKS(double, 8)
RICOCHET_STATIC_NETWORKS(double, 16)
RICOCHET_STATIC_NETWORKS(double, 16, 16)
RICOCHET_STATIC_NETWORKS(double, 16, 16, 16, 16, 16)
RICOCHET_STATIC_NETWORKS(double, 64, 64)

void run_multiply_adds([[maybe_unused]] std::size_t rounds)
{
#if defined(__FMA__)
    multiply_add_rounds(rounds);
#endif
}

bool static_networks_are_v3() noexcept
{
#if defined(__AVX2__) && defined(__FMA__)
    return true;
#else
    return false;
#endif
}

}  // namespace ricochet::bench
