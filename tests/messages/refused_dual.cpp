// What dual numbers and degrees refuse at compile time; see refused.cpp.

#include <array>
#include <cmath>
#include <cstddef>

#include "ricochet/integrate/integrate.hpp"
#include "ricochet/rosenbrock.hpp"

using namespace ricochet;
using X = std::array<double, 2>;

// CASE 1: found a number wanted of a
// CASE 2: found a number wanted of a
// CASE 3: found a number wanted of a dual number; expected functions called by their bare names
// CASE 4: found a number wanted of a dual number; expected functions called by their bare names
// CASE 5: found a jacobian whose parameters do not fit, or that is not const
struct Swinging {
    using State = X;
#if CASE == 4
    [[nodiscard]] static double moment(double angle)
    {
        return std::sin(angle);
    }
#endif
    template <class S>
    void flow(const S&, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
#if CASE == 3
        dxdt[1] = -std::sin(x[0]);
#elif CASE == 4
        dxdt[1] = -moment(x[0]);
#else
        dxdt[1] = -sin(x[0]);
#endif
    }
#if CASE == 5
    void jacobian(double, const X&, std::array<double, 4>&) const {}
#endif
    template <class S>
    [[nodiscard]] S guard(const S& t, const std::array<S, 2>& x) const
    {
#if CASE == 1
        return x[0] - t - std::cos(x[1]);
#elif CASE == 2
        return x[0] - std::pow(t, 2);
#else
        using std::cos, std::abs, std::max;
        return max(x[0], t) - abs(cos(x[1])) + (x[0] > 0 ? 1 : 2);
#endif
    }
};

int main()
{
    const Options options{.t_end = 1};
    static_cast<void>(integrate(Swinging{}, X{1, 0}, options));
    static_cast<void>(integrate(Swinging{}, X{1, 0}, options, ErrorControlled<Rosenbrock4>{}));
}
