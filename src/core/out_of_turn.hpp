// Refusal of calls of a host that are out of turn.
#pragma once

#include <stdexcept>

namespace ricochet::detail {

/// Error for a call that the monitor does not expect now; nothing has changed.
class OutOfTurn : public std::logic_error {
public:
    using std::logic_error::logic_error;
};

}  // namespace ricochet::detail
