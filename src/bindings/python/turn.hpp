// Exclusive use of an object by one call.
#pragma once

#include <atomic>
#include <stdexcept>
#include <string>

namespace ricochet::python {

/// Marks an object as in use until the end of a call.
class Turn {
public:
    /// @throws std::runtime_error if another call, of another thread or around this one, holds it.
    Turn(std::atomic<bool>& in_use, const char* who) : in_use_(in_use)
    {
        if (in_use_.exchange(true)) {
            throw std::runtime_error(
                std::string(who) +
                ": found in use, by another thread or by the callback that asks; expected one "
                "caller at a time");
        }
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    ~Turn() { in_use_ = false; }

private:
    std::atomic<bool>& in_use_;
};

}  // namespace ricochet::python
