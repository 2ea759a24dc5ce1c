#include "source.hpp"

namespace ricochet::python {

void SignalWatch::look() noexcept
{
    using std::chrono::milliseconds;
    const Clock::time_point now = Clock::now();
    if (looked_ == Clock::time_point{}) looked_ = handled_ = now;  // the first check
    // The number of calls is adapted so that they take a few milliseconds, from the time of the
    // last ones.
    const auto took = now - looked_;
    if (took < milliseconds(1)) {
        if (ticks_between_ < (1U << 20)) ticks_between_ *= 2;
    } else if (took > milliseconds(32)) {
        ticks_between_ = 1;
    } else if (took > milliseconds(4)) {
        ticks_between_ = (ticks_between_ + 1) / 2;
    }
    looked_ = now;
    ticks_left_ = ticks_between_;
    if (raised_ || now - handled_ < milliseconds(20)) return;
    handled_ = now;
    const PyGILState_STATE interpreter = PyGILState_Ensure();
    if (PyErr_CheckSignals() != 0) {
        raised_.emplace();
        cancelled_ = true;
    }
    PyGILState_Release(interpreter);
}

}  // namespace ricochet::python
