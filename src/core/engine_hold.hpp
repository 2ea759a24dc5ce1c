// What a rest holds, and until when.
//
// After a rest in the same mode the motion goes on. If the flow presses on the guard that has come
// to rest, the components whose result in `rest` does not depend on the state are held: they stand
// still, the others flow, and the guard is not examined. They are released together where the flow
// without the hold lifts the guard, and where a reset or another mode changes one of them.
#pragma once

#include "core/engine.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
template <class Flow>
double EventEngine<X, single>::drift(const Following& by, const Flow& flow)
{
    const X& x = *by.x;
    X rate = x, later = x, rate_later = x;
    const double end = by.frozen ? by.t : step_.inside(by.t + (backward_ ? -by.ahead : by.ahead));
    flow(by.t, x, rate);
    move(later, x, by.ahead, rate);
    flow(end, later, rate_later);
    move(later, x, by.ahead / 2, rate);
    move(later, later, by.ahead / 2, rate_later);
    const auto guard = guards_.view(by.guard, step_.mode(), calls());
    return guard.value(end, later) - guard.value(by.t, x);
}

template <class X, bool single>
double EventEngine<X, single>::free_drift(const Following& by)
{
    return drift(by, [this](double t, const X& x, X& dxdt) { step_.free_flow(t, x, dxdt); });
}

template <class X, bool single>
bool EventEngine<X, single>::presses(const Rested& rested, Hold& hold)
{
    const std::size_t i = rested.guard;
    const GuardRecord& record = std::as_const(guards_)[i];
    const Mode mode = step_.mode();
    if (record.info.boolean || !system_.enabled_in(i, mode) || !is_enabled_here(i)) return false;
    const Crossing crossing = record.info.crossing;
    hold.guard = i;
    hold.inward = crossing == Crossing::falling    ? 1
                  : crossing == Crossing::rising   ? -1
                  : sign_of(record.last_side) == 0 ? 1
                                                   : sign_of(record.last_side);
    hold.rounding = rounding_of(i);
    hold.level = std::max(hold.rounding, rested.tolerance);
    const double g = guards_.view(i, mode, calls()).value(step_.time(0), step_.x0());
    if (hold.inward * g > hold.level) return false;
    if (!system_->flow) return hold.inward * departure(i, h_next_) <= 0;
    // The first derivative that is not zero decides, and a short drift shows its sign. The drift
    // that is watched afterwards is a longer one, which stands out from rounding by a factor of a
    // million.
    double first = 0;
    for (double ahead = tolerances::of_difference * h_next_; ahead <= h_next_; ahead *= 16) {
        const double moved =
            hold.inward * free_drift({i, step_.time(0), &step_.x0(), ahead, false});
        if (!(std::fabs(moved) > 8 * hold.rounding)) continue;
        if (first == 0) first = moved;
        if (moved * first < 0) break;
        hold.ahead = ahead;
        if (std::fabs(moved) > tolerances::of_drift * hold.rounding) break;
    }
    return first < 0;
}

template <class X, bool single>
void EventEngine<X, single>::hold_rested()
{
    for (const Rested& rested : std::exchange(rested_, {})) {
        Hold hold;
        if (ended_ || !presses(rested, hold)) continue;
        if (!finds_components(hold)) return end(Outcome::zeno, rested.guard);
        holds_.push_back(hold);
        renew_holds();
        if (!stays_held(hold)) return end(Outcome::zeno, rested.guard);
        carry_on(rested.ahead);
    }
}

template <class X, bool single>
void EventEngine<X, single>::hold_again()
{
    if (!system_->rest) return;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        Hold hold;
        if (!is_at_rest(i) || !presses({i, 0, 0}, hold) || !finds_components(hold)) continue;
        holds_.push_back(hold);
        renew_holds();
        if (stays_held(hold)) continue;
        holds_.pop_back();
        renew_holds();
        if (!step_.is_of_host()) step_.refresh();
    }
}

template <class X, bool single>
bool EventEngine<X, single>::is_at_rest(std::size_t i)
{
    const Mode mode = step_.mode();
    const GuardInfo& info = std::as_const(guards_)[i].info;
    if (is_of_phases(i) || info.boolean || !(resets_any_ && info.resets)) return false;
    if (!system_.enabled_in(i, mode)) return false;
    const double t = step_.time(0);
    const double g = guards_.view(i, mode, calls()).value(t, step_.x0());
    if (!(std::fabs(g) <= rounding_of(i))) return false;
    X x = step_.x0();
    return system_->rest(system_.adapter(), i, mode, t, x) == mode && same_state(x, step_.x0());
}

template <class X, bool single>
void EventEngine<X, single>::carry_on(double ahead)
{
    if (ahead == 0 || step_.is_of_host()) return;
    X x = step_.x0();
    move(x, x, ahead, step_.rate0());
    if (!same_state(x, step_.x0())) step_.restart(step_.start(), x, step_.mode());
}

template <class X, bool single>
bool EventEngine<X, single>::finds_components(Hold& hold)
{
    const X& x = step_.x0();
    X up = x, down = x;
    std::size_t c = 0;
    for_each_component(x, [&](auto i) {
        const double size = 0x1p-10 * std::fabs(x[i]) + h_next_ * std::fabs(step_.rate0()[i]);
        // All displacements differ, so that every sum or difference of components changes.
        const double part = 1 + std::fmod(0.618034 * static_cast<double>(++c), 1.0);
        const double shift = (c % 2 == 0 ? -part : part) * (size > 0 ? size : 0x1p-10);
        up[i] += shift;
        down[i] -= shift;
    });
    X earlier = x, later = x;
    const double t = step_.time(0);
    const auto rest = [&](double at, X& to) {
        static_cast<void>(system_->rest(system_.adapter(), hold.guard, step_.mode(), at, to));
        return to.size() == x.size();
    };
    if (!rest(t, up) || !rest(t, down) || !rest(step_.inside(t - h_next_), earlier) ||
        !rest(step_.inside(t + h_next_), later)) {
        return false;
    }
    bool moves_by_itself = false;
    c = 0;
    for_each_component(x, [&](auto i) {
        const std::size_t component = c++;
        if (up[i] != x[i] || down[i] != x[i]) return;
        const bool in_time = earlier[i] != x[i] || later[i] != x[i];
        if (!in_time) hold.components.push_back(component);
        moves_by_itself = moves_by_itself || (in_time && step_.rate0()[i] != 0);
    });
    return !moves_by_itself && !hold.components.empty();
}

template <class X, bool single>
bool EventEngine<X, single>::stays_held(const Hold& hold)
{
    const double t = step_.time(0);
    const double g = guards_.view(hold.guard, step_.mode(), calls()).value(t, step_.x0());
    if (!(std::fabs(g) <= hold.level)) return false;
    if (!system_->flow) return true;
    const auto held = [this](double at, const X& x, X& dxdt) {
        step_.flow_in(step_.mode(), at, x, dxdt);
    };
    const double moved = drift({hold.guard, t, &step_.x0(), h_next_, false}, held);
    return std::fabs(moved) <= 8 * hold.rounding;
}

template <class X, bool single>
void EventEngine<X, single>::renew_holds()
{
    boost::container::small_vector<std::size_t, 16> components;
    for (const Hold& hold : holds_) {
        components.insert(components.end(), hold.components.begin(), hold.components.end());
    }
    std::sort(components.begin(), components.end());
    components.erase(std::unique(components.begin(), components.end()), components.end());
    step_.hold_components({components.data(), components.size()});
    on_series_ = may_be_on_series_ && step_.has_guard_series();
    guards_.leave_series();
    changed_holds_ = 2;
}

template <class X, bool single>
void EventEngine<X, single>::release(std::size_t k)
{
    GuardRecord& record = guards_[holds_[k].guard];
    record.intervals.come_to_rest();
    record.tolerance = holds_[k].level;  // it is on its surface
    guards_.row().clear();
    holds_.erase(holds_.begin() + static_cast<std::ptrdiff_t>(k));
    resting_ = false;
    renew_holds();
}

template <class X, bool single>
void EventEngine<X, single>::release_changed(const X& before, const X& after, bool changes_mode)
{
    for (std::size_t k = holds_.size(); k-- > 0;) {
        const auto& components = holds_[k].components;
        const bool changed = changes_mode || before.size() != after.size() ||
                             std::any_of(components.begin(), components.end(),
                                         [&](std::size_t c) { return before[c] != after[c]; });
        if (changed) release(k);
    }
}

template <class X, bool single>
double EventEngine<X, single>::lift(const Hold& hold, double t, const X& x)
{
    if (!system_.enabled_at(hold.guard, step_.mode(), t, x)) return 1;
    if (!system_->flow || hold.ahead == 0) return -1;
    return hold.inward * free_drift({hold.guard, t, &x, hold.ahead, true}) - hold.rounding;
}

template <class X, bool single>
bool EventEngine<X, single>::release_lifted()
{
    for (std::size_t k = 0; k < holds_.size(); ++k) {
        if (lift(holds_[k], step_.time(0), step_.x0()) > 0) return release_here(k), true;
    }
    return false;
}

template <class X, bool single>
void EventEngine<X, single>::release_here(std::size_t k)
{
    const double t = step_.time(0);
    ++run_.statistics.events;
    record({.t = t,
            .kind = EventKind::mode,
            .guard = holds_[k].guard,
            .mode_before = step_.mode(),
            .mode_after = step_.mode(),
            .before = step_.x0(),
            .after = step_.x0(),
            .bracket = {t, t},
            .slope = 0});
    guards_.take_tolerances();
    release(k);
    leaves_phase_ = changed_mode_ = enters_mode_ = false;
    if (!step_.is_of_host()) step_.refresh();
    search_.fired().clear();
    pending_ = Pending::arm_released;
}

template <class X, bool single>
template <class StateAt>
auto EventEngine<X, single>::first_release(double length, const StateAt& state_at) -> Release
{
    Release first{.at = length};
    X x = step_.x0();
    for (std::size_t k = 0; k < holds_.size(); ++k) {
        const auto value = [&](double s) {
            state_at(s, x);
            return lift(holds_[k], step_.inside(step_.time(s)), x);
        };
        const Rise rise = first_rise(value, first.at);
        first.bend = std::max(first.bend, rise.bend);
        if (rise.at <= first.at) first = {k, rise.at, first.bend};
    }
    return first;
}

template <class X, bool single>
template <class Value>
auto EventEngine<X, single>::first_rise(const Value& value, double length) -> Rise
{
    constexpr int most = 256;
    constexpr double golden = 0.381966;
    boost::container::small_vector<std::pair<double, double>, 16> ends;  // still to be passed
    double a = 0, low = value(0.0);
    ends.emplace_back(length, value(length));
    Rise rise{.bend = 0};
    for (int count = 0; !ends.empty();) {
        const auto [b, high] = ends.back();
        const double m = a + golden * (b - a), inner = value(m);
        const double bend = std::fabs(inner - (low + golden * (high - low)));
        const double size = std::max({std::fabs(low), std::fabs(inner), std::fabs(high)});
        if (count++ == 0 && size > 0) rise.bend = bend / size;
        const bool resolved = b - a <= length / 4096 || count >= most;
        if (high > 0 && (resolved || (low < 0 && bend <= (high - low) / 4))) {
            return {inner > 0 ? narrow(value, a, m) : narrow(value, m, b), rise.bend};
        }
        if (high <= 0 && inner <= 0 && (resolved || std::max({low, inner, high}) + 4 * bend < 0)) {
            a = b;
            low = high;
            ends.pop_back();
        } else {
            ends.emplace_back(m, inner);
        }
    }
    return rise;
}

template <class X, bool single>
template <class Value>
double EventEngine<X, single>::narrow(const Value& value, double lo, double hi)
{
    const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(step_.start().value);
    while (hi - lo > std::max(ulp, std::numeric_limits<double>::epsilon() * hi)) {
        const double middle = lo + (hi - lo) / 2;
        if (middle == lo || middle == hi) break;
        (value(middle) > 0 ? hi : lo) = middle;
    }
    return hi;
}

template <class X, bool single>
std::size_t EventEngine<X, single>::guard_left_at(double t, const X& x)
{
    for (const Hold& hold : holds_) {
        const double g = guards_.view(hold.guard, step_.mode(), calls()).value(t, x);
        if (!(std::fabs(g) <= hold.level + 8 * hold.rounding)) return hold.guard;
    }
    return no_guard;
}

template <class X, bool single>
bool EventEngine<X, single>::stands_still()
{
    bool still = true;
    for_each_component(step_.x0(), [&](auto c) { still = still && step_.rate0()[c] == 0; });
    if (!still) return false;
    const double end = timed_ ? std::min(step_.until(time_event_), step_.until(options_.t_end))
                              : step_.until(options_.t_end);
    const double span =
        std::isfinite(end) && !endless_ && !step_.is_of_host() ? end : 1e6 * h_next_;
    const X& x = step_.x0();
    X now = x, later = x;
    if (!step_.is_of_host()) step_.free_flow(step_.time(0), x, now);
    for (const double part : {0.001, 0.0381966, 0.381966, 1.0}) {
        const double t = step_.inside(step_.time(part * span));
        if (!step_.is_of_host()) step_.free_flow(t, x, later);
        if (!same_state(now, later) || !guards_stand_still(t)) return false;
    }
    return true;
}

template <class X, bool single>
bool EventEngine<X, single>::guards_stand_still(double t)
{
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        if (!system_.enabled_in(i, step_.mode())) continue;
        if (is_held(i) && !system_.enabled_at(i, step_.mode(), t, step_.x0())) return false;
        const auto guard = guards_.view(i, step_.mode(), calls());
        const double g = guard.value(step_.time(0), step_.x0());
        const double moved = std::fabs(guard.value(t, step_.x0()) - g);
        if (moved == 0) continue;
        const auto holds = [&](const Hold& hold) {
            return hold.guard == i && moved <= 8 * hold.rounding;
        };
        if (std::none_of(holds_.begin(), holds_.end(), holds)) return false;
    }
    return true;
}

template <class X, bool single>
template <class Visitor>
void EventEngine<X, single>::visit_holds(Visitor&& visit)
{
    constexpr bool saves = std::remove_cvref_t<Visitor>::saves;
    std::size_t count = holds_.size();
    visit(count);
    if constexpr (!saves) {
        if (count > guards_.size()) throw_snapshot_is_no_state("the number of rests");
        holds_.resize(count);
        resting_ = false;
    }
    if (count > 0) visit(resting_);
    for (Hold& hold : holds_) {
        visit(hold.guard);
        visit(hold.inward);
        visit(hold.rounding);
        visit(hold.level);
        visit(hold.ahead);
        std::size_t components = hold.components.size();
        visit(components);
        if constexpr (!saves) hold.components.clear();
        for (std::size_t k = 0; k < components; ++k) {
            if constexpr (!saves) hold.components.push_back(0);  // one by one: it may be any number
            visit(hold.components[k]);
        }
    }
}

}  // namespace ricochet::detail
