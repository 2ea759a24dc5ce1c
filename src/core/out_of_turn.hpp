// What a host may not do now.
#pragma once

#include <stdexcept>

namespace ricochet::detail {

/// A call to a monitor that is not the one it expects; nothing has changed.
class OutOfTurn : public std::logic_error {
public:
    using std::logic_error::logic_error;
};

}  // namespace ricochet::detail
