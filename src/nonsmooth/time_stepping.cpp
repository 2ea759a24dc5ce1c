#include "ricochet/nonsmooth/time_stepping.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "base/require.hpp"

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
    // A difference over s is wrong by s times the curvature of the gap, and by its rounding over s.
    // Where the two sides agree best both are small, unless the gap bends within 1e-10 of |q|.
    constexpr double agreement = 0.01;
    if (!row.allFinite()) return;  // the run reports it
    const double size = 1 + q.lpNorm<Eigen::Infinity>();
    const double here = gap(q);
    double least = std::numeric_limits<double>::infinity();
    Eigen::VectorXd low, high;  // slopes on both sides, which differ at a kink
    for (const double relative : {1e-3, 1e-6, 1e-9, 1e-12}) {
        Eigen::VectorXd before = q, after = q;
        for (Eigen::Index i = 0; i < q.size(); ++i) {
            Eigen::VectorXd at = q;
            at[i] = q[i] - relative * size;
            before[i] = (here - gap(at)) / (q[i] - at[i]);
            at[i] = q[i] + relative * size;
            after[i] = (gap(at) - here) / (at[i] - q[i]);
        }
        const double apart = (after - before).lpNorm<Eigen::Infinity>();
        if (!(apart <= least)) continue;
        least = apart;
        low = before.cwiseMin(after);
        high = before.cwiseMax(after);
    }
    if (low.size() == 0) return;  // the gap has no slope there
    const double off =
        agreement * std::max({row.lpNorm<Eigen::Infinity>(), low.lpNorm<Eigen::Infinity>(),
                              high.lpNorm<Eigen::Infinity>()});
    if ((row.array() >= low.array() - off && row.array() <= high.array() + off).all()) return;
    throw std::invalid_argument(
        fmt::format("contact {}: the first row of its directions must be the gradient of its gap, "
                    "about ({:.3g}), got ({:.3g})",
                    contact, fmt::join((low + high) / 2, ", "), fmt::join(row, ", ")));
}

void check_surface_rate(int contact, double rate, double t,
                        const std::function<double(double)>& gap)
{
    // The shorter difference halves the error of the longer one where the gap is smooth, and both
    // agree unless it is not, or rounding prevails.
    if (!std::isfinite(rate)) return;
    const double here = gap(t);
    double least = std::numeric_limits<double>::infinity(), slope = rate;
    for (const double length : {1e-3, 1e-6, 1e-9}) {
        const double h = length * (1 + std::fabs(t));
        const double far = (gap(t + h) - here) / h, near = (gap(t + h / 2) - here) / (h / 2);
        if (!(std::fabs(far - near) < least)) continue;
        least = std::fabs(far - near);
        slope = near;
    }
    if (std::fabs(rate - slope) <= 0.01 * std::max(std::fabs(rate), std::fabs(slope)) + 2 * least)
        return;
    throw std::invalid_argument(
        fmt::format("contact {}: surface_rates must begin with the rate of its gap where v = 0, "
                    "about {:.3g}, got {:.3g}",
                    contact, slope, rate));
}

DryFriction checked(const DryFriction& of)
{
    if (of.force >= 0 && std::isfinite(of.force)) return of;
    throw std::invalid_argument(
        fmt::format("coordinate {}: dry_friction must be finite, zero or positive, got {}",
                    of.coordinate, of.force));
}

}  // namespace detail

}  // namespace ricochet
