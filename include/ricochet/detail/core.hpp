// Internal: what it declares may change without notice.
//
// The loop, as it is compiled in the library.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/meter.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/snapshot.hpp"

namespace ricochet::detail {

/// All that a run is made of besides its start and its options. What it points to must outlive it.
template <class X>
struct RunSetup {
    const SystemTable<X>* system = nullptr;
    void* door = nullptr;
    const StepKernel<X>* kernel = nullptr;
    QuietKernel<X> quiet = nullptr;  ///< null: every step is one of the loop
    bool error_controlled = true;
    bool method_by_name = false;
    const char* stepping = "";  ///< its type, as the compiler writes it
    DetectorTable<X> detector;
    const void* detecting = nullptr;
    LocatorTable locator;
    const void* locating = nullptr;
};

template <class X>
class AnyLoop;

/// A run in progress; see `Simulation`.
template <class X>
class Core {
public:
    Core(const RunSetup<X>& setup, const X& x0, const Options& options);
    ~Core();
    Core(Core&&) noexcept;
    Core& operator=(Core&&) noexcept;

    [[nodiscard]] double t() const noexcept;
    [[nodiscard]] const X& x() const noexcept;
    [[nodiscard]] Mode mode() const noexcept;
    [[nodiscard]] bool ended() const noexcept;
    [[nodiscard]] const Run<X>& run() const noexcept;
    [[nodiscard]] MeterReading meter() const;

    bool step();
    bool advance();
    /// Forgets what `advance` has not shown yet.
    void show_all();
    /// One step, which may be one of a stretch that is closed later if it looks ahead.
    void advance_once(bool look_ahead);
    [[nodiscard]] Run<X> take();
    [[nodiscard]] Run<X> finish();
    [[nodiscard]] Snapshot save();
    void restore(const Snapshot& snapshot);

private:
    std::unique_ptr<AnyLoop<X>> loop_;
};

/// A whole run, on the stack.
template <class X>
[[nodiscard]] Run<X> run_whole(const RunSetup<X>& setup, const X& x0, const Options& options);

}  // namespace ricochet::detail
