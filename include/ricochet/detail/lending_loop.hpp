// Internal: the declarations of this header may change without notice.
//
// A loop whose quiet steps are taken elsewhere, together with the quiet steps of other runs.
#pragma once

#include <memory>

#include "ricochet/detail/core.hpp"
#include "ricochet/detail/quiet_run.hpp"

namespace ricochet::detail {

template <class X>
class LendingLoop : public AnyLoop<X> {
public:
    /// Advances to a step that may be quiet; if `beyond`, to one after the current step. False: the
    /// run has ended.
    virtual bool go_to_quiet_steps(QuietRun& quiet, bool beyond) = 0;
    /// Takes over the result of quiet steps taken elsewhere, from the point where they began; the
    /// current step is the next one.
    virtual void take_back(const QuietRun& quiet) = 0;
    [[nodiscard]] virtual StepState<X>& lend() noexcept = 0;
};

/// Keeps a copy of `setup`, which has a quiet kernel on series. After an exception the run is over.
/// @throws std::invalid_argument as `Simulation` does
template <class X>
[[nodiscard]] std::unique_ptr<LendingLoop<X>> make_lending_loop(const RunBindings<X>& setup,
                                                                const X& x0,
                                                                const Options& options);

}  // namespace ricochet::detail
