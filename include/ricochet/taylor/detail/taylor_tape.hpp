// Internal: the declarations of this header may change without notice.
//
// A recording of a flow prepared for its series: without repetitions, in an order in which it can
// be computed, with the degrees in time of all its operations.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "ricochet/taylor/detail/taylor_recording.hpp"

namespace ricochet::detail {

/// Where the coefficients of a motion are written, up to an order.
/// @tparam S  double, or several
template <class S>
struct TaylorCoefficients {
    int order;
    S* x;       ///< x[k n + i] = coefficient k of component i of n
    S* guards;  ///< the same of the guards
};

/// An operation of the tape. Its constant has the operation's number.
struct TapeOp {
    TaylorOp op = TaylorOp::input;
    int a = -1;
    int b = -1;
    int c = -1;
    double exponent = 0;
};

/// Functions g with g' = f(a) a' for another series f.
[[nodiscard]] constexpr bool is_function(TaylorOp op) noexcept
{
    switch (op) {
        case TaylorOp::exponential:
        case TaylorOp::sine:
        case TaylorOp::cosine:
        case TaylorOp::hyperbolic_sine:
        case TaylorOp::hyperbolic_cosine:
        case TaylorOp::tangent:
        case TaylorOp::hyperbolic_tangent: return true;
        default: return false;
    }
}

/// Functions g with f(a) g' = a'.
[[nodiscard]] constexpr bool is_inverse(TaylorOp op) noexcept
{
    switch (op) {
        case TaylorOp::logarithm:
        case TaylorOp::arc_sine:
        case TaylorOp::arc_cosine:
        case TaylorOp::arc_tangent:
        case TaylorOp::angle: return true;
        default: return false;
    }
}

/// Degree of a series that is no polynomial in time.
inline constexpr int no_degree = 1 << 20;

/// The operations of a flow without repetitions, in an order in which they can be computed. The
/// first n are the components of the state, the next one is the time.
/// @tparam size  number of operations
/// @tparam recorded  number of operations of the recording
template <std::size_t n, std::size_t m, std::size_t size, std::size_t recorded>
struct TaylorTape {
    static constexpr std::size_t states = n;
    static constexpr std::size_t guards = m;
    static constexpr std::size_t ops_count = size;
    std::array<TapeOp, size> ops{};
    std::array<int, n + m> outputs{};     ///< the rates of the state, and the guards
    std::array<bool, size> for_guards{};  ///< whether a guard depends on it
    std::array<int, size> degree{};       ///< in time, or `no_degree`
    std::array<TapeOp, recorded> as_recorded{};
    std::array<int, recorded> place{};  ///< of a recorded operation on the tape
};

/// The tape under construction.
template <std::size_t n, std::size_t m>
struct TapeDraft {
    Recording recording;  ///< in order
    Recording ops;
    GrowingArray<int> place;
    std::array<int, n + m> outputs{};

    constexpr int add(const RecordedOp& op)
    {
        for (int i = static_cast<int>(n) + 1; i < ops.size(); ++i) {
            const RecordedOp& other = ops[i];
            if (other.op != op.op || other.a != op.a || other.b != op.b || other.c != op.c ||
                other.exponent != op.exponent) {
                continue;
            }
            const bool same_constant = !has_constant(op.op) || (op.from && other.from == op.from &&
                                                                other.value == op.value);
            if (same_constant) return i;
        }
        return ops.push_back(op);
    }

    /// Adds the partners that the derivatives of operations need: `partner(a)` of sin(a) is cos(a).
    constexpr void add_partners()
    {
        for (int i = 0; i < ops.size(); ++i) {
            const int a = ops[i].a;
            int b = -1;
            switch (ops[i].op) {
                case TaylorOp::sine: b = add_partner(TaylorOp::cosine, a); break;
                case TaylorOp::cosine: b = add_partner(TaylorOp::sine, a); break;
                case TaylorOp::hyperbolic_sine:
                    b = add_partner(TaylorOp::hyperbolic_cosine, a);
                    break;
                case TaylorOp::hyperbolic_cosine:
                    b = add_partner(TaylorOp::hyperbolic_sine, a);
                    break;
                case TaylorOp::tangent:
                case TaylorOp::hyperbolic_tangent: b = add({.op = TaylorOp::square, .a = i}); break;
                default: continue;
            }
            ops[i].b = b;
        }
    }

private:
    constexpr int add_partner(TaylorOp op, int a)
    {
        for (int i = static_cast<int>(n) + 1; i < ops.size(); ++i) {
            if (ops[i].op == op && ops[i].a == a) return i;
        }
        return ops.push_back({.op = op, .a = a});
    }
};

template <class System, std::size_t n, std::size_t m>
constexpr void draft_tape(const System& system, Mode mode, TapeDraft<n, m>& draft)
{
    Recording as_called;
    record_flow<System, n, m>(system, mode, as_called, draft.outputs);
    put_in_order(n, as_called, draft.recording, draft.outputs);
    for (int i = 0; i < draft.recording.size(); ++i) {
        RecordedOp op = draft.recording[i];
        if (op.op == TaylorOp::input) {
            draft.place.push_back(draft.ops.push_back(op));
            continue;
        }
        if (op.a >= 0) op.a = draft.place[op.a];
        if (op.b >= 0) op.b = draft.place[op.b];
        if (op.c >= 0) op.c = draft.place[op.c];
        if (op.op == TaylorOp::product && op.a == op.b) {
            op.op = TaylorOp::square;
            op.b = -1;
        }
        draft.place.push_back(draft.add(op));
    }
    for (int& output : draft.outputs) output = draft.place[output];
    draft.add_partners();
}

/// The degree of one operation from those of its operands.
template <class Tape>
[[nodiscard]] constexpr int degree_of_op(const Tape& tape, const TapeOp& op) noexcept
{
    const int a = op.a >= 0 ? tape.degree[static_cast<std::size_t>(op.a)] : 0;
    const int b = op.b >= 0 ? tape.degree[static_cast<std::size_t>(op.b)] : 0;
    const auto finite = [](int degree) { return degree >= no_degree ? no_degree : degree; };
    switch (op.op) {
        case TaylorOp::input:
        case TaylorOp::constant: return 0;
        case TaylorOp::sum:
        case TaylorOp::difference: return a > b ? a : b;
        case TaylorOp::negative:
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant:
        case TaylorOp::constant_minus:
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return a;
        case TaylorOp::product: return finite(a + b);
        case TaylorOp::square: return finite(2 * a);
        case TaylorOp::quotient: return b == 0 ? a : no_degree;
        case TaylorOp::angle: return a == 0 && b == 0 ? 0 : no_degree;
        default: return a == 0 ? 0 : no_degree;
    }
}

/// The degrees in time of all series: from states that do not move, rates raise the degrees of the
/// states, until nothing changes or a state is no polynomial of a degree that counts.
template <class Tape>
constexpr void find_degrees(Tape& tape) noexcept
{
    constexpr int most = 32;
    const std::size_t n = tape.states;
    for (bool changed = true; changed;) {
        changed = false;
        tape.degree[n] = 1;
        for (std::size_t i = n + 1; i < tape.ops_count; ++i) {
            tape.degree[i] = degree_of_op(tape, tape.ops[i]);
        }
        for (std::size_t i = 0; i < n; ++i) {
            int degree = tape.degree[static_cast<std::size_t>(tape.outputs[i])] + 1;
            if (degree > most) degree = no_degree;
            if (degree > tape.degree[i]) {
                tape.degree[i] = degree;
                changed = true;
            }
        }
    }
}

/// The largest degree in time of states and guards, rounded up to a multiple of 4.
template <class Tape>
[[nodiscard]] constexpr int polynomial_order(const Tape& tape) noexcept
{
    int most = 1;
    for (std::size_t i = 0; i < tape.states; ++i) {
        most = most > tape.degree[i] ? most : tape.degree[i];
    }
    for (std::size_t i = 0; i < tape.guards; ++i) {
        const int degree = tape.degree[static_cast<std::size_t>(tape.outputs[tape.states + i])];
        most = most > degree ? most : degree;
    }
    return (most + 3) / 4 * 4;
}

/// Marks the operations on which guards depend, partners included.
template <class Tape>
constexpr void mark_for_guards(Tape& tape) noexcept
{
    for (std::size_t i = 0; i < tape.guards; ++i) {
        tape.for_guards[static_cast<std::size_t>(tape.outputs[tape.states + i])] = true;
    }
    for (bool changed = true; changed;) {
        changed = false;
        for (std::size_t i = tape.ops_count; i-- > 0;) {
            if (!tape.for_guards[i]) continue;
            for (const int operand : {tape.ops[i].a, tape.ops[i].b, tape.ops[i].c}) {
                if (operand < 0 || tape.for_guards[static_cast<std::size_t>(operand)]) continue;
                tape.for_guards[static_cast<std::size_t>(operand)] = changed = true;
            }
        }
    }
}

struct TapeSize {
    std::size_t ops;
    std::size_t recorded;
};

template <class System, std::size_t n, std::size_t m, Mode mode>
[[nodiscard]] constexpr TapeSize tape_size()
{
    TapeDraft<n, m> draft;
    draft_tape<System, n, m>(System(), mode, draft);
    return {static_cast<std::size_t>(draft.ops.size()),
            static_cast<std::size_t>(draft.recording.size())};
}

template <class System, std::size_t n, std::size_t m, Mode mode>
[[nodiscard]] constexpr auto make_tape()
{
    constexpr TapeSize size = tape_size<System, n, m, mode>();
    TaylorTape<n, m, size.ops, size.recorded> tape;
    TapeDraft<n, m> draft;
    draft_tape<System, n, m>(System(), mode, draft);
    const auto plain = [](const RecordedOp& op) {
        return TapeOp{op.op, op.a, op.b, op.c, op.exponent};
    };
    for (std::size_t i = 0; i < size.ops; ++i) tape.ops[i] = plain(draft.ops[static_cast<int>(i)]);
    for (std::size_t i = 0; i < size.recorded; ++i) {
        tape.as_recorded[i] = plain(draft.recording[static_cast<int>(i)]);
        tape.place[i] = draft.place[static_cast<int>(i)];
    }
    tape.outputs = draft.outputs;
    find_degrees(tape);
    mark_for_guards(tape);
    return tape;
}

/// Whether the flow can be recorded in a constant expression.
template <class System, std::size_t n>
concept RecordableFlow = requires
{
    typename std::integral_constant<std::size_t, tape_size<System, n, 0, 0>().ops>;
};
/// The same including the guards.
template <class System, std::size_t n, std::size_t m>
concept RecordableGuards = requires
{
    typename std::integral_constant<std::size_t, tape_size<System, n, m, 0>().ops>;
};

/// The number of guards with series: all of them, or none.
template <class System, std::size_t n>
[[nodiscard]] constexpr std::size_t series_guards() noexcept
{
    if constexpr (ScalarGuards<System, n>) {
        constexpr std::size_t m = fixed_guard_count<System, std::array<double, n>>();
        if constexpr (RecordableGuards<System, n, m>) return m;
    }
    return 0;
}

template <class System, std::size_t n, Mode mode>
inline constexpr auto taylor_tape = make_tape<System, n, series_guards<System, n>(), mode>();

/// Result of comparing a recording of an object with the tape of its type.
enum class TapeMatch : std::uint8_t { fits, differs, not_finite };

/// The constants of `system`, each at the number of its operation.
template <class System, std::size_t n, Mode mode, class Constants>
[[nodiscard]] TapeMatch read_constants(const System& system, Constants& constants)
{
    constexpr const auto& tape = taylor_tape<System, n, mode>;
    Recording as_called;
    Recording recording;
    constexpr std::size_t m = tape.guards;
    std::array<int, n + m> outputs{};
    record_flow<System, n, m>(system, mode, as_called, outputs);
    put_in_order(n, as_called, recording, outputs);
    if (static_cast<std::size_t>(recording.size()) != tape.as_recorded.size()) {
        return TapeMatch::differs;
    }
    std::array<bool, tape.ops_count> known{};
    for (std::size_t i = 0; i < tape.as_recorded.size(); ++i) {
        const RecordedOp& found = recording[static_cast<int>(i)];
        const TapeOp& expected = tape.as_recorded[i];
        if (found.op != expected.op || found.a != expected.a || found.b != expected.b ||
            found.c != expected.c || found.exponent != expected.exponent) {
            return TapeMatch::differs;
        }
        if (!has_constant(found.op)) continue;
        const auto at = static_cast<std::size_t>(tape.place[i]);
        const double value = found.op == TaylorOp::over_constant ? 1 / found.value : found.value;
        if (!std::isfinite(value)) return TapeMatch::not_finite;
        if (known[at] && constants[at] != value) return TapeMatch::differs;
        constants[at] = value;
        known[at] = true;
    }
    for (std::size_t i = 0; i < n + m; ++i) {
        const auto at = static_cast<std::size_t>(outputs[i]);
        if (tape.place[at] != tape.outputs[i]) return TapeMatch::differs;
    }
    return TapeMatch::fits;
}

}  // namespace ricochet::detail
