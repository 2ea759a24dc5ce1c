// Ties: guards whose crossings rounding alone parts from a time event, or from the end of the run.
#pragma once

#include "core/engine.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool EventEngine<X, single>::may_tie(std::size_t i) const noexcept
{
    const GuardRecord& record = guards_[i];
    if (!record.enabled || record.deferred || record.info.boolean) return false;
    if (!record.acting && !ends_at_.time_event) return false;
    if (!counts(record.side, record.info.crossing)) return false;
    return std::fabs(guards_.g1(i)) <= tolerances::by_rounding * guards_.scale(i, step_.h());
}

template <class X, bool single>
inline bool EventEngine<X, single>::has_ties()
{
    if (!ends_on_time()) return false;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        if (may_tie(i) && rate_of_tie(i) != 0) return true;
    }
    return false;
}

template <class X, bool single>
double EventEngine<X, single>::rate_of_tie(std::size_t i)
{
    const double sign = sign_of(guards_[i].side);
    const double h = step_.h();
    const double t = step_.time(h);
    const double g = guards_.g1(i);
    const auto rate_at = [&](double time, const X& x, const X& dxdt) {
        return guards_.view(i, step_.mode(), calls()).rate(time, x, dxdt, h);
    };
    const double rate = rate_at(t, step_.x1(), step_.rate1());
    const double slope = std::fabs(rate);
    if (!(sign * rate < 0) || !std::isfinite(slope)) return 0;
    const double ulps = tolerances::of_time * std::fabs(t);
    const double reach = std::max(ulps, rounding_of(i, step_.mode(), t, step_.x1()) / slope);
    if (!(std::fabs(g) <= 2 * slope * reach)) return 0;
    // A touch has a rate there that is itself no more than rounding.
    const double rate0 = rate_at(step_.time(0), step_.x0(), step_.rate0());
    const double g0 = guards_[i].examined.from > 0 ? g - h * (rate0 + rate) / 2 : guards_.g0(i);
    const double curvature = (6 * (g0 - g) / h + 2 * rate0 + 4 * rate) / h;
    double noise = std::fabs(curvature) * ulps;
    X near = step_.x1();
    for_each_component(near, [&](auto c) {
        const double kept = near[c];
        near[c] = kept * (1 + tolerances::of_state);
        if (near[c] != kept) noise += std::fabs(rate_at(t, near, step_.rate1()) - rate);
        near[c] = kept;
    });
    if (!(slope > noise)) return 0;
    const double value = sign * g;
    if (value <= 0) return -value <= slope * reach ? rate : 0;  // it has just crossed
    const double root = slope * slope - 2 * sign * curvature * value;
    return root >= 0 && 2 * value <= reach * (slope + std::sqrt(root)) ? rate : 0;
}

template <class X, bool single>
bool EventEngine<X, single>::add_ties(bool found)
{
    if (!ends_on_time()) return false;
    const double h = step_.h();
    bool at_end = false;
    if (found) {
        const double end = search_->at() + resolution_.window(step_.time(search_->at()));
        at_end = end >= h;
        if (!at_end) {
            if (!ends_at_.time_event) return false;
            for (const std::size_t i : search_->fired()) {
                if (!may_tie(i) || rate_of_tie(i) == 0) return false;
            }
            search_->stay_at_end(step_);
            at_end = true;
        }
    }
    bool added = false;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        if (!may_tie(i) || is_member(i)) continue;
        const double rate = rate_of_tie(i);
        if (rate == 0) continue;
        if (!added) search_->stay_at_end(step_);
        added = true;
        if (guards_[i].acting) search_->join_at_end(step_, i, guards_[i].side, rate);
    }
    return added;
}

template <class X, bool single>
void EventEngine<X, single>::note_ties()
{
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        GuardRecord& record = guards_[i];
        if (record.acting || !may_tie(i)) continue;
        const double rate = rate_of_tie(i);
        if (rate == 0) continue;
        record.noted.tolerance = 2 * std::fabs(guards_.g1(i));
        const Side side = record.side;
        if (counts_at_set(i)) {
            search_->note_at_set(guards_, i, side, rate);
        } else {
            guards_.arm(i, opposite(side));
        }
    }
}

}  // namespace ricochet::detail
