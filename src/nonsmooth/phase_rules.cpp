#include "phase_rules.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include <fmt/format.h>

namespace ricochet::detail {

namespace {

constexpr double most_patience = 0x1p20;

}  // namespace

PhaseRules::PhaseRules(const BranchPhases& any, bool by_mode, const PhaseOptions& options)
    : any_(any),
      branch_modes_(any.branch_modes()),
      count_(any.reactions()),
      size_(any.size()),
      by_mode_(by_mode),
      options_(options)
{
    for (auto* numbers : {&sides_, &at_bound_, &y_, &y_before_, &lower_, &upper_, &rates_}) {
        numbers->assign(count_, 0);
    }
    flow_.assign(size_, 0);
    const double span = options.t_end - options.t_start;
    shortest_ = std::isinf(span) ? 1e-6 * options.step : 1e-9 * span;
    if (options.alone) stall_ = {options.t_start, options.t_end, options.alone->stall_steps};
    arrived_.assign(count_, false);
    observed_.assign(count_, 0);
}

void PhaseRules::choose_watched(ModeInclusion& of, const double* x0)
{
    of.watched.assign(count(), by_mode_);
    if (by_mode_ || !of.inclusion) return;
    of.inclusion->bounds(options_.t_start, x0, lower_.data(), upper_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        of.watched[i] = std::isfinite(lower_[i]) && std::isfinite(upper_[i]);
    }
    for (const std::size_t reaction : of.stands_for) {
        if (reaction != no_reaction) of.watched[reaction] = true;
    }
}

// --- the motion ---

void PhaseRules::flow(Kind kind, double t, const double* x, double* dxdt)
{
    if (is_implicit(kind)) {
        inclusion().selected_rate(t, x, dxdt);
    } else {
        std::fill_n(dxdt, size_, 0.0);
    }
}

double PhaseRules::fraction_of_held(BranchPhases& inclusion, Mode b, double t0, const double* x0,
                                    double t1, const double* x1, bool may_jump)
{
    // Below that length the motion has no smoothness that steps could follow.
    if (t1 - t0 <= shortest_) return 1;
    const double fraction = inclusion.fraction_of_held(b, t0, x0, t1, x1, may_jump);
    memory_.contradicts = fraction > 0 ? 0 : 1;
    return fraction > 0 ? fraction : 0.1;
}

void PhaseRules::reaction(Kind kind, const Place& at, std::vector<double>& r)
{
    r.clear();
    if (!has_inclusion()) return;
    r.resize(count(), std::numeric_limits<double>::quiet_NaN());
    if (kind == own) return reaction_of_own(at.t, at.x, r.data());
    const Mode b = branches_of(kind);
    if (is_explicit(kind)) return inclusion().reaction(b, at.t, at.x, r.data());
    if (!is_implicit(kind)) return;
    inclusion().reaction_in_step({at.t0, at.x0, b, kind == across()}, at.s, r.data());
}

void PhaseRules::reaction_of_own(double t, const double* x, double* r)
{
    inclusion().observe(t, x, observed_.data());
    const bool clear = inclusion().decides_at_zero() && !inclusion().holds(inclusion().signs(t, x));
    // The law says which reaction holds a y that is zero although the flow is followed.
    if (!clear) return inclusion().selected_reaction(t, x, r);
    inclusion().bounds(t, x, lower_.data(), upper_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        const double bound = observed_[i] > 0 ? lower_[i] : upper_[i];
        if (std::isfinite(bound)) r[i] = bound;
    }
}

GuardInfo PhaseRules::guard_info(std::size_t which) const
{
    if (!watches_own(which)) return any_.guard_info(in_branches(which));
    GuardInfo info;
    info.name = "y arrives at zero";
    info.crossing = Crossing::either;
    return info;
}

std::string PhaseRules::name_of(std::size_t which) const
{
    const std::size_t kind = kind_of_guard(which);
    const bool of_y = kind < 2 || watches_own(which);
    return fmt::format("{} of reaction {}", of_y ? "y" : "the value or a bound",
                       reaction_of(which));
}

bool PhaseRules::watches(std::size_t which, Kind kind) const
{
    return has_inclusion() && kind == own && now_->watched[reaction_of(which)];
}

double PhaseRules::guard(std::size_t which, double t, const double* x) const
{
    if (!has_inclusion() || !watches_own(which)) return 1;
    // -y, kind 1, does not depend on the branches.
    return -inclusion().guard(in_branches(which) - 4, 0, t, x);
}

void PhaseRules::guards(Kind kind, double t, const double* x, std::span<double> g) const
{
    std::fill(g.begin(), g.end(), 1.0);
    if (!has_inclusion() || kind != own) return;
    constexpr std::size_t from = BranchPhases::guards_of_reaction;
    inclusion().observe(t, x, observed_.data());
    for (std::size_t i = 0; i < count(); ++i) g[guards_of_reaction() * i + from] = observed_[i];
}

double PhaseRules::guard_rate(std::size_t which, double t, const double* x,
                              const double* dxdt) const
{
    if (!has_inclusion() || !watches_own(which)) return 0;
    return -inclusion().guard_rate(in_branches(which) - 4, 0, t, x, dxdt);
}

void PhaseRules::guard_rates(Kind kind, double t, const double* x, const double* dxdt,
                             std::span<double> rates) const
{
    std::fill(rates.begin(), rates.end(), 0.0);
    if (!has_inclusion() || kind != own) return;
    constexpr std::size_t from = BranchPhases::guards_of_reaction;
    for (std::size_t i = 0; i < count(); ++i) {
        const std::size_t which = guards_of_reaction() * i + from;
        if (now_->watched[i]) rates[which] = guard_rate(which, t, x, dxdt);
    }
}

// --- where the motion is ---

bool PhaseRules::are_clear(Mode b, double t, const double* x)
{
    inclusion().observe(t, x, y_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (BranchPhases::branch(i, b) != Branch::inside && !is_clear(i, y_[i], x)) return false;
    }
    return true;
}

bool PhaseRules::lets_go(Mode b, double t, const double* x)
{
    if (options_.alone && !options_.alone->until_released) return false;
    return !inclusion().holds(b) && are_clear(b, t, x);
}

bool PhaseRules::is_near_surface(double t, const double* x)
{
    inclusion().observe(t, x, y_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (!is_clear(i, y_[i], x)) return true;
    }
    return false;
}

std::size_t PhaseRules::unbounded(Mode at, double t, const double* x)
{
    if (!inclusion().has_branches()) return no_reaction;
    inclusion().bounds(t, x, lower_.data(), upper_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch branch = BranchPhases::branch(i, at);
        if (branch == Branch::lower && std::isinf(lower_[i])) return i;
        if (branch == Branch::upper && std::isinf(upper_[i])) return i;
    }
    return no_reaction;
}

std::string PhaseRules::sentence_of_unbounded(std::size_t i) const
{
    const std::string where = by_mode_ ? fmt::format("in mode {} ", now_->mode) : std::string();
    return fmt::format("{}y of reaction {} is {}, where the reaction has no bound", where, i,
                       y_[i]);
}

// --- entering ---

Kind PhaseRules::enter(double t, double* x)
{
    memory_ = {};
    reason_.clear();
    changes_.clear();
    while (!phases_->empty() && phases_->back().from >= t) phases_->pop_back();
    Kind kind = own;
    if (has_inclusion()) {
        refuse_faulty_set(t, x);
        inclusion().check_bounds(t, x);
    }
    if (has_inclusion() && !goes_by_itself(t, x)) {
        const Mode at = inclusion().signs(t, x);
        if (const std::size_t i = unbounded(at, t, x); by_mode_ && i != no_reaction) {
            throw InclusionRefused("integrate: at the start " + sentence_of_unbounded(i));
        }
        const Mode b = start(t, x);
        kind = determined_kind(at, b, t, x, PhaseCause::start);
    }
    note_sides(t, x);
    note_bounds(kind, t, x);
    note(kind, t, options_.alone && is_implicit(kind) ? cause_ : PhaseCause::start);
    begins_ = true;
    return kind_ = kind;
}

void PhaseRules::refuse_faulty_set(double t, const double* x)
{
    if (options_.alone) return;  // the selection of its first reaction refuses it
    inclusion().bounds(t, x, lower_.data(), upper_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (lower_[i] <= upper_[i]) continue;
        throw InclusionRefused(
            fmt::format("integrate: at the start the bounds of reaction {} are {} and {}; expected "
                        "numbers, the "
                        "lower one first",
                        i, lower_[i], upper_[i]));
    }
    const std::string fault = inclusion().fault(t, x);
    if (!fault.empty()) throw InclusionRefused("integrate: at the start the set " + fault);
}

Mode PhaseRules::start(double t, double* x)
{
    if (!options_.alone || options_.alone->reaction.empty()) return inclusion().start(t, x);
    const double size = std::fabs(*std::max_element(
        x, x + size_, [](double a, double b) { return std::fabs(a) < std::fabs(b); }));
    const double error = options_.atol + options_.rtol * size;
    return inclusion().resume(t, x, options_.alone->reaction.data(), 10 * error);
}

Kind PhaseRules::enter_mode(Kind before, double t, double* x)
{
    if (before == over()) return over();
    reason_.clear();
    Kind kind = own;
    cause_ = PhaseCause::held;
    if (has_inclusion() && !goes_by_itself(t, x)) {
        kind = settle(inclusion().signs(t, x), t, x, PhaseCause::held);
    }
    if (kind != before && kind != over()) note(kind, t, cause_);
    note_sides(t, x);
    note_bounds(kind, t, x);
    return kind;
}

bool PhaseRules::goes_by_itself(double t, const double* x)
{
    if (options_.alone) return false;
    inclusion().observe(t, x, y_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (now_->watched[i] && !is_clear(i, y_[i], x)) return false;
    }
    // The inclusion of a mode holds wherever the mode does, so that no motion may contradict it.
    return !by_mode_ || has_finite_bounds(inclusion().signs(t, x), t, x);
}

Kind PhaseRules::settle(Mode at, double t, double* x, PhaseCause cause)
{
    if (const std::size_t i = unbounded(at, t, x); i != no_reaction) {
        reason_ = sentence_of_unbounded(i);
        return end_with(Outcome::not_handed_over);
    }
    const Mode b = inclusion().arrive(at, t, x);
    return determined_kind(at, b, t, x, cause);
}

Kind PhaseRules::determined_kind(Mode at, Mode b, double t, const double* x, PhaseCause cause)
{
    const std::size_t i = inclusion().undetermined(at, t, x);
    if (i == no_reaction) return kind_for(b, t, x, cause);
    reason_ = fmt::format(
        "where its y is zero, reaction {} may hold it or let it leave to either side", i);
    return end_with(Outcome::several);
}

Kind PhaseRules::kind_for(Mode b, double t, const double* x, PhaseCause cause)
{
    const Mode several = branch_modes_;
    cause_ = cause;
    if (b < several) return explicit_in(b);
    if (!inclusion().has_branches()) return go_by_steps(PhaseCause::no_modes, t, x);
    if (b == several) return go_by_steps(PhaseCause::several, t, x);
    if (b == several + 1) return go_by_steps(PhaseCause::no_flow, t, x);
    inclusion().note_faulty(t, x);
    reason_ = fmt::format("at t = {} the bounds of reaction {} form no interval", t,
                          inclusion().failure().set);
    return end_with(Outcome::not_converged);
}

Kind PhaseRules::end_without_reaction(double t)
{
    reason_ = fmt::format("at t = {} no reaction with which the motion could go on was found", t);
    return end_with(Outcome::not_converged);
}

Kind PhaseRules::go_by_steps(PhaseCause cause, double t, const double* x)
{
    // A phase that is entered again immediately is kept longer each time.
    const bool at_once = t - memory_.since < 10 * options_.step;
    memory_.patience = at_once ? std::min(2 * memory_.patience, most_patience) : 1;
    const bool chatters = cause == PhaseCause::chattering;
    if (chatters) {
        memory_.patience = memory_.chatter_patience;
        memory_.chatter_patience = std::min(2 * memory_.chatter_patience, most_patience);
    }
    memory_.steps = 0;
    cause_ = cause;
    Mode b = 0;
    const bool events_only = options_.alone && options_.alone->events_only;
    if (events_only || inclusion().keeps_to_branches()) {
        reason_ = fmt::format(
            "implicit steps are due at t = {} ({}), {}", t, name(cause),
            events_only ? "and events_only excludes them" : "and they do not know static bounds");
        return end_with(Outcome::not_handed_over);
    }
    if (!inclusion().select(t, x, b)) return end_without_reaction(t);
    memory_.across = b;
    return chatters ? across() : implicit_in(b);
}

// --- sets ---

void PhaseRules::forget_changes()
{
    changes_.clear();
    std::fill(arrived_.begin(), arrived_.end(), false);
}

Kind PhaseRules::decide(const Set& set, double* x)
{
    forget_changes();
    if (set.kind == over()) return over();
    reason_.clear();
    if (!has_inclusion()) return own;
    // The loop ends the run.
    if (!std::all_of(x, x + size_, [](double c) { return std::isfinite(c); })) return set.kind;
    inclusion().observe(set.t, set.before, y_before_.data());
    inclusion().observe(set.t, x, y_.data());
    cause_ = PhaseCause::held;
    sides_before_ = sides_;
    const Mode before = branches_before(set);
    const bool was_own = has_own_guards(set.kind);
    const Kind next = was_own                 ? decide_own(set, x)
                      : is_explicit(set.kind) ? decide_explicit(set, x)
                                              : decide_implicit(set, x);
    if (!has_own_guards(next) && next != over()) note_changes(set, before, next, x);
    if (!was_own && is_explicit(set.kind)) note_flutter(set, next, x);
    if (next != set.kind) {
        const bool by_steps = is_implicit(next) && !is_implicit(set.kind);
        note(next, set.t, is_set_valued(next) && !by_steps ? PhaseCause::held : cause_);
    }
    note_sides(set.t, x);
    note_bounds(next, set.t, x);
    return next;
}

Kind PhaseRules::decide_own(const Set& set, double* x)
{
    Mode at = inclusion().signs(set.t, x);
    bool asks = false;
    for (const Fired& fired : set.fired) {
        const bool of_set = fired.which != no_guard && kind_of_guard(fired.which) == 4;
        if (of_set) return kind_for(branch_modes_ + 2, set.t, x, cause_);
        if (fired.asks != no_reaction) {
            asks = asks || (inclusion().has_branches()
                                ? BranchPhases::branch(fired.asks, at) == Branch::inside
                                : !is_clear(fired.asks, y_[fired.asks], x));
            continue;
        }
        const std::size_t i = fired.which != no_guard ? reaction_of(fired.which) : fired.reaction;
        if (y_[i] != y_before_[i]) continue;  // a reset has moved it on
        // A reset of an earlier set of this instant has carried it across zero.
        if (y_[i] * sides_[i] > 0 && is_clear(i, y_[i], x)) continue;
        arrived_[i] = asks = true;
        at = BranchPhases::with_branch(i, Branch::inside, at);
    }
    for (std::size_t i = 0; i < count(); ++i) {
        asks = asks || (now_->watched[i] && !is_clear(i, y_[i], x));
    }
    const bool moves = !std::equal(x, x + size_, set.before);
    if (by_mode_ && moves && !has_finite_bounds(at, set.t, x)) asks = true;
    if (!asks) {
        return moves ? own : set.kind;
    }
    return settle(at, set.t, x, PhaseCause::held);
}

Mode PhaseRules::branches_after(Mode b, double t, const double* x)
{
    const Mode signs = inclusion().signs(t, x);
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch sign = BranchPhases::branch(i, signs);
        if (y_[i] == y_before_[i] || sign == Branch::inside) continue;
        b = BranchPhases::with_branch(i, sign, b);
    }
    return b;
}

Kind PhaseRules::decide_explicit(const Set& set, double* x)
{
    const double t = set.t;
    const bool moves = !std::equal(x, x + size_, set.before);
    const Mode b = branches_of(set.kind);
    const Mode from = moves ? branches_after(b, t, x) : b;
    kept_.clear();
    for (const Fired& fired : set.fired) {
        if (fired.which == no_guard) continue;
        const std::size_t i = reaction_of(fired.which);
        if (y_[i] != y_before_[i]) continue;
        arrived_[i] = kind_of_guard(fired.which) < 2;
        kept_.push_back(in_branches(fired.which));
        ++memory_.events;
    }
    if (!kept_.empty()) {
        Mode at = from;
        for (std::size_t i = 0; i < count(); ++i) {
            if (arrived_[i]) at = BranchPhases::with_branch(i, Branch::inside, at);
        }
        const Mode b = inclusion().reset(kept_, from, t, x);
        return determined_kind(at, b, t, x, cause_);
    }
    // Loads may have jumped, and a reset may have set a y to zero.
    bool asks =
        (moves || set.on_time) && inclusion().holds(from) && !inclusion().stays_held(from, t, x);
    Mode at = from;
    const Mode signs = inclusion().signs(t, x);
    for (std::size_t i = 0; i < count(); ++i) {
        if (BranchPhases::branch(i, signs) != Branch::inside) continue;
        if (y_[i] == y_before_[i]) continue;
        at = BranchPhases::with_branch(i, Branch::inside, at);
        asks = asks || BranchPhases::branch(i, from) != Branch::inside;
    }
    if (!asks && from != b && !has_finite_bounds(from, t, x)) asks = true;
    if (!asks) return explicit_in(from);
    return settle(at, t, x, cause_);
}

Kind PhaseRules::decide_implicit(const Set& set, double* x)
{
    const bool moves = !std::equal(x, x + size_, set.before);
    if (set.on_change && !moves) {
        const Mode b = inclusion().change(branches_of(set.kind), set.t, x);
        arrived_[inclusion().changed()] = true;
        memory_.changed_at = set.t;
        memory_.steps = 0;
        return implicit_in(b);
    }
    if (!moves && !(set.on_time && inclusion().jumps(set.t, x))) return set.kind;
    Mode b = branches_before(set);
    // A y that the set has left alone is as much at zero as it was, but for the rounding of steps.
    double size = 0;
    for (std::size_t c = 0; c < size_; ++c) size = std::fmax(size, std::fabs(x[c]));
    for (std::size_t i = 0; i < count(); ++i) {
        const bool is_held = BranchPhases::branch(i, b) == Branch::inside;
        const bool stays = y_[i] == y_before_[i] && (is_held || std::fabs(y_[i]) <= 1e-14 * size);
        b = BranchPhases::with_branch(i, stays ? Branch::inside : Branch::lower, b);
    }
    inclusion().hold(b, set.t, x);
    if (!inclusion().select(set.t, x, b)) return end_without_reaction(set.t);
    memory_.across = b;
    return set.kind == across() ? across() : implicit_in(b);
}

Mode PhaseRules::branches_before(const Set& set) const
{
    if (set.kind == across()) return static_cast<Mode>(memory_.across);
    if (!has_own_guards(set.kind)) return branches_of(set.kind);
    Mode b = 0;
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch side = sides_[i] >= 0 ? Branch::lower : Branch::upper;
        b = BranchPhases::with_branch(i, side, b);
    }
    return b;
}

bool PhaseRules::step_back(double t, double* x)
{
    inclusion().observe(t, x, y_before_.data());
    bool any = false;
    for (std::size_t i = 0; i < count(); ++i) {
        if (!arrived_[i]) continue;
        any = true;
        inclusion().shift(i, sides_before_[i] * resolution(i, x) - y_before_[i], x);
    }
    inclusion().observe(t, x, y_before_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (arrived_[i] && !(y_before_[i] * sides_before_[i] > 0)) return false;
    }
    return any;
}

bool PhaseRules::is_flow(double t, const double* x, const double* rate)
{
    Mode b = 0;
    inclusion().observe(t, x, y_before_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch side = y_before_[i] >= 0 ? Branch::lower : Branch::upper;
        b = BranchPhases::with_branch(i, side, b);
    }
    if (!has_finite_bounds(b, t, x)) return true;
    inclusion().flow(b, t, x, flow_.data());
    std::size_t off = 0;
    double largest = 0, size = 0;
    for (std::size_t c = 0; c < size_; ++c) {
        const double difference = std::fabs(flow_[c] - rate[c]);
        if (!(difference <= largest)) largest = difference, off = c;
        size = std::max({size, std::fabs(flow_[c]), std::fabs(rate[c])});
    }
    const double there = flow_[off];
    // A rate is the difference of terms that may be larger: that of the other bounds tells how far.
    for (std::size_t i = 0; i < count(); ++i) {
        if (!arrived_[i] || !has_finite_bounds(other_side(i, b), t, x)) continue;
        inclusion().flow(other_side(i, b), t, x, flow_.data());
        for (const double component : flow_) size = std::fmax(size, std::fabs(component));
    }
    if (largest <= 1e-6 * size) return true;
    reason_ = fmt::format(
        "where {}, at t = {}, the flow gives component {} the rate {}, and the inclusion {}",
        begins_ ? "the inclusion decides at the start" : "a y arrives at zero", t, off, rate[off],
        there);
    return false;
}

bool PhaseRules::is_flow_at_start(double t, const double* x, const double* rate)
{
    if (!has_inclusion() || !inclusion().has_branches()) return true;
    inclusion().observe(t, x, y_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (!(std::fabs(y_[i]) > 1e-3 * inclusion().size_of_row(i, x))) return true;
    }
    std::fill(arrived_.begin(), arrived_.end(), true);
    const bool same = is_flow(t, x, rate);
    forget_changes();
    return same;
}

void PhaseRules::note_changes(const Set& set, Mode before, Kind next, const double* x)
{
    if (!inclusion().has_branches()) return;
    inclusion().bounds(set.t, x, lower_.data(), upper_.data());
    const Mode after = next == across() ? static_cast<Mode>(memory_.across) : branches_of(next);
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch from = BranchPhases::branch(i, before);
        const Branch to = BranchPhases::branch(i, after);
        if (from != Branch::inside && lower_[i] == upper_[i]) continue;  // it has one value
        ReactionChange change{.reaction = i};
        if (from == Branch::inside && to != Branch::inside) {
            change.kind = EventKind::slip;
        } else if (from != Branch::inside && to == Branch::inside) {
            change.kind = EventKind::stick;
        } else if (from != to && arrived_[i]) {
            change.kind = EventKind::mode;
        } else if (from == to && arrived_[i] && has_own_guards(set.kind)) {
            change.kind = EventKind::touch;
        } else {
            continue;
        }
        for (const Fired& fired : set.fired) {
            if (fired.which != no_guard && reaction_of(fired.which) == i) {
                change.fired = fired.which;
            } else if (fired.reaction == i && change.kind != EventKind::slip) {
                change.guard = std::min(change.guard, fired.guard);
            }
        }
        changes_.push_back(change);
        if (options_.alone) branch_changes_.push_back({before, after});
    }
}

bool PhaseRules::records(std::size_t reaction, std::size_t guard) const
{
    for (const ReactionChange& change : changes_) {
        if (change.reaction == reaction && change.guard != no_guard) return change.guard == guard;
    }
    return true;
}

void PhaseRules::note_flutter(const Set& set, Kind next, const double* x)
{
    for (const Fired& fired : set.fired) {
        if (fired.which == no_guard) continue;
        const std::size_t i = reaction_of(fired.which);
        double speed = std::numeric_limits<double>::infinity();
        if (kind_of_guard(fired.which) < 2 && is_explicit(next)) {
            inclusion().flow(branches_of(next), set.t, x, flow_.data());
            speed = std::fabs(inclusion().rate_of(i, flow_.data()));
        }
        // The largest |y| is that of a parabola between two zeros.
        const bool flutters = speed * (set.t - memory_.fluttered_at) / 4 <= resolution(i, x);
        memory_.fluttering = flutters ? memory_.fluttering + 1 : 0;
        memory_.fluttered_at = set.t;
    }
}

void PhaseRules::note_sides(double t, const double* x)
{
    if (!has_inclusion()) return;
    inclusion().observe(t, x, y_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (y_[i] != 0) sides_[i] = std::copysign(1.0, y_[i]);
    }
}

void PhaseRules::note_bounds(Kind kind, double t, const double* x)
{
    is_at_bound_ = holds(kind) && inclusion().at_bounds(branches_of(kind), t, x, at_bound_.data());
    if (!is_at_bound_) std::fill(at_bound_.begin(), at_bound_.end(), 0.0);
}

void PhaseRules::note(Kind kind, double t, PhaseCause cause)
{
    memory_.contradicts = 0;
    const double sort = has_own_guards(kind) ? 0 : is_explicit(kind) ? 1 : 2;
    const bool first = memory_.listed == 0;
    if (first || sort != memory_.sort) {
        memory_.events = memory_.marked_events = memory_.fluttering = 0;
        memory_.marked_at = memory_.since = t;
        memory_.sort = sort;
    }
    const bool set_valued = is_set_valued(kind);
    const bool plainly = cause == PhaseCause::held || cause == PhaseCause::released;
    const bool goes_on = !first && set_valued == (memory_.set_valued != 0);
    if (goes_on && (!set_valued || plainly)) return;
    memory_.set_valued = set_valued;
    phases_->push_back({.from = t,
                        .set_valued = set_valued,
                        .cause = set_valued || first ? cause : PhaseCause::released});
    memory_.listed = static_cast<double>(phases_->size());
}

// --- after steps ---

PhaseRules::Verdict PhaseRules::change_to(Kind kind, double t, PhaseCause cause, double h)
{
    if (kind == over()) {
        return {PhaseVerdict::Kind::ends, kind, 0, static_cast<Outcome>(memory_.outcome)};
    }
    note(kind, t, cause);
    return {PhaseVerdict::Kind::changes, kind, h};
}

PhaseRules::Verdict PhaseRules::release(double t)
{
    if (options_.alone) return {PhaseVerdict::Kind::ends, kind_, 0, Outcome::released};
    return change_to(own, t, PhaseCause::released, -1);
}

PhaseRules::Verdict PhaseRules::review(const Step& step, double* x)
{
    kind_ = step.kind;
    steps_ += step.has_advanced;
    if (stall_(step.t, steps_)) {
        return {PhaseVerdict::Kind::ends, step.kind, 0, Outcome::stalled};
    }
    if (step.kind == over()) {
        return {PhaseVerdict::Kind::ends, step.kind, 0, static_cast<Outcome>(memory_.outcome)};
    }
    // The first step of a run is that of its flow, which says nothing of implicit steps.
    const bool begins = std::exchange(begins_, false);
    if (!has_inclusion()) return {};
    note_sides(step.t, x);
    if (begins && is_implicit(step.kind)) {
        return {PhaseVerdict::Kind::changes, step.kind, options_.step};
    }
    const Verdict verdict = has_own_guards(step.kind) ? review_own(step, x)
                            : is_explicit(step.kind)  ? review_explicit(step.kind, step.t, x)
                                                      : review_implicit(step, x);
    const bool changes = verdict.what == PhaseVerdict::Kind::changes;
    if (changes || is_at_bound_) note_bounds(changes ? verdict.kind : step.kind, step.t, x);
    return verdict;
}

bool PhaseRules::may_arrive(const Step& step, double reach)
{
    inclusion().observe_rate(step.t, step.rate, rates_.data());
    for (std::size_t i = 0; i < count(); ++i) {
        if (!now_->watched[i] || !(y_[i] * rates_[i] < 0)) continue;
        if (std::fabs(y_[i]) <= reach * std::fabs(rates_[i])) return true;
    }
    return false;
}

bool PhaseRules::is_flow_of(Mode b, const Step& step, const double* x)
{
    inclusion().flow(b, step.t, x, flow_.data());
    double size = 0, off = 0;
    for (std::size_t c = 0; c < flow_.size(); ++c) {
        size = std::fmax(size, std::fabs(step.rate[c]));
        off = std::fmax(off, std::fabs(flow_[c] - step.rate[c]));
    }
    return off <= 1e-6 * size;
}

// A flow that is written with the sign of y jumps where y arrives, and what the stages of a step
// see beyond is another motion. Near y = 0 the step is therefore one of the inclusion, whose
// branches are smooth there.
PhaseRules::Verdict PhaseRules::review_own(const Step& step, const double* x)
{
    if (is_approach(step.kind)) {
        if (may_arrive(step, 4 * step.h_next)) return {};
        return change_to(own, step.t, PhaseCause::released, -1);
    }
    if (may_arrive_unseen(step, 2)) {
        const Kind kind = go_by_steps(PhaseCause::no_modes, step.t, x);
        return change_to(kind, step.t, PhaseCause::no_modes, options_.step);
    }
    if (!inclusion().has_branches() || !may_arrive(step, 2 * step.h_next)) return {};
    const Mode b = inclusion().signs(step.t, x);
    const bool plain = !inclusion().holds(b) && has_finite_bounds(b, step.t, x);
    if (!plain || !is_flow_of(b, step, x)) return {};
    return change_to(approach_in(b), step.t, PhaseCause::released, -1);
}

bool PhaseRules::chatters(double t) noexcept
{
    if (memory_.events < memory_.marked_events + most_events) return false;
    const bool chatters = t - memory_.marked_at < options_.step / 100;
    memory_.marked_events = memory_.events;
    memory_.marked_at = t;
    return chatters;
}

PhaseRules::Verdict PhaseRules::review_explicit(Kind kind, double t, double* x)
{
    const Mode b = branches_of(kind);
    bool contradicts = memory_.contradicts != 0;
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch branch = BranchPhases::branch(i, b);
        const bool wrong =
            branch == Branch::lower ? y_[i] < 0 : branch == Branch::upper && y_[i] > 0;
        contradicts = contradicts || (wrong && std::fabs(y_[i]) > 10 * resolution(i, x));
    }
    const auto by_steps = [&](PhaseCause cause) {
        return change_to(go_by_steps(cause, t, x), t, cause, options_.step);
    };
    if (contradicts) return by_steps(PhaseCause::contradiction);
    if (lets_go(b, t, x)) return release(t);
    if (chatters(t)) return by_steps(PhaseCause::chattering);
    if (memory_.fluttering > most_flutters) {
        inclusion().hold(inclusion().signs(t, x), t, x);
        return by_steps(PhaseCause::accumulation);
    }
    return {};
}

PhaseRules::Verdict PhaseRules::review_implicit(const Step& step, double* x)
{
    const Kind kind = step.kind;
    const double t = step.t;
    if (step.has_advanced) {
        ++memory_.steps;
        ++implicit_steps_;
        if (const double law = inclusion().law(); law > 1e-6) {
            reason_ = fmt::format(
                "the reactions at the end of the implicit step to t = {} violate their law by {}, "
                "as a fraction of the forces; expected at most 1e-6",
                t, law);
            return {PhaseVerdict::Kind::ends, kind, 0, Outcome::law_violated};
        }
    }
    Mode b = branches_of(kind);
    if (kind == across()) {
        b = inclusion().branches_at_end();
        // Changes that are not located restart the count.
        if (b != static_cast<Mode>(memory_.across)) memory_.steps = 0;
        memory_.across = b;
    }
    if (lets_go(b, t, x) && !may_arrive_unseen(step, 4)) return release(t);
    if (memory_.steps < memory_.patience || !inclusion().flows(b)) return {};
    // The branch of a y that has just left zero tells its direction, so that its size is not
    // tested.
    Mode tested = b;
    if (memory_.changed_at == t) {
        tested = BranchPhases::with_branch(inclusion().changed(), Branch::inside, b);
    }
    if (!are_clear(tested, t, x)) return {};
    for (std::size_t i = 0; i < count(); ++i) {
        const Branch branch = BranchPhases::branch(i, b);
        const bool wrong = branch == Branch::lower ? y_[i] < 0 : y_[i] > 0;
        if (wrong) b = BranchPhases::with_branch(i, Branch::inside, b);
    }
    std::vector<double> held(x, x + size_);
    inclusion().hold(b, t, held.data());
    try {
        const Mode next = inclusion().start(t, held.data());
        if (next >= branch_modes_) return {};
        std::copy(held.begin(), held.end(), x);
        return change_to(explicit_in(next), t, PhaseCause::released);
    } catch (const InclusionRefused&) {
        return {};
    }
}

PhaseRules::Verdict PhaseRules::ask(const End& end, double* x, PhaseCause cause)
{
    const std::size_t i = end.reaction;
    const Mode b = branches_of(end.kind);
    if (i == no_reaction || BranchPhases::branch(i, b) == Branch::inside) return {};
    inclusion().observe(end.t, x, y_.data());
    if (is_clear(i, y_[i], x)) return {};
    const Mode at = BranchPhases::with_branch(i, Branch::inside, b);
    if (!has_finite_bounds(at, end.t, x)) return {};
    return change_to(settle(at, end.t, x, cause), end.t, cause);
}

PhaseRules::Verdict PhaseRules::give_up(const End& end, double* x)
{
    const Verdict verdict = after_end(end, x);
    if (verdict.what == PhaseVerdict::Kind::changes) note_bounds(verdict.kind, end.t, x);
    return verdict;
}

PhaseRules::Verdict PhaseRules::after_end(const End& end, double* x)
{
    kind_ = end.kind;
    reason_.clear();
    if (is_implicit(end.kind)) {
        const bool unsolved = end.outcome == Outcome::non_finite;
        if (!unsolved || end.which != no_guard || !end.of_phases) return {};
        reason_ = fmt::format("a stage of the implicit step from t = {} has no solution", end.t);
        return {PhaseVerdict::Kind::ends, end.kind, 0, Outcome::not_converged};
    }
    const auto cause = cause_after(end.outcome);
    if (!cause || end.kind == over()) return {};
    if (!has_inclusion()) return {};
    if (has_own_guards(end.kind)) {
        if (!is_near_surface(end.t, x)) return {};
        // A guard with a reaction asks that one alone.
        if (end.reaction != no_reaction && is_clear(end.reaction, y_[end.reaction], x)) return {};
        if (end.t == memory_.gave_up_at) {
            reason_ = fmt::format(
                "the inclusion has decided at t = {}, and the motion ends there again ({})", end.t,
                name(end.outcome));
            return {PhaseVerdict::Kind::ends, end.kind, 0, Outcome::not_handed_over};
        }
        memory_.gave_up_at = end.t;
        Mode at = inclusion().signs(end.t, x);
        for (std::size_t i = 0; i < count(); ++i) {
            if (is_clear(i, y_[i], x)) continue;
            at = BranchPhases::with_branch(i, Branch::inside, at);
        }
        if (!has_finite_bounds(at, end.t, x)) return {};
        return change_to(settle(at, end.t, x, *cause), end.t, *cause);
    }
    if (!end.of_phases) return ask(end, x, *cause);
    if (*cause == PhaseCause::accumulation && end.which != no_guard) {
        // Other y may accumulate with it: a position with its speed.
        Mode at = BranchPhases::with_branch(reaction_of(end.which), Branch::inside,
                                            branches_of(end.kind));
        inclusion().observe(end.t, x, y_.data());
        for (std::size_t i = 0; i < count(); ++i) {
            if (!is_clear(i, y_[i], x)) at = BranchPhases::with_branch(i, Branch::inside, at);
        }
        inclusion().hold(at, end.t, x);
    }
    return change_to(go_by_steps(*cause, end.t, x), end.t, *cause, options_.step);
}

// --- records ---

EndInBranches PhaseRules::end_in_branches(double t, const double* x) const
{
    EndInBranches end{branch_modes_, std::vector<double>(count()), branch_changes_};
    if (is_explicit(kind_)) {
        end.mode = branches_of(kind_);
        inclusion().reaction(end.mode, t, x, end.reaction.data());
    } else {
        inclusion().reaction_of_step(end.reaction.data());
    }
    return end;
}

// --- memory ---

void PhaseRules::save(std::vector<double>& memory) const
{
    memory.resize(remembered);
    std::memcpy(memory.data(), &memory_, sizeof memory_);
    memory.insert(memory.end(), sides_.begin(), sides_.end());
    memory.insert(memory.end(), at_bound_.begin(), at_bound_.end());
    if (has_inclusion()) inclusion().save(memory);
}

std::size_t PhaseRules::memory_in(const ModeInclusion& of) const
{
    std::vector<double> memory;
    if (of.inclusion) of.inclusion->save(memory);
    return remembered + 2 * count() + memory.size();
}

void PhaseRules::restore(const std::vector<double>& memory)
{
    std::memcpy(static_cast<void*>(&memory_), memory.data(), sizeof memory_);
    const double* const sides = memory.data() + remembered;
    std::copy_n(sides, count(), sides_.begin());
    std::copy_n(sides + count(), count(), at_bound_.begin());
    is_at_bound_ = std::any_of(at_bound_.begin(), at_bound_.end(), [](double r) { return r > 0; });
    if (has_inclusion()) inclusion().restore(std::span(memory).subspan(remembered + 2 * count()));
    reason_.clear();
    const auto listed = static_cast<std::size_t>(memory_.listed);
    if (phases_->size() > listed) phases_->resize(listed);
}

}  // namespace ricochet::detail
