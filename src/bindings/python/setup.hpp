// The parts of a run, made from a request of Python.
#pragma once

#include <memory>

#include "request.hpp"
#include "ricochet/detail/core.hpp"
#include "source.hpp"

namespace ricochet::python {

/// A setup together with its detector, where the setup has one of its own.
struct OwnedSetup {
    detail::RunSetup<State> setup;
    std::shared_ptr<const void> detector;
};

/// Opens the door of a run.
/// @throws std::invalid_argument for a start, or a method, that the source cannot serve.
[[nodiscard]] std::unique_ptr<RunDoor> open_for(const Request& request, const Source& source,
                                                const State& x0);

/// The setup of a run of `source` at `door`, which must outlive it.
/// @throws std::invalid_argument for an unknown detector or locator, or a gate of a kind that the
/// detector cannot use.
[[nodiscard]] OwnedSetup setup_for(const Request& request, const Source& source, RunDoor& door);

/// The same for the detectors that ask a gate. False: the request names another one.
[[nodiscard]] bool detect_by_gate(OwnedSetup& out, const Request& request, const Source& source,
                                  RunDoor& door);

}  // namespace ricochet::python
