// Internal: the declarations of this header may change without notice.
//
// The event loop, as it is compiled in the library.
#pragma once

#include <array>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/meter.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/options.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// All parts of a run except its start and its options. Objects that it points to must outlive it.
template <class X>
struct RunBindings {
    const SystemTable<X>* system = nullptr;
    void* adapter = nullptr;
    const StepKernel<X>* kernel = nullptr;
    QuietKernel<X> quiet = nullptr;  ///< with flow and guard inlined; may be null
    bool quiet_on_series = false;    ///< it clears guards by their power series
    bool error_controlled = true;
    bool cancels_by_itself = false;  ///< `Options::cancelled` is not the caller's
    bool method_by_name = false;
    int order = 0;              ///< order chosen for the method, if it has a choice
    const char* stepping = "";  ///< type of the stepping, as the compiler writes it
    DetectorTable<X> detector;
    const void* detecting = nullptr;
    LocatorTable locator;
    const void* locating = nullptr;

    /// Adds an event to the records of the caller, in states of its own type; null: the loop keeps
    /// them.
    void (*add_event)(void* events, const Event<X>& event) = nullptr;
    void* events = nullptr;
};

/// A run in progress; see `Simulation`.
template <class X>
class AnyLoop {
public:
    AnyLoop() = default;
    AnyLoop(const AnyLoop&) = delete;
    AnyLoop& operator=(const AnyLoop&) = delete;
    virtual ~AnyLoop() = default;

    [[nodiscard]] virtual double t() const noexcept = 0;
    [[nodiscard]] virtual const X& x() const noexcept = 0;
    [[nodiscard]] virtual Mode mode() const noexcept = 0;
    /// Reactions at t; may call functions of the system.
    [[nodiscard]] virtual std::vector<double> reaction() const = 0;
    [[nodiscard]] virtual bool ended() const noexcept = 0;
    [[nodiscard]] virtual const Run<X>& run() const noexcept = 0;
    [[nodiscard]] virtual MeterReading meter() const = 0;
    virtual bool step() = 0;
    virtual bool advance() = 0;
    /// Skips everything that `advance` has not shown yet.
    virtual void show_all() noexcept = 0;
    /// Number of events, of those recorded, that `advance` has shown.
    [[nodiscard]] virtual std::size_t shown_events() const noexcept = 0;
    /// Takes one step. With `look_ahead` the step may stay tentative until a later check closes its
    /// interval.
    virtual void advance_once(bool look_ahead) = 0;
    /// Takes the fastest way to the end, which `step` and `advance` do not take.
    virtual void run_to_end() = 0;
    [[nodiscard]] virtual Run<X> take() = 0;
    [[nodiscard]] virtual Run<X> finish() = 0;
    /// Result so far, with its time, state and counts up to date.
    virtual const Run<X>& bring_up_to_date() = 0;
    /// Allows a run that was cancelled to continue.
    virtual void go_on() noexcept = 0;
    [[nodiscard]] virtual Snapshot save() = 0;
    virtual void restore(const Snapshot& snapshot) = 0;
    virtual void restart(double t, const X& x, Mode mode) = 0;
    virtual void extend(double t_end) = 0;
};

/// Keeps a copy of `setup`. @throws std::invalid_argument as `Simulation` does
template <class X>
[[nodiscard]] Owner<AnyLoop<X>> make_loop(const RunBindings<X>& setup, const X& x0,
                                          const Options& options);

/// Computes a whole run, with the loop on the stack.
template <class X>
[[nodiscard]] Run<X> run_whole(const RunBindings<X>& setup, const X& x0, const Options& options);

/// The same, with the result shown to `take` where it is, and not moved.
template <class X>
void run_whole(const RunBindings<X>& setup, const X& x0, const Options& options,
               void (*take)(void* out, const Run<X>& run), void* out);

}  // namespace ricochet::detail
