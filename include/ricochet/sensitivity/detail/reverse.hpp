// Internal: the declarations of this header may change without notice.
//
// Reverse mode: a scalar that records what is computed with it, and the sweep back through the
// record.
//
// (A. Griewank and A. Walther, Evaluating Derivatives, 2nd edition, SIAM, 2008, chapter 4.) An
// operation of one or two operands is one entry with its partial derivatives. Entry 0 stands for
// every constant, so that nothing is recorded of operations on constants alone.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "ricochet/dual.hpp"

namespace ricochet::detail {

/// The record of a thread that is being written.
class ReverseTape {
public:
    struct Entry {
        std::uint32_t a, b;  ///< operands
        double by_a, by_b;   ///< partial derivatives
    };

    ReverseTape() : entries_(1, Entry{0, 0, 0, 0}) {}

    [[nodiscard]] std::uint32_t add(std::uint32_t a, double by_a, std::uint32_t b, double by_b)
    {
        entries_.push_back({a, b, by_a, by_b});
        return static_cast<std::uint32_t>(entries_.size() - 1);
    }
    /// A variable, with respect to which derivatives are wanted.
    [[nodiscard]] std::uint32_t variable() { return add(0, 0, 0, 0); }

    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
    /// Drops the entries from `size` on.
    void shrink(std::size_t size) { entries_.resize(size); }

    /// Prepares the adjoints of all entries: zero.
    void clear_adjoints() { adjoints_.assign(entries_.size(), 0.0); }
    [[nodiscard]] double& adjoint(std::uint32_t entry) { return adjoints_[entry]; }

    /// From the results to the variables.
    void sweep()
    {
        for (std::size_t i = entries_.size(); i-- > 1;) {
            const double of = adjoints_[i];
            if (of == 0) continue;
            const Entry& entry = entries_[i];
            // A partial derivative may be infinite where its operand is a constant.
            if (entry.a != 0) adjoints_[entry.a] += of * entry.by_a;
            if (entry.b != 0) adjoints_[entry.b] += of * entry.by_b;
        }
    }

    /// The tape on which this thread records.
    [[nodiscard]] static ReverseTape*& current() noexcept
    {
        thread_local ReverseTape* tape = nullptr;
        return tape;
    }

private:
    std::vector<Entry> entries_;
    std::vector<double> adjoints_;
};

/// Lets a thread record on a tape while it lives.
class ReverseRecording {
public:
    explicit ReverseRecording(ReverseTape& tape) noexcept : before_(ReverseTape::current())
    {
        ReverseTape::current() = &tape;
    }
    ReverseRecording(const ReverseRecording&) = delete;
    ReverseRecording& operator=(const ReverseRecording&) = delete;
    ~ReverseRecording() { ReverseTape::current() = before_; }

private:
    ReverseTape* before_;
};

/// A number whose operations are recorded for a sweep in reverse, as a user's template sees it: it
/// has the operators and functions of `Dual`, and comparisons compare values.
struct Reverse {
    double value = 0;
    std::uint32_t entry = 0;  ///< 0: a constant

    constexpr Reverse() = default;
    template <class U>
    requires std::is_arithmetic_v<U>
    constexpr Reverse(const U& constant) noexcept  // NOLINT(google-explicit-constructor)
        : value(static_cast<double>(constant))
    {
    }
    constexpr Reverse(double value_, std::uint32_t entry_) noexcept : value(value_), entry(entry_)
    {
    }
    template <class U>
    requires std::is_same_v<U, double>
    constexpr operator U() const  // NOLINT(google-explicit-constructor)
    {
        static_assert(is_never_number<U>,
                      "ricochet: found a number wanted of a recorded number; expected functions "
                      "called by their bare names (using std::cos; cos(x)) and parameters, time "
                      "and state to have the type of the template parameter");
        return U();
    }

    friend Reverse operator+(const Reverse& a) { return a; }
    friend Reverse operator-(const Reverse& a) { return of(-a.value, a, -1); }
    friend Reverse operator+(const Reverse& a, const Reverse& b)
    {
        return of(a.value + b.value, a, 1, b, 1);
    }
    friend Reverse operator-(const Reverse& a, const Reverse& b)
    {
        return of(a.value - b.value, a, 1, b, -1);
    }
    friend Reverse operator*(const Reverse& a, const Reverse& b)
    {
        return of(a.value * b.value, a, b.value, b, a.value);
    }
    friend Reverse operator/(const Reverse& a, const Reverse& b)
    {
        const double f = a.value / b.value;
        return of(f, a, 1 / b.value, b, -f / b.value);
    }
    Reverse& operator+=(const Reverse& b) { return *this = *this + b; }
    Reverse& operator-=(const Reverse& b) { return *this = *this - b; }
    Reverse& operator*=(const Reverse& b) { return *this = *this * b; }
    Reverse& operator/=(const Reverse& b) { return *this = *this / b; }

    friend bool operator<(const Reverse& a, const Reverse& b) { return a.value < b.value; }
    friend bool operator>(const Reverse& a, const Reverse& b) { return a.value > b.value; }
    friend bool operator<=(const Reverse& a, const Reverse& b) { return a.value <= b.value; }
    friend bool operator>=(const Reverse& a, const Reverse& b) { return a.value >= b.value; }
    friend bool operator==(const Reverse& a, const Reverse& b) { return a.value == b.value; }
    friend bool operator!=(const Reverse& a, const Reverse& b) { return a.value != b.value; }

    // Mixed with numbers of any type.
#define RICOCHET_REVERSE_WITH_NUMBERS(result, op)           \
    template <class U>                                      \
    requires std::is_arithmetic_v<U>                        \
    friend result operator op(const Reverse& a, const U& b) \
    {                                                       \
        return a op Reverse(b);                             \
    }                                                       \
    template <class U>                                      \
    requires std::is_arithmetic_v<U>                        \
    friend result operator op(const U& a, const Reverse& b) \
    {                                                       \
        return Reverse(a) op b;                             \
    }
    RICOCHET_REVERSE_WITH_NUMBERS(Reverse, +)
    RICOCHET_REVERSE_WITH_NUMBERS(Reverse, -)
    RICOCHET_REVERSE_WITH_NUMBERS(Reverse, *)
    RICOCHET_REVERSE_WITH_NUMBERS(Reverse, /)
    RICOCHET_REVERSE_WITH_NUMBERS(bool, <)
    RICOCHET_REVERSE_WITH_NUMBERS(bool, >)
    RICOCHET_REVERSE_WITH_NUMBERS(bool, <=)
    RICOCHET_REVERSE_WITH_NUMBERS(bool, >=)
    RICOCHET_REVERSE_WITH_NUMBERS(bool, ==)
    RICOCHET_REVERSE_WITH_NUMBERS(bool, !=)
#undef RICOCHET_REVERSE_WITH_NUMBERS

    // Functions of one number: their values and derivatives are those of dual numbers.
#define RICOCHET_REVERSE_FUNCTION(name)                  \
    friend Reverse name(const Reverse& a)                \
    {                                                    \
        const Dual<1> f = name(Dual<1>(a.value, {1.0})); \
        return of(f.value, a, f.slope[0]);               \
    }
    RICOCHET_REVERSE_FUNCTION(sqrt)
    RICOCHET_REVERSE_FUNCTION(cbrt)
    RICOCHET_REVERSE_FUNCTION(exp)
    RICOCHET_REVERSE_FUNCTION(log)
    RICOCHET_REVERSE_FUNCTION(sin)
    RICOCHET_REVERSE_FUNCTION(cos)
    RICOCHET_REVERSE_FUNCTION(tan)
    RICOCHET_REVERSE_FUNCTION(asin)
    RICOCHET_REVERSE_FUNCTION(acos)
    RICOCHET_REVERSE_FUNCTION(atan)
    RICOCHET_REVERSE_FUNCTION(sinh)
    RICOCHET_REVERSE_FUNCTION(cosh)
    RICOCHET_REVERSE_FUNCTION(tanh)
    RICOCHET_REVERSE_FUNCTION(fabs)
    RICOCHET_REVERSE_FUNCTION(abs)
    RICOCHET_REVERSE_FUNCTION(floor)
    RICOCHET_REVERSE_FUNCTION(ceil)
#undef RICOCHET_REVERSE_FUNCTION

    // Functions of two numbers, either of which may be a constant.
#define RICOCHET_REVERSE_FUNCTION(name)                              \
    friend Reverse name(const Reverse& a, const Reverse& b)          \
    {                                                                \
        const Dual<1> by_a = name(Dual<1>(a.value, {1.0}), b.value); \
        if (b.entry == 0) return of(by_a.value, a, by_a.slope[0]);   \
        const Dual<1> by_b = name(a.value, Dual<1>(b.value, {1.0})); \
        return of(by_a.value, a, by_a.slope[0], b, by_b.slope[0]);   \
    }                                                                \
    template <class U>                                               \
    requires std::is_arithmetic_v<U>                                 \
    friend Reverse name(const Reverse& a, const U& b)                \
    {                                                                \
        return name(a, Reverse(b));                                  \
    }                                                                \
    template <class U>                                               \
    requires std::is_arithmetic_v<U>                                 \
    friend Reverse name(const U& a, const Reverse& b)                \
    {                                                                \
        return name(Reverse(a), b);                                  \
    }
    RICOCHET_REVERSE_FUNCTION(pow)
    RICOCHET_REVERSE_FUNCTION(atan2)
    RICOCHET_REVERSE_FUNCTION(hypot)
#undef RICOCHET_REVERSE_FUNCTION
    friend Reverse max(const Reverse& a, const Reverse& b)
    {
        return a.value < b.value ? b : a;
    }
    friend Reverse min(const Reverse& a, const Reverse& b)
    {
        return b.value < a.value ? b : a;
    }
    friend Reverse fmax(const Reverse& a, const Reverse& b)
    {
        return max(a, b);
    }
    friend Reverse fmin(const Reverse& a, const Reverse& b)
    {
        return min(a, b);
    }

private:
    [[nodiscard]] static Reverse of(double value, const Reverse& a, double by_a)
    {
        if (a.entry == 0) return {value, 0};
        return {value, ReverseTape::current()->add(a.entry, by_a, 0, 0)};
    }
    [[nodiscard]] static Reverse of(double value, const Reverse& a, double by_a, const Reverse& b,
                                    double by_b)
    {
        if (a.entry == 0 && b.entry == 0) return {value, 0};
        return {value, ReverseTape::current()->add(a.entry, by_a, b.entry, by_b)};
    }
};

}  // namespace ricochet::detail
