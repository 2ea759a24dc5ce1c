// The coefficients of short tapes: operations one by one, in the order and with the bits of those
// that are computed side by side, whose passes over few lanes cost more than what they compute.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "ricochet/taylor/detail/lazy_tape.hpp"
#include "ricochet/taylor/detail/taylor_sums.hpp"

namespace ricochet::detail {

namespace {

/// A program takes less time where there are few operations of a kind to be computed side by side,
/// up to this many on average: 3 pendulums take as long either way, 2 of them 1.3 times as long
/// side by side.
constexpr std::size_t most_side_by_side = 3;
/// Number of operations beyond which that has not been measured.
constexpr std::size_t most_program_operations = 64;

/// Distance of two places in the columns: a column ends with a coefficient beyond the last order.
constexpr std::uint32_t stride = 24;
static_assert(stride > most_taylor_order + 1);

/// sum of a_j b_{k-j} for j from `from` to k, of series of these degrees. Where both have no end
/// the function is known, and called directly: a call by pointer whose target changes from row to
/// row costs as much as a dozen terms.
template <int k, int from>
[[gnu::always_inline]] inline double convolved(const double* a, const double* b, bool endless,
                                               int degree_a, int degree_b)
{
    if (endless) return reversed_product<k - from>(a + from, b + (k - from));
    const int lo = std::max(from, k - degree_b), hi = std::min(degree_a, k);
    if (hi < lo) return 0;
    return reversed_products[static_cast<std::size_t>(hi - lo)](a + lo, b + (k - lo));
}

/// sum of a_j a_{k-j} for j from lo to k - lo, likewise
template <int k, int from>
[[gnu::always_inline]] inline double squared(const double* a, bool endless, int degree)
{
    constexpr int half = (k - 1) / 2;
    if (endless) {
        double twice = 0;
        if constexpr (from <= half) {
            twice = 2 * reversed_product<half - from>(a + from, a + (k - from));
        }
        return k % 2 == 0 && from <= k / 2 ? twice + a[k / 2] * a[k / 2] : twice;
    }
    const int lo = std::max(from, k - degree);
    double twice = 0;
    if (lo <= half) {
        twice = 2 * reversed_products[static_cast<std::size_t>(half - lo)](a + lo, a + (k - lo));
    }
    return k % 2 == 0 && lo <= k / 2 ? twice + a[k / 2] * a[k / 2] : twice;
}

/// How a program computes operations of one kind.
template <class Step>
struct KindOf {
    Step step{};
    bool by_lanes = true;  ///< operands are places of lanes, rather than side by side
};

/// The step of a program for an operation, if there is one.
template <class Step>
[[nodiscard]] std::optional<KindOf<Step>> kind_of(TaylorOp op) noexcept
{
    using Kind = KindOf<Step>;
    switch (op) {
        case TaylorOp::sum: return Kind{Step::sum};
        case TaylorOp::difference: return Kind{Step::difference};
        case TaylorOp::negative:
        case TaylorOp::constant_minus: return Kind{Step::negative};
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant: return Kind{Step::copy};
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return Kind{Step::times};
        case TaylorOp::product: return Kind{Step::product, false};
        case TaylorOp::square: return Kind{Step::square, false};
        case TaylorOp::quotient: return Kind{Step::quotient, false};
        case TaylorOp::constant_over: return Kind{Step::constant_over, false};
        case TaylorOp::square_root: return Kind{Step::square_root, false};
        case TaylorOp::exponential:
        case TaylorOp::sine:
        case TaylorOp::hyperbolic_sine:
        case TaylorOp::hyperbolic_cosine: return Kind{Step::function, false};
        case TaylorOp::cosine: return Kind{Step::cosine, false};
        case TaylorOp::tangent: return Kind{Step::tangent, false};
        case TaylorOp::hyperbolic_tangent: return Kind{Step::hyperbolic_tangent, false};
        default: return std::nullopt;
    }
}

}  // namespace

/// Writes the program of the batches, if it can have one.
void LazyTape::write_program()
{
    program_.clear();
    program_terms_.clear();
    std::size_t kinds = 0, lanes = 0;
    for (const Batch& batch : batches_) {
        const bool is_copy = batch.pass == Pass::copy || batch.pass == Pass::slope;
        if (is_copy || batch.op == TaylorOp::input || batch.op == TaylorOp::constant) continue;
        ++kinds;
        lanes += batch.lanes.size();
    }
    if (lanes > most_program_operations || lanes >= most_side_by_side * kinds) return;
    // Where the operand of a pass is read that takes a copy of it.
    std::vector<std::uint32_t> sources(width_);
    std::iota(sources.begin(), sources.end(), 0U);
    for (const auto* passes : {&batches_, &late_}) {
        for (const Batch& batch : *passes) {
            if (batch.pass != Pass::copy) continue;
            for (std::size_t l = 0; l < batch.lanes.size(); ++l) {
                sources[batch.first + l] = batch.lanes[l].a;
            }
        }
    }
    for (const auto* passes : {&batches_, &late_}) {
        for (const Batch& batch : *passes) {
            if (append(batch, sources)) continue;
            program_.clear();
            return;
        }
    }
    columns_.assign(width_ * stride, 0);
}

/// Appends the instructions of a batch; false if there is none for its operation.
bool LazyTape::append(const Batch& batch, std::vector<std::uint32_t>& sources)
{
    if (batch.pass == Pass::copy) return true;
    const bool is_operation = batch.pass == Pass::operation;
    const bool is_given = batch.op == TaylorOp::input || batch.op == TaylorOp::constant;
    if (is_operation && is_given) return true;
    std::optional<KindOf<Step>> kind = kind_of<Step>(batch.op);
    if (batch.pass == Pass::slope) kind = KindOf<Step>{Step::slope};
    if (batch.pass == Pass::combination) kind = KindOf<Step>{Step::combination};
    if (!kind) return false;
    // Sums whose terms go on to the newest coefficients.
    const bool a_ends = kind->step != Step::quotient && batch.degree_a < no_degree;
    const bool b_ends = kind->step < Step::constant_over && batch.degree_b < no_degree;
    const Instruction each{.step = kind->step,
                           .for_guards = batch.for_guards,
                           .endless = !a_ends && (kind->step == Step::square || !b_ends),
                           .degree = batch.degree,
                           .degree_a = batch.degree_a,
                           .degree_b = batch.degree_b};
    const bool by_lanes = kind->by_lanes;
    const bool of_itself = is_operation && batch.op == TaylorOp::exponential;
    const std::size_t a = batch.a, b = of_itself ? batch.first : batch.b;
    const bool sloped = each.step >= Step::function;
    for (std::size_t l = 0; l < batch.lanes.size(); ++l) {
        Instruction next = each;
        next.out = static_cast<std::uint32_t>(batch.first + l);
        next.a = by_lanes ? batch.lanes[l].a : static_cast<std::uint32_t>(a + l);
        next.b = by_lanes ? batch.lanes[l].b : static_cast<std::uint32_t>(b + l);
        next.a = sources[next.a];
        next.b = sources[next.b];
        next.factor = factors_[batch.first + l];
        next.first = next.out;
        if (sloped) next.first = static_cast<std::uint32_t>(batch.slope_a + l) * stride;
        if (each.step == Step::combination) {
            const std::size_t terms = batch.terms.size() / batch.lanes.size();
            next.first = static_cast<std::uint32_t>(program_terms_.size());
            next.count = static_cast<std::uint32_t>(terms);
            for (std::size_t i = 0; i < terms; ++i) {
                program_terms_.push_back(batch.terms[l * terms + i]);
                program_terms_.back().of *= stride;
            }
        }
        for (std::uint32_t* column : {&next.out, &next.a, &next.b}) *column *= stride;
        program_.push_back(next);
    }
    return true;
}

[[gnu::always_inline]] inline double LazyTape::combined(const Instruction& of, int k) const noexcept
{
    const double* const columns = columns_.data() + k;
    const Term* const terms = program_terms_.data() + of.first;
    double sum = terms[0].factor * columns[terms[0].of];
    for (std::uint32_t i = 1; i < of.count; ++i) {
        sum += terms[i].factor * columns[terms[i].of];
    }
    return sum;
}

/// Branches rather than a table of jumps, for the reason that `convolved` states.
template <int k>
[[gnu::always_inline]] inline void LazyTape::compute_instruction(const Instruction& of)
{
    double* const columns = columns_.data();
    const double* const a = columns + of.a;
    const double* const b = columns + of.b;
    double* const out = columns + of.out;
    const bool endless = of.endless;
    const Step step = of.step;
    double& next = out[k];
    if (step == Step::product) {
        next = convolved<k, 0>(a, b, endless, of.degree_a, of.degree_b);
    } else if (step == Step::combination) {
        next = combined(of, k);
    } else if (step == Step::square) {
        next = squared<k, 0>(a, endless, of.degree_a);
    } else if (step >= Step::function) {
        const double sum =
            convolved<k, 1>(columns + of.first, b, endless, of.degree_a, no_degree) / k;
        if (step == Step::function) {
            next = sum;
        } else if (step == Step::cosine) {
            next = -sum;
        } else {
            next = step == Step::tangent ? a[k] + sum : a[k] - sum;
        }
    } else if (step >= Step::quotient) {
        const double inverse = inverses_[of.first];
        if (step == Step::quotient) {
            next = (a[k] - convolved<k, 1>(b, out, endless, of.degree_b, no_degree)) * inverse;
        } else if (step == Step::constant_over) {
            next = convolved<k, 1>(a, out, endless, of.degree_a, no_degree) * inverse;
        } else {
            next = (a[k] - squared<k, 1>(out, true, no_degree)) * inverse;
        }
    } else if (step >= Step::times) {
        next = (step == Step::slope ? k : of.factor) * a[k];
    } else if (step >= Step::negative) {
        next = step == Step::negative ? -a[k] : a[k];
    } else {
        next = step == Step::sum ? a[k] + b[k] : a[k] - b[k];
    }
}

/// Coefficient k of all operations, or of what the guards depend on where it is the last one; true
/// if there are more.
template <int k>
[[gnu::always_inline]] inline bool LazyTape::run_row(int order,
                                                     const TaylorCoefficients<double>& to)
{
    const bool is_last = k == order;
    if (is_last && tape_.guards == 0) return false;
    for (const Instruction& of : program_) {
        if (k > of.degree || (is_last && !of.for_guards)) continue;  // zeros
        compute_instruction<k>(of);
    }
    if (is_last) {
        keep_guard_columns(k, to.guards);
    } else {
        advance_columns(k, to);
    }
    return !is_last;
}

int LazyTape::run_program(double t, const double* x, const TaylorCoefficients<double>& to,
                          int order)
{
    start(t, x);
    const std::size_t n = tape_.states;
    for (std::size_t place = 0; place < width_; ++place) columns_[place * stride] = rows_[place];
    columns_[n * stride + 1] = 1;
    std::copy_n(x, n, to.x);
    advance_columns(0, to);
    [&]<int... before>(std::integer_sequence<int, before...>)
    {
        // Stops behind the last order.
        static_cast<void>((... && run_row<before + 1>(order, to)));
    }
    (std::make_integer_sequence<int, most_taylor_order>{});
    return order;
}

/// x_{k+1} = f_k / (k + 1)
void LazyTape::advance_columns(int k, const TaylorCoefficients<double>& to)
{
    const std::size_t n = tape_.states;
    const auto at = static_cast<std::size_t>(k);
    keep_guard_columns(k, to.guards);
    for (std::size_t i = 0; i < n; ++i) {
        const double next = columns_[outputs_[i] * stride + at] / (k + 1);
        columns_[i * stride + at + 1] = next;
        to.x[(at + 1) * n + i] = next;
    }
}

void LazyTape::keep_guard_columns(int k, double* guards) const
{
    const std::size_t n = tape_.states, m = tape_.guards;
    const auto at = static_cast<std::size_t>(k);
    for (std::size_t i = 0; i < m; ++i) {
        guards[at * m + i] = columns_[outputs_[n + i] * stride + at];
    }
}

}  // namespace ricochet::detail
