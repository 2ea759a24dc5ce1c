// What a rest holds, and until when.
//
// After a rest in the same mode the motion goes on. If the flow presses on the guard that has come
// to rest, the components whose result in `rest` does not depend on the state are held: they stand
// still, the others flow, and the guard is not examined. They are released together where the flow
// without the hold lifts the guard, and where a reset or another mode changes one of them.
#pragma once

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "core/first_rise.hpp"
#include "core/guard_rounding.hpp"
#include "core/guard_table.hpp"
#include "core/step.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/refusals.hpp"

namespace ricochet::detail {

/// A guard that has come to rest.
struct Rested {
    std::size_t guard = 0;
    double tolerance = 0;  ///< |g| where it fired last
    double ahead = 0;      ///< [s] from there to the limit, for which the state stood still
};

template <class X, bool single>
class HeldComponents {
    /// Components that stand still since the rest of a guard on whose surface the flow presses.
    struct Hold {
        std::size_t guard = 0;
        double inward = 1;    ///< sign of the guard inside
        double rounding = 0;  ///< of its value there
        double level = 0;     ///< |g| up to which it is on its surface
        double ahead = 0;     ///< [s] over which the flow without the hold is followed; 0: never
        boost::container::small_vector<std::size_t, 8> components{};
    };

public:
    /// Keeps references to all; the step holds the components.
    /// @param calls  number of guard calls so far
    HeldComponents(const SystemAt<X>& system, Step<X>& step, GuardTable<X, single>& guards,
                   std::uint64_t& calls, bool backward)
        : system_(system), step_(step), guards_(guards), calls_(calls), backward_(backward)
    {
    }

    [[nodiscard]] bool empty() const noexcept { return holds_.empty(); }
    /// The guard of hold k.
    [[nodiscard]] std::size_t guard(std::size_t k) const noexcept { return holds_[k].guard; }
    [[nodiscard]] bool is_held(std::size_t i) const noexcept
    {
        return std::any_of(holds_.begin(), holds_.end(),
                           [i](const Hold& hold) { return hold.guard == i; });
    }
    /// Whether something is held, and nothing moves.
    [[nodiscard]] bool rests() const noexcept { return rests_; }
    void wake() noexcept { rests_ = false; }

    /// Whether all guards are to be enabled and disabled again, since other components are held.
    [[nodiscard]] bool has_changed() const noexcept { return changed_ > 0; }
    /// All guards have been enabled and disabled.
    void see_enabled() noexcept
    {
        if (changed_ > 0) --changed_;
    }

    /// Takes notice of a rest at this instant.
    void add(const Rested& rested) { rested_.push_back(rested); }
    /// Holds what the rests of this instant have to hold.
    /// @param scale  [s] approximate length of the next step
    /// @return a guard for which that is not possible, or `no_guard`
    [[nodiscard]] std::size_t hold_rested(double scale);

    /// Holds again what rests of the run before this one have held: of guards on their surfaces
    /// whose `rest` leaves the state and the mode as they are. `is_candidate(i)`: guard i may have
    /// come to rest.
    template <class Candidate>
    void hold_again(double scale, const Candidate& is_candidate);

    /// Lets the components of hold k move again. The accumulation of events at its guard is then
    /// counted from the beginning.
    void release(std::size_t k);
    /// Releases the holds of components that a reset has changed, or all holds where the mode has
    /// changed.
    void release_changed(const X& before, const X& after, bool changes_mode);
    /// The first hold whose guard the flow lifts at the start of the step; `no_guard`: none.
    [[nodiscard]] std::size_t lifted();

    /// Where the flow first lifts the guard of a hold from its surface.
    struct Release {
        std::size_t hold = no_guard;  ///< number of the hold; `no_guard`: nothing is lifted
        double at = 0;                ///< [s] offset
        double bend = 0;              ///< as in `Rise`
    };
    /// @param state_at  called as state_at(s, x), writes the state at offset s into x
    [[nodiscard]] Release first_release(double length, FunctionRef<void(double, X&)> state_at);

    /// The guard of a hold that has left its surface; `no_guard`: none has.
    [[nodiscard]] std::size_t guard_left_at(double t, const X& x);

    /// Finds out whether nothing moves and nothing will, for `span` [s]: all rates are zero, and
    /// the flow without holds and all guards have at four later times the values that they have
    /// now. (For a host only the guards are evaluated.)
    void review(double span) { rests_ = !empty() && stands_still(span); }

    void forget()
    {
        rests_ = false;
        rested_.clear();
        if (empty()) return;
        holds_.clear();
        renew();
    }

    /// All that is held, to be put back.
    struct Kept {
        boost::container::small_vector<Hold, 2> holds{};
        bool rests = false;
    };
    [[nodiscard]] Kept keep() const { return {holds_, rests_}; }
    void put_back(const Kept& kept)
    {
        holds_ = kept.holds;
        rests_ = kept.rests;
        resume();
    }
    /// Holds what has been put back or read together with the guards, which need not be enabled
    /// again.
    void resume()
    {
        const std::uint8_t changed = changed_;
        rested_.clear();
        renew();
        changed_ = changed;
    }
    /// Whether holds that have been read are those of a state of n components.
    [[nodiscard]] bool fit(std::size_t n) const noexcept
    {
        return std::all_of(holds_.begin(), holds_.end(), [&](const Hold& hold) {
            return hold.guard < guards_.size() &&
                   std::all_of(hold.components.begin(), hold.components.end(),
                               [n](std::size_t component) { return component < n; });
        });
    }
    /// Saves or reads the holds.
    template <class Visitor>
    void visit(Visitor&& visit);

private:
    /// A short part of a motion that is followed for the sake of a guard.
    struct Following {
        std::size_t guard;
        double t;  ///< [s]
        const X* x;
        double ahead;  ///< [s]
        bool frozen;   ///< the flow is that at t
    };

    using Flow = FunctionRef<void(double, const X&, X&)>;
    /// Change of a guard along `flow(t, x, dxdt)`, by Heun's step.
    [[nodiscard]] double drift(const Following& by, Flow flow);
    /// The same along the flow in which nothing is held.
    [[nodiscard]] double free_drift(const Following& by);

    /// Whether the flow presses on a guard that has come to rest: it is on its surface, and its
    /// first derivative that is not zero points outward. Fills in `hold`, but not its components.
    [[nodiscard]] bool presses(const Rested& rested, Hold& hold, double scale);
    [[nodiscard]] bool is_at_rest(std::size_t i);

    /// Lets the components that are not held catch up with the limit of the events.
    void carry_on(double ahead);

    /// Finds the components that `rest` sets to a value that depends neither on the state, by two
    /// displacements of all of them, nor on the time. False: there are none, or one of them is set
    /// to a value that moves with the time.
    [[nodiscard]] bool finds_components(Hold& hold, double scale);

    /// Whether the guard stays on its surface for the length of a step while components are held.
    [[nodiscard]] bool stays_held(const Hold& hold, double scale);

    /// Makes the step hold the components of all holds.
    void renew();

    /// Positive where the flow lifts the guard of a hold from its surface.
    [[nodiscard]] double lift(const Hold& hold, double t, const X& x);

    [[nodiscard]] bool stands_still(double span);
    [[nodiscard]] bool guards_stand_still(double t);

    [[nodiscard]] CoreGuard<X> view(std::size_t i) { return guards_.view(i, step_.mode(), calls_); }
    [[nodiscard]] double value_here(std::size_t i)
    {
        return view(i).value(step_.time(0), step_.x0());
    }
    [[nodiscard]] double rounding_of(std::size_t i)
    {
        return detail::rounding_of(view(i), step_, step_.time(0), step_.x0());
    }

    const SystemAt<X>& system_;
    Step<X>& step_;
    GuardTable<X, single>& guards_;
    std::uint64_t& calls_;
    bool backward_;
    bool rests_ = false;
    /// Number of times that all guards are still to be enabled and disabled afresh since the holds
    /// have changed: once, and once more, after which no guard counts as newly enabled.
    std::uint8_t changed_ = 0;
    boost::container::small_vector<Hold, 2> holds_;
    boost::container::small_vector<Rested, 2> rested_;  ///< at this instant
};

template <class X, bool single>
double HeldComponents<X, single>::drift(const Following& by, Flow flow)
{
    const X& x = *by.x;
    X rate = x, later = x, rate_later = x;
    const double end = by.frozen ? by.t : step_.inside(by.t + (backward_ ? -by.ahead : by.ahead));
    flow(by.t, x, rate);
    move(later, x, by.ahead, rate);
    flow(end, later, rate_later);
    move(later, x, by.ahead / 2, rate);
    move(later, later, by.ahead / 2, rate_later);
    const auto guard = view(by.guard);
    return guard.value(end, later) - guard.value(by.t, x);
}

template <class X, bool single>
double HeldComponents<X, single>::free_drift(const Following& by)
{
    return drift(by, [this](double t, const X& x, X& dxdt) { step_.free_flow(t, x, dxdt); });
}

template <class X, bool single>
bool HeldComponents<X, single>::presses(const Rested& rested, Hold& hold, double scale)
{
    const std::size_t i = rested.guard;
    const GuardRecord& record = std::as_const(guards_)[i];
    const Mode mode = step_.mode();
    const double t = step_.time(0);
    const X& x = step_.x0();
    if (record.info.boolean || !system_.enabled_in(i, mode) || !system_.enabled_at(i, mode, t, x))
        return false;
    const Crossing crossing = record.info.crossing;
    hold.guard = i;
    hold.inward = crossing == Crossing::falling    ? 1
                  : crossing == Crossing::rising   ? -1
                  : sign_of(record.last.side) == 0 ? 1
                                                   : sign_of(record.last.side);
    hold.rounding = rounding_of(i);
    hold.level = std::max(hold.rounding, rested.tolerance);
    if (hold.inward * value_here(i) > hold.level) return false;
    if (!system_->flow) return hold.inward * view(i).rate(t, x, step_.rate0(), scale) <= 0;
    // The first derivative that is not zero decides, and a short drift shows its sign. The drift
    // that is watched afterwards is a longer one, which stands out from rounding by a factor of a
    // million.
    double first = 0;
    for (double ahead = tolerances::of_difference * scale; ahead <= scale; ahead *= 16) {
        const double moved = hold.inward * free_drift({i, t, &x, ahead, false});
        if (!(std::fabs(moved) > 8 * hold.rounding)) continue;
        if (first == 0) first = moved;
        if (moved * first < 0) break;
        hold.ahead = ahead;
        if (std::fabs(moved) > tolerances::of_drift * hold.rounding) break;
    }
    return first < 0;
}

template <class X, bool single>
std::size_t HeldComponents<X, single>::hold_rested(double scale)
{
    for (const Rested& rested : std::exchange(rested_, {})) {
        Hold hold;
        if (!presses(rested, hold, scale)) continue;
        if (!finds_components(hold, scale)) return rested.guard;
        holds_.push_back(hold);
        renew();
        if (!stays_held(hold, scale)) return rested.guard;
        carry_on(rested.ahead);
    }
    return no_guard;
}

template <class X, bool single>
template <class Candidate>
void HeldComponents<X, single>::hold_again(double scale, const Candidate& is_candidate)
{
    if (!system_->rest) return;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        Hold hold;
        if (!is_candidate(i) || !is_at_rest(i)) continue;
        if (!presses({i, 0, 0}, hold, scale) || !finds_components(hold, scale)) continue;
        holds_.push_back(hold);
        renew();
        if (stays_held(hold, scale)) continue;
        holds_.pop_back();
        renew();
        if (!step_.is_of_host()) step_.refresh();
    }
}

template <class X, bool single>
bool HeldComponents<X, single>::is_at_rest(std::size_t i)
{
    const Mode mode = step_.mode();
    if (std::as_const(guards_)[i].info.boolean || !system_.enabled_in(i, mode)) return false;
    if (!(std::fabs(value_here(i)) <= rounding_of(i))) return false;
    X x = step_.x0();
    return system_->rest(system_.adapter(), i, mode, step_.time(0), x) == mode &&
           same_state(x, step_.x0());
}

template <class X, bool single>
void HeldComponents<X, single>::carry_on(double ahead)
{
    if (ahead == 0 || step_.is_of_host()) return;
    X x = step_.x0();
    move(x, x, ahead, step_.rate0());
    if (!same_state(x, step_.x0())) step_.restart(step_.start(), x, step_.mode());
}

template <class X, bool single>
bool HeldComponents<X, single>::finds_components(Hold& hold, double scale)
{
    const X& x = step_.x0();
    X up = x, down = x;
    std::size_t c = 0;
    for_each_component(x, [&](auto i) {
        const double size = 0x1p-10 * std::fabs(x[i]) + scale * std::fabs(step_.rate0()[i]);
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
    if (!rest(t, up) || !rest(t, down) || !rest(step_.inside(t - scale), earlier) ||
        !rest(step_.inside(t + scale), later)) {
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
bool HeldComponents<X, single>::stays_held(const Hold& hold, double scale)
{
    if (!(std::fabs(value_here(hold.guard)) <= hold.level)) return false;
    if (!system_->flow) return true;
    const auto held = [this](double at, const X& x, X& dxdt) {
        step_.flow_in(step_.mode(), at, x, dxdt);
    };
    const double moved = drift({hold.guard, step_.time(0), &step_.x0(), scale, false}, held);
    return std::fabs(moved) <= 8 * hold.rounding;
}

template <class X, bool single>
void HeldComponents<X, single>::renew()
{
    boost::container::small_vector<std::size_t, 16> components;
    for (const Hold& hold : holds_) {
        components.insert(components.end(), hold.components.begin(), hold.components.end());
    }
    std::sort(components.begin(), components.end());
    components.erase(std::unique(components.begin(), components.end()), components.end());
    step_.hold_components({components.data(), components.size()});
    guards_.await_series(step_);
    changed_ = 2;
}

template <class X, bool single>
void HeldComponents<X, single>::release(std::size_t k)
{
    assert(k < holds_.size());
    GuardRecord& record = guards_[holds_[k].guard];
    record.intervals.come_to_rest();
    record.tolerance = holds_[k].level;  // it is on its surface
    guards_.row().clear();
    holds_.erase(holds_.begin() + static_cast<std::ptrdiff_t>(k));
    rests_ = false;
    renew();
}

template <class X, bool single>
void HeldComponents<X, single>::release_changed(const X& before, const X& after, bool changes_mode)
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
double HeldComponents<X, single>::lift(const Hold& hold, double t, const X& x)
{
    if (!system_.enabled_at(hold.guard, step_.mode(), t, x)) return 1;
    if (!system_->flow || hold.ahead == 0) return -1;
    return hold.inward * free_drift({hold.guard, t, &x, hold.ahead, true}) - hold.rounding;
}

template <class X, bool single>
std::size_t HeldComponents<X, single>::lifted()
{
    for (std::size_t k = 0; k < holds_.size(); ++k) {
        if (lift(holds_[k], step_.time(0), step_.x0()) > 0) return k;
    }
    return no_guard;
}

template <class X, bool single>
auto HeldComponents<X, single>::first_release(double length, FunctionRef<void(double, X&)> state_at)
    -> Release
{
    Release first{.at = length};
    X x = step_.x0();
    const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(step_.start().value);
    for (std::size_t k = 0; k < holds_.size(); ++k) {
        const auto value = [&](double s) {
            state_at(s, x);
            return lift(holds_[k], step_.inside(step_.time(s)), x);
        };
        const Rise rise = first_rise(value, first.at, ulp);
        first.bend = std::max(first.bend, rise.bend);
        if (rise.at <= first.at) first = {k, rise.at, first.bend};
    }
    return first;
}

template <class X, bool single>
std::size_t HeldComponents<X, single>::guard_left_at(double t, const X& x)
{
    for (const Hold& hold : holds_) {
        const double g = view(hold.guard).value(t, x);
        if (!(std::fabs(g) <= hold.level + 8 * hold.rounding)) return hold.guard;
    }
    return no_guard;
}

template <class X, bool single>
bool HeldComponents<X, single>::stands_still(double span)
{
    bool still = true;
    for_each_component(step_.x0(), [&](auto c) { still = still && step_.rate0()[c] == 0; });
    if (!still) return false;
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
bool HeldComponents<X, single>::guards_stand_still(double t)
{
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        if (!system_.enabled_in(i, step_.mode())) continue;
        if (is_held(i) && !system_.enabled_at(i, step_.mode(), t, step_.x0())) return false;
        const auto guard = view(i);
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
void HeldComponents<X, single>::visit(Visitor&& visit)
{
    constexpr bool saves = std::remove_cvref_t<Visitor>::saves;
    std::size_t count = holds_.size();
    visit(count);
    if constexpr (!saves) {
        if (count > guards_.size()) throw_snapshot_is_no_state("the number of rests");
        holds_.resize(count);
        rests_ = false;
    }
    if (count > 0) visit(rests_);
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
