// What Taylor's method refuses at compile time; see refused.cpp.

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/taylor/taylor.hpp"

using namespace ricochet;
using X = std::array<double, 2>;

// CASE 1: found a comparison of a Taylor series, or a function with a kink or a jump
// CASE 2: found a comparison of a Taylor series, or a function with a kink or a jump
// CASE 3: found a comparison of a Taylor series, or a function with a kink or a jump
// CASE 4: found a number wanted of a Taylor series; expected functions called by their bare names
struct Rubbing {
    double friction = 0.1;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::abs, std::cos, std::floor, std::tan, std::pow, std::hypot;
        dxdt[0] = 2 * x[1];
        dxdt[1] = cos(t) - pow(x[0], 3) + tan(0.1f * x[0]) - hypot(x[0], x[1]);
#if CASE == 1
        dxdt[1] -= x[1] > 0.0 ? friction : -friction;
#elif CASE == 2
        dxdt[1] -= friction * abs(x[1]);
#elif CASE == 3
        dxdt[1] -= friction * floor(t);
#elif CASE == 4
        dxdt[1] -= std::cos(x[0]);
#endif
    }
};

// CASE 5: found no flow that takes Taylor series; expected template <class S>
// CASE 6: found a number wanted of a Taylor series
struct Falling {
#if CASE == 5
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt = {x[1], -9.81};
    }
#elif CASE == 6
    template <class V>
    constexpr void flow(double t, const V& x, V& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -t;
    }
#else
    template <class S>
    constexpr void flow(const S&, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
#endif
    explicit constexpr Falling(double g = 9.81) : gravity(g) {}
    double gravity = 0;
};

// CASE 7: found no flow that takes Taylor series; expected template <class S> void flow([Mode,]
// CASE 8: found a comparison of a Taylor series, or a function with a kink or a jump
struct Hanging {  // as many weights as the state has
#if CASE == 7
    void flow(double, const std::vector<double>& x, std::vector<double>& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); ++i) dxdt[i] = -x[i];
    }
#else
    template <class S>
    void flow(const S&, const std::vector<S>& x, std::vector<S>& dxdt) const
    {
        using std::abs;
        for (std::size_t i = 0; i < x.size(); ++i) {
            dxdt[i] = -x[i];
#if CASE == 8
            dxdt[i] += abs(x[i]);
#endif
        }
    }
#endif
};

int main()
{
    const Options options{.t_end = 1};
    static_cast<void>(integrate(Rubbing{}, X{1, 0}, options, ErrorControlled<Taylor>{}));
    static_cast<void>(integrate(Falling(9.81), X{1, 0}, options, ErrorControlled<Taylor>{}));
    static_cast<void>(
        integrate(Hanging{}, std::vector<double>{1, 0}, options, ErrorControlled<Taylor>{}));
}
