// Internal: the declarations of this header may change without notice.
//
// The events in the steps of a host program, as they are compiled in the library.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "ricochet/cut.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/host_step.hpp"
#include "ricochet/options.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument because an array of a host does not have the size of the state.
[[noreturn]] void throw_wrong_size(std::size_t expected, std::size_t found);

/// See `EventMonitor`.
template <class X>
class AnyMonitor {
public:
    AnyMonitor() = default;
    AnyMonitor(const AnyMonitor&) = delete;
    AnyMonitor& operator=(const AnyMonitor&) = delete;
    virtual ~AnyMonitor() = default;

    /// @param dxdt  null: computed by the system's flow
    virtual Verdict start(const Instant& t, const X& x, const double* dxdt, Mode mode,
                          double scale) = 0;
    virtual Verdict examine(const HostStepTable& step) = 0;
    virtual Verdict resume(const double* dxdt, double scale) = 0;
    virtual Verdict resume(const X& after, Mode mode, const double* dxdt, double scale) = 0;
    virtual Verdict hold(double t) = 0;

    [[nodiscard]] virtual const Cut<X>& cut() const noexcept = 0;
    [[nodiscard]] virtual Instant t() const noexcept = 0;
    [[nodiscard]] virtual const X& x() const noexcept = 0;
    [[nodiscard]] virtual Mode mode() const noexcept = 0;
    [[nodiscard]] virtual double must_stop_at() const noexcept = 0;
    [[nodiscard]] virtual std::span<const std::size_t> held() const noexcept = 0;
    [[nodiscard]] virtual double quiet_until() const noexcept = 0;
    virtual void skip_to(const Instant& t, const X& x, const double* dxdt) = 0;
    [[nodiscard]] virtual Side side(std::size_t guard) const = 0;
    /// Records so far; their time and state are those of the last `start`.
    [[nodiscard]] virtual const Run<X>& run() noexcept = 0;
    virtual void clear_events() noexcept = 0;
    [[nodiscard]] virtual Snapshot save() = 0;
    virtual void restore(const Snapshot& snapshot) = 0;
};

/// Keeps a copy of `setup`, whose method is not needed.
/// @param cuts_at_all  guards without a reset cut the step, too
/// @throws std::invalid_argument as `EventMonitor` does
template <class X>
[[nodiscard]] Owner<AnyMonitor<X>> make_monitor(const RunBindings<X>& setup, const X& like,
                                                const Options& options, bool cuts_at_all);

}  // namespace ricochet::detail
