// The resets of guards that fired together, applied to one state.
//
// The reset of a single guard changes the state in place. Several resets all read the state
// before, and their changes are merged: two resets that give one component, or the mode, different
// values are in conflict, unless the system takes the whole set.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "core/guard_bank.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/hybrid/guard.hpp"

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
    explicit MergedResets(const X& like) : after_(like), single_(like) {}

    /// Applies the resets of the guards that fired, which all read the state `before`, and the
    /// reset of a time event. `bank` knows which guards have a reset.
    template <class Bank>
    void apply(const SystemAt<X>& system, const Bank& bank, const FiredSet& set, const X& before)
    {
        const auto& [fired, on_time, mode, t] = set;
        assign(after_, before);
        mode_ = mode;
        conflict_ = {no_guard, no_guard};
        if (fired.size() > 1 || on_time) {
            mode_writer_ = resizer_ = no_guard;
            writers_.assign(static_cast<std::size_t>(before.size()), no_guard);
        }
        if (system->reset_set) {
            std::size_t resetting = 0;
            for (const std::size_t i : fired) resetting += bank[i].info.resets;
            if (resetting > 0) {
                mode_ =
                    system->reset_set(system.door(), FiredGuards(fired, on_time), mode, t, after_);
                return;
            }
        } else if (system->reset) {
            if (fired.size() == 1 && !on_time) {
                const std::size_t i = fired[0];
                if (bank[i].info.resets) mode_ = system->reset(system.door(), i, mode, t, after_);
                return;
            }
            for (const std::size_t i : fired) {
                if (!bank[i].info.resets) continue;
                assign(single_, before);
                merge(i, system->reset(system.door(), i, mode, t, single_), mode, before);
            }
        }
        if (!on_time || !system->timed()) return;
        if (fired.empty()) {
            mode_ = system->time_reset(system.door(), mode, t, after_);
        } else {
            assign(single_, before);
            merge(time_event_reset, system->time_reset(system.door(), mode, t, single_), mode,
                  before);
        }
    }

    [[nodiscard]] X& after() noexcept { return after_; }
    [[nodiscard]] const X& after() const noexcept { return after_; }
    [[nodiscard]] X& scratch() noexcept { return single_; }
    [[nodiscard]] Mode mode() const noexcept { return mode_; }

    /// The two guards whose resets disagree, or a guard and `time_event_reset`; `no_guard` if none
    /// disagree.
    [[nodiscard]] const std::pair<std::size_t, std::size_t>& conflict() const noexcept
    {
        return conflict_;
    }

private:
    /// Merges the result of one reset, in `single_`, into `after_`.
    void merge(std::size_t writer, Mode mode_after, Mode mode, const X& before)
    {
        const auto claim = [&](std::size_t& owner, bool same) {
            if (owner != no_guard && !same) conflict_ = {owner, writer};
            owner = writer;
        };
        if (mode_after != mode) {
            claim(mode_writer_, mode_after == mode_);
            mode_ = mode_after;
        }
        if (resizer_ != no_guard || single_.size() != before.size()) {
            return merge_resized(writer, before);
        }
        for_each_component(before, [&](auto c) {
            if (single_[c] == before[c]) return;
            claim(writers_[static_cast<std::size_t>(c)], single_[c] == after_[c]);
            after_[c] = single_[c];
        });
    }

    /// Merges a reset that changes the dimension of the state. It writes all components, and is in
    /// conflict with any other reset that writes, unless they agree.
    void merge_resized(std::size_t writer, const X& before)
    {
        if (same_state(single_, before)) return;
        for (const std::size_t owner : writers_) {
            if (owner != no_guard) conflict_ = {owner, writer};
        }
        if (resizer_ != no_guard && !same_state(single_, after_)) conflict_ = {resizer_, writer};
        resizer_ = writer;
        assign(after_, single_);
    }

    X after_;
    X single_;
    Mode mode_ = 0;
    std::pair<std::size_t, std::size_t> conflict_{no_guard, no_guard};
    std::vector<std::size_t> writers_;
    std::size_t mode_writer_ = no_guard;
    std::size_t resizer_ = no_guard;
};

}  // namespace ricochet::detail
