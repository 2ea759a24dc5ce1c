// Rejection of calls that a host makes out of turn.
#pragma once

#include <stdexcept>

namespace ricochet::detail {

/// Error for a call that the monitor does not expect now; the call has changed nothing.
class OutOfTurn : public std::logic_error {
public:
    using std::logic_error::logic_error;
};

}  // namespace ricochet::detail
