// The step in progress where it is that of a host: included by `core/step.hpp`.
#pragma once

#include "core/step.hpp"

namespace ricochet::detail {

template <class X>
inline void Step<X>::align_start() const
{
    StepState<X>& of = state_;
    of.host->interpolate(of.host->host, 0, of.at.data(), of.x0.size());
    assign(defect_, of.at);
    bool differs = false;
    for_components([&](auto i) {
        defect_[i] = of.x0[i] - of.at[i];
        differs = differs || defect_[i] != 0;
    });
    aligned_ = differs;
    const double t = std::fabs(of.start.value);
    straight_ = std::nextafter(t, std::numeric_limits<double>::infinity()) - t;
}

template <class X>
inline void Step<X>::interpolate_on_host(double s, X& x) const
{
    const HostStepTable& host = *state_.host;
    if (aligned_ && s < straight_) return detail::move(x, state_.x0, s, state_.rate0);
    host.interpolate(host.host, s, x.data(), state_.x0.size());
    if (!aligned_) return;
    const double left = 1 - s / host.h;
    for_components([&](auto i) { x[i] += left * defect_[i]; });
}

template <class X>
inline void Step<X>::restep_on_host(double s, X& x) const
{
    const HostStepTable& host = *state_.host;
    if (!host.restep) {
        interpolate_on_host(s, x);
    } else {
        host.restep(host.host, s, x.data(), state_.x0.size());
    }
    for (std::size_t i = 0; i < state_.x0.size(); ++i) {
        if (!std::isfinite(x[i])) throw_host_not_finite(i, x[i], s, host.restep != nullptr);
    }
}

template <class X>
inline void Step<X>::rate_on_host(double s, X& dxdt) const
{
    const HostStepTable& host = *state_.host;
    if (host.rate) return host.rate(host.host, s, dxdt.data(), state_.x0.size());
    const double reach = 1e-4 * host.h;
    const double from = std::max(0.0, s - reach);
    const double to = std::min(host.h, s + reach);
    X& at = state_.at;
    interpolate_on_host(from, at);
    interpolate_on_host(to, dxdt);
    for_components([&](auto i) { dxdt[i] = (dxdt[i] - at[i]) / (to - from); });
}

}  // namespace ricochet::detail
