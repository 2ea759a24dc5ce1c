// Internal: the declarations of this header may change without notice.
//
// The rate of a guard along the flow, by dual numbers.
#pragma once

#include <array>
#include <cstddef>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/dual.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

/// A state x, or a view of one, at time t, and the direction (dt, s) in which a function of both
/// is differentiated: along a motion dt = 1 and s = x'.
template <class X, class D = X>
struct Along {
    Mode mode;
    double t;  ///< [s]
    const X& x;
    const D& s;
    double dt = 1;
};
template <class X, class D>
Along(Mode, double, const X&, const D&) -> Along<X, D>;
template <class X, class D>
Along(Mode, double, const X&, const D&, double) -> Along<X, D>;

/// A state and its rate as dual numbers, one component at a time.
template <class V, class D>
class DualView {
public:
    DualView(const V& x, const D& dxdt) noexcept : x_(&x), dxdt_(&dxdt) {}
    template <class Index>
    [[nodiscard, gnu::always_inline]] Dual<1> operator[](Index i) const noexcept
    {
        return {(*x_)[static_cast<decltype(x_->size())>(i)],
                {(*dxdt_)[static_cast<decltype(dxdt_->size())>(i)]}};
    }
    [[nodiscard]] auto size() const noexcept { return x_->size(); }

private:
    const V* x_;
    const D* dxdt_;
};

/// Whether the guard accepts dual numbers of states, or views, like V, and so gives its rate.
template <class System, class V>
concept RateByDuals = GuardOfScalarViews<System> || GuardOfScalarArrays < System,
        fixed_size<V>()
> ;

/// The rate of a guard along a direction.
template <class System, class V, class D>
[[gnu::always_inline]] [[nodiscard]] inline double rate_by_duals(const System& system,
                                                                 std::size_t which,
                                                                 const Along<V, D>& at)
{
    const Dual<1> time(at.t, {at.dt});
    if constexpr (GuardOfScalarViews<System>) {
        const DualView<V, D> state(at.x, at.s);
        return guard_of_scalar(system, which, at.mode, time, state).slope[0];
    } else {
        std::array<Dual<1>, fixed_size<V>()> state;
        const DualView<V, D> view(at.x, at.s);
        for (std::size_t i = 0; i < state.size(); ++i) state[i] = view[i];
        return guard_of_scalar(system, which, at.mode, time, state).slope[0];
    }
}

}  // namespace ricochet::detail
