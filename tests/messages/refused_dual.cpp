// What dual numbers and degrees refuse at compile time; see refused.cpp.

#include <array>
#include <cmath>
#include <cstddef>

#include "ricochet/integrate.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"

using namespace ricochet;
using X = std::array<double, 2>;

// CASE 1: found a number wanted of a
// CASE 2: found a number wanted of a
// CASE 3: found a number wanted of a dual number; expected functions called by their bare names
// CASE 4: found a number wanted of a dual number; expected functions called by their bare names
// CASE 5: found a jacobian whose parameters do not fit, or that is not const
// CASE 6 alone: found a guard_derivative or reset_derivative that takes the Mode before
// CASE 7 alone: found a guard_derivative or reset_derivative that takes the Mode before
struct Swinging {
    using State = X;
    static constexpr bool resets = false;
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

/// A ball with written derivatives.
struct Bouncing {
    using State = X;
    static constexpr std::size_t guard_count = 1;
    void flow(Mode, double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(std::size_t, Mode, double, const X& x) const { return x[0]; }
    Mode reset(std::size_t, Mode mode, double, X& x) const
    {
        x[1] = -x[1];
        return mode;
    }
#if CASE == 6
    double guard_derivative(Mode, std::size_t, double, const X&, const X& s) const
#else
    double guard_derivative(std::size_t, Mode, double, const X&, const X& s) const
#endif
    {
        return s[0];
    }
#if CASE == 7
    void reset_derivative(Mode, std::size_t, double, const X&, double, X& s) const
#else
    void reset_derivative(std::size_t, Mode, double, const X&, double, X& s) const
#endif
    {
        s[1] = -s[1];
    }
};

int main()
{
    const Options options{.t_end = 1};
    static_cast<void>(sensitivities(Bouncing{}, {1, 0}, {}, options));
    static_cast<void>(integrate(Swinging{}, X{1, 0}, options));
    static_cast<void>(integrate(Swinging{}, X{1, 0}, options, ErrorControlled<Rosenbrock4>{}));
}
