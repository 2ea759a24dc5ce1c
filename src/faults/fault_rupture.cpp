#include "ricochet/faults/strike_slip_fault.hpp"

#include <algorithm>
#include <array>
#include <complex>
#include <utility>

#include "base/require.hpp"
#include "fault_forces.hpp"
#include "rupture_record.hpp"

namespace ricochet {

namespace {

using detail::FaultFields;
using detail::FaultForces;
using detail::MeanMotion;
using detail::RuptureRecord;
using Eigen::Index;
using Eigen::VectorXd;

constexpr double default_step = 0.28867513459481287;  // time units: 0.25 s at 3 km
constexpr double default_bound = 1e-4;
constexpr double stable_share = 0.95;

/// Factor of the default steps and bounds on a small mesh, at most 1.
double finer(const StrikeSlipFault& fault)
{
    return std::clamp(fault.elements() / 100.0, 0.1, 1.0);
}

/// Dormand and Prince's coefficients of order 5, and those of the difference to order 4.
constexpr std::array<std::array<double, 6>, 7> a{{
    {},
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84},
}};
constexpr std::array<double, 7> error_weights{
    71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
constexpr int stages = 7;

/// An element's slip on a step: the polynomial of fifth degree through both ends' slips,
/// velocities and accelerations.
class ElementPath {
public:
    ElementPath(double h, double d0, double v0, double a0, double d1, double v1, double a1)
        : h_(h), c_{d0, h * v0, 0.5 * h * h * a0, 0, 0, 0}
    {
        const double p = d1 - c_[0] - c_[1] - c_[2];
        const double q = h * v1 - c_[1] - 2 * c_[2];
        const double r = h * h * a1 - 2 * c_[2];
        c_[3] = 10 * p - 4 * q + 0.5 * r;
        c_[4] = -15 * p + 7 * q - r;
        c_[5] = 6 * p - 3 * q + 0.5 * r;
    }
    [[nodiscard]] double slip(double x) const
    {
        return c_[0] + x * (c_[1] + x * (c_[2] + x * (c_[3] + x * (c_[4] + x * c_[5]))));
    }
    [[nodiscard]] double velocity(double x) const
    {
        return (c_[1] + x * (2 * c_[2] + x * (3 * c_[3] + x * (4 * c_[4] + x * 5 * c_[5])))) / h_;
    }
    [[nodiscard]] double acceleration(double x) const
    {
        return (2 * c_[2] + x * (6 * c_[3] + x * (12 * c_[4] + x * 20 * c_[5]))) / (h_ * h_);
    }

    /// Time at which a motion with the sign `sign` that has reversed at 1 stops.
    [[nodiscard]] double arrest(double sign) const
    {
        double from = 0;
        if (!(sign * velocity(0) > 0)) {
            // An element that starts at rest begins to slip inside the step, or does not slip in
            // it.
            from = 0.5;
            while (from > 1e-6 && !(sign * velocity(from) > 0)) from *= 0.5;
            if (!(sign * velocity(from) > 0)) return 0;
        }
        double to = 1;
        for (int i = 0; i < 60 && to - from > 1e-16; ++i) {
            const double middle = 0.5 * (from + to);
            (sign * velocity(middle) > 0 ? from : to) = middle;
        }
        return to;
    }

private:
    double h_;
    std::array<double, 6> c_;
};

class ExplicitRupture {
public:
    ExplicitRupture(const StrikeSlipFault& fault, const RuptureOptions& options)
        : fault_(fault),
          options_(options),
          forces_(fault, detail::polynomial_bound(fault, options)),
          record_(fault, options, out_)
    {
        const Index n = fault.size();
        for (VectorXd* v : {&now_.slip, &now_.velocity, &now_.path, &acceleration_, &drive_, &d_,
                            &v_, &d1_, &v1_, &a1_}) {
            v->setZero(n);
        }
        for (auto& k : v_stage_) k.setZero(n);
        for (auto& k : a_stage_) k.setZero(n);
        stop_.setConstant(n, 2);
        back_.setZero(n);
        sign_.setZero(n);
        sign1_.setZero(n);
    }

    Rupture run()
    {
        const double end = options_.t_end / fault_.time_unit();
        const double stable =
            stable_step_of_mode(fault_.parameters().damping) / std::sqrt(forces_.spectrum().upper);
        const double wanted =
            options_.step > 0 ? options_.step / fault_.time_unit() : default_step * finer(fault_);
        longest_ = std::min(wanted, stable_share * stable);
        out_.stable_step = stable * fault_.time_unit();
        out_.longest_step = longest_ * fault_.time_unit();
        double h = longest_;
        start();
        out_.outcome = Outcome::reached_end;
        while (t_ < end && !at_rest()) {
            if (out_.statistics.steps >= options_.max_steps) return finish(Outcome::step_limit);
            const double left = end - t_;
            const double step = left <= h * (1 + 1e-9) ? left : left < 2 * h ? 0.5 * left : h;
            const double error = attempt(step);
            const bool finite = std::isfinite(error);
            // Stages of a step that is too long may overflow where the motion does not.
            if (!finite && !std::isfinite(options_.rtol)) return finish(Outcome::non_finite);
            h = std::min(longest_, step * (finite ? growth(error) : 0.2));
            if (!finite || error > 1) {
                ++out_.statistics.rejected;
                if (h < 1e-12 * std::max(t_, std::min(1.0, end))) {
                    return finish(finite ? Outcome::step_underflow : Outcome::non_finite);
                }
                continue;
            }
            accept(step, step == left ? end : t_ + step);
            if (options_.progress && !options_.progress(t_ * fault_.time_unit())) {
                return finish(Outcome::cancelled);
            }
        }
        return finish(at_rest() ? Outcome::at_rest : Outcome::reached_end);
    }

private:
    [[nodiscard]] bool at_rest() const { return moving_ == 0; }

    static double growth(double error)
    {
        if (error <= 0) return 5;
        return std::clamp(0.9 * std::pow(error, -0.2), 0.2, 5.0);
    }

    void start()
    {
        forces_.drive(now_.slip, now_.velocity, drive_);
        release();
    }

    /// Decides which elements move from here on, and computes their accelerations.
    void release()
    {
        moving_ = 0;
        for (Index i = 0; i < fault_.size(); ++i) {
            const double forward = drive_[i] + fault_.weakening(i, now_.path[i]);
            const double backward = forward + 2 * fault_.strength(i, now_.path[i]);
            if (sign_[i] == 0) {
                sign_[i] = forward > 0 ? 1 : backward < 0 ? -1 : 0;
                if (sign_[i] != 0 && out_.statistics.steps > 0) ++out_.statistics.restarts;
            }
            acceleration_[i] = sign_[i] == 0 ? 0 : sign_[i] > 0 ? forward : backward;
            if (sign_[i] != 0) ++moving_;
        }
    }

    /// Accelerations of the elements that slip, with the signs of the start of the step.
    void accelerate(const VectorXd& d, const VectorXd& v, VectorXd& out)
    {
        forces_.drive(d, v, drive_);
        for (Index i = 0; i < fault_.size(); ++i) {
            if (sign_[i] == 0) continue;
            const double path = now_.path[i] + sign_[i] * (d[i] - now_.slip[i]);
            const double forward = drive_[i] + fault_.weakening(i, path);
            out[i] = sign_[i] > 0 ? forward : forward + 2 * fault_.strength(i, path);
        }
    }

    /// Takes the step into d1_, v1_, a1_; returns its error relative to the allowed one.
    double attempt(double h)
    {
        v_stage_[0] = now_.velocity;
        a_stage_[0] = acceleration_;
        for (std::size_t s = 1; s < stages; ++s) {
            d_ = now_.slip;
            v_ = now_.velocity;
            for (std::size_t j = 0; j < s; ++j) {
                if (a[s][j] == 0) continue;
                d_ += h * a[s][j] * v_stage_[j];
                v_ += h * a[s][j] * a_stage_[j];
            }
            v_stage_[s] = v_;
            a_stage_[s].setZero();
            accelerate(d_, v_, a_stage_[s]);
        }
        d1_ = d_;
        v1_ = v_;
        a1_ = a_stage_[stages - 1];
        return std::isfinite(options_.rtol)
                   ? error(h)
                   : (d1_.allFinite() && v1_.allFinite() ? 0.0 : v1_.sum());
    }

    double error(double h)
    {
        d_.setZero();
        v_.setZero();
        for (std::size_t j = 0; j < stages; ++j) {
            if (error_weights[j] == 0) continue;
            d_ += h * error_weights[j] * v_stage_[j];
            v_ += h * error_weights[j] * a_stage_[j];
        }
        // Near the end, when few elements creep, their velocities are no measure.
        fastest_ = std::max(fastest_, now_.velocity.norm());
        const double of_v = std::max({now_.velocity.norm(), v1_.norm(), 1e-2 * fastest_});
        const double of_d = d1_.norm();
        return std::max(v_.norm() / of_v, d_.norm() / of_d) / options_.rtol;
    }

    void accept(double h, double t_next)
    {
        stop_.setConstant(2);
        last_stop_ = 0;
        bool stopped = false;
        for (Index i = 0; i < fault_.size(); ++i) {
            sign1_[i] = sign_[i];
            if (sign_[i] == 0 || sign_[i] * v1_[i] > 0) continue;
            const ElementPath path = path_of(i, h);
            stop_[i] = path.arrest(sign_[i]);
            sign1_[i] = 0;
            stopped = true;
            ++out_.statistics.arrests;
            back_[i] = acceleration_back(i, path);
            if (back_[i] != 0) {
                sign1_[i] = -sign_[i];
                ++out_.statistics.restarts;
            }
            last_stop_ = std::max(last_stop_, t_ + stop_[i] * h);
        }
        ++out_.statistics.steps;
        record_.add(
            t_, h, [&](double theta) { return mean_at(theta, h); },
            [&](double theta, FaultFields& fields) { fields_at(theta, h, fields); });
        fields_at(1, h, next_);
        std::swap(now_, next_);
        sign_.swap(sign1_);
        t_ = t_next;
        if (stopped) {
            forces_.drive(now_.slip, now_.velocity, drive_);
        }
        release();
        record_.note_fastest(t_, now_);
    }

    [[nodiscard]] ElementPath path_of(Index i, double h) const
    {
        return {h, now_.slip[i], now_.velocity[i], acceleration_[i], d1_[i], v1_[i], a1_[i]};
    }

    /// Acceleration of an element that turns back where it stops, by the friction of the other
    /// direction; 0 if it stays at rest.
    [[nodiscard]] double acceleration_back(Index i, const ElementPath& path) const
    {
        const double slipped = sign_[i] * (path.slip(stop_[i]) - now_.slip[i]);
        const double strength = fault_.strength(i, now_.path[i] + slipped);
        const double back = path.acceleration(stop_[i]) + 2 * sign_[i] * strength;
        return sign_[i] * back < 0 ? back : 0;
    }

    /// Fields between the step's start, now_, and its end, d1_, v1_, a1_, with every arrest. An
    /// element that turns back is accelerated evenly to the end, which keeps the order of arrests.
    void fields_at(double theta, double h, FaultFields& out) const
    {
        out = now_;
        for (Index i = 0; i < fault_.size(); ++i) {
            if (sign_[i] == 0) continue;
            const bool stopped = theta >= stop_[i];
            const double at = stopped ? stop_[i] : theta;
            const bool end = at == 1;
            const ElementPath path = path_of(i, h);
            out.slip[i] = end ? d1_[i] : path.slip(at);
            out.velocity[i] = stopped ? 0 : end ? v1_[i] : path.velocity(at);
            out.path[i] += sign_[i] * (out.slip[i] - now_.slip[i]);
            if (!stopped || back_[i] == 0) continue;
            out.velocity[i] = back_[i] * (theta - at) * h;
            const double turned = 0.5 * out.velocity[i] * (theta - at) * h;
            out.slip[i] += turned;
            out.path[i] += std::abs(turned);
        }
    }

    [[nodiscard]] MeanMotion mean_at(double theta, double h) const
    {
        MeanMotion sum;
        for (Index i = 0; i < fault_.size(); ++i) {
            sum.slip += now_.path[i];
            if (sign_[i] == 0) continue;
            const ElementPath path = path_of(i, h);
            sum.slip += sign_[i] * (path.slip(std::min(theta, stop_[i])) - now_.slip[i]);
            if (theta < stop_[i]) {
                sum.velocity += path.velocity(theta);
            } else if (back_[i] != 0) {
                const double velocity = back_[i] * (theta - stop_[i]) * h;
                sum.velocity += velocity;
                sum.slip += 0.5 * std::abs(velocity) * (theta - stop_[i]) * h;
            }
        }
        return {.slip = fault_.share() * sum.slip, .velocity = fault_.share() * sum.velocity};
    }

    Rupture finish(Outcome outcome)
    {
        out_.outcome = outcome;
        const bool rests = outcome == Outcome::at_rest;
        record_.finish(t_, rests ? last_stop_ : std::numeric_limits<double>::quiet_NaN(), true,
                       now_);
        auto& s = out_.statistics;
        s.evaluations = forces_.evaluations();
        s.products = forces_.product().count();
        s.degree = forces_.root_of_stiffness().degree();
        s.bound = forces_.bound();
        return std::move(out_);
    }

    const StrikeSlipFault& fault_;
    const RuptureOptions& options_;
    Rupture out_;
    FaultForces forces_;
    RuptureRecord record_;
    double t_ = 0;
    double longest_ = 0;
    double fastest_ = 0;
    double last_stop_ = 0;
    Index moving_ = 0;
    FaultFields now_, next_;
    VectorXd acceleration_, drive_;
    std::array<VectorXd, stages> v_stage_, a_stage_;
    VectorXd d_, v_, d1_, v1_, a1_;
    VectorXd stop_;          // fraction of the step after which an element stopped; 2: it did not
    VectorXd back_;          // acceleration of an element that turned back there; 0: it did not
    VectorXd sign_, sign1_;  // of the motion; 0: at rest
};

}  // namespace

double detail::polynomial_bound(const StrikeSlipFault& fault, const RuptureOptions& options)
{
    if (options.polynomial_bound > 0) return options.polynomial_bound;
    return default_bound * finer(fault) * finer(fault);
}

void validate(const RuptureOptions& o)
{
    constexpr detail::Require require{"RuptureOptions"};
    // Fractions of still shorter runs would not be numbers of full precision.
    require(o.t_end >= 1e-300 && std::isfinite(o.t_end),
            "t_end must be at least 1e-300 s and finite", o.t_end);
    require(o.step >= 0 && std::isfinite(o.step), "step must be zero or positive", o.step);
    require(o.rtol > 0, "rtol must be positive", o.rtol);
    require(o.polynomial_bound >= 0, "polynomial_bound must be zero or positive",
            o.polynomial_bound);
    if (!std::is_sorted(o.snapshot_times.begin(), o.snapshot_times.end())) {
        detail::Refuse{require.who}("snapshot_times must ascend");
    }
    for (const double t : o.snapshot_times) {
        require(t >= 0 && t <= o.t_end, "snapshot_times must lie within [0, t_end]", t);
    }
    require(o.max_steps > 0, "max_steps must be positive", 0);
}

double stable_step_of_mode(double damping)
{
    using Complex = std::complex<double>;
    // The square of a damping above 1e8 may overflow, and the 1 is below its rounding.
    const Complex root = damping > 1e8 ? damping : std::sqrt(Complex(damping * damping - 1, 0));
    const double step = 1e-3 / std::max(1.0, damping);
    for (double h = step;; h += step) {
        for (const Complex z : {h * (-damping + root), h * (-damping - root)}) {
            const Complex r =
                1.0 +
                z * (1.0 +
                     z / 2.0 *
                         (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0 * (1.0 + z / 5.0)))));
            if (std::abs(r) > 1 + 1e-4) return h - step;
        }
    }
}

Rupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options)
{
    validate(options);
    return ExplicitRupture(fault, options).run();
}

}  // namespace ricochet
