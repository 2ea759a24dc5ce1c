// Error of a run with set-valued phases, from two more runs with shorter steps.
//
// Steps across changes of branch, and Moreau's steps, are of order 1: their errors are not those of
// any tolerance. Runs with shorter steps tell them, however they arise and whatever they grow to.
// One with half the steps alone is not enough: its steps end where those of the run do, and may
// miss a change by as much.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ricochet/run.hpp"

namespace ricochet {

/// The larger of |x - x_k| / (1 - k) in every component, where x_k has k = 0.5 or 0.37 of the
/// steps: the error of a method of order 1, and up to one and a half times that of order 2.
/// Infinite where a run ends for another reason or is cut short, and at sample times that it does
/// not reach.
template <class State>
struct EstimatedError {
    State end;                   ///< of the state at the end
    std::vector<State> samples;  ///< of the states at the sample times
};

namespace detail {

/// Raises an error to the difference from another state, or to infinity where there is none.
template <class Vector>
void raise(Vector& error, const Vector& x, const Vector* other, double factor)
{
    for (std::size_t i = 0; i < static_cast<std::size_t>(x.size()); ++i) {
        const auto k = static_cast<decltype(x.size())>(i);  // Eigen counts with signs
        const double found =
            other ? factor * std::abs(x[k] - (*other)[k]) : std::numeric_limits<double>::infinity();
        error[k] = std::max(error[k], found);
    }
}

/// @param repeat  runs with a part of the steps
template <class X, class Repeat>
[[nodiscard]] EstimatedError<X> estimated_error(const Run<X>& whole, const Repeat& repeat)
{
    const auto zero = [](X x) {
        for (auto& component : x) component = 0;
        return x;
    };
    EstimatedError<X> out{zero(whole.x), {}};
    for (const X& x : whole.trajectory.x) out.samples.push_back(zero(x));
    const bool is_cut = whole.outcome == Outcome::step_limit ||
                        whole.outcome == Outcome::cancelled || whole.outcome == Outcome::stalled;
    for (const double part : {0.5, 0.37}) {
        const Run<X> other = repeat(part);
        const double factor = 1 / (1 - part);
        const bool ends_alike = whole.outcome == other.outcome && !is_cut;
        raise(out.end, whole.x, ends_alike ? &other.x : nullptr, factor);
        const std::vector<X>&samples = whole.trajectory.x, &others = other.trajectory.x;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            raise(out.samples[k], samples[k], k < others.size() ? &others[k] : nullptr, factor);
        }
    }
    return out;
}

}  // namespace detail

}  // namespace ricochet
