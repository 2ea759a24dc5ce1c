// The coefficients of recorded operations: a row for each order, in which operations of one kind
// stand side by side, so that the processor computes several at a time.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "base/wide.hpp"
#include "ricochet/taylor/detail/lazy_tape.hpp"
#include "ricochet/taylor/detail/taylor_sums.hpp"

namespace ricochet::detail {

namespace {

/// Operations of one kind begin at multiples of four, and as many are computed at a time.
[[nodiscard]] std::size_t whole(std::size_t place) noexcept
{
    return (place + 3) / 4 * 4;
}
/// The largest number of terms in a sum.
constexpr std::size_t most_terms = most_taylor_order + 1;

/// Four doubles, in one register or in two.
typedef double Four __attribute__((vector_size(32)));
/// The same in a row, where the first has an even place.
typedef Four InRow __attribute__((aligned(16), may_alias));

/// The terms of a sum: j times the width of a row for each, and their factors if there are any.
struct TermsOfRows {
    std::size_t count;
    const std::ptrdiff_t* offsets;
    const double* weights;
};

template <std::size_t fours, bool weighted>
[[gnu::always_inline]] inline void sum_block(const double* a, const double* b,
                                             const TermsOfRows& terms, double* sums)
{
    Four sum[fours];  // NOLINT(*-avoid-c-arrays): std::array would lose the attributes
    const auto with_terms = [&](std::size_t i, const auto& put) __attribute__((always_inline))
    {
        const InRow* const left = reinterpret_cast<const InRow*>(a + terms.offsets[i]);
        const InRow* right = reinterpret_cast<const InRow*>(b - terms.offsets[i]);
        asm("" : "+r"(right));  // else g++ computes every address again
        for (std::size_t l = 0; l < fours; ++l) {
            if constexpr (weighted)
                put(sum[l], Four(terms.weights[i] * left[l] * right[l]));
            else
                put(sum[l], Four(left[l] * right[l]));
        }
    };
    with_terms(
        0, [](Four & to, const Four& term) __attribute__((always_inline)) { to = term; });
    for (std::size_t i = 1; i < terms.count; ++i) {
        with_terms(
            i, [](Four & to, const Four& term) __attribute__((always_inline)) { to += term; });
    }
    for (std::size_t l = 0; l < fours; ++l) reinterpret_cast<InRow*>(sums)[l] = sum[l];
}

/// In each lane, and in those that fill up the last four, the sum of weight_j a_j b_{-j}.
template <bool weighted>
RICOCHET_WIDE void sum_rows(const double* a, const double* b, const TermsOfRows& terms,
                            std::size_t lanes, double* sums)
{
    const std::size_t fours = (lanes + 3) / 4;
    std::size_t l = 0;
    for (; l + 24 <= 4 * fours; l += 24) sum_block<6, weighted>(a + l, b + l, terms, sums + l);
    switch (fours % 6) {
        case 1: return sum_block<1, weighted>(a + l, b + l, terms, sums + l);
        case 2: return sum_block<2, weighted>(a + l, b + l, terms, sums + l);
        case 3: return sum_block<3, weighted>(a + l, b + l, terms, sums + l);
        case 4: return sum_block<4, weighted>(a + l, b + l, terms, sums + l);
        case 5: return sum_block<5, weighted>(a + l, b + l, terms, sums + l);
        default: return;
    }
}

/// out_l = f(l), for places that are not among those that f reads
template <class F>
[[gnu::always_inline]] inline void fill(double* __restrict out, std::size_t count, const F& f)
{
#pragma GCC unroll 4
    for (std::size_t l = 0; l < count; ++l) out[l] = f(l);
}

/// Whether a coefficient is a sum of products of coefficients, rather than linear in them.
[[nodiscard]] bool is_linear(TaylorOp op) noexcept
{
    switch (op) {
        case TaylorOp::input:
        case TaylorOp::constant:
        case TaylorOp::sum:
        case TaylorOp::difference:
        case TaylorOp::negative:
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant:
        case TaylorOp::constant_minus:
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return true;
        default: return false;
    }
}

}  // namespace

// --- arrangement ---

LazyTape::Lane LazyTape::lane(std::size_t a, std::size_t b) noexcept
{
    return {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)};
}

/// Operations of one kind, with operands of the same degrees, that depend on earlier ones alone.
std::vector<LazyTape::Batch> LazyTape::batches() const
{
    using Kind = std::tuple<int, TaylorOp, std::uint64_t, std::size_t, int, int, int, int>;
    std::map<Kind, Batch> kinds;
    std::vector<int> levels(tape_.ops_count, 0);
    for (std::size_t i = tape_.states + 1; i < tape_.ops_count; ++i) {
        if (absorbed_[i]) continue;
        const TapeOp& op = tape_.ops[i];
        const auto follow = [&](std::size_t operand) {
            levels[i] = std::max(levels[i], levels[operand] + 1);
        };
        for (const Term& term : terms_[i]) follow(term.of);
        if (!terms_[i].empty()) {
            Batch& batch =
                kinds[{levels[i], TaylorOp::sum, 0, terms_[i].size(), 0, 0, 0, tape_.degree[i]}];
            batch.pass = Pass::combination;
            batch.op = TaylorOp::sum;
            batch.degree = tape_.degree[i];
            batch.for_guards = batch.for_guards || tape_.for_guards[i];
            batch.ops.push_back(i);
            continue;
        }
        for (const int operand : {op.a, op.b, op.c}) {
            // Of sin and cos, each is an operand of the other.
            if (operand < 0 || static_cast<std::size_t>(operand) >= i) continue;
            follow(static_cast<std::size_t>(operand));
        }
        Batch& batch = kinds[{levels[i], op.op, std::bit_cast<std::uint64_t>(op.exponent), 0,
                              degree(op.a), degree(op.b), degree(op.c), tape_.degree[i]}];
        batch.op = op.op;
        batch.exponent = op.exponent;
        batch.degree_a = degree(op.a);
        batch.degree_b = degree(op.b);
        batch.degree_c = degree(op.c);
        batch.degree = tape_.degree[i];
        batch.for_guards = batch.for_guards || tape_.for_guards[i];
        batch.ops.push_back(i);
    }
    std::vector<Batch> out;
    for (auto& [kind, batch] : kinds) out.push_back(std::move(batch));
    return out;
}

void LazyTape::arrange()
{
    places_.assign(tape_.ops_count, 0);
    for (std::size_t i = 0; i <= tape_.states; ++i) places_[i] = i;
    width_ = whole(tape_.states + 1);
    std::vector<Batch> operations = batches();
    for (Batch& batch : operations) place(batch);
    for (Batch& batch : operations) {
        const auto place_of = [&](int i) {
            return places_[static_cast<std::size_t>(std::max(i, 0))];
        };
        for (const std::size_t i : batch.ops) {
            batch.lanes.push_back(lane(place_of(tape_.ops[i].a), place_of(tape_.ops[i].b)));
            for (const Term& term : terms_[i]) {
                batch.terms.push_back({places_[term.of], term.factor});
            }
        }
        if (!is_linear(batch.op)) side_by_side(batch);
        if (is_inverse(batch.op)) batch.slope = slopes_of(batch.first, batch.ops.size(), true);
        batches_.push_back(std::move(batch));
    }
    for (const int output : tape_.outputs) {
        outputs_.push_back(places_[static_cast<std::size_t>(output)]);
    }
    rows_.assign((most_taylor_order + 1) * width_ + 4, 0);
    for (int last = 0; last <= most_taylor_order; ++last) {
        for (int i = 0; i <= last; ++i) {
            outward_[static_cast<std::size_t>(last)][static_cast<std::size_t>(i)] =
                outward(0, last, i) * static_cast<std::ptrdiff_t>(width_);
        }
    }
    inverses_.assign(width_, 0);
    factors_.assign(width_, 0);
    for (std::size_t i = 0; i < tape_.ops_count; ++i) factors_[places_[i]] = constants_[i];
    sums_.assign(width_ + 4, 0);
    other_sums_ = sums_;
    write_program();
}

/// Places a batch behind the others, by its operands, with room for a whole number of blocks.
void LazyTape::place(Batch& batch)
{
    const auto operands = [&](std::size_t i) {
        const auto place_of = [&](int operand) {
            const auto at = static_cast<std::size_t>(operand);
            return operand < 0 || at >= i ? 0 : places_[at];
        };
        if (!terms_[i].empty())
            return std::pair(places_[terms_[i][0].of], places_[terms_[i][1].of]);
        return std::pair(place_of(tape_.ops[i].a), place_of(tape_.ops[i].b));
    };
    std::ranges::stable_sort(batch.ops, {}, operands);
    batch.first = width_;
    for (const std::size_t i : batch.ops) places_[i] = width_++;
    width_ = whole(width_);
}

/// Lets the operands of a batch stand side by side.
void LazyTape::side_by_side(Batch& batch)
{
    const auto operand = [&](int TapeOp::*which) -> std::size_t {
        std::vector<std::size_t> places;
        bool late = false;
        for (const std::size_t op : batch.ops) {
            const int i = tape_.ops[op].*which;
            if (i < 0) return 0;
            places.push_back(places_[static_cast<std::size_t>(i)]);
            late = late || places.back() >= batch.first;
        }
        return in_a_row(places, late);
    };
    batch.a = operand(&TapeOp::a);
    batch.b = operand(&TapeOp::b);
    batch.c = operand(&TapeOp::c);
    const std::size_t count = batch.lanes.size();
    if (is_function(batch.op) || batch.op == TaylorOp::angle) {
        batch.slope_a = slopes_of(batch.a, count, false);
    }
    if (batch.op == TaylorOp::angle) batch.slope_b = slopes_of(batch.b, count, false);
}

/// The place of the first of these, or of the first of their copies.
std::size_t LazyTape::in_a_row(const std::vector<std::size_t>& places, bool late)
{
    bool stand_so = places.front() % 2 == 0;
    for (std::size_t l = 0; l < places.size(); ++l) {
        stand_so = stand_so && places[l] == places.front() + l;
    }
    if (stand_so) return places.front();
    Batch copies{.pass = Pass::copy, .degree = no_degree, .for_guards = true, .first = width_};
    for (const std::size_t place : places) copies.lanes.push_back(lane(place, 0));
    width_ += whole(places.size());
    (late ? late_ : batches_).push_back(copies);
    return copies.first;
}

/// The place of the first slope of series that stand side by side.
std::size_t LazyTape::slopes_of(std::size_t first, std::size_t count, bool late)
{
    Batch slopes{.pass = Pass::slope, .degree = no_degree, .for_guards = true, .first = width_};
    for (std::size_t l = 0; l < count; ++l) slopes.lanes.push_back(lane(first + l, 0));
    width_ += whole(count);
    (late ? late_ : batches_).push_back(slopes);
    return slopes.first;
}

// --- computation ---

/// sum of a_j b_{k-j} for j from lo to hi, in each of `count` lanes
[[gnu::always_inline]] inline void LazyTape::convolve(std::size_t a, std::size_t b, Terms terms,
                                                      std::size_t count, double* sums)
{
    const auto& [k, lo, hi] = terms;
    if (hi < lo) {
        std::fill_n(sums, count, 0.0);
        return;
    }
    const auto last = static_cast<std::size_t>(hi - lo);
    sum_rows<false>(row(lo) + a, row(k - lo) + b, {last + 1, outward_[last].data(), nullptr}, count,
                    sums);
}

/// sum of a_j a_{k-j} for j from lo to k - lo
[[gnu::always_inline]] inline void LazyTape::square(std::size_t a, int k, int lo, std::size_t count)
{
    convolve(a, a, {k, lo, (k - 1) / 2}, count, sums_.data());
    const bool has_middle = k % 2 == 0 && lo <= k / 2;
    const double* const middle = row(k / 2) + a;
    for (std::size_t l = 0; l < count; ++l) {
        const double twice = 2 * sums_[l];
        sums_[l] = has_middle ? twice + middle[l] * middle[l] : twice;
    }
}

/// sum of ((exponent + 1) j / k - 1) a_j p_{k-j} for j from 1 to hi, with the results p
void LazyTape::power(const Batch& batch, int k, int hi)
{
    if (hi < 1) {
        std::ranges::fill(sums_, 0.0);
        return;
    }
    std::array<double, most_terms> weights{};
    std::array<std::ptrdiff_t, most_terms> offsets{};
    const double each = (batch.exponent + 1) / k;
    for (int j = 1; j <= hi; ++j) {
        weights[static_cast<std::size_t>(j - 1)] = each * j - 1;
        offsets[static_cast<std::size_t>(j - 1)] = (j - 1) * static_cast<std::ptrdiff_t>(width_);
    }
    sum_rows<true>(row(1) + batch.a, row(k - 1) + batch.first,
                   {static_cast<std::size_t>(hi), offsets.data(), weights.data()},
                   batch.lanes.size(), sums_.data());
}

[[gnu::always_inline]] inline void LazyTape::add_up(const Batch& batch, int k)
{
    const std::size_t count = batch.lanes.size();
    const std::size_t own = batch.first;
    const double* const a = row(k) + batch.a;
    double* const out = row(k) + own;
    const int upto_a = std::min(batch.degree_a, k), upto_b = std::min(batch.degree_b, k);
    const double* const inverses = inverses_.data() + own;
    const auto scale = [&](const auto& numerator) {
        for (std::size_t l = 0; l < count; ++l) {
            out[l] = numerator(l) * inverses[l];
        }
    };
    switch (batch.op) {
        case TaylorOp::product:
            return convolve(batch.a, batch.b, {k, std::max(0, k - batch.degree_b), upto_a}, count,
                            out);
        case TaylorOp::square:
            square(batch.a, k, std::max(0, k - batch.degree_a), count);
            std::copy_n(sums_.data(), count, out);
            return;
        case TaylorOp::quotient:
            convolve(batch.b, own, {k, 1, upto_b}, count, sums_.data());
            return scale([&](std::size_t l) { return a[l] - sums_[l]; });
        case TaylorOp::constant_over:
            convolve(batch.a, own, {k, 1, upto_a}, count, sums_.data());
            return scale([&](std::size_t l) { return sums_[l]; });
        case TaylorOp::square_root:
            square(own, k, 1, count);
            return scale([&](std::size_t l) { return a[l] - sums_[l]; });
        default: power(batch, k, upto_a); return scale([&](std::size_t l) { return sums_[l]; });
    }
}

/// Coefficients of functions g(a) with g' = f(a) a'.
[[gnu::always_inline]] inline void LazyTape::add_up_function(const Batch& batch, int k)
{
    const std::size_t count = batch.lanes.size();
    const std::size_t f = batch.op == TaylorOp::exponential ? batch.first : batch.b;
    convolve(batch.slope_a, f, {k, 1, std::min(batch.degree_a, k)}, count, sums_.data());
    const double* const a = row(k) + batch.a;
    double* const out = row(k) + batch.first;
    for (std::size_t l = 0; l < count; ++l) {
        const double sum = sums_[l] / k;
        switch (batch.op) {
            case TaylorOp::cosine: out[l] = -sum; break;
            case TaylorOp::tangent: out[l] = a[l] + sum; break;
            case TaylorOp::hyperbolic_tangent: out[l] = a[l] - sum; break;
            default: out[l] = sum;
        }
    }
}

/// Coefficients of functions g(a) with f(a) g' = a'.
void LazyTape::add_up_inverse(const Batch& batch, int k)
{
    const std::size_t count = batch.lanes.size();
    const int da = batch.degree_a, db = batch.degree_b;
    const double* const inverses = inverses_.data() + batch.first;
    const double* const a = row(k) + batch.a;
    double* const out = row(k) + batch.first;
    if (batch.op == TaylorOp::angle) {
        // c g' = a' b - b' a
        convolve(batch.slope_a, batch.b, {k, std::max(1, k - db), std::min(da, k)}, count,
                 sums_.data());
        convolve(batch.slope_b, batch.a, {k, std::max(1, k - da), std::min(db, k)}, count,
                 other_sums_.data());
        for (std::size_t l = 0; l < count; ++l) out[l] = sums_[l] - other_sums_[l];
        convolve(batch.slope, batch.c, {k, std::max(1, k - batch.degree_c), k - 1}, count,
                 sums_.data());
        for (std::size_t l = 0; l < count; ++l) {
            out[l] = (out[l] - sums_[l]) * inverses[l] / k;
        }
        return;
    }
    const bool of_a = batch.op == TaylorOp::logarithm;
    const int from = std::max(1, k - (of_a ? da : db));
    convolve(batch.slope, of_a ? batch.a : batch.b, {k, from, k - 1}, count, sums_.data());
    const double sign = batch.op == TaylorOp::arc_cosine ? -1 : 1;
    for (std::size_t l = 0; l < count; ++l) {
        out[l] = (sign * a[l] - sums_[l] / k) * inverses[l];
    }
}

/// Sums of as many terms in every lane.
[[gnu::always_inline]] inline void LazyTape::combine(const Batch& batch, int k)
{
    const double* const from = row(k);
    const std::size_t count = batch.lanes.size();
    double* __restrict const out = row(k) + batch.first;
    const auto by = [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline))
    {
        const Term* term = batch.terms.data();
        for (std::size_t l = 0; l < count; ++l, term += sizeof...(I)) {
            out[l] = (... + (term[I].factor * from[term[I].of]));
        }
    };
    switch (const std::size_t terms = batch.terms.size() / count) {
        case 2: return by(std::make_index_sequence<2>{});
        case 3: return by(std::make_index_sequence<3>{});
        case 4: return by(std::make_index_sequence<4>{});
        case 5: return by(std::make_index_sequence<5>{});
        case 6: return by(std::make_index_sequence<6>{});
        default:
            for (std::size_t l = 0; l < count; ++l) {
                const Term* const first = batch.terms.data() + l * terms;
                double sum = first->factor * from[first->of];
                for (std::size_t i = 1; i < terms; ++i) sum += first[i].factor * from[first[i].of];
                out[l] = sum;
            }
    }
}

[[gnu::always_inline]] inline void LazyTape::compute_batch(const Batch& batch, int k)
{
    const double* const from = row(k);
    const Lane* const lanes = batch.lanes.data();
    const double* const factors = factors_.data() + batch.first;
    const auto put = [&](const auto& f) { fill(row(k) + batch.first, batch.lanes.size(), f); };
    const auto a = [=](std::size_t l) { return from[lanes[l].a]; };
    const auto b = [=](std::size_t l) { return from[lanes[l].b]; };
    if (batch.pass == Pass::slope) return put([=](std::size_t l) { return k * a(l); });
    if (batch.pass == Pass::copy) return put(a);
    if (batch.pass == Pass::combination) return combine(batch, k);
    switch (batch.op) {
        case TaylorOp::input:
        case TaylorOp::constant: return;
        case TaylorOp::sum: return put([=](std::size_t l) { return a(l) + b(l); });
        case TaylorOp::difference: return put([=](std::size_t l) { return a(l) - b(l); });
        case TaylorOp::negative:
        case TaylorOp::constant_minus: return put([=](std::size_t l) { return -a(l); });
        case TaylorOp::plus_constant:
        case TaylorOp::minus_constant: return put(a);
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return put([=](std::size_t l) { return factors[l] * a(l); });
        default:
            if (is_function(batch.op)) return add_up_function(batch, k);
            if (is_inverse(batch.op)) return add_up_inverse(batch, k);
            add_up(batch, k);
    }
}

int LazyTape::compute(double t, const double* x, const TaylorCoefficients<double>& to)
{
    const int order = is_polynomial() ? degree_ : to.order;
    if (!program_.empty()) return run_program(t, x, to, order);
    start(t, x);
    std::copy_n(x, tape_.states, to.x);
    advance(0, to.x, to.guards);
    for (int k = 1; k < order; ++k) {
        compute_row(k, false);
        advance(k, to.x, to.guards);
    }
    if (tape_.guards > 0) {
        compute_row(order, true);
        keep_guards(order, to.guards);
    }
    return order;
}

/// Row 0, and the time.
void LazyTape::start(double t, const double* x)
{
    const std::size_t n = tape_.states;
    std::copy_n(x, n, row(0));
    row(0)[n] = t;
    row(1)[n] = 1;
    for (const auto* passes : {&batches_, &late_}) {
        for (const Batch& batch : *passes) {
            const bool as_later = batch.pass == Pass::copy || batch.op == TaylorOp::sum ||
                                  batch.op == TaylorOp::difference ||
                                  batch.op == TaylorOp::times_constant;
            if (as_later && batch.pass != Pass::slope) {
                compute_batch(batch, 0);
            } else {  // slopes have no operations, and are 0
                for (const std::size_t i : batch.ops) row(0)[places_[i]] = begin(i);
            }
        }
    }
}

void LazyTape::compute_row(int k, bool guards_alone)
{
    for (const auto* passes : {&batches_, &late_}) {
        for (const Batch& batch : *passes) {
            if (k > batch.degree || (guards_alone && !batch.for_guards)) continue;  // zeros
            compute_batch(batch, k);
        }
    }
}

/// x_{k+1} = f_k / (k + 1)
void LazyTape::advance(int k, double* out, double* guards)
{
    const std::size_t n = tape_.states;
    const double* const from = row(k);
    double* __restrict const to = row(k + 1);
    const std::size_t* const places = outputs_.data();
#pragma GCC unroll 4
    for (std::size_t i = 0; i < n; ++i) to[i] = from[places[i]];
    for (std::size_t i = 0; i < n; ++i) to[i] /= k + 1;
    std::copy_n(to, n, out + static_cast<std::size_t>(k + 1) * n);
    keep_guards(k, guards);
}

void LazyTape::keep_guards(int k, double* guards) const
{
    const std::size_t m = tape_.guards;
    for (std::size_t i = 0; i < m; ++i) {
        guards[static_cast<std::size_t>(k) * m + i] = row(k)[outputs_[tape_.states + i]];
    }
}

/// Coefficient 0, and the factor of the later ones.
double LazyTape::begin(std::size_t i)
{
    const TapeOp& op = tape_.ops[i];
    const auto first = [&](int of) {
        return of >= 0 ? row(0)[places_[static_cast<std::size_t>(of)]] : 0;
    };
    const double c = constants_[i];
    const double a = first(op.a);
    const double b = first(op.b);
    double& inverse = inverses_[places_[i]];
    switch (op.op) {
        case TaylorOp::input: break;
        case TaylorOp::constant: return c;
        case TaylorOp::sum: return a + b;
        case TaylorOp::difference: return a - b;
        case TaylorOp::negative: return -a;
        case TaylorOp::product: return a * b;
        case TaylorOp::square: return a * a;
        case TaylorOp::quotient: inverse = 1 / b; return a / b;
        case TaylorOp::plus_constant: return a + c;
        case TaylorOp::minus_constant: return a - c;
        case TaylorOp::constant_minus: return c - a;
        case TaylorOp::times_constant:
        case TaylorOp::over_constant: return c * a;
        case TaylorOp::constant_over: inverse = -1 / a; return c / a;
        case TaylorOp::square_root: inverse = 0.5 / std::sqrt(a); return std::sqrt(a);
        case TaylorOp::power: inverse = 1 / a; return std::pow(a, op.exponent);
        case TaylorOp::cube_root: inverse = 1 / a; return std::cbrt(a);
        case TaylorOp::exponential: return std::exp(a);
        case TaylorOp::logarithm: inverse = 1 / a; return std::log(a);
        case TaylorOp::sine: return std::sin(a);
        case TaylorOp::cosine: return std::cos(a);
        case TaylorOp::hyperbolic_sine: return std::sinh(a);
        case TaylorOp::hyperbolic_cosine: return std::cosh(a);
        case TaylorOp::tangent: return std::tan(a);
        case TaylorOp::hyperbolic_tangent: return std::tanh(a);
        case TaylorOp::arc_sine: inverse = 1 / b; return std::asin(a);
        case TaylorOp::arc_cosine: inverse = 1 / b; return std::acos(a);
        case TaylorOp::arc_tangent: inverse = 1 / b; return std::atan(a);
        case TaylorOp::angle: inverse = 1 / first(op.c); return std::atan2(a, b);
    }
    return 0;
}

}  // namespace ricochet::detail
