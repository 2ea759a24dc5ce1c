// The parts of a run, made from a request of Python.
#pragma once

#include <memory>
#include <vector>

#include "request.hpp"
#include "ricochet/detail/core.hpp"
#include "source.hpp"

namespace ricochet::python {

/// A setup together with its detector, where the setup has one of its own.
struct OwnedSetup {
    detail::RunBindings<State> setup;
    std::shared_ptr<const void> detector;
};

/// The setup of a run of `source` at `adapter`, which must outlive it.
/// @throws std::invalid_argument for an unknown detector or locator, or a gate of a kind that the
/// detector cannot use.
[[nodiscard]] OwnedSetup setup_for(const Request& request, const Source& source,
                                   RunAdapter& adapter);

/// The loop of a run, which has phases if its system has set-valued motion.
class RunLoop {
public:
    RunLoop() = default;
    /// @throws std::invalid_argument as `make_loop`, and for options that no run with set-valued
    /// motion has
    RunLoop(const Request& request, const OwnedSetup& setup, RunAdapter& adapter, const State& x0);

    [[nodiscard]] explicit operator bool() const noexcept { return loop_ != nullptr; }
    [[nodiscard]] detail::AnyLoop<State>& operator*() const noexcept { return *loop_; }
    [[nodiscard]] detail::AnyLoop<State>* operator->() const noexcept { return loop_; }

    [[nodiscard]] bool has_contacts() const noexcept { return contact_ != nullptr; }
    /// Reactions after the last step; of a mechanism the forces in it.
    [[nodiscard]] std::vector<double> reaction() const;
    /// The record of a run of this loop.
    [[nodiscard]] Record record(Run<State>&& run, RunAdapter& adapter,
                                const StepEnds<State>* steps = nullptr) const;

private:
    detail::Owner<detail::AnyLoop<State>> own_;
    detail::Owner<detail::PhasedRun<State>> phased_;
    std::unique_ptr<ContactLoop> contact_;
    detail::AnyLoop<State>* loop_ = nullptr;
};

/// The same for the detectors that ask a gate. False: the request names another one.
[[nodiscard]] bool detect_by_gate(OwnedSetup& out, const Request& request, const Source& source,
                                  RunAdapter& adapter);

}  // namespace ricochet::python
