// Failures of the C interface: a status, and a sentence for the thread.
#pragma once

#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "ricochet/ricochet.h"

namespace ricochet::c {

/// Refusal of a call, with the status that the call returns.
class Refusal : public std::runtime_error {
public:
    Refusal(rc_status status, const std::string& message)
        : std::runtime_error(message), status_(status)
    {
    }
    [[nodiscard]] rc_status status() const noexcept { return status_; }

private:
    rc_status status_;
};

/// Thrown when a callback returned a number other than 0. It is no std::exception, so that no
/// handler between the callback and the call that needed it catches it.
struct CallbackFailed {
    const char* callback = nullptr;  ///< its name; null: none has failed
    int code = 0;
    std::size_t guard = RC_NO_GUARD;
    double t = std::numeric_limits<double>::quiet_NaN();  ///< [s]
};

/// Sets the text that `rc_last_error` returns in this thread, truncated to the size of its buffer.
void set_message(std::string_view message) noexcept;

/// The status of the exception in flight, with its message set. To be called in a handler.
[[nodiscard]] rc_status status_of_exception() noexcept;

/// The last failure of a callback in this thread.
[[nodiscard]] CallbackFailed& last_failed_callback() noexcept;

/// Calls `body` and converts an exception to a status.
template <class Body>
[[nodiscard]] rc_status guarded(const Body& body) noexcept
{
    try {
        body();
        return RC_OK;
    } catch (...) {
        return status_of_exception();
    }
}

/// The same for a function that returns a value, with `failed` for failure.
template <class T, class Body>
[[nodiscard]] T guarded_value(T failed, const Body& body) noexcept
{
    try {
        return body();
    } catch (...) {
        static_cast<void>(status_of_exception());
        return failed;
    }
}

}  // namespace ricochet::c
