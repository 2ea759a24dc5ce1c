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
#include <type_traits>
#include <vector>

#include "ricochet/run.hpp"

namespace ricochet {

/// The larger of |x - x_k| / (1 - k) in every component, where x_k has k = 0.5 or 0.37 of the
/// steps: the error of a method of order 1, and up to one and a half times that of order 2.
/// Infinite where a run ends for another reason or is cut short, and at sample times that it does
/// not reach.
template <class Vector>
struct EstimatedError {
    Vector end;                   ///< of the state at the end
    std::vector<Vector> samples;  ///< of the states at the sample times
};

namespace detail {

/// What a run leaves to be compared.
template <class Vector>
struct ComparedRun {
    Outcome outcome;
    const Vector& end;
    const std::vector<Vector>& samples;
};

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

/// @param repeat    runs with a part of the steps
/// @param compared  `ComparedRun` of a run
template <class Run, class Repeat, class Compared>
[[nodiscard]] auto estimated_error(const Run& run, const Repeat& repeat, const Compared& compared)
{
    const auto whole = compared(run);
    const auto zero = [](auto x) {
        for (auto& component : x) component = 0;
        return x;
    };
    EstimatedError<std::decay_t<decltype(whole.end)>> out{zero(whole.end), {}};
    for (const auto& x : whole.samples) out.samples.push_back(zero(x));
    const bool is_cut = whole.outcome == Outcome::step_limit ||
                        whole.outcome == Outcome::cancelled || whole.outcome == Outcome::stalled;
    for (const double part : {0.5, 0.37}) {
        const Run again = repeat(part);
        const auto other = compared(again);
        const double factor = 1 / (1 - part);
        const bool ends_alike = whole.outcome == other.outcome && !is_cut;
        raise(out.end, whole.end, ends_alike ? &other.end : nullptr, factor);
        for (std::size_t k = 0; k < whole.samples.size(); ++k) {
            const bool reaches = k < other.samples.size();
            raise(out.samples[k], whole.samples[k], reaches ? &other.samples[k] : nullptr, factor);
        }
    }
    return out;
}

}  // namespace detail

}  // namespace ricochet
