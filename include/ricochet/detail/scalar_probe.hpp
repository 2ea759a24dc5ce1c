// Internal: the declarations of this header may change without notice.
//
// Detects which functions of a system take any scalar.
//
// A function is tested with a scalar that is used nowhere else, and once more with different
// scalars for the state and the time: a function that accepts both is no template over one scalar,
// but takes the time as a number, or arguments of any type. Nothing is computed, and bodies are
// compiled only where a result is deduced from them.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <type_traits>

#include "ricochet/detail/counts.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

/// A scalar with all operations of a number, but of a distinct type.
template <int>
struct ScalarProbe {
    constexpr ScalarProbe() = default;
    template <class U>
    requires std::is_arithmetic_v<U>
    constexpr ScalarProbe(const U&) noexcept {}  // NOLINT(google-explicit-constructor)
    template <class U>
    requires std::is_same_v<U, double>
    constexpr operator U() const noexcept { return 0; }  // NOLINT(google-explicit-constructor)

    friend constexpr ScalarProbe operator+(const ScalarProbe&) noexcept { return {}; }
    friend constexpr ScalarProbe operator-(const ScalarProbe&) noexcept { return {}; }
#define RICOCHET_PROBE(result, name)                                              \
    friend constexpr result name(const ScalarProbe&, const ScalarProbe&) noexcept \
    {                                                                             \
        return {};                                                                \
    }                                                                             \
    template <class U>                                                            \
    requires std::is_arithmetic_v<U>                                              \
    friend constexpr result name(const ScalarProbe&, const U&) noexcept           \
    {                                                                             \
        return {};                                                                \
    }                                                                             \
    template <class U>                                                            \
    requires std::is_arithmetic_v<U>                                              \
    friend constexpr result name(const U&, const ScalarProbe&) noexcept           \
    {                                                                             \
        return {};                                                                \
    }
    RICOCHET_PROBE(ScalarProbe, operator+)
    RICOCHET_PROBE(ScalarProbe, operator-)
    RICOCHET_PROBE(ScalarProbe, operator*)
    RICOCHET_PROBE(ScalarProbe, operator/)
    RICOCHET_PROBE(bool, operator<)
    RICOCHET_PROBE(bool, operator>)
    RICOCHET_PROBE(bool, operator<=)
    RICOCHET_PROBE(bool, operator>=)
    RICOCHET_PROBE(bool, operator==)
    RICOCHET_PROBE(bool, operator!=)
    RICOCHET_PROBE(ScalarProbe, pow)
    RICOCHET_PROBE(ScalarProbe, hypot)
    RICOCHET_PROBE(ScalarProbe, atan2)
    RICOCHET_PROBE(ScalarProbe, max)
    RICOCHET_PROBE(ScalarProbe, min)
#undef RICOCHET_PROBE
    template <class U>
    constexpr ScalarProbe& operator+=(const U&) noexcept
    {
        return *this;
    }
    template <class U>
    constexpr ScalarProbe& operator-=(const U&) noexcept
    {
        return *this;
    }
    template <class U>
    constexpr ScalarProbe& operator*=(const U&) noexcept
    {
        return *this;
    }
    template <class U>
    constexpr ScalarProbe& operator/=(const U&) noexcept
    {
        return *this;
    }
#define RICOCHET_PROBE(name)                                       \
    friend constexpr ScalarProbe name(const ScalarProbe&) noexcept \
    {                                                              \
        return {};                                                 \
    }
    RICOCHET_PROBE(sqrt)
    RICOCHET_PROBE(cbrt)
    RICOCHET_PROBE(exp)
    RICOCHET_PROBE(log)
    RICOCHET_PROBE(sin)
    RICOCHET_PROBE(cos)
    RICOCHET_PROBE(tan)
    RICOCHET_PROBE(asin)
    RICOCHET_PROBE(acos)
    RICOCHET_PROBE(atan)
    RICOCHET_PROBE(sinh)
    RICOCHET_PROBE(cosh)
    RICOCHET_PROBE(tanh)
    RICOCHET_PROBE(abs)
    RICOCHET_PROBE(fabs)
    RICOCHET_PROBE(floor)
    RICOCHET_PROBE(ceil)
#undef RICOCHET_PROBE
};

using TimeProbe = ScalarProbe<0>;
using OtherProbe = ScalarProbe<1>;

/// A state that can only be read, one component at a time.
template <class S>
struct ViewProbe {
    template <class Index>
    [[nodiscard]] S operator[](Index) const noexcept;
    [[nodiscard]] std::size_t size() const noexcept;
};

/// A guard, in whatever form, with time T and state X returns a G.
template <class System, class T, class X, class G>
concept GuardReturns =
    (CountsGuards<System> &&
     (
         requires(const System& s, std::size_t which, Mode mode, const T& t, const X& x) {
             {
                 s.guard(which, mode, t, x)
                 } -> std::same_as<G>;
         } ||
         requires(const System& s, std::size_t which, const T& t, const X& x) {
             {
                 s.guard(which, t, x)
                 } -> std::same_as<G>;
         })) ||
    (!CountsGuards<System> && (
                                  requires(const System& s, Mode mode, const T& t, const X& x) {
                                      {
                                          s.guard(mode, t, x)
                                          } -> std::same_as<G>;
                                  } ||
                                  requires(const System& s, const T& t, const X& x) {
                                      {
                                          s.guard(t, x)
                                          } -> std::same_as<G>;
                                  }));

/// A guard that takes any scalar, in states X<scalar>.
template <class System, template <class> class X>
concept GuardOfScalars = GuardReturns<System, TimeProbe, X<TimeProbe>, TimeProbe> &&
    !GuardReturns<System, TimeProbe, X<OtherProbe>, OtherProbe>;

/// The guard depends on the mode.
template <class System, class X>
concept GuardTakesMode = requires(const System& s, std::size_t which, Mode mode, const TimeProbe& t,
                                  const X& x)
{
    requires CountsGuards<System>;
    s.guard(which, mode, t, x);
}
|| requires(const System& s, Mode mode, const TimeProbe& t, const X& x)
{
    requires !CountsGuards<System>;
    s.guard(mode, t, x);
};

/// A guard that takes any scalar, in views of a state.
template <class System>
concept GuardOfScalarViews = GuardOfScalars<System, ViewProbe>;

template <std::size_t n>
struct ArraysOf {
    template <class S>
    using Of = std::array<S, n>;
};
/// A guard that takes any scalar, in arrays of n.
template <class System, std::size_t n>
concept GuardOfScalarArrays = n >
0 && GuardOfScalars<System, ArraysOf<n>::template Of>;

/// A flow with time T and states X.
template <class System, class T, class X>
concept FlowTakes = requires(const System& s, Mode mode, const T& t, const X& x, X& dxdt)
{
    s.flow(mode, t, x, dxdt);
}
|| requires(const System& s, const T& t, const X& x, X& dxdt)
{
    s.flow(t, x, dxdt);
};

/// A flow that takes any scalar, in states X<scalar>.
template <class System, template <class> class X>
concept FlowOfScalars =
    FlowTakes<System, TimeProbe, X<TimeProbe>> && !FlowTakes<System, TimeProbe, X<OtherProbe>>;

/// A reset with time T and states X, preceded by arguments of the types `Which`.
template <class System, class T, class X, class... Which>
concept ResetTakes = requires(const System& s, Mode mode, const T& t, X& x, const Which&... which)
{
    s.reset(which..., mode, t, x);
}
|| requires(const System& s, const T& t, X& x, const Which&... which)
{
    s.reset(which..., t, x);
};
template <class System, class T, class X>
concept TimeResetTakes = requires(const System& s, Mode mode, const T& t, X& x)
{
    s.time_reset(mode, t, x);
}
|| requires(const System& s, const T& t, X& x)
{
    s.time_reset(t, x);
};
template <class System, template <class> class X, class... Which>
concept ResetOfScalars = ResetTakes<System, TimeProbe, X<TimeProbe>, Which...> &&
    !ResetTakes<System, TimeProbe, X<OtherProbe>, Which...>;
template <class System, template <class> class X>
concept TimeResetOfScalars = TimeResetTakes<System, TimeProbe, X<TimeProbe>> &&
    !TimeResetTakes<System, TimeProbe, X<OtherProbe>>;

/// The guard with any scalar S.
template <class S, class System, class X>
[[gnu::always_inline]] [[nodiscard]] constexpr S guard_of_scalar(const System& system,
                                                                 [[maybe_unused]] std::size_t which,
                                                                 [[maybe_unused]] Mode mode,
                                                                 const S& t, const X& x)
{
    if constexpr (CountsGuards<System>) {
        if constexpr (requires { system.guard(which, mode, t, x); }) {
            return system.guard(which, mode, t, x);
        } else {
            return system.guard(which, t, x);
        }
    } else if constexpr (requires { system.guard(mode, t, x); }) {
        return system.guard(mode, t, x);
    } else {
        return system.guard(t, x);
    }
}

}  // namespace ricochet::detail
