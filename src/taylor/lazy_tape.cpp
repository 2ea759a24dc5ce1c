#include "ricochet/taylor/detail/lazy_tape.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>

namespace ricochet::detail {

namespace {

/// Key of an operation: two operations with the same key have the same result.
using Key = std::tuple<TaylorOp, int, int, int, std::uint64_t, std::uint64_t>;

Key key_of(const TapeOp& op, double constant)
{
    return {op.op,
            op.a,
            op.b,
            op.c,
            std::bit_cast<std::uint64_t>(op.exponent),
            std::bit_cast<std::uint64_t>(constant)};
}

}  // namespace

LazyTape::LazyTape(std::size_t states, const Recording& as_called, std::vector<int> outputs)
{
    tape_.states = states;
    tape_.guards = outputs.size() - states;
    tape_.outputs = std::move(outputs);
    Recording recording;
    put_in_order(states, as_called, recording, tape_.outputs);
    simplify(recording);
    add_partners();
    tape_.ops_count = tape_.ops.size();
    tape_.degree.assign(tape_.ops_count, 0);
    tape_.for_guards.assign(tape_.ops_count, false);
    find_degrees(tape_);
    mark_for_guards(tape_);
    degree_ = polynomial_order(tape_);
    combine_sums();
    arrange();
}

/// The operand that an operation only repeats, or -1. An operation that is always zero becomes a
/// constant; derivatives by dual numbers contain many of both.
int LazyTape::repeated(TapeOp& op, double& constant) const
{
    const auto is_zero = [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        return tape_.ops[at].op == TaylorOp::constant && constants_[at] == 0;
    };
    bool vanishes = false;
    switch (op.op) {
        case TaylorOp::sum: return is_zero(op.a) ? op.b : is_zero(op.b) ? op.a : -1;
        case TaylorOp::difference:
            if (is_zero(op.a)) op = {.op = TaylorOp::negative, .a = op.b};
            return op.b >= 0 && is_zero(op.b) ? op.a : -1;
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant: return constant == 0 ? op.a : -1;
        case TaylorOp::constant_minus:
            if (constant == 0) op = {.op = TaylorOp::negative, .a = op.a};
            return -1;
        case TaylorOp::times_constant:
        case TaylorOp::over_constant:
            if (constant == 1) return op.a;
            vanishes = constant == 0 || is_zero(op.a);
            break;
        case TaylorOp::product: vanishes = is_zero(op.a) || is_zero(op.b); break;
        case TaylorOp::negative:
        case TaylorOp::square:
        case TaylorOp::quotient: vanishes = is_zero(op.a); break;
        default: break;
    }
    if (vanishes) {
        op = {.op = TaylorOp::constant};
        constant = 0;
    }
    return -1;
}

void LazyTape::simplify(const Recording& recording)
{
    std::vector<int> place;
    std::map<Key, int> known;
    for (int i = 0; i < recording.size(); ++i) {
        const RecordedOp& recorded = recording[i];
        TapeOp op{recorded.op, recorded.a, recorded.b, recorded.c, recorded.exponent};
        for (int* operand : {&op.a, &op.b, &op.c}) {
            if (*operand >= 0) *operand = place[static_cast<std::size_t>(*operand)];
        }
        if (op.op == TaylorOp::product && op.a == op.b) {
            op.op = TaylorOp::square;
            op.b = -1;
        }
        double constant = 0;
        if (has_constant(op.op)) {
            constant = op.op == TaylorOp::over_constant ? 1 / recorded.value : recorded.value;
            finite_ = finite_ && std::isfinite(constant);
        }
        if (const int same = repeated(op, constant); same >= 0) {
            place.push_back(same);
            continue;
        }
        const int next = static_cast<int>(tape_.ops.size());
        int at = next;
        if (op.op != TaylorOp::input) at = known.emplace(key_of(op, constant), next).first->second;
        if (at == next) {
            tape_.ops.push_back(op);
            constants_.push_back(constant);
        }
        place.push_back(at);
    }
    for (int& output : tape_.outputs) output = place[static_cast<std::size_t>(output)];
}

void LazyTape::add_partners()
{
    const auto has_partner = [](const TapeOp& op) { return is_function(op.op); };
    if (std::ranges::none_of(tape_.ops, has_partner)) return;
    std::map<std::pair<TaylorOp, int>, int> known;
    for (std::size_t i = tape_.states + 1; i < tape_.ops.size(); ++i) {
        known.emplace(std::pair(tape_.ops[i].op, tape_.ops[i].a), static_cast<int>(i));
    }
    const auto partner = [&](TaylorOp op, int a) {
        const int next = static_cast<int>(tape_.ops.size());
        const auto [at, added] = known.emplace(std::pair(op, a), next);
        if (added) {
            tape_.ops.push_back({.op = op, .a = a});
            constants_.push_back(0);
        }
        return at->second;
    };
    for (std::size_t i = 0; i < tape_.ops.size(); ++i) {
        const int a = tape_.ops[i].a;
        int b = tape_.ops[i].b;
        switch (tape_.ops[i].op) {
            case TaylorOp::sine: b = partner(TaylorOp::cosine, a); break;
            case TaylorOp::cosine: b = partner(TaylorOp::sine, a); break;
            case TaylorOp::hyperbolic_sine: b = partner(TaylorOp::hyperbolic_cosine, a); break;
            case TaylorOp::hyperbolic_cosine: b = partner(TaylorOp::hyperbolic_sine, a); break;
            case TaylorOp::tangent:
            case TaylorOp::hyperbolic_tangent:
                b = partner(TaylorOp::square, static_cast<int>(i));
                break;
            default: break;
        }
        tape_.ops[i].b = b;
    }
}

/// An operand of a sum: where it is used nowhere else, a multiple of another operation.
LazyTape::Term LazyTape::term(int i, const std::vector<int>& uses)
{
    const auto at = static_cast<std::size_t>(i);
    const TapeOp& op = tape_.ops[at];
    const bool opposite = op.op == TaylorOp::negative;
    const bool multiple = op.op == TaylorOp::times_constant || op.op == TaylorOp::over_constant;
    if (!(opposite || multiple) || uses[at] > 1) return {at, 1};
    absorbed_[at] = true;
    if (multiple) return {static_cast<std::size_t>(op.a), constants_[at]};
    const Term of = term(op.a, uses);
    return {of.of, -of.factor};
}

/// Combines sums of sums, and of multiples, in the order in which they are added.
void LazyTape::combine_sums()
{
    std::vector<int> uses(tape_.ops_count, 0);
    for (const TapeOp& op : tape_.ops) {
        for (const int operand : {op.a, op.b, op.c}) {
            if (operand >= 0) ++uses[static_cast<std::size_t>(operand)];
        }
    }
    for (const int output : tape_.outputs) ++uses[static_cast<std::size_t>(output)];
    terms_.assign(tape_.ops_count, {});
    absorbed_.assign(tape_.ops_count, false);
    for (std::size_t i = tape_.states + 1; i < tape_.ops_count; ++i) {
        const TapeOp& op = tape_.ops[i];
        const bool sum = op.op == TaylorOp::sum;
        if (!sum && op.op != TaylorOp::difference) continue;
        const auto goes_on = [&](int operand) {
            const auto at = static_cast<std::size_t>(operand);
            return !terms_[at].empty() && uses[at] == 1;
        };
        const bool of_b = sum && goes_on(op.b) && !goes_on(op.a);
        const auto first = static_cast<std::size_t>(of_b ? op.b : op.a);
        Term next = term(of_b ? op.a : op.b, uses);
        if (!sum) next.factor = -next.factor;
        if (goes_on(static_cast<int>(first))) {
            terms_[i] = std::move(terms_[first]);
            terms_[first].clear();
            absorbed_[first] = true;
        } else {
            terms_[i].push_back(term(static_cast<int>(first), uses));
        }
        terms_[i].push_back(next);
    }
    for (std::size_t i = 0; i < tape_.ops_count; ++i) {
        const std::vector<Term>& terms = terms_[i];
        const auto is = [&](const Term& term, int operand) {
            return std::fabs(term.factor) == 1 && static_cast<int>(term.of) == operand;
        };
        const TapeOp& op = tape_.ops[i];
        if (terms.size() == 2 && is(terms[0], op.a) && is(terms[1], op.b)) terms_[i].clear();
    }
}

}  // namespace ricochet::detail
