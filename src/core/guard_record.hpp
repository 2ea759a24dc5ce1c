// Records of the guards of a system, one for each.
#pragma once

#include <array>
#include <boost/container/small_vector.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "core/lost_row.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/finding.hpp"
#include "ricochet/guard.hpp"
#include "shrinking_intervals.hpp"

namespace ricochet::detail {

/// Storage of one T, for systems that have a single guard.
template <class T>
class ForTheGuard : public std::array<T, 1> {
public:
    explicit ForTheGuard(std::size_t /*guards*/ = 1) : std::array<T, 1>{} {}
    void resize(std::size_t /*guards*/) noexcept {}
    void swap(ForTheGuard& other) noexcept { std::swap((*this)[0], other[0]); }
    /// Returns the only element for any index, so that the compiler need not know the index.
    [[nodiscard]] T& operator[](std::size_t /*guard*/) noexcept { return this->front(); }
    [[nodiscard]] const T& operator[](std::size_t /*guard*/) const noexcept
    {
        return this->front();
    }
};

/// One T for every guard, without an allocation if there are few. Most systems have one guard,
/// and for them the loop is compiled with that number as a constant.
inline constexpr std::size_t few_guards = 8;
template <class T, bool single>
using PerGuard =
    std::conditional_t<single, ForTheGuard<T>, boost::container::small_vector<T, few_guards>>;

/// List with room for as many elements as there are guards.
template <class T, bool single>
class GuardList {
public:
    explicit GuardList(std::size_t guards) : items_(guards) {}
    void clear() noexcept { size_ = 0; }
    void shrink(std::size_t size) noexcept { size_ = size; }
    void push_back(const T& item) noexcept { items_[size_++] = item; }
    [[nodiscard]] T& add() noexcept { return items_[size_++]; }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
    [[nodiscard]] T& operator[](std::size_t i) noexcept { return items_[i]; }
    [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return items_[i]; }
    [[nodiscard]] T* begin() noexcept { return items_.data(); }
    [[nodiscard]] T* end() noexcept { return items_.data() + size_; }
    [[nodiscard]] const T* begin() const noexcept { return items_.data(); }
    [[nodiscard]] const T* end() const noexcept { return items_.data() + size_; }
    [[nodiscard]] std::span<const T> span() const noexcept { return {items_.data(), size_}; }

private:
    PerGuard<T, single> items_;
    std::size_t size_ = 0;
};

/// What is found of a guard at a set before its resets are called, for use after them: no function
/// is called any more in a mode that has been left.
struct NotedAtSet {
    double tolerance = 0;  ///< event tolerance
    double value = 0;      ///< |g| where it fired, if the tolerance is estimated
    double slope = 0;      ///< [1/s] of an excursion that ends here, and
    double rounding = 0;   ///< the change of the guard by rounding, where they have to be known
    bool vetoed = false;   ///< `enabled` rejects an event here
};

/// How often something has happened at the last instant at which it did.
struct TimesAtInstant {
    std::uint64_t instant = 0;
    std::uint32_t times = 0;
};

/// The last event of a guard.
struct PastEvent {
    double t = std::numeric_limits<double>::quiet_NaN();  ///< [s]
    Side side = Side::plateau;                            ///< that it left then
    bool returned = false;  ///< it has come back to that side from the other one
    bool jumped = false;    ///< it was a jump
    /// The arming of all guards by which it has been recorded.
    std::uint64_t recorded_in = std::numeric_limits<std::uint64_t>::max();
};

/// How a guard leaves its surface after its last reset.
struct Departure {
    bool turned = false;  ///< it has been sent back
    double rate = 0;      ///< [1/s]
    /// [s] scale over which the rate was taken; NaN if it is not one of the current state.
    double over = std::numeric_limits<double>::quiet_NaN();
};

/// How far a guard has been examined in the current step.
struct Examined {
    double from = 0;            ///< [s] offset up to which it has been
    double slope = 0;           ///< [1/s] its rate there; NaN if it is not known
    Side next = Side::plateau;  ///< its side at the end of the step, if it stands
    bool dips = false;          ///< its bounds show an event
};

/// State of a guard besides its values.
struct GuardRecord {
    GuardInfo info;
    bool acting = false;  ///< has a reset or may end the run; else events are only recorded
    bool enabled = true;
    bool newly_enabled = false;
    bool deferred = false;  ///< its check is deferred: nothing of this step is known of it
    Side side = Side::plateau;
    Side awaited = Side::plateau;  ///< on a plateau: leaving it away from here is an event
    bool departs = false;          ///< the current smooth phase started at its event, or enabled it
    bool fired = false;
    bool again = false;  ///< it has returned inside the window of its last event
    /// Event tolerance: |g| where it fired, up to which it counts as being on its surface.
    double tolerance = 0;
    bool estimated = false;  ///< the tolerance is the error of location, not a value of the guard
    bool armed_beyond = false;  ///< where it was armed at the start, or by a mode
    bool armed_on = false;      ///< the last time on its surface, moving beyond
    Examined examined;
    NotedAtSet noted;
    Departure departure;
    PastEvent last;
    std::uint64_t events = 0;
    TimesAtInstant here;  ///< events at the start of a step
    ShrinkingIntervals intervals;
    Excursions excursions;
};

[[nodiscard]] constexpr double sign_of(Side side) noexcept
{
    return side == Side::above ? 1 : side == Side::below ? -1 : 0;
}

/// Whether checks are deferred. Without bounds or a gate, a deferring detector is the exact
/// detector that it wraps.
template <class X>
[[nodiscard]] bool defers(const DetectorTable<X>& detector, const SystemTable<X>& system)
{
    return detector.defers && system.guarded && (!detector.needs_bounds || system.bounded);
}

/// Requirements of a detector on all guards, of a system with bounds or without.
struct GuardRules {
    Screening screening = Screening::ends;
    bool uses_rates = false;
    bool defers = false;
    /// Whether the scale of a guard is its largest value so far: for detectors that do
    /// not ask for the rounding of the state, so that neighbouring steps agree on which minimum
    /// counts as a touch.
    bool remembers = false;
    /// Whether brackets are not narrowed below the rounding of the sizes with which smooth phases
    /// started, as for guards with declared bounds, which may be expensive.
    bool coarse = false;
    /// Whether guards declare bounds: then these sizes are kept for any detector.
    bool bounded = false;
    /// Whether guards can be examined inside a step.
    bool checks_inside = false;
    Suspects* suspects = nullptr;

    /// Whether sizes are kept from step to step.
    [[nodiscard]] bool keeps_sizes() const noexcept { return remembers || bounded; }

    template <class X>
    [[nodiscard]] static GuardRules of(const DetectorTable<X>& detector, const SystemAt<X>& system)
    {
        const bool bounded = system->bounded;
        return {.screening = detector.screening,
                .uses_rates = detector.uses_rates,
                .defers = detail::defers(detector, *system.operator->()),
                .remembers = detector.uses_rates && !detector.checks_inside && !bounded,
                .coarse = detector.uses_rates && bounded,
                .bounded = bounded,
                .checks_inside = detector.checks_inside && !bounded,
                .suspects = detector.suspects};
    }
};

}  // namespace ricochet::detail
