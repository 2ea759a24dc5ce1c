#include "ricochet/faults/strike_slip_fault.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/require.hpp"
#include "fault_forces.hpp"
#include "fault_friction_stage.hpp"
#include "ricochet/faults/variational_step.hpp"
#include "rupture_record.hpp"

namespace ricochet {

namespace {

using detail::FaultFields;
using detail::MeanMotion;
using detail::RuptureRecord;
using Eigen::Index;
using Eigen::VectorXd;

/// Nondimensional except for xi.
struct Motion {
    VectorXd u;             ///< d - v_pl t
    VectorXd v;             ///< velocity
    VectorXd xi;            ///< log(V* theta / D_RS)
    VectorXd acceleration;  ///< of the last stage

    void resize(Index n)
    {
        for (VectorXd* x : {&u, &v, &xi, &acceleration}) x->setZero(n);
    }
};

/// Rates of a stage, for the following stages.
struct StageRates {
    VectorXd u, v, xi;
};

/// One run with a law of a certain type.
template <class Law>
class FaultLoop {
public:
    FaultLoop(const StrikeSlipFault& fault, const RuptureOptions& options,
              const FaultFriction& friction, const RateStateOptions& how)
        : fault_(fault),
          options_(options),
          how_(how),
          law_(friction.law),
          table_(&detail::sdirk_table(how.order)),
          normal_(detail::normal_forces(fault, friction)),
          stiffness_(fault, options.polynomial_bound > 0 ? options.polynomial_bound : 1e-4),
          stage_(law_, fault, stiffness_, normal_,
                 {how.tolerance, how.max_iterations, how.max_inner}),
          record_(fault, options, out_.rupture),
          plate_(friction.plate_velocity / fault.velocity_unit()),
          distance_(friction.law.d_rs / fault.slip_unit())
    {
        for (Motion* m : {&now_, &next_, &half_, &coarse_}) m->resize(fault.size());
        for (StageRates& r : rates_)
            for (VectorXd* x : {&r.u, &r.v, &r.xi}) x->setZero(fault.size());
        for (VectorXd* x : {&u_before_, &v_before_, &ku_, &at_.v, &equation_.force, &equation_.xi})
            x->setZero(fault.size());
        start(friction);
    }

    RateStateRupture run()
    {
        const double unit = fault_.time_unit();
        const double end = options_.t_end / unit;
        const double longest = options_.step > 0 ? options_.step / unit : end;
        out_.rupture.longest_step = longest * unit;
        double h = controlled() ? std::min(longest, first_step() / unit) : longest;
        out_.rupture.mean_velocities.front() = fault_.mean(now_.v) * fault_.velocity_unit();
        note_fastest(0);
        while (t_ < end) {
            if (out_.rupture.statistics.steps >= options_.max_steps)
                return finish(Outcome::step_limit);
            const double left = end - t_;
            const double step = left <= h * (1 + 1e-9) ? left : left < 2 * h ? left / 2 : h;
            const bool solved = attempt(step);
            if (solved && !finite(next_)) return finish(Outcome::non_finite);
            const double error = solved && controlled() ? error_of() : 0;
            if (!solved || error > 1) {
                ++out_.rupture.statistics.rejected;
                h = step * (solved ? std::clamp(growth(error), 0.1, 0.9) : 0.25);
                if (h < least_step()) {
                    return finish(solved ? Outcome::step_underflow : Outcome::not_converged);
                }
                continue;
            }
            // A step cut short by the end says nothing about the next.
            h = std::min(longest, std::max(step * std::clamp(growth(error), 0.2, 5.0),
                                           step < h && error < 1 ? h : 0));
            accept(step, step == left ? end : t_ + step);
            if (options_.progress && !options_.progress(t_ * unit))
                return finish(Outcome::cancelled);
        }
        return finish(Outcome::reached_end);
    }

private:
    [[nodiscard]] bool controlled() const { return std::isfinite(options_.rtol); }

    [[nodiscard]] double first_step() const
    {
        if (how_.first_step > 0) return how_.first_step;
        const double balance = std::abs(now_.v[0]) / (law_.parameters().a * normal_.maxCoeff());
        return std::min(balance * fault_.time_unit(), 1e-2 * options_.t_end);
    }

    void start(const FaultFriction& friction)
    {
        const double xi = friction.theta ? law_.xi_of_theta(*friction.theta)
                                         : law_.steady_state(std::abs(friction.slip_rate));
        now_.v.setConstant(friction.slip_rate / fault_.velocity_unit());
        now_.xi.setConstant(xi);
        stress_ = (1 + friction.overload) * law_.friction(friction.slip_rate, xi) * normal_;
        const auto& p = fault_.parameters();
        const double element =
            p.side / (p.elements + (p.mesh == FaultMesh::tip_corrected ? 0.5 : 0.0));
        const double stress =
            normal_.maxCoeff() * p.shear_modulus * p.slip_distance / p.side;  // [Pa]
        out_.elements_of_front =
            p.shear_modulus * friction.law.d_rs / (stress * friction.law.b) / element;
    }

    static bool finite(const Motion& m)
    {
        return m.u.allFinite() && m.v.allFinite() && m.xi.allFinite();
    }

    /// A step from `now_` to `next_`. At order 1 under error control it is two halves, whose
    /// difference from the whole is the estimate; a step of order 4 that leaves elements creeping
    /// is repeated with order 2.
    bool attempt(double h)
    {
        residual_ = 0;
        table_ = &detail::sdirk_table(how_.order);
        if (how_.order == 1 && controlled()) {
            return take(now_, h, coarse_) && take(now_, h / 2, half_) && take(half_, h / 2, next_);
        }
        if (!take(now_, h, next_)) return false;
        if (how_.order < 4 || !leaves_creeping()) return true;
        ++out_.handed_over;
        table_ = &detail::sdirk_table(2);
        return take(now_, h, next_);
    }

    /// Whether an element that a stage found at rest is still being braked at the end of the step.
    /// The motion that S brakes to rest, v' = -S for v > 0, has a spurious stable equilibrium under
    /// order 4: with q = v / (S h / 4) between 1 and 2 the first stage leaves (q - 1), the next
    /// three rest, and the last is 2.09 - 0.757 q, which q = 1.19 repeats forever. Order 2 brings
    /// every q below 3.4 to rest. Elements too slow to count in the error are accepted.
    [[nodiscard]] bool leaves_creeping() const
    {
        const double counts = 0.01 * std::min(options_.rtol, 1e-3) * size_of_velocity() /
                              std::sqrt(static_cast<double>(next_.v.size()));
        for (Index k = 0; k < next_.v.size(); ++k) {
            const double v = next_.v[k];
            if (std::abs(v) < counts || v * next_.acceleration[k] >= 0) continue;
            for (std::size_t i = 0; i + 1 < table_->stages; ++i) {
                if (std::abs(rates_[i].u[k] + plate_) < at_rest * std::abs(v)) return true;
            }
        }
        return false;
    }

    /// Relative to the velocity at the end of the step: friction at rest falls by decades within a
    /// stage.
    static constexpr double at_rest = 1e-3;

    bool take(const Motion& from, double h, Motion& to)
    {
        const double g = table_->gamma * h;
        stiffness_.set_length(g);
        at_.v = from.v;
        for (std::size_t i = 0; i < table_->stages; ++i) {
            before_stage(from, h, i);
            ++out_.rupture.statistics.solves;
            const FaultStageReport report = stage_.solve(equation_, at_);
            out_.rupture.statistics.iterations += static_cast<std::uint64_t>(report.iterations);
            out_.inner += static_cast<std::uint64_t>(report.inner);
            if (!report.solved) {
                ++out_.unsolved;
                return false;
            }
            residual_ = std::max(residual_, report.residual);
            StageRates& r = rates_[i];
            r.u = at_.v.array() - plate_;
            r.v = (at_.v - v_before_) / g;
            r.xi = (at_.xi - equation_.xi) / g;
        }
        const StageRates& last = rates_[table_->stages - 1];
        to.u = u_before_ + g * last.u;
        to.v = at_.v;
        to.xi = at_.xi;
        to.acceleration = last.v;
        return true;
    }

    /// The equation of stage i, and u and v before it.
    void before_stage(const Motion& from, double h, std::size_t i)
    {
        u_before_ = from.u;
        v_before_ = from.v;
        equation_.xi = from.xi;
        for (std::size_t j = 0; j < i; ++j) {
            const double a = h * table_->a[i][j];
            u_before_ += a * rates_[j].u;
            v_before_ += a * rates_[j].v;
            equation_.xi += a * rates_[j].xi;
        }
        stiffness_.product()(u_before_, ku_);
        const double g = stiffness_.length();
        for (Index k = 0; k < ku_.size(); ++k) {
            equation_.force[k] =
                v_before_[k] / g + stress_[k] - ku_[k] + plate_ * stiffness_.on_ones(k);
        }
    }

    /// [time units] Length below which steps are not taken.
    [[nodiscard]] double least_step() const noexcept { return 1e-14 * t_ + 1e-12; }

    /// Norm of the whole field, the reference of its error. What the time does not resolve is no
    /// error: a braking changes the velocity by that much in the shortest step.
    [[nodiscard]] double size_of_velocity() const
    {
        const double brief = std::max(braking, least_step() / options_.rtol);
        const double least = 1e-6 * law_.parameters().v_star / fault_.velocity_unit();
        return std::max(next_.v.norm(), now_.v.norm()) +
               brief * std::max(next_.acceleration.norm(), now_.acceleration.norm()) +
               std::sqrt(static_cast<double>(next_.v.size())) * least;
    }

    /// The error relative to the allowed one.
    [[nodiscard]] double error_of() const
    {
        double of_u = 0;
        double of_v = 0;
        double of_xi = 0;
        for (Index k = 0; k < next_.v.size(); ++k) {
            double u = next_.u[k] - coarse_.u[k];
            double v = next_.v[k] - coarse_.v[k];
            double xi = next_.xi[k] - coarse_.xi[k];
            if (how_.order > 1) {
                u = v = xi = 0;
                for (std::size_t i = 0; i < table_->stages; ++i) {
                    u += table_->error[i] * rates_[i].u[k];
                    v += table_->error[i] * rates_[i].v[k];
                    xi += table_->error[i] * rates_[i].xi[k];
                }
                const double h = stiffness_.length() / table_->gamma;
                u *= h, v *= h, xi *= h;
            }
            u /= std::abs(next_.u[k]) + distance_;
            of_u += u * u;
            of_v += v * v;
            of_xi += xi * xi;
        }
        const double root_n = std::sqrt(static_cast<double>(next_.v.size()));
        const double v = std::sqrt(of_v) / size_of_velocity();
        return std::max(v, std::sqrt(std::max(of_u, of_xi)) / root_n) / options_.rtol;
    }

    /// In time units. Its neighbours brake an element evenly to rest, down to where log V counts:
    /// from 0.1 to 1e-15 m/s in a time below the resolution of its velocity.
    static constexpr double braking = 0.01;

    [[nodiscard]] double growth(double error) const
    {
        const double order = table_->stages > 2 ? 4 : 2;  // of the estimate
        return 0.9 * std::pow(std::max(error, 1e-10), -1 / order);
    }

    void accept(double h, double t_next)
    {
        ++out_.rupture.statistics.steps;
        out_.residual = std::max(out_.residual, residual_);
        note(h);
        std::swap(now_, next_);
        t_ = t_next;
        slip_.slip = now_.u.array() + plate_ * t_;
        slip_.path = slip_.slip;
        slip_.velocity = now_.v;
        record_.note_fastest(t_, slip_);
        note_fastest(h);
    }

    /// Records cubics through both ends of a step; velocities of single elements, which may fall by
    /// decades, are straight lines.
    void note(double h)
    {
        const Motion& a = now_;
        const Motion& b = next_;
        const double v[2] = {fault_.mean(a.v), fault_.mean(b.v)};
        const double rate[2] = {h * fault_.mean(a.acceleration), h * fault_.mean(b.acceleration)};
        const auto along = [&](double x, double p, double q, double p_rate, double q_rate) {
            const double y = 1 - x;
            return y * y * (1 + 2 * x) * p + x * x * (3 - 2 * x) * q +
                   x * y * (y * p_rate - x * q_rate);
        };
        const double all = fault_.share() * static_cast<double>(fault_.size());
        const double s[2] = {fault_.mean(a.u) + all * plate_ * t_,
                             fault_.mean(b.u) + all * plate_ * (t_ + h)};
        record_.add(
            t_, h,
            [&](double x) {
                return MeanMotion{.slip = along(x, s[0], s[1], h * v[0], h * v[1]),
                                  .velocity = along(x, v[0], v[1], rate[0], rate[1])};
            },
            [&](double x, FaultFields& out) {
                out.velocity = (1 - x) * a.v + x * b.v;
                out.slip = (1 - x) * (1 - x) * (1 + 2 * x) * a.u + x * x * (3 - 2 * x) * b.u +
                           x * (1 - x) * h * ((1 - x) * a.v - x * b.v);
                out.slip.array() += plate_ * (t_ + x * h) - plate_ * h * x * (1 - x) * (1 - 2 * x);
                out.path = out.slip;
            });
    }

    /// Records the fastest element, and earthquakes that begin or end.
    void note_fastest(double h)
    {
        const double fastest = now_.v.cwiseAbs().maxCoeff() * fault_.velocity_unit();
        const double before = out_.fastest.empty() ? 0 : out_.fastest.back();
        const double unit = fault_.time_unit();
        const double mean = out_.rupture.mean_slips.back();
        out_.fastest.push_back(fastest);
        out_.step_times.push_back(t_ * unit);
        const double level = how_.threshold;
        double crossing = t_ * unit;
        if (before > 0 && fastest > 0 && fastest != before) {
            crossing -= h * unit * std::log(fastest / level) / std::log(fastest / before);
        }
        if (before < level && fastest >= level) {
            out_.earthquakes.push_back({.start = crossing});
            slip_at_onset_ = mean;
        }
        if (out_.earthquakes.empty() || before < level) {
            if (fastest >= level) out_.earthquakes.back().largest_velocity = fastest;
            return;
        }
        FaultEarthquake& event = out_.earthquakes.back();
        event.mean_slip = mean - slip_at_onset_;
        event.largest_velocity = std::max(event.largest_velocity, fastest);
        if (fastest < level) event.end = crossing;
    }

    RateStateRupture finish(Outcome outcome)
    {
        Rupture& r = out_.rupture;
        r.outcome = outcome;
        if (r.statistics.steps == 0) {
            slip_.slip = slip_.path = now_.u;
            slip_.velocity = now_.v;
        }
        record_.finish(t_, std::numeric_limits<double>::quiet_NaN(), false, slip_);
        r.statistics.products = stiffness_.product().count();
        r.statistics.degree = stiffness_.degree();
        r.statistics.bound = stiffness_.bound();
        out_.xi = now_.xi;
        return std::move(out_);
    }

    const StrikeSlipFault& fault_;
    const RuptureOptions& options_;
    const RateStateOptions& how_;
    Law law_;
    const detail::SdirkTable* table_;  ///< of the step in progress
    RateStateRupture out_;
    VectorXd normal_, stress_;
    StageStiffness stiffness_;
    FaultFrictionStage<Law> stage_;
    RuptureRecord record_;
    double plate_, distance_;
    Motion now_, next_, half_, coarse_;
    std::array<StageRates, 5> rates_;
    VectorXd u_before_, v_before_, ku_;
    FaultStageEquation equation_;
    FaultStagePoint at_;
    FaultFields slip_;
    double t_ = 0;
    double residual_ = 0;
    double slip_at_onset_ = 0;
};

template <StateEvolution evolution>
RateStateRupture run(const StrikeSlipFault& fault, const RuptureOptions& options,
                     const FaultFriction& friction, const RateStateOptions& how)
{
    if (friction.effect == DirectEffect::log) {
        using Law = RateStateLaw<evolution, DirectEffect::log>;
        return FaultLoop<Law>(fault, options, friction, how).run();
    }
    using Law = RateStateLaw<evolution, DirectEffect::asinh>;
    return FaultLoop<Law>(fault, options, friction, how).run();
}

}  // namespace

void validate(const FaultFriction& f)
{
    constexpr std::string_view who = "FaultFriction";
    validate(f.law);
    detail::require_not_negative(who, "plate_velocity", f.plate_velocity);
    detail::require_not_negative(who, "normal_stress", f.normal_stress);
    detail::require_finite(who, "slip_rate", f.slip_rate);
    if (f.effect == DirectEffect::log && !(f.slip_rate > 0)) detail::refuse_slip_rate(f.slip_rate);
    detail::require(f.slip_rate != 0, who, "slip_rate", "differ from zero", f.slip_rate);
    if (f.theta && !(*f.theta > 0 && std::isfinite(*f.theta))) detail::refuse_theta(*f.theta);
    detail::require(f.overload > -1 && std::isfinite(f.overload), who, "overload",
                    "be finite and above -1", f.overload);
}

void validate(const RateStateOptions& o)
{
    constexpr std::string_view who = "RateStateOptions";
    (void)detail::sdirk_table(o.order);
    detail::require_not_negative(who, "first_step", o.first_step);
    detail::require(o.tolerance >= 1e-13 && o.tolerance <= 1e-3, who, "tolerance",
                    "lie in [1e-13, 1e-3]", o.tolerance);
    detail::require(o.max_iterations >= 1, who, "max_iterations", "be at least 1",
                    o.max_iterations);
    detail::require(o.max_inner >= 1, who, "max_inner", "be at least 1", o.max_inner);
    detail::require_positive(who, "threshold", o.threshold);
}

RateStateRupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options,
                          const FaultFriction& friction, const RateStateOptions& how)
{
    validate(options);
    validate(friction);
    validate(how);
    detail::require(std::isfinite(options.rtol) || options.step > 0, "RuptureOptions", "step",
                    "be positive where rtol is infinite", options.step);
    switch (friction.evolution) {
        case StateEvolution::slip: return run<StateEvolution::slip>(fault, options, friction, how);
        case StateEvolution::prz: return run<StateEvolution::prz>(fault, options, friction, how);
        case StateEvolution::ageing: break;
    }
    return run<StateEvolution::ageing>(fault, options, friction, how);
}

}  // namespace ricochet
