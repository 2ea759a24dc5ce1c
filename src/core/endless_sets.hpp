// Sets of events that follow each other at one instant without an end.
#pragma once

#include <algorithm>
#include <bit>
#include <boost/container/small_vector.hpp>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "core/guard_record.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/components.hpp"

namespace ricochet::detail {

/// Counts the sets of an instant, and recognises that they have no end: set, mode and state repeat,
/// or a guard or a timer has its thousandth event there.
template <class X>
class EndlessSets {
public:
    explicit EndlessSets(const X& like) : x_(like) {}

    void begin_instant() noexcept
    {
        level_ = 0;
        ++instant_;
    }
    /// Number of instants so far.
    [[nodiscard]] std::uint64_t instants() const noexcept { return instant_; }
    /// Number of sets so far at this instant, without the first.
    [[nodiscard]] std::uint64_t level() const noexcept { return level_; }

    /// Counts one more event of a guard or a timer at this instant; true if it is one too many.
    [[nodiscard]] bool exceeds(TimesAtInstant& events) const noexcept
    {
        assert(events.instant <= instant_);
        events.times = std::exchange(events.instant, instant_) == instant_ ? events.times + 1 : 1;
        return events.times == tolerances::events_at_instant;
    }

    /// Whether the next set, with the mode and the state before it, repeats one of this instant.
    [[nodiscard]] bool repeats(const X& x, Mode mode, std::span<const std::size_t> fired)
    {
        // Finds a loop of any length: a set is compared with the last one whose number is a power
        // of two.
        const bool known = level_ > 0 && mode == mode_ &&
                           std::equal(fired_.begin(), fired_.end(), fired.begin(), fired.end()) &&
                           same_state(x, x_);
        if (known) return true;
        if (std::has_single_bit(++level_)) {
            x_ = x;
            mode_ = mode;
            fired_.assign(fired.begin(), fired.end());
        }
        return false;
    }

private:
    std::uint64_t level_ = 0, instant_ = 0;
    X x_;
    Mode mode_ = 0;
    boost::container::small_vector<std::size_t, 8> fired_{};
};

}  // namespace ricochet::detail
