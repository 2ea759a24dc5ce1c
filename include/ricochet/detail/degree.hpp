// Internal: the declarations of this header may change without notice.
//
// The degree of a guard as a polynomial in time and state together, found from its code.
//
// A guard that takes any scalar is called with degrees in place of numbers: 1 for the time and
// every component, 0 for constants. A guard that divides by a variable, calls a non-polynomial
// function of one or branches on it is no polynomial.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/counts.hpp"
#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

class Degree {
public:
    constexpr Degree() = default;
    template <class U>
    requires std::is_arithmetic_v<U>
    constexpr Degree(const U&) noexcept {}  // NOLINT(google-explicit-constructor): a constant
    /// A variable. @param branched  set if its value decides what is computed
    constexpr explicit Degree(bool& branched) noexcept : degree_(1), branched_(&branched) {}

    /// The degree; 0 for constants and non-polynomials.
    [[nodiscard]] constexpr int value() const noexcept { return degree_ < none ? degree_ : 0; }

    template <class U>
    requires std::is_same_v<U, double>
    constexpr operator U() const  // NOLINT(google-explicit-constructor)
    {
        static_assert(is_never_a_degree<U>,
                      "ricochet: found a number wanted of a guard's degree; expected functions "
                      "called by their bare names (using std::cos; cos(x)) and the time and the "
                      "state to have the type of the function's template parameter");
        return U();
    }

    friend constexpr Degree operator+(const Degree& a) noexcept { return a; }
    friend constexpr Degree operator-(const Degree& a) noexcept { return a; }

#define RICOCHET_DEGREE(name, expression)                                   \
    friend constexpr Degree name(const Degree& a, const Degree& b) noexcept \
    {                                                                       \
        return of(expression, a, b);                                        \
    }                                                                       \
    template <class U>                                                      \
    requires std::is_arithmetic_v<U>                                        \
    friend constexpr Degree name(const Degree& a, const U&) noexcept        \
    {                                                                       \
        return name(a, Degree());                                           \
    }                                                                       \
    template <class U>                                                      \
    requires std::is_arithmetic_v<U>                                        \
    friend constexpr Degree name(const U&, const Degree& b) noexcept        \
    {                                                                       \
        return name(Degree(), b);                                           \
    }
    RICOCHET_DEGREE(operator+, a.degree_ > b.degree_ ? a.degree_ : b.degree_)
    RICOCHET_DEGREE(operator-, a.degree_ > b.degree_ ? a.degree_ : b.degree_)
    RICOCHET_DEGREE(operator*, a.degree_ + b.degree_)
    RICOCHET_DEGREE(operator/, b.degree_ == 0 ? a.degree_ : none)
    RICOCHET_DEGREE(atan2, bent(a.degree_ + b.degree_))
    RICOCHET_DEGREE(hypot, bent(a.degree_ + b.degree_))
    RICOCHET_DEGREE(max, bent(a.degree_ + b.degree_))
    RICOCHET_DEGREE(min, bent(a.degree_ + b.degree_))
#undef RICOCHET_DEGREE

    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Degree pow(const Degree& a, const U& exponent) noexcept
    {
        const bool whole = exponent >= 0 && exponent <= 64 &&
                           exponent == static_cast<U>(static_cast<int>(exponent));
        return of(whole ? a.degree_ * static_cast<int>(exponent) : bent(a.degree_), a, a);
    }
    friend constexpr Degree pow(const Degree& a, const Degree& b) noexcept
    {
        return of(bent(a.degree_ + b.degree_), a, b);
    }

#define RICOCHET_DEGREE(name)                              \
    friend constexpr Degree name(const Degree& a) noexcept \
    {                                                      \
        return of(bent(a.degree_), a, a);                  \
    }
    RICOCHET_DEGREE(sqrt)
    RICOCHET_DEGREE(cbrt)
    RICOCHET_DEGREE(exp)
    RICOCHET_DEGREE(log)
    RICOCHET_DEGREE(sin)
    RICOCHET_DEGREE(cos)
    RICOCHET_DEGREE(tan)
    RICOCHET_DEGREE(asin)
    RICOCHET_DEGREE(acos)
    RICOCHET_DEGREE(atan)
    RICOCHET_DEGREE(sinh)
    RICOCHET_DEGREE(cosh)
    RICOCHET_DEGREE(tanh)
    RICOCHET_DEGREE(abs)
    RICOCHET_DEGREE(fabs)
    RICOCHET_DEGREE(floor)
    RICOCHET_DEGREE(ceil)
#undef RICOCHET_DEGREE

#define RICOCHET_DEGREE(op)                                                      \
    friend constexpr bool operator op(const Degree& a, const Degree& b) noexcept \
    {                                                                            \
        return branch(a, b);                                                     \
    }                                                                            \
    template <class U>                                                           \
    requires std::is_arithmetic_v<U>                                             \
    friend constexpr bool operator op(const Degree& a, const U&) noexcept        \
    {                                                                            \
        return branch(a, a);                                                     \
    }                                                                            \
    template <class U>                                                           \
    requires std::is_arithmetic_v<U>                                             \
    friend constexpr bool operator op(const U&, const Degree& b) noexcept        \
    {                                                                            \
        return branch(b, b);                                                     \
    }
    RICOCHET_DEGREE(<)
    RICOCHET_DEGREE(>)
    RICOCHET_DEGREE(<=)
    RICOCHET_DEGREE(>=)
    RICOCHET_DEGREE(==)
    RICOCHET_DEGREE(!=)
#undef RICOCHET_DEGREE

    template <class U>
    constexpr Degree& operator+=(const U& b) noexcept
    {
        return *this = *this + b;
    }
    template <class U>
    constexpr Degree& operator-=(const U& b) noexcept
    {
        return *this = *this - b;
    }
    template <class U>
    constexpr Degree& operator*=(const U& b) noexcept
    {
        return *this = *this * b;
    }
    template <class U>
    constexpr Degree& operator/=(const U& b) noexcept
    {
        return *this = *this / b;
    }

private:
    static constexpr int none = 1 << 12;
    template <class>
    static constexpr bool is_never_a_degree = false;

    [[nodiscard]] static constexpr int bent(int degree) noexcept
    {
        return degree == 0 ? 0 : none;
    }
    [[nodiscard]] static constexpr Degree of(int degree, const Degree& a, const Degree& b) noexcept
    {
        Degree out;
        out.degree_ = degree < none ? degree : none;
        out.branched_ = a.branched_ ? a.branched_ : b.branched_;
        return out;
    }
    static constexpr bool branch(const Degree& a, const Degree& b) noexcept
    {
        if (a.branched_) *a.branched_ = true;
        if (b.branched_) *b.branched_ = true;
        return false;
    }

    int degree_ = 0;
    bool* branched_ = nullptr;  ///< null for a constant
};

/// All components of a state.
class DegreeView {
public:
    constexpr explicit DegreeView(bool& branched) noexcept : one_(branched) {}
    template <class Index>
    [[nodiscard]] constexpr Degree operator[](Index) const noexcept
    {
        return one_;
    }

private:
    Degree one_;
};

/// Whether the guard can be evaluated with degrees for such states.
template <class System, class X>
concept DegreeKnown = GuardOfScalarArrays < System,
        fixed_size<X>()
> || GuardOfScalarViews<System>;

/// The degree of a guard in one mode; 0: constant, or not a polynomial.
template <class X, class System>
[[nodiscard]] constexpr int degree_in_mode(const System& system, std::size_t which, Mode mode)
{
    bool branched = false;
    const Degree variable(branched);
    int degree = 0;
    if constexpr (GuardOfScalarViews<System>) {
        degree = guard_of_scalar(system, which, mode, variable, DegreeView(branched)).value();
    } else {
        std::array<Degree, fixed_size<X>()> x;
        x.fill(variable);
        degree = guard_of_scalar(system, which, mode, variable, x).value();
    }
    return branched ? 0 : degree;
}

/// The degree of a guard in all modes in which it is watched; 0: not known.
template <class X, class System>
[[nodiscard]] constexpr int inferred_degree(const System& system, std::size_t which)
{
    using Probed = std::conditional_t<GuardOfScalarViews<System>, ViewProbe<TimeProbe>,
                                      std::array<TimeProbe, fixed_size<X>()>>;
    if constexpr (!GuardTakesMode<System, Probed>) return degree_in_mode<X>(system, which, 0);
    int largest = 0;
    const std::size_t modes = mode_count_of(system);
    for (std::size_t k = 0; k < modes; ++k) {
        const auto mode = static_cast<Mode>(k);
        if (!call_enabled_in(system, which, mode)) continue;
        const int degree = degree_in_mode<X>(system, which, mode);
        if (degree == 0) return 0;
        largest = degree > largest ? degree : largest;
    }
    return largest;
}

}  // namespace ricochet::detail
