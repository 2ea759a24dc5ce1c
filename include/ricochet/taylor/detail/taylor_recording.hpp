// Internal: the declarations of this header may change without notice.
//
// A flow as a list of elementary operations.
//
// The flow is a template over its scalar. Called with `Recorded` scalars it produces the graph
// of its operations: once in a constant expression, from a system of the same type that is
// constructed by default, and once at the start of a run, from the object itself. The first
// recording fixes the operations, so that the compiler can unroll their recurrences; the
// second one provides the constants, and both must agree in everything else.
//
// Compilers differ in the order in which they evaluate operands, and one compiler differs between
// constant expressions and run time. Both recordings are therefore numbered from their results
// backward, by the places of the operands.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

enum class TaylorOp : std::uint8_t {
    input,               ///< a component of the state, or the time
    constant,            ///< c
    sum,                 ///< a + b
    difference,          ///< a - b
    negative,            ///< -a
    product,             ///< a b
    square,              ///< a^2
    quotient,            ///< a / b
    plus_constant,       ///< a + c
    minus_constant,      ///< a - c
    constant_minus,      ///< c - a
    times_constant,      ///< c a
    over_constant,       ///< a / c
    constant_over,       ///< c / a
    square_root,         ///< sqrt(a)
    power,               ///< a^exponent
    cube_root,           ///< a^exponent for every sign of a, with exponent = 1/3
    exponential,         ///< exp(a)
    logarithm,           ///< log(a)
    sine,                ///< sin(a), with b = cos(a)
    cosine,              ///< cos(a), with b = sin(a)
    hyperbolic_sine,     ///< sinh(a), with b = cosh(a)
    hyperbolic_cosine,   ///< cosh(a), with b = sinh(a)
    tangent,             ///< tan(a), with b = tan(a)^2
    hyperbolic_tangent,  ///< tanh(a), with b = tanh(a)^2
    arc_sine,            ///< asin(a), with b = sqrt(1 - a^2)
    arc_cosine,          ///< acos(a), with b = sqrt(1 - a^2)
    arc_tangent,         ///< atan(a), with b = 1 + a^2
    angle,               ///< atan2(a, b), with c = a^2 + b^2
};

/// Whether the operation uses a constant of the object.
[[nodiscard]] constexpr bool has_constant(TaylorOp op) noexcept
{
    return op == TaylorOp::constant ||
           (op >= TaylorOp::plus_constant && op <= TaylorOp::constant_over);
}

/// An array that can grow, also in constant expressions.
template <class T>
class GrowingArray {
public:
    constexpr GrowingArray() = default;
    GrowingArray(const GrowingArray&) = delete;
    GrowingArray& operator=(const GrowingArray&) = delete;
    constexpr GrowingArray(GrowingArray&& other) noexcept
        : items_(std::exchange(other.items_, nullptr)),
          size_(std::exchange(other.size_, 0)),
          capacity_(std::exchange(other.capacity_, 0))
    {
    }
    GrowingArray& operator=(GrowingArray&&) = delete;
    constexpr ~GrowingArray() { delete[] items_; }

    constexpr int push_back(const T& item)
    {
        if (size_ == capacity_) {
            capacity_ = capacity_ == 0 ? 16 : 2 * capacity_;
            T* const items = new T[static_cast<std::size_t>(capacity_)]{};
            for (int i = 0; i < size_; ++i) items[i] = items_[i];
            delete[] items_;
            items_ = items;
        }
        items_[size_] = item;
        return size_++;
    }
    constexpr void pop_back() noexcept { --size_; }
    [[nodiscard]] constexpr int size() const noexcept { return size_; }
    [[nodiscard]] constexpr T& operator[](int i) noexcept { return items_[i]; }  // NOLINT
    [[nodiscard]] constexpr const T& operator[](int i) const noexcept { return items_[i]; }
    [[nodiscard]] constexpr T& back() noexcept { return items_[size_ - 1]; }

private:
    T* items_ = nullptr;
    int size_ = 0;
    int capacity_ = 0;
};

/// An operation as the flow calls it.
struct RecordedOp {
    TaylorOp op = TaylorOp::input;
    int a = -1;
    int b = -1;
    int c = -1;
    double exponent = 0;
    double value = 0;              ///< of its constant
    const double* from = nullptr;  ///< address of the constant; only ever compared
};

using Recording = GrowingArray<RecordedOp>;

template <class>
inline constexpr bool is_never_series = false;

/// The scalar that records: a constant, or the result of an operation.
class Recorded {
public:
    constexpr Recorded() = default;
    // NOLINTNEXTLINE(google-explicit-constructor): constants enter expressions as they are
    constexpr Recorded(const double& value) noexcept : value_(value), from_(&value) {}
    constexpr Recorded(Recording& recording, int index) noexcept
        : recording_(&recording), index_(index)
    {
    }

    [[nodiscard]] constexpr bool is_constant() const noexcept { return index_ < 0; }
    [[nodiscard]] constexpr double value() const noexcept { return value_; }
    [[nodiscard]] constexpr const double* from() const noexcept { return from_; }
    [[nodiscard]] constexpr int index() const noexcept { return index_; }

    /// A series is converted to a double where no overload of a function for series was found, or
    /// where a parameter is declared as double.
    template <class T>
    requires std::is_same_v<T, double>
    constexpr operator T() const  // NOLINT(google-explicit-constructor)
    {
        static_assert(is_never_series<T>,
                      "ricochet: found a number wanted of a Taylor series; expected functions "
                      "called by their bare names (using std::cos; cos(x)) and the time and the "
                      "state to have the type of the flow's template parameter");
        return T();
    }

    friend constexpr Recorded operator+(const Recorded& a, const Recorded& b)
    {
        if (a.is_constant() && b.is_constant()) return folded(a.value_ + b.value_);
        if (b.is_constant()) return with(TaylorOp::plus_constant, a, b);
        if (a.is_constant()) return with(TaylorOp::plus_constant, b, a);
        return of(TaylorOp::sum, a, b);
    }
    friend constexpr Recorded operator-(const Recorded& a, const Recorded& b)
    {
        if (a.is_constant() && b.is_constant()) return folded(a.value_ - b.value_);
        if (b.is_constant()) return with(TaylorOp::minus_constant, a, b);
        if (a.is_constant()) return with(TaylorOp::constant_minus, b, a);
        return of(TaylorOp::difference, a, b);
    }
    friend constexpr Recorded operator*(const Recorded& a, const Recorded& b)
    {
        if (a.is_constant() && b.is_constant()) return folded(a.value_ * b.value_);
        if (b.is_constant()) return with(TaylorOp::times_constant, a, b);
        if (a.is_constant()) return with(TaylorOp::times_constant, b, a);
        if (a.index_ == b.index_) return of(TaylorOp::square, a);
        return of(TaylorOp::product, a, b);
    }
    friend constexpr Recorded operator/(const Recorded& a, const Recorded& b)
    {
        if (a.is_constant() && b.is_constant()) {
            // The values of constants do not matter in constant expressions.
            if (std::is_constant_evaluated() && b.value_ == 0) return folded(a.value_);
            return folded(a.value_ / b.value_);
        }
        if (b.is_constant()) return with(TaylorOp::over_constant, a, b);
        if (a.is_constant()) return with(TaylorOp::constant_over, b, a);
        return of(TaylorOp::quotient, a, b);
    }
    friend constexpr Recorded operator-(const Recorded& a)
    {
        return a.is_constant() ? folded(-a.value_) : of(TaylorOp::negative, a);
    }
    friend constexpr Recorded operator+(const Recorded& a) { return a; }

    // Numbers of any type, without a conversion that competes with that of a series to a number.
#define RICOCHET_WITH_NUMBERS(op)                                        \
    template <class T>                                                   \
    requires std::is_arithmetic_v<T>                                     \
    friend constexpr Recorded operator op(const Recorded& a, const T& b) \
    {                                                                    \
        return a op number(b);                                           \
    }                                                                    \
    template <class T>                                                   \
    requires std::is_arithmetic_v<T>                                     \
    friend constexpr Recorded operator op(const T& a, const Recorded& b) \
    {                                                                    \
        return number(a) op b;                                           \
    }                                                                    \
    template <class T>                                                   \
    constexpr Recorded& operator op##=(const T& b)                       \
    {                                                                    \
        return *this = *this op b;                                       \
    }
    RICOCHET_WITH_NUMBERS(+)
    RICOCHET_WITH_NUMBERS(-)
    RICOCHET_WITH_NUMBERS(*)
    RICOCHET_WITH_NUMBERS(/)
#undef RICOCHET_WITH_NUMBERS

#define RICOCHET_FUNCTION(name, op)                                            \
    friend constexpr Recorded name(const Recorded& a)                          \
    {                                                                          \
        if (!a.is_constant()) return of(TaylorOp::op, a);                      \
        return folded(std::is_constant_evaluated() ? 1 : std::name(a.value_)); \
    }
    RICOCHET_FUNCTION(sqrt, square_root)
    RICOCHET_FUNCTION(exp, exponential)
    RICOCHET_FUNCTION(log, logarithm)
    RICOCHET_FUNCTION(sin, sine)
    RICOCHET_FUNCTION(cos, cosine)
    RICOCHET_FUNCTION(tan, tangent)
    RICOCHET_FUNCTION(sinh, hyperbolic_sine)
    RICOCHET_FUNCTION(cosh, hyperbolic_cosine)
    RICOCHET_FUNCTION(tanh, hyperbolic_tangent)
#undef RICOCHET_FUNCTION

    friend constexpr Recorded cbrt(const Recorded& a)
    {
        if (!a.is_constant()) return of_power(TaylorOp::cube_root, a, 1.0 / 3);
        return folded(std::is_constant_evaluated() ? 1 : std::cbrt(a.value_));
    }
    friend constexpr Recorded asin(const Recorded& a)
    {
        if (!a.is_constant()) return of(TaylorOp::arc_sine, a, sqrt(1.0 - a * a));
        return folded(std::is_constant_evaluated() ? 1 : std::asin(a.value_));
    }
    friend constexpr Recorded acos(const Recorded& a)
    {
        if (!a.is_constant()) return of(TaylorOp::arc_cosine, a, sqrt(1.0 - a * a));
        return folded(std::is_constant_evaluated() ? 1 : std::acos(a.value_));
    }
    friend constexpr Recorded atan(const Recorded& a)
    {
        if (!a.is_constant()) return of(TaylorOp::arc_tangent, a, 1.0 + a * a);
        return folded(std::is_constant_evaluated() ? 1 : std::atan(a.value_));
    }
    friend constexpr Recorded atan2(const Recorded& y, const Recorded& x)
    {
        if (y.is_constant() && x.is_constant()) {
            return folded(std::is_constant_evaluated() ? 1 : std::atan2(y.value_, x.value_));
        }
        const Recorded& series = y.is_constant() ? x : y;
        const Recorded a = series.beside(y), b = series.beside(x), c = a * a + b * b;
        return {*a.recording_,
                a.recording_->push_back(
                    {.op = TaylorOp::angle, .a = a.index_, .b = b.index_, .c = c.index_})};
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    friend constexpr Recorded atan2(const Recorded& y, const T& x)
    {
        return atan2(y, number(x));
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    friend constexpr Recorded atan2(const T& y, const Recorded& x)
    {
        return atan2(number(y), x);
    }
    friend constexpr Recorded hypot(const Recorded& a, const Recorded& b)
    {
        return sqrt(a * a + b * b);
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    friend constexpr Recorded hypot(const Recorded& a, const T& b)
    {
        return hypot(a, number(b));
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    friend constexpr Recorded hypot(const T& a, const Recorded& b)
    {
        return hypot(number(a), b);
    }

    /// a^b. The exponent is part of the structure: whole powers are products, whose series exists
    /// at a = 0 too.
    friend constexpr Recorded pow(const Recorded& a, double b)
    {
        if (a.is_constant()) {
            return folded(std::is_constant_evaluated() ? 1 : std::pow(a.value_, b));
        }
        if (b == 0.5) return sqrt(a);
        const double size = b < 0 ? -b : b;
        if (size <= most_whole_power && size == static_cast<double>(static_cast<int>(size))) {
            const Recorded whole = whole_power(a, static_cast<int>(size));
            return b < 0 ? 1.0 / whole : whole;
        }
        return of_power(TaylorOp::power, a, b);
    }
    template <class T>
    requires std::is_integral_v<T>
    friend constexpr Recorded pow(const Recorded& a, T b)
    {
        return pow(a, static_cast<double>(b));
    }
    friend constexpr Recorded pow(const Recorded& a, const Recorded& b)
    {
        return b.is_constant() ? pow(a, b.value_) : exp(b * log(a));
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    friend constexpr Recorded pow(const T& a, const Recorded& b)
    {
        return pow(number(a), b);
    }

private:
    static constexpr double most_whole_power = 1024;

    [[nodiscard]] static constexpr Recorded folded(double value) noexcept
    {
        Recorded out;
        out.value_ = value;
        return out;
    }
    /// Keeps the address of a double, which distinguishes the same constant from an equal one.
    template <class T>
    [[nodiscard]] static constexpr Recorded number(const T& value) noexcept
    {
        if constexpr (std::is_same_v<T, double>) {
            return Recorded(value);
        } else {
            return folded(static_cast<double>(value));
        }
    }
    [[nodiscard]] static constexpr Recorded of(TaylorOp op, const Recorded& a)
    {
        return {*a.recording_, a.recording_->push_back({.op = op, .a = a.index_})};
    }
    [[nodiscard]] static constexpr Recorded of(TaylorOp op, const Recorded& a, const Recorded& b)
    {
        return {*a.recording_, a.recording_->push_back({.op = op, .a = a.index_, .b = b.index_})};
    }
    [[nodiscard]] static constexpr Recorded of_power(TaylorOp op, const Recorded& a,
                                                     double exponent)
    {
        return {*a.recording_,
                a.recording_->push_back({.op = op, .a = a.index_, .exponent = exponent})};
    }
    /// `other` as a series in the recording of this one.
    [[nodiscard]] constexpr Recorded beside(const Recorded& other) const
    {
        if (!other.is_constant()) return other;
        return {*recording_,
                recording_->push_back(
                    {.op = TaylorOp::constant, .value = other.value_, .from = other.from_})};
    }
    /// An operation with the constant c.
    [[nodiscard]] static constexpr Recorded with(TaylorOp op, const Recorded& a, const Recorded& c)
    {
        return {*a.recording_, a.recording_->push_back(
                                   {.op = op, .a = a.index_, .value = c.value_, .from = c.from_})};
    }
    [[nodiscard]] static constexpr Recorded whole_power(const Recorded& a, int n)
    {
        if (n == 0) return folded(1);
        if (n == 1) return a;
        const Recorded half = whole_power(a, n / 2);
        const Recorded even = half * half;
        return n % 2 == 0 ? even : a * even;
    }

    double value_ = 0;
    const double* from_ = nullptr;
    Recording* recording_ = nullptr;
    int index_ = -1;
};

/// Functions that no power series represents at their kinks or jumps.
template <class T>
struct RefusedOfSeries {
    static_assert(is_never_series<T>,
                  "ricochet: found a comparison of a Taylor series, or a function with a kink or a "
                  "jump (abs, min, max, floor, fmod, ...); expected a guard at the kink and a mode "
                  "on each side of it, or another method, such as Fehlberg78");
};
#define RICOCHET_REFUSED_OF_SERIES(name)                                                          \
    template <class T>                                                                            \
    requires std::is_same_v<T, Recorded>                                                          \
    constexpr Recorded name(const T& a)                                                           \
    {                                                                                             \
        return RefusedOfSeries<T>{}, a;                                                           \
    }                                                                                             \
    template <class T, class U>                                                                   \
    requires(std::is_same_v<T, Recorded> || std::is_same_v<U, Recorded>) constexpr Recorded name( \
        const T& a, const U&)                                                                     \
    {                                                                                             \
        return RefusedOfSeries<T>{}, Recorded(a);                                                 \
    }
RICOCHET_REFUSED_OF_SERIES(abs)
RICOCHET_REFUSED_OF_SERIES(fabs)
RICOCHET_REFUSED_OF_SERIES(floor)
RICOCHET_REFUSED_OF_SERIES(ceil)
RICOCHET_REFUSED_OF_SERIES(round)
RICOCHET_REFUSED_OF_SERIES(trunc)
RICOCHET_REFUSED_OF_SERIES(fmod)
RICOCHET_REFUSED_OF_SERIES(remainder)
RICOCHET_REFUSED_OF_SERIES(copysign)
RICOCHET_REFUSED_OF_SERIES(fmin)
RICOCHET_REFUSED_OF_SERIES(fmax)
#undef RICOCHET_REFUSED_OF_SERIES
#define RICOCHET_REFUSED_OF_SERIES(op)                                                  \
    template <class T, class U>                                                         \
    requires(std::is_same_v<T, Recorded> || std::is_same_v<U, Recorded>) constexpr bool \
    operator op(const T&, const U&)                                                     \
    {                                                                                   \
        return RefusedOfSeries<T>{}, false;                                             \
    }
RICOCHET_REFUSED_OF_SERIES(<)
RICOCHET_REFUSED_OF_SERIES(>)
RICOCHET_REFUSED_OF_SERIES(<=)
RICOCHET_REFUSED_OF_SERIES(>=)
RICOCHET_REFUSED_OF_SERIES(==)
RICOCHET_REFUSED_OF_SERIES(!=)
#undef RICOCHET_REFUSED_OF_SERIES

// --- recordings of a flow ---

/// A flow that takes any scalar.
template <class System, std::size_t n>
concept ScalarFlow = requires(const System& system, const Recorded& t,
                              const std::array<Recorded, n>& x, std::array<Recorded, n>& dxdt)
{
    system.flow(t, x, dxdt);
};
template <class System, std::size_t n>
concept ModedScalarFlow = requires(const System& system, Mode mode, const Recorded& t,
                                   const std::array<Recorded, n>& x, std::array<Recorded, n>& dxdt)
{
    system.flow(mode, t, x, dxdt);
};

/// A guard, number `which` of those in `mode`, that takes any scalar.
template <class System, class Xs>
[[nodiscard]] constexpr auto scalar_guard(const System& system, [[maybe_unused]] std::size_t which,
                                          [[maybe_unused]] Mode mode, const Recorded& t,
                                          const Xs& x)
{
    if constexpr (requires { system.guard(which, mode, t, x); }) {
        return system.guard(which, mode, t, x);
    } else if constexpr (requires {
                             requires CountsGuards<System>;
                             system.guard(which, t, x);
                         }) {
        return system.guard(which, t, x);
    } else if constexpr (requires { system.guard(mode, t, x); }) {
        return system.guard(mode, t, x);
    } else if constexpr (requires { system.guard(t, x); }) {
        return system.guard(t, x);
    }
}

/// Whether guards take any scalar, in states Xs of it.
template <class System, class Xs>
concept ScalarGuardsOn = GuardReturns<System, Recorded, Xs, Recorded>;

template <class System>
inline constexpr bool counts_guards_at_run_time =
    CountsGuards<System> && !CountsGuardsFixed<System>;

/// Whether all guards take any scalar, and there is a constant number of them.
template <class System, std::size_t n>
concept ScalarGuards =
    !counts_guards_at_run_time<System> && fixed_guard_count<System, std::array<double, n>>() > 0 &&
    ScalarGuardsOn<System, std::array<Recorded, n>>;

[[noreturn]] inline void throw_rates_differ(std::size_t found, std::size_t expected)
{
    throw std::invalid_argument("a flow gives rates of " + std::to_string(found) +
                                " components, expected " + std::to_string(expected));
}

/// Whether a guard takes the states Xs of this mode. A guard that is not watched in it may be for
/// vectors of another size.
template <class Xs, class System>
[[nodiscard]] constexpr bool fits_mode(const System& system, std::size_t which, Mode mode)
{
    if constexpr (requires { std::tuple_size<Xs>::value; }) {
        return true;
    } else {
        return call_enabled_in(system, which, mode);
    }
}

/// Records the flow of `system`, and its first guards, as many as there are outputs beyond the
/// rates. The inputs are the components and the time, in this order; the outputs are the rates and
/// the guards. `x` has the size of the state.
template <class System, class Xs, class Outputs>
constexpr void record_into(const System& system, Mode mode, Recording& recording, Xs x,
                           Outputs& outputs)
{
    const std::size_t n = x.size();
    Xs dxdt = x;
    for (std::size_t i = 0; i < n; ++i) x[i] = {recording, recording.push_back({})};
    const Recorded t(recording, recording.push_back({}));
    if constexpr (requires { system.flow(mode, t, x, dxdt); }) {
        system.flow(mode, t, x, dxdt);
    } else {
        system.flow(t, x, dxdt);
    }
    if (dxdt.size() != n) throw_rates_differ(dxdt.size(), n);
    const auto index_of = [&](const Recorded& out) {
        if (!out.is_constant()) return out.index();
        return recording.push_back(
            {.op = TaylorOp::constant, .value = out.value(), .from = out.from()});
    };
    for (std::size_t i = 0; i < n; ++i) outputs[i] = index_of(dxdt[i]);
    if constexpr (ScalarGuardsOn<System, Xs>) {
        for (std::size_t i = 0; n + i < outputs.size(); ++i) {
            outputs[n + i] = fits_mode<Xs>(system, i, mode)
                                 ? index_of(scalar_guard(system, i, mode, t, std::as_const(x)))
                                 : index_of(Recorded(1.0));
        }
    }
}

/// The same for arrays.
template <class System, std::size_t n, std::size_t m>
constexpr void record_flow(const System& system, Mode mode, Recording& recording,
                           std::array<int, n + m>& outputs)
{
    record_into(system, mode, recording, std::array<Recorded, n>{}, outputs);
}

/// The operations that the outputs depend on, numbered from the first one: operands before results,
/// left before right. Inputs keep their numbers; `outputs` are renumbered.
template <class Outputs>
constexpr void put_in_order(std::size_t states, const Recording& from, Recording& to,
                            Outputs& outputs)
{
    const int inputs = static_cast<int>(states) + 1;
    GrowingArray<int> number;  // number in `to`, or -1
    for (int i = 0; i < from.size(); ++i) number.push_back(i < inputs ? i : -1);
    for (int i = 0; i < inputs; ++i) to.push_back(from[i]);
    GrowingArray<int> open;
    for (int& output : outputs) {
        open.push_back(output);
        while (open.size() > 0) {
            const int i = open.back();
            const RecordedOp& op = from[i];
            if (number[i] >= 0) {
                open.pop_back();
            } else if (op.a >= 0 && number[op.a] < 0) {
                open.push_back(op.a);
            } else if (op.b >= 0 && number[op.b] < 0) {
                open.push_back(op.b);
            } else if (op.c >= 0 && number[op.c] < 0) {
                open.push_back(op.c);
            } else {
                RecordedOp out = op;
                if (op.a >= 0) out.a = number[op.a];
                if (op.b >= 0) out.b = number[op.b];
                if (op.c >= 0) out.c = number[op.c];
                number[i] = to.push_back(out);
                open.pop_back();
            }
        }
        output = number[output];
    }
}

}  // namespace ricochet::detail
