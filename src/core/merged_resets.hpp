// The resets of guards that fired together, applied to one state.
//
// The reset of a single guard changes the state in place. Several resets all read the state
// before. Those that change different components are merged. Those that change a common component,
// or the mode, are applied one after the other in every order, where a guard whose event an earlier
// reset has undone is left out:
//
//     r_i = R_i(x⁻)      G = the members that share a component     C = the components they change
//     for every order of G:   x = x⁻;  for i in the order:  if i still has its event:  x = R_i(x)
//     a component of C   is x⁻ plus all increments where each member adds the same in every place,
//                        else its value at the end of all orders where that is one value,
//                        else in conflict
//
// A system may take the whole set instead (`SystemTable::reset_set`).
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/guard_table.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/stop.hpp"

namespace ricochet::detail {

/// What happens at one instant: the guards that fired, and a time event if it is on time.
struct FiredSet {
    std::span<const std::size_t> fired;
    bool on_time;
    Mode mode;
    double t;
};

template <class X>
class MergedResets {
public:
    explicit MergedResets(const X& like) : after_(like), single_(like), along_(like) {}

    /// Applies the resets of the guards that fired to the state `before`, and the reset of a time
    /// event, and then lets the system decide its mode, if it does. `guards` knows which guards
    /// have a reset.
    /// @param stands  whether guard i still has its event in a mode and a state, and in which
    ///                direction it has crossed
    template <class Guards, class Stands>
    void apply(const SystemAt<X>& system, const Guards& guards, const FiredSet& set,
               const X& before, const Stands& stands)
    {
        apply_resets(system, guards, set, before, stands);
        if (!system->after_set || conflict_.first != no_guard) return;
        mode_ = system->after_set(system.adapter(), FiredGuards(set.fired, set.on_time), set.mode,
                                  set.t, before, after_);
    }

    /// Applies to the state x the reset of guard i, which has left the state `before` unchanged.
    /// Components that it leaves alone keep their values before. True: it changes something.
    [[nodiscard]] bool ask_again(const SystemAt<X>& system, std::size_t i, Mode mode, double t,
                                 X& x, const X& before)
    {
        const X from = x;
        mode_ = ask(i, mode, [&] { return system->reset(system.adapter(), i, mode, t, x); });
        if (x.size() != from.size()) {
            assign(after_, x);
            return true;
        }
        assign(after_, before);
        for (std::size_t c = 0; c < size_of(from); ++c) {
            if (differs(x, from, c)) at(after_, c) = at(x, c);
        }
        return stops_ || mode_ != mode || !same_state(after_, before);
    }

    static void tell_direction(const SystemAt<X>& system, Crossing direction)
    {
        if (system->tell_direction) system->tell_direction(system.adapter(), direction);
    }

    [[nodiscard]] X& after() noexcept { return after_; }
    [[nodiscard]] const X& after() const noexcept { return after_; }
    [[nodiscard]] X& scratch() noexcept { return single_; }
    [[nodiscard]] Mode mode() const noexcept { return mode_; }
    /// Sets the mode after the set.
    void move_to(Mode mode) noexcept { mode_ = mode; }

    /// The two guards whose resets disagree, or a guard and `time_event_reset`; `no_guard` if none
    /// disagree.
    [[nodiscard]] const std::pair<std::size_t, std::size_t>& conflict() const noexcept
    {
        return conflict_;
    }

    /// Whether a reset has ended the run, which one, and the text that it gave.
    [[nodiscard]] bool stops() const noexcept { return stops_; }
    [[nodiscard]] std::size_t stopper() const noexcept { return stopper_; }
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

private:
    template <class Guards, class Stands>
    void apply_resets(const SystemAt<X>& system, const Guards& guards, const FiredSet& set,
                      const X& before, const Stands& stands)
    {
        const std::span<const std::size_t> fired = set.fired;
        const bool on_time = set.on_time;
        const Mode mode = set.mode;
        const double t = set.t;
        assign(after_, before);
        mode_ = mode;
        conflict_ = {no_guard, no_guard};
        stops_ = false;
        if (fired.size() == 1 && !on_time && !system->reset_set) {
            const std::size_t i = fired[0];
            if (!system->reset || !guards[i].info.resets) return;
            tell_direction(system, stands.direction(i));
            mode_ =
                ask(i, mode, [&] { return system->reset(system.adapter(), i, mode, t, after_); });
            return;
        }
        const auto resets = [&](std::size_t i) {
            return system->resets() && guards[i].info.resets;
        };
        if (system->reset_set && std::any_of(fired.begin(), fired.end(), resets)) {
            const FiredGuards set(fired, on_time);
            mode_ = ask(fired[0], mode,
                        [&] { return system->reset_set(system.adapter(), set, mode, t, after_); });
            return;
        }
        members_ = {};
        for (const std::size_t i : fired) {
            if (resets(i)) add_member(i);
        }
        if (on_time && system->time_reset) add_member(time_event_reset);
        const auto reset = [&](const Member& member, Mode in, X& x) {
            if (member.who != time_event_reset)
                tell_direction(system, stands.direction(member.who));
            return ask(member.who, in, [&] {
                return member.who == time_event_reset
                           ? system->time_reset(system.adapter(), in, t, x)
                           : system->reset(system.adapter(), member.who, in, t, x);
            });
        };
        if (members_.size() == 1) {
            mode_ = reset(members_[0], mode, after_);
        } else if (!members_.empty()) {
            apply_together(before, mode, reset, stands);
        }
    }

    /// The mode after a reset. The first that ends the run is noted, unless resets are asked again
    /// in other orders.
    template <class Reset>
    [[nodiscard]] Mode ask(std::size_t who, Mode mode, const Reset& reset)
    {
        try {
            return reset();
        } catch (const StopRun& stop) {
            if (!stops_ && !asks_again_) {
                stops_ = true;
                stopper_ = who;
                reason_ = stop.why();
            }
            return stop.mode().value_or(mode);
        }
    }

    struct Range {
        double least = std::numeric_limits<double>::infinity();
        double most = -std::numeric_limits<double>::infinity();

        void add(double value) noexcept
        {
            if (value < least || value != value) least = value;
            if (value > most || value != value) most = value;
        }
        /// Whether all values are the same to within `rounding`; NaN is the same as nothing.
        [[nodiscard]] bool is_one(double rounding) const noexcept
        {
            return most - least <= rounding;
        }
    };

    struct Member {
        std::size_t who = no_guard;  ///< a guard, or `time_event_reset`
        Mode mode = 0;               ///< after its reset of the state before
        X result{};                  ///< the state after that
        bool shares = false;
        double rounding = 0;  ///< of the components that it changes
        std::vector<Range> increments{};

        [[nodiscard]] bool changes(const X& before, Mode from) const
        {
            return mode != from || !same_state(result, before);
        }
    };

    /// In memory that earlier sets have allocated.
    void add_member(std::size_t who)
    {
        const std::size_t count = members_.size();
        if (count == all_members_.size()) all_members_.emplace_back();
        members_ = {all_members_.data(), count + 1};
        members_.back().who = who;
        members_.back().shares = false;
    }

    template <class Reset, class Stands>
    void apply_together(const X& before, Mode mode, const Reset& reset, const Stands& stands)
    {
        bool resized = false;
        for (Member& member : members_) {
            assign(member.result, before);
            member.mode = reset(member, mode, member.result);
            resized = resized || member.result.size() != before.size();
        }
        asks_again_ = true;
        merge_all(before, mode, resized, reset, stands);
        asks_again_ = false;
    }

    template <class Reset, class Stands>
    void merge_all(const X& before, Mode mode, bool resized, const Reset& reset,
                   const Stands& stands)
    {
        if (resized) return merge_resized(before, mode);
        if (find_shared(before, mode)) {
            if (!stands.knows_flow() && agree(before, mode)) return merge(before, mode);
        } else {
            merge(before, mode);
            if (!undo_one_another(before, mode, reset)) return;
            assign(after_, before);
            mode_ = mode;
        }
        merge(before, mode);
        apply_in_every_order(before, mode, reset, stands);
    }

    /// A reset that changes the dimension of the state writes all components, and is in conflict
    /// with any other reset that changes anything, unless they agree.
    void merge_resized(const X& before, Mode mode)
    {
        const Member* first = nullptr;
        for (const Member& member : members_) {
            if (!member.changes(before, mode)) continue;
            if (!first) {
                first = &member;
                assign(after_, member.result);
                mode_ = member.mode;
            } else if (member.mode != mode_ || !same_state(member.result, after_)) {
                conflict_ = {first->who, member.who};
            }
        }
    }

    /// Marks the members that change a common component, or give different modes.
    bool find_shared(const X& before, Mode mode)
    {
        bool any = false;
        const auto share = [&](auto&& changes) {
            const auto count = std::count_if(members_.begin(), members_.end(), changes);
            if (count < 2) return;
            any = true;
            for (Member& member : members_) member.shares = member.shares || changes(member);
        };
        for (std::size_t c = 0; c < size_of(before); ++c) {
            share([&](const Member& member) { return differs(member.result, before, c); });
        }
        Mode next = mode;
        bool several = false;
        for (const Member& member : members_) {
            if (member.mode == mode) continue;
            several = several || (next != mode && member.mode != next);
            next = member.mode;
        }
        if (several) share([&](const Member& member) { return member.mode != mode; });
        return any;
    }

    /// Whether all members that change a component give it the same value. That is the only test
    /// where the flow is a host's; the members then share nothing.
    [[nodiscard]] bool agree(const X& before, Mode mode)
    {
        for (const Member& one : members_) {
            for (const Member& other : members_) {
                if (one.mode != mode && other.mode != mode && one.mode != other.mode) return false;
                for (std::size_t c = 0; c < size_of(before); ++c) {
                    const bool both =
                        differs(one.result, before, c) && differs(other.result, before, c);
                    if (both && differs(one.result, other.result, c)) return false;
                }
            }
        }
        for (Member& member : members_) member.shares = false;
        return true;
    }

    /// Marks members of which one sets a component that another one changes back to its value
    /// before: asked alone, the reset changes nothing there.
    template <class Reset>
    [[nodiscard]] bool undo_one_another(const X& before, Mode mode, const Reset& reset)
    {
        const auto changing =
            std::count_if(members_.begin(), members_.end(),
                          [&](const Member& member) { return !same_state(member.result, before); });
        if (changing < 1 || members_.size() < 2) return false;
        bool any = false;
        for (Member& member : members_) {
            assign(single_, after_);
            reset(member, mode, single_);
            for (std::size_t c = 0; c < size_of(before); ++c) {
                const bool of_another =
                    differs(after_, before, c) && !differs(member.result, before, c);
                if (!of_another || at(single_, c) != at(before, c)) continue;
                any = member.shares = true;
                for (Member& other : members_) {
                    other.shares = other.shares || differs(other.result, before, c);
                }
            }
        }
        return any;
    }

    /// Merges the changes of the members that share nothing, and takes one mode for all.
    void merge(const X& before, Mode mode)
    {
        for (const Member& member : members_) {
            if (member.mode != mode) mode_ = member.mode;
            if (member.shares) continue;
            for (std::size_t c = 0; c < size_of(before); ++c) {
                if (differs(member.result, before, c)) at(after_, c) = at(member.result, c);
            }
        }
    }

    template <class Reset, class Stands>
    void apply_in_every_order(const X& before, Mode mode, const Reset& reset, const Stands& stands)
    {
        group_.clear();
        for (std::size_t k = 0; k < members_.size(); ++k) {
            if (!members_[k].shares) continue;
            group_.push_back(k);
            members_[k].increments.assign(size_of(before), {});
            note_rounding(members_[k], before);
        }
        assert(group_.size() >= 2);
        ends_.assign(size_of(before), {});
        first_mode_ = last_mode_ = mode;
        modes_differ_ = false;
        orders_ = 0;
        const auto take = [&](std::span<const std::size_t> order) {
            take_in_order(order, before, mode, reset, stands);
        };
        constexpr std::size_t most = 4;
        if (group_.size() <= most) {
            do {
                take(group_);
            } while (std::next_permutation(group_.begin(), group_.end()));
        } else {
            take(group_);
            std::reverse(group_.begin(), group_.end());
            take(group_);
            std::reverse(group_.begin(), group_.end());
        }
        const bool additive = settle(before);
        const bool asks_pairs = conflict_.first != no_guard || (group_.size() > most && !additive);
        if (asks_pairs) name_pair(before, mode, reset, stands);
    }

    /// Applies the group in one order, and adds to the records what each member adds and where the
    /// order ends.
    template <class Reset, class Stands>
    void take_in_order(std::span<const std::size_t> order, const X& before, Mode mode,
                       const Reset& reset, const Stands& stands)
    {
        X& x = along_;
        assign(x, before);
        Mode in = mode;
        for (const std::size_t k : order) {
            Member& member = members_[k];
            const bool timed = member.who == time_event_reset;
            if (!timed && !stands.enabled(member.who, in)) continue;
            assign(single_, x);
            const Mode next = reset(member, in, single_);
            for (std::size_t c = 0; c < size_of(before); ++c) {
                member.increments[c].add(at(single_, c) - at(x, c));
            }
            if (k != order.front() && !timed && !stands.moves(member.who, in, x)) continue;
            assign(x, single_);
            in = next;
        }
        for (std::size_t c = 0; c < size_of(before); ++c) ends_[c].add(at(x, c));
        modes_differ_ = modes_differ_ || (orders_ > 0 && in != last_mode_);
        last_mode_ = in;
        ++orders_;
    }

    /// Gives the components of the group their values, or notes a conflict. Returns whether each
    /// member adds the same in every place, to every component.
    bool settle(const X& before)
    {
        bool additive = true;
        double rounding = 0;
        for (const std::size_t k : group_) rounding = std::max(rounding, members_[k].rounding);
        for (std::size_t c = 0; c < size_of(before); ++c) {
            bool each_is_one = true;
            added_.clear();
            for (const std::size_t k : group_) {
                const Range& added = members_[k].increments[c];
                if (added.most < added.least) continue;
                each_is_one = each_is_one && added.is_one(members_[k].rounding);
                added_.push_back(added.least);
            }
            if (each_is_one) {
                // The terms are sorted, so that the order in which guards are declared does not
                // matter.
                std::sort(added_.begin(), added_.end());
                double value = at(before, c);
                for (const double added : added_) value += added;
                if (std::any_of(added_.begin(), added_.end(), [](double d) { return d != 0; })) {
                    at(after_, c) = value;
                }
                continue;
            }
            additive = false;
            if (ends_[c].is_one(rounding)) {
                at(after_, c) = ends_[c].least;
            } else {
                note_conflict();
            }
        }
        if (modes_differ_) note_conflict();
        if (last_mode_ != first_mode_) mode_ = last_mode_;
        return additive && !modes_differ_;
    }

    void note_conflict()
    {
        if (conflict_.first != no_guard) return;
        conflict_ = {members_[group_[0]].who, members_[group_[1]].who};
    }

    /// Names the first two members whose order matters.
    template <class Reset, class Stands>
    void name_pair(const X& before, Mode mode, const Reset& reset, const Stands& stands)
    {
        const auto end_of = [&](std::size_t first, std::size_t second, X& x) {
            ends_.assign(size_of(before), {});
            const std::size_t order[] = {first, second};
            take_in_order(order, before, mode, reset, stands);
            for (std::size_t c = 0; c < size_of(before); ++c) at(x, c) = ends_[c].least;
            return last_mode_;
        };
        X one = before, other = before;
        for (std::size_t i = 0; i < group_.size(); ++i) {
            for (std::size_t j = i + 1; j < group_.size(); ++j) {
                const Mode a = end_of(group_[i], group_[j], one);
                const Mode b = end_of(group_[j], group_[i], other);
                const double rounding =
                    std::max(members_[group_[i]].rounding, members_[group_[j]].rounding);
                bool same = a == b;
                for (std::size_t c = 0; c < size_of(before); ++c) {
                    same = same && std::fabs(at(one, c) - at(other, c)) <= rounding;
                }
                if (same) continue;
                conflict_ = {members_[group_[i]].who, members_[group_[j]].who};
                return;
            }
        }
    }

    void note_rounding(Member& member, const X& before) const
    {
        double size = 0;
        for (std::size_t c = 0; c < size_of(before); ++c) {
            if (!differs(member.result, before, c)) continue;
            const double from = at(before, c), to = at(member.result, c);
            size = std::max({size, std::fabs(from), std::fabs(to), std::fabs(to - from)});
        }
        member.rounding = tolerances::of_sum * size;
    }

    [[nodiscard]] static std::size_t size_of(const X& x) noexcept
    {
        return static_cast<std::size_t>(x.size());
    }
    [[nodiscard]] static double& at(X& x, std::size_t c) noexcept
    {
        return x[static_cast<decltype(x.size())>(c)];
    }
    [[nodiscard]] static double at(const X& x, std::size_t c) noexcept
    {
        return x[static_cast<decltype(x.size())>(c)];
    }
    [[nodiscard]] static bool differs(const X& a, const X& b, std::size_t c) noexcept
    {
        return at(a, c) != at(b, c);
    }

    X after_;
    X single_;
    Mode mode_ = 0;
    std::pair<std::size_t, std::size_t> conflict_{no_guard, no_guard};
    bool stops_ = false;       ///< a reset has ended the run
    bool asks_again_ = false;  ///< resets that have been asked before
    std::size_t stopper_ = no_guard;
    std::string reason_;
    X along_;  ///< state between the resets of one order
    std::vector<Member> all_members_;
    std::span<Member> members_;  ///< of a set of several
    std::vector<std::size_t> group_;
    std::vector<double> added_;            ///< by each of the group to one component
    std::vector<Range> ends_;              ///< of every order
    Mode first_mode_ = 0, last_mode_ = 0;  ///< at the start, and at the end of the last order
    bool modes_differ_ = false;
    std::size_t orders_ = 0;
};

}  // namespace ricochet::detail
