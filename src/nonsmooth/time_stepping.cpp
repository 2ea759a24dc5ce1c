#include "ricochet/nonsmooth/time_stepping.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

#include "../checks/require.hpp"

namespace ricochet {

void validate(const TimeSteppingOptions& options)
{
    constexpr std::string_view who = "TimeSteppingOptions";
    detail::require_positive(who, "step", options.step);
    if (!std::isfinite(options.t_start) || !(options.t_end >= options.t_start) ||
        !std::isfinite(options.t_end)) {
        detail::Refuse{who}(fmt::format("t_end must be finite and not before t_start {}, got {}",
                                        options.t_start, options.t_end));
    }
}

namespace detail {

void check_contact(int contact, double restitution, double friction, double gap, double room)
{
    const std::string who = fmt::format("contact {}", contact);
    const Require require{who};
    require(restitution >= 0 && restitution <= 1, "restitution must lie in [0, 1]", restitution);
    require(friction >= 0 && std::isfinite(friction), "friction must be finite, zero or positive",
            friction);
    if (std::isnan(gap)) Refuse{who}("the gap of the initial state is not a number");
    if (!(gap >= -room)) {
        throw std::invalid_argument(fmt::format(
            "the initial state is inside an obstacle: the gap of contact {} is {}", contact, gap));
    }
}

void check_direction(int contact, const Eigen::VectorXd& row, const Eigen::VectorXd& q,
                     const std::function<double(const Eigen::VectorXd&)>& gap)
{
    // A difference over s is wrong by s times the curvature of the gap, and by rounding over s: a
    // hundredth is met over one of these lengths unless the gap bends within 1e-10 of |q|.
    constexpr double agreement = 0.01;
    if (!row.allFinite()) return;  // the run reports it
    const double size = 1 + q.lpNorm<Eigen::Infinity>();
    const double here = gap(q);
    Eigen::VectorXd seen;
    for (const double relative : {1e-6, 1e-3, 1e-9, 1e-12}) {
        Eigen::VectorXd before = q, after = q;  // one-sided slopes, which differ at a kink
        for (Eigen::Index i = 0; i < q.size(); ++i) {
            Eigen::VectorXd at = q;
            at[i] = q[i] - relative * size;
            before[i] = (here - gap(at)) / (q[i] - at[i]);
            at[i] = q[i] + relative * size;
            after[i] = (gap(at) - here) / (at[i] - q[i]);
        }
        if (!before.allFinite() || !after.allFinite()) continue;
        const Eigen::ArrayXd low = before.cwiseMin(after);
        const Eigen::ArrayXd high = before.cwiseMax(after);
        const double off =
            agreement * std::max({row.lpNorm<Eigen::Infinity>(), before.lpNorm<Eigen::Infinity>(),
                                  after.lpNorm<Eigen::Infinity>()});
        if ((row.array() >= low - off && row.array() <= high + off).all()) return;
        if (seen.size() == 0) seen = (before + after) / 2;
    }
    if (seen.size() == 0) return;  // the gap has no slope there
    throw std::invalid_argument(
        fmt::format("contact {}: the first row of its directions must be the gradient of its gap, "
                    "about ({:.3g}), got ({:.3g})",
                    contact, fmt::join(seen, ", "), fmt::join(row, ", ")));
}

}  // namespace detail

}  // namespace ricochet
