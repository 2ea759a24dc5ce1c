// Internal: the declarations of this header may change without notice.
//
// A hybrid system as an FMU for model exchange: what the loop of this library does at an event,
// where another program has the loop.
//
// An indicator is the guard, on the side on which the guard was armed: where the guard is zero, or
// beyond it by the rounding of its reset, it is the least normal number of that side. A round of
// event iteration applies the resets of all guards that have left their sides in the direction that
// counts; guards that a reset carries across fire in the next round. Where events accumulate the
// rest rule is applied, and the components that it fixes stand still while the flow presses.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "ricochet/detail/system_table.hpp"
#include "ricochet/fmi/detail/exported.hpp"

namespace ricochet::fmi::detail {

using ricochet::detail::SystemTable;

template <class C>
class Exchange {
public:
    /// @param adapter  the argument of the table's functions, of the system as it is now
    /// @param states  number of components
    void bind(const SystemTable<C>& table, void* adapter, std::size_t states)
    {
        held_.resize(states);
        table_ = &table;
        adapter_ = adapter;
        guards_.resize(table.guard_count(adapter));
        infos_.clear();
        for (std::size_t i = 0; i < guards_.size(); ++i) infos_.push_back(table.info(adapter, i));
    }

    void start(double t, const C& x, Mode mode)
    {
        for (Guard& guard : guards_) guard = {};
        (void)release();
        for (std::size_t i = 0; i < guards_.size(); ++i) arm(i, {t, x, mode}, false);
        const bool due = table_->time_event_count && table_->time_event_count(adapter_, t) > 0;
        next_time_ = due ? t : next_after(t, x, mode);
    }

    void rates(double t, const C& x, Mode mode, C& dxdt) const
    {
        table_->flow(adapter_, mode, t, x, dxdt);
        for (std::size_t i = 0; i < held_.size(); ++i) {
            if (held_[i]) dxdt[i] = 0;
        }
    }

    void indicators(double t, const C& x, Mode mode, std::span<double> z) const
    {
        for (std::size_t i = 0; i < z.size(); ++i) {
            const Guard& guard = guards_[i];
            if (!guard.enabled) {
                z[i] = 1;
            } else if (i == resting_) {
                z[i] = nonzero(-curvature({t, x, mode}), true);
            } else {
                z[i] = nonzero(value(i, {t, x, mode}) + guard.bias, guard.above);
            }
        }
    }

    /// One round. @param count  of events, raised
    [[nodiscard]] ModelUpdate update(double t, C& x, Mode& mode, std::uint64_t& count)
    {
        const C before = x;
        const bool timed = t >= next_time_;
        const std::vector<std::size_t> fired = find(t, x, mode);
        ModelUpdate out{.next_time = next_time_};
        if (fired.empty() && !timed) return out;
        rounds_ = t == last_round_ ? rounds_ + 1 : 0;
        last_round_ = t;
        if (rounds_ > most_rounds) {
            throw std::runtime_error("resets keep triggering each other at one instant");
        }
        const Mode mode_before = mode;
        apply(fired, t, x, mode);
        if (timed && table_->time_reset) mode = table_->time_reset(adapter_, mode, t, x);
        count += fired.size() + (timed ? 1 : 0);
        if (resting_ != no_guard && (mode != mode_before || !still_rests(before, {t, x, mode}))) {
            arm(release(), {t, x, mode}, false);
        }
        out.again = arm_all(fired, {t, x, mode}, mode != mode_before);
        for (const std::size_t i : fired) come_to_rest(i, t, x, mode);
        next_time_ = next_after(t, x, mode);
        out.again = out.again || next_time_ <= t;
        out.next_time = next_time_;
        out.states_changed = !std::equal(x.begin(), x.end(), before.begin(), before.end());
        return out;
    }

    /// Passes every number to `visit`, which reads or writes it.
    template <class Visitor>
    void visit(Visitor&& visit)
    {
        for (Guard& guard : guards_) {
            visit(guard.enabled);
            visit(guard.above);
            visit(guard.bias);
            visit(guard.last);
            visit(guard.flight);
            visit(guard.shrinking);
        }
        for (auto& one : held_) visit(one);
        visit(resting_);
        visit(next_time_);
    }

    /// Whether what `visit` has read can be of this system.
    [[nodiscard]] bool is_valid() const noexcept
    {
        return resting_ == no_guard || resting_ < guards_.size();
    }

private:
    static constexpr std::uint64_t most_rounds = 1000;

    struct Guard {
        bool enabled = false, above = false;
        double bias = 0;  ///< of the indicator, from the rounding of a reset
        // Flights between its events, to find out where they accumulate.
        double last = -std::numeric_limits<double>::infinity();
        double flight = std::numeric_limits<double>::infinity();
        std::uint64_t shrinking = 0;
    };
    struct At {
        double t;
        const C& x;
        Mode mode;
    };

    [[nodiscard]] static double nonzero(double z, bool above)
    {
        if (z != 0) return z;
        return above ? std::numeric_limits<double>::min() : -std::numeric_limits<double>::min();
    }
    [[nodiscard]] double value(std::size_t i, const At& at) const
    {
        return table_->guard(adapter_, i, at.mode, at.t, at.x);
    }
    [[nodiscard]] double rate(std::size_t i, const At& at) const
    {
        C dxdt = at.x;
        rates(at.t, at.x, at.mode, dxdt);
        return rate_along(i, at, dxdt);
    }
    [[nodiscard]] double rate_along(std::size_t i, const At& at, const C& dxdt) const
    {
        return table_->rate(adapter_, {i, at.mode}, {at.t, 1}, at.x, dxdt);
    }

    /// Second derivative of the resting guard along the free flow, by central differences whose
    /// error is that of their length squared.
    [[nodiscard]] double curvature(const At& at) const
    {
        const double length = 1e-5;
        C flow = at.x, there = at.x, flow_there = at.x;
        table_->flow(adapter_, at.mode, at.t, at.x, flow);
        const auto along = [&](double s) {
            for (std::size_t i = 0; i < held_.size(); ++i) there[i] = at.x[i] + s * flow[i];
            table_->flow(adapter_, at.mode, at.t + s, there, flow_there);
            return rate_along(resting_, {at.t + s, there, at.mode}, flow_there);
        };
        return (along(length) - along(-length)) / (2 * length);
    }

    [[nodiscard]] bool counts(std::size_t i, bool from_above) const
    {
        const Crossing crossing = infos_[i].crossing;
        return crossing == Crossing::either || (crossing == Crossing::falling) == from_above;
    }
    [[nodiscard]] bool is_enabled(std::size_t i, const At& at) const
    {
        return !table_->enabled_in || table_->enabled_in(adapter_, i, at.mode);
    }

    /// Guards that have left their sides; those that did in a direction that does not count are
    /// armed on the other side.
    [[nodiscard]] std::vector<std::size_t> find(double t, const C& x, Mode mode)
    {
        std::vector<std::size_t> fired;
        const At at{t, x, mode};
        if (resting_ != no_guard && curvature(at) > 0) {  // the flow lifts it
            const std::size_t lifted = release();
            guards_[lifted].above = true;
            guards_[lifted].bias = -value(lifted, at);
        }
        for (std::size_t i = 0; i < guards_.size(); ++i) {
            Guard& guard = guards_[i];
            if (!guard.enabled || i == resting_) continue;
            const double z = value(i, at) + guard.bias;
            const bool left = guard.above ? z < 0 : z > 0;
            if (!left) continue;
            const bool acts = infos_[i].resets && table_->resets();
            const bool permitted =
                !table_->enabled_at || table_->enabled_at(adapter_, i, mode, t, x);
            if (acts && permitted && counts(i, guard.above)) {
                fired.push_back(i);
            } else {
                guard.above = !guard.above;
                guard.bias = 0;
            }
        }
        return fired;
    }

    /// The resets of the set: where members change different components, all from the state before;
    /// else one after the other, leaving out those whose guard an earlier one has turned.
    void apply(const std::vector<std::size_t>& fired, double t, C& x, Mode& mode)
    {
        if (fired.empty()) return;
        if (table_->reset_set) {
            mode = table_->reset_set(adapter_, FiredGuards(fired), mode, t, x);
            return;
        }
        const C before = x;
        const Mode mode_before = mode;
        bool apart = true;
        for (const std::size_t i : fired) {
            C after = before;
            const Mode next = reset(i, mode_before, t, after);
            if (next != mode_before) mode = next;
            for (std::size_t k = 0; k < held_.size(); ++k) {
                if (after[k] == before[k]) continue;
                apart = apart && x[k] == before[k];
                x[k] = after[k];
            }
        }
        if (apart) return;
        x = before;
        mode = mode_before;
        for (const std::size_t i : fired) {
            const double r = rate(i, {t, x, mode});
            if (i != fired.front() && (guards_[i].above ? r >= 0 : r <= 0)) continue;
            mode = reset(i, mode, t, x);
        }
    }
    Mode reset(std::size_t i, Mode mode, double t, C& x)
    {
        if (table_->tell_direction) {
            table_->tell_direction(adapter_,
                                   guards_[i].above ? Crossing::falling : Crossing::rising);
        }
        return table_->reset(adapter_, i, mode, t, x);
    }

    /// Arms every guard after a set. True: one has been carried across, and fires next.
    bool arm_all(const std::vector<std::size_t>& fired, const At& at, bool new_mode)
    {
        bool again = false;
        for (std::size_t i = 0; i < guards_.size(); ++i) {
            Guard& guard = guards_[i];
            if (i == resting_) continue;
            const bool own = std::find(fired.begin(), fired.end(), i) != fired.end();
            const bool stays = guard.enabled && is_enabled(i, at);
            const double z = value(i, at) + guard.bias;
            const bool carried = !own && stays && (guard.above ? z < 0 : z > 0);
            if (carried && infos_[i].resets && counts(i, guard.above)) {
                again = true;
            } else if (own || !stays || new_mode || carried) {
                arm(i, at, own);
            }
        }
        return again;
    }

    /// Arms a guard on its sign; on its surface, or after its own event, on the sign of its rate.
    void arm(std::size_t i, const At& at, bool own)
    {
        Guard& guard = guards_[i];
        guard.bias = 0;
        guard.enabled = is_enabled(i, at);
        if (!guard.enabled) return;
        const double g = value(i, at);
        guard.above = g > 0;
        if (g != 0 && !own) return;
        const double r = rate(i, at);
        // On a plateau it waits on the side that it may leave.
        guard.above = r != 0 ? r > 0 : infos_[i].crossing != Crossing::rising;
        // What a reset has left beyond the surface, by rounding.
        if (guard.above ? g < 0 : g > 0) guard.bias = -g;
    }

    /// Whether an event of others has left alone what a rest holds, and the flow still presses.
    [[nodiscard]] bool still_rests(const C& before, const At& at) const
    {
        for (std::size_t k = 0; k < held_.size(); ++k) {
            if (held_[k] && at.x[k] != before[k]) return false;
        }
        return !(curvature(at) > 0);
    }

    /// Ends a rest. @return the guard that rested
    std::size_t release()
    {
        std::fill(held_.begin(), held_.end(), std::uint8_t{0});
        return std::exchange(resting_, no_guard);
    }

    /// The rest rule, where flights have shrunk three times and what is left of their geometric
    /// series is below the rounding of the time, or the reset has left the guard without a rate.
    void come_to_rest(std::size_t i, double t, C& x, Mode& mode)
    {
        Guard& guard = guards_[i];
        const double flight = t - guard.last;
        const double ratio = flight / guard.flight;
        guard.shrinking =
            flight < guard.flight && std::isfinite(guard.flight) ? guard.shrinking + 1 : 0;
        guard.last = t;
        guard.flight = flight;
        if (!table_->rest) return;
        const double resolution =
            16 * std::numeric_limits<double>::epsilon() * std::max(1.0, std::fabs(t));
        const bool accumulates = guard.shrinking >= 3 && flight * ratio / (1 - ratio) < resolution;
        const bool stands =
            guard.enabled && value(i, {t, x, mode}) == 0 && rate(i, {t, x, mode}) == 0;
        if (!accumulates && !stands) return;
        C other = x;
        for (std::size_t k = 0; k < held_.size(); ++k) other[k] += 1 + std::fabs(other[k]);
        const Mode next = table_->rest(adapter_, i, mode, t, x);
        (void)table_->rest(adapter_, i, mode, t, other);
        guard.shrinking = 0;
        if (next != mode) {
            mode = next;
            for (std::size_t k = 0; k < guards_.size(); ++k) arm(k, {t, x, mode}, k == i);
            return;
        }
        resting_ = i;
        if (curvature({t, x, mode}) > 0) {
            (void)release();
            return;
        }
        for (std::size_t k = 0; k < held_.size(); ++k) held_[k] = x[k] == other[k];
    }

    [[nodiscard]] double next_after(double t, const C& x, Mode mode) const
    {
        if (table_->next_time_event_at) return table_->next_time_event_at(adapter_, mode, t, x);
        if (table_->next_time_event) return table_->next_time_event(adapter_, t);
        return std::numeric_limits<double>::infinity();
    }

    const SystemTable<C>* table_ = nullptr;
    void* adapter_ = nullptr;
    std::vector<Guard> guards_;
    std::vector<GuardInfo> infos_;
    std::vector<std::uint8_t> held_;  ///< components that stand still
    std::size_t resting_ = no_guard;
    double next_time_ = std::numeric_limits<double>::infinity();
    double last_round_ = std::numeric_limits<double>::quiet_NaN();
    std::uint64_t rounds_ = 0;
};

}  // namespace ricochet::fmi::detail
