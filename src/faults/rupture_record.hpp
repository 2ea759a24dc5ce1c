// Record of a rupture while it runs.
#pragma once

#include <algorithm>
#include <cmath>

#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::detail {

/// The value of `RuptureOptions::polynomial_bound`, or its default.
[[nodiscard]] double polynomial_bound(const StrikeSlipFault& fault, const RuptureOptions& options);

/// Fields nondimensional.
struct FaultFields {
    Eigen::VectorXd slip;      ///< d
    Eigen::VectorXd velocity;  ///< v
    Eigen::VectorXd path;      ///< s
};

struct MeanMotion {
    double slip = 0;  ///< path
    double velocity = 0;
};

/// Peak and arrest of the mean velocity, its history and snapshots.
class RuptureRecord {
public:
    RuptureRecord(const StrikeSlipFault& fault, const RuptureOptions& options, Rupture& out)
        : fault_(fault), options_(options), out_(out)
    {
        const Eigen::Index n = fault.size();
        out_.slip = out_.velocity = out_.peak_velocity_of = out_.arrival = Eigen::VectorXd::Zero(n);
        out_.times = {0.0};
        out_.mean_slips = {0.0};
        out_.mean_velocities = {0.0};
    }

    /// Records a step from t over h, both nondimensional. `mean_at(theta)` is the mean motion at t
    /// + theta h, `fields_at(theta, fields)` is the motion.
    template <class MeanAt, class FieldsAt>
    void add(double t, double h, MeanAt&& mean_at, FieldsAt&& fields_at)
    {
        constexpr int parts = 4;
        double velocity[parts + 1];
        velocity[0] = out_.mean_velocities.back() / fault_.velocity_unit();
        int fastest = 0;
        for (int i = 1; i <= parts; ++i) {
            const double theta = static_cast<double>(i) / parts;
            const MeanMotion mean = mean_at(theta);
            velocity[i] = mean.velocity;
            if (velocity[i] > velocity[fastest]) fastest = i;
            out_.times.push_back(seconds(t + theta * h));
            out_.mean_slips.push_back(mean.slip * fault_.slip_unit());
            out_.mean_velocities.push_back(mean.velocity * fault_.velocity_unit());
        }
        const double from = std::max(0, fastest - 1) / static_cast<double>(parts);
        const double to = std::min(parts, fastest + 1) / static_cast<double>(parts);
        if (velocity[fastest] > 0.99 * peak_) refine_peak(t, h, from, to, mean_at);
        find_arrest(t, h, velocity[parts], mean_at);
        while (next_ < options_.snapshot_times.size() &&
               options_.snapshot_times[next_] <= seconds(t + h)) {
            const double theta = (options_.snapshot_times[next_] / fault_.time_unit() - t) / h;
            fields_at(std::clamp(theta, 0.0, 1.0), fields_);
            snapshot(options_.snapshot_times[next_++], fields_);
        }
    }

    /// Records the fields at the end of a step.
    void note_fastest(double t, const FaultFields& fields)
    {
        for (Eigen::Index i = 0; i < fields.velocity.size(); ++i) {
            const double v = std::abs(fields.velocity[i]) * fault_.velocity_unit();
            if (v > out_.peak_velocity_of[i]) {
                out_.peak_velocity_of[i] = v;
                out_.arrival[i] = seconds(t);
            }
        }
    }

    /// @param rest_time  nondimensional; NaN: something moves
    /// @param located    whether it is more accurate than the ends of steps
    void finish(double t, double rest_time, bool located, const FaultFields& fields)
    {
        const bool rests = !std::isnan(rest_time);
        // The end in seconds may differ by rounding from the end of the last step.
        const bool over = rests || t == options_.t_end / fault_.time_unit();
        out_.t = over ? options_.t_end : seconds(t);
        out_.slip = fields.path * fault_.slip_unit();
        out_.velocity = fields.velocity * fault_.velocity_unit();
        out_.mean_slip = fault_.mean(out_.slip);
        out_.rest_time = seconds(rest_time);
        if (rests && located && fault_.size() == 1) out_.arrest_time = out_.rest_time;
        if (rests && out_.times.back() < options_.t_end) {
            out_.times.push_back(options_.t_end);
            out_.mean_slips.push_back(out_.mean_slip);
            out_.mean_velocities.push_back(0.0);
        }
        while (over && next_ < options_.snapshot_times.size()) {
            snapshot(options_.snapshot_times[next_++], fields);
        }
    }

    /// The largest mean velocity so far, nondimensional.
    [[nodiscard]] double peak() const noexcept { return peak_; }

private:
    [[nodiscard]] double seconds(double t) const { return t * fault_.time_unit(); }

    void snapshot(double t, const FaultFields& fields)
    {
        out_.snapshots.push_back({.t = t,
                                  .slip = fields.path * fault_.slip_unit(),
                                  .velocity = fields.velocity * fault_.velocity_unit()});
    }

    /// Golden section search; the mean velocity has one maximum in a quarter of a step or two.
    template <class MeanAt>
    void refine_peak(double t, double h, double from, double to, MeanAt&& mean_at)
    {
        constexpr double golden = 0.6180339887498949;
        double a = to - golden * (to - from);
        double b = from + golden * (to - from);
        double at_a = mean_at(a).velocity;
        double at_b = mean_at(b).velocity;
        while (to - from > 1e-7) {
            if (at_a >= at_b) {
                to = b, b = a, at_b = at_a;
                a = to - golden * (to - from);
                at_a = mean_at(a).velocity;
            } else {
                from = a, a = b, at_a = at_b;
                b = from + golden * (to - from);
                at_b = mean_at(b).velocity;
            }
        }
        const double best = at_a >= at_b ? a : b;
        const double value = std::max(at_a, at_b);
        if (value <= peak_) return;
        peak_ = value;
        out_.peak_velocity = value * fault_.velocity_unit();
        out_.peak_time = seconds(t + best * h);
    }

    template <class MeanAt>
    void find_arrest(double t, double h, double at_end, MeanAt&& mean_at)
    {
        const double slow = 1e-3 * peak_;
        if (std::abs(at_end) >= slow) {
            out_.arrest_time = std::numeric_limits<double>::quiet_NaN();
            return;
        }
        if (!std::isnan(out_.arrest_time)) return;
        double from = 0;
        double to = 1;
        for (int i = 0; i < 40; ++i) {
            const double middle = 0.5 * (from + to);
            (std::abs(mean_at(middle).velocity) < slow ? to : from) = middle;
        }
        out_.arrest_time = seconds(t + to * h);
    }

    const StrikeSlipFault& fault_;
    const RuptureOptions& options_;
    Rupture& out_;
    FaultFields fields_;
    double peak_ = 0;
    std::size_t next_ = 0;
};

}  // namespace ricochet::detail
