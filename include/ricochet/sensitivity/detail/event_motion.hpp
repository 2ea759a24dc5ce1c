// Internal: the declarations of this header may change without notice.
//
// A motion with its derivatives at an event, and the derivatives of the event's time.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// A state at time t [s] and its derivatives there, one column for each direction.
template <class X>
struct Motion {
    Mode mode;
    double t;
    X x;
    Eigen::MatrixXd derivatives;
};

/// Data of the last event.
struct LastEvent {
    double t;             ///< [s] of the last event
    Eigen::VectorXd dt;   ///< its derivatives
    bool any;             ///< whether there has been an event
    double flight_start;  ///< [s] of the last event of a guard, or of the start
};

/// Derivatives of an event's time, where they exist.
struct EventTime {
    Undefined undefined = Undefined::no;
    Eigen::VectorXd dt;
};

/// Whether two sets of numbers are the same up to `relative` of the largest.
template <class A, class B>
[[nodiscard]] bool agree(const A& a, const B& b, double relative)
{
    if (a.size() != b.size()) return false;
    double size = 0;
    double difference = 0;
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(a.size()); ++i) {
        const auto k = static_cast<decltype(a.size())>(i);
        size = std::max({size, std::fabs(a[k]), std::fabs(b[k])});
        difference = std::max(difference, std::fabs(a[k] - b[k]));
    }
    return difference <= relative * size;
}

}  // namespace ricochet::detail
