#include "ricochet/faults/strike_slip_fault.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include "base/require.hpp"
#include "fault_bathe_stage.hpp"
#include "fault_forces.hpp"
#include "rupture_record.hpp"

namespace ricochet {

namespace {

using detail::FaultFields;
using detail::FaultForces;
using detail::MeanMotion;
using detail::RuptureRecord;
using detail::Solved;
using detail::StageOfFault;
using detail::StageSolver;
using Eigen::Index;
using Eigen::VectorXd;

/// State of the fault, with f + r there.
struct Moment {
    FaultFields fields;
    VectorXd acceleration;
};

class BatheRupture {
public:
    BatheRupture(const StrikeSlipFault& fault, FaultForces& forces, const RuptureOptions& options,
                 const BatheOptions& bathe)
        : fault_(fault),
          options_(options),
          bathe_(bathe),
          forces_(forces),
          evaluations_(forces.evaluations()),
          products_(forces.product().count()),
          record_(fault, options, out_),
          solver_(fault, forces_, bathe)
    {
        for (Moment* m : {&now_, &next_, &half_, &coarse_}) zero(*m);
        zero(middle_);
        zero(first_middle_);
        forces_.drive(now_.fields.slip, now_.fields.velocity, now_.acceleration);
        next_ = now_;
        seen_ = view(0);
    }

    /// `BatheMotion::step`
    bool step(double h)
    {
        const double end = end_time();
        const double left = end - t_;
        const double length = left <= h * (1 + 1e-9) ? left : h;
        if (!attempt(length)) {
            ++out_.statistics.rejected;
            return false;
        }
        scaled_error_ = bathe_.estimate == ErrorEstimate::none ? 0 : error_of(length);
        seen_ = view(length);
        accept(length, length == left ? end : t_ + length);
        return true;
    }
    [[nodiscard]] double end_time() const { return options_.t_end / fault_.time_unit(); }
    [[nodiscard]] double time() const { return t_; }
    [[nodiscard]] double error() const { return scaled_error_; }
    [[nodiscard]] const StepView& seen() const { return seen_; }
    [[nodiscard]] const RuptureStatistics& statistics() const { return out_.statistics; }
    [[nodiscard]] double mean_slip() const
    {
        return fault_.mean(now_.fields.path * fault_.slip_unit());
    }
    /// Whether the fault is at rest and no element is loaded beyond its strength.
    bool at_rest() { return now_.fields.velocity.isZero(0) && rests(); }

    Rupture run()
    {
        const double unit = fault_.time_unit();
        const double end = end_time();
        const double longest = bathe_.h_max > 0 ? bathe_.h_max / unit : end / 5;
        double h = std::min(longest, options_.step / unit);
        out_.longest_step = longest * unit;
        StepController& controller = controller_;
        while (t_ < end) {
            if (out_.statistics.steps >= options_.max_steps) return finish(Outcome::step_limit);
            const double left = end - t_;
            const double step = left <= h * (1 + 1e-9) ? left : h;
            const bool solved = attempt(step);
            double factor = 0;
            bool accepted = solved;
            if (solved) {
                const double error = bathe_.estimate == ErrorEstimate::none ? 0 : error_of(step);
                const StepVerdict verdict =
                    judge(controller, error, step * unit, [&] { return view(step); });
                accepted = verdict.accepted;
                factor = verdict.factor;
            } else {
                factor = std::visit([](auto& rule) { return rule.failed(); }, controller);
            }
            // A step cut short by the end says nothing about the next.
            h = std::min(longest, (accepted ? std::max(step, h) : step) * factor);
            if (!accepted) {
                ++out_.statistics.rejected;
                if (h < 1e-12 * std::max(t_, std::min(1.0, end))) {
                    return finish(solved ? Outcome::step_underflow : Outcome::not_converged);
                }
                continue;
            }
            accept(step, step == left ? end : t_ + step);
            if (at_rest()) {
                rest_time_ = t_;
                return finish(Outcome::at_rest);
            }
            if (options_.progress && !options_.progress(t_ * unit))
                return finish(Outcome::cancelled);
        }
        return finish(Outcome::reached_end);
    }

private:
    void zero(FaultFields& f) const
    {
        for (VectorXd* v : {&f.slip, &f.velocity, &f.path}) v->setZero(fault_.size());
    }
    void zero(Moment& m) const
    {
        zero(m.fields);
        m.acceleration.setZero(fault_.size());
    }

    bool attempt(double h)
    {
        if (bathe_.estimate != ErrorEstimate::doubling) return take(now_, h, middle_, next_);
        if (!take(now_, h, middle_, coarse_)) return false;
        if (!take(now_, h / 2, first_middle_, half_)) return false;
        return take(half_, h / 2, middle_, next_);
    }

    /// Bathe's step; `middle` is the end of its first stage.
    bool take(const Moment& from, double h, FaultFields& middle, Moment& to)
    {
        const FaultFields& n = from.fields;
        const bool averaged = bathe_.first_stage != FirstStage::at_end;
        stage_.g = h / 4;
        stage_.friction = averaged ? h / 4 : h / 2;
        if (averaged) {
            stage_.start = n.velocity + stage_.g * from.acceleration;
        } else {
            forces_.drive(n.slip, n.velocity, stage_.start);
            stage_.start = n.velocity + stage_.g * stage_.start;
        }
        stage_.slip = n.slip + stage_.g * n.velocity;
        stage_.path = n.path + stage_.g * n.velocity.cwiseAbs();
        stage_.at_path = n.path + (h / 2) * n.velocity.cwiseAbs();
        guess(n.velocity, n.velocity + (h / 2) * from.acceleration, middle.velocity);
        if (!solve(middle)) return false;

        FaultFields& e = to.fields;
        stage_.g = stage_.friction = h / 3;
        stage_.start = (4 * middle.velocity - n.velocity) / 3;
        stage_.slip = (4 * middle.slip - n.slip) / 3;
        stage_.path = (4 * middle.path - n.path) / 3;
        stage_.at_path = middle.path + (h / 2) * middle.velocity.cwiseAbs();
        guess(middle.velocity, 2 * middle.velocity - n.velocity, e.velocity);
        if (!solve(e)) return false;
        to.acceleration = (3 * e.velocity - 4 * middle.velocity + n.velocity) / h;
        return true;
    }

    /// `extrapolated`, but 0 where its sign has changed.
    template <class Expression>
    static void guess(const VectorXd& v, const Expression& extrapolated, VectorXd& out)
    {
        for (Index i = 0; i < v.size(); ++i) {
            const double value = extrapolated.coeff(i);
            out[i] = value * v[i] < 0 ? 0 : value;
        }
    }

    bool solve(FaultFields& to)
    {
        ++out_.statistics.solves;
        const Solved solved = solver_.solve(stage_, to.velocity);
        out_.statistics.iterations += static_cast<std::uint64_t>(solved.iterations);
        to.slip = stage_.slip + stage_.g * to.velocity;
        to.path = stage_.path + stage_.g * to.velocity.cwiseAbs();
        return solved.converged;
    }

    double error_of(double h)
    {
        FaultFields& e = error_;
        const FaultFields& a = now_.fields;
        const FaultFields& b = next_.fields;
        if (bathe_.estimate == ErrorEstimate::doubling) {
            e.velocity = coarse_.fields.velocity - b.velocity;
            e.slip = coarse_.fields.slip - b.slip;
            e.path = coarse_.fields.path - b.path;
        } else {
            e.velocity =
                0.5 * (b.velocity - 4 * middle_.velocity + 3 * a.velocity + h * now_.acceleration);
            e.slip = 0.5 * (b.slip - 4 * middle_.slip + 3 * a.slip + h * a.velocity);
            e.path = 0.5 * (b.path - 4 * middle_.path + 3 * a.path + h * a.velocity.cwiseAbs());
        }
        if (bathe_.norm == FaultNorm::components) return of_components();
        const double floor = bathe_.floor;
        fastest_ = std::max(fastest_, b.velocity.norm());
        const double of_v = e.velocity.norm() / std::max(b.velocity.norm(), floor * fastest_);
        const double of_s = e.path.norm() / std::max(b.path.norm(), floor * fastest_);
        return std::max(of_v, of_s) / bathe_.rtol;
    }

    /// Inputs of a policy that describe the attempt.
    [[nodiscard]] StepView view(double h) const
    {
        const FaultFields& e = next_.fields;
        const auto n = static_cast<double>(fault_.size());
        double speed = 0;  // of v^2
        double growth = 0;
        double path = 0;
        double slipping = 0;
        double switched = 0;
        for (Index i = 0; i < fault_.size(); ++i) {
            const double v = e.velocity[i];
            speed += v * v;
            growth += v * next_.acceleration[i];
            path += std::exp(-e.path[i]);
            slipping += v != 0 ? 1 : 0;
            switched += (v != 0) != (now_.fields.velocity[i] != 0) ? 1 : 0;
        }
        const double rate = speed > 0 ? growth / speed : 0;
        const double longest = 6;  // logarithm of an unlimited time
        StepView out{.tolerance = bathe_.rtol, .step = h, .switched = switched / n};
        out.state = {
            0.5 * std::log(std::max(speed / n, 1e-24)),
            std::asinh(rate),
            rate < 0 ? std::clamp(-std::log(-rate), -longest, longest) : longest,
            path / n,
            slipping / n,
            std::log(fault_.parameters().friction_drop * fault_.weight().sum() / n),
        };
        return out;
    }

    double of_components()
    {
        const double unit = fault_.slip_unit() / 1e-4;  // of slip, in 0.1 mm
        if (unloaded_.size() == 0) {
            VectorXd strength(fault_.size());
            for (Index i = 0; i < fault_.size(); ++i) strength[i] = forces_.first_strength(i);
            unloaded_ = -(1 + fault_.parameters().overload) * fault_.stiffness().solve(strength);
        }
        const FaultFields& c = coarse_.fields;
        const FaultFields& b = next_.fields;
        double sum = 0;
        const auto add = [&](double error, double one, double other) {
            const double size = unit * std::max(std::abs(one), std::abs(other));
            const double scaled = unit * error / (bathe_.atol + bathe_.rtol * size);
            sum += scaled * scaled;
        };
        for (Index i = 0; i < fault_.size(); ++i) {
            add(error_.velocity[i], c.velocity[i], b.velocity[i]);
            add(error_.slip[i], unloaded_[i] + c.slip[i], unloaded_[i] + b.slip[i]);
            add(error_.path[i], c.path[i], b.path[i]);
        }
        return std::sqrt(sum / (3 * static_cast<double>(fault_.size())));
    }

    void accept(double h, double t_next)
    {
        ++out_.statistics.steps;
        for (Index i = 0; i < fault_.size(); ++i) {
            const bool moved = now_.fields.velocity[i] != 0;
            const bool moves = next_.fields.velocity[i] != 0;
            if (moved && !moves) ++out_.statistics.arrests;
            if (!moved && moves && out_.statistics.steps > 1) ++out_.statistics.restarts;
        }
        if (bathe_.estimate == ErrorEstimate::doubling) {
            note(t_, h / 2, now_.fields, first_middle_, half_.fields);
            note(t_ + h / 2, h / 2, half_.fields, middle_, next_.fields);
        } else {
            note(t_, h, now_.fields, middle_, next_.fields);
        }
        std::swap(now_, next_);
        t_ = t_next;
        record_.note_fastest(t_, now_.fields);
    }

    /// Records parabolas through the three states of a step.
    void note(double t, double h, const FaultFields& a, const FaultFields& b, const FaultFields& c)
    {
        if (bathe_.observer) {
            bathe_.observer({.t = t,
                             .h = h,
                             .velocity = {&a.velocity, &b.velocity, &c.velocity},
                             .path = {&a.path, &b.path, &c.path}});
        }
        const double v[3] = {fault_.mean(a.velocity), fault_.mean(b.velocity),
                             fault_.mean(c.velocity)};
        const double s[3] = {fault_.mean(a.path), fault_.mean(b.path), fault_.mean(c.path)};
        const auto weights = [](double x) {
            return std::array<double, 3>{(2 * x - 1) * (x - 1), 4 * x * (1 - x), x * (2 * x - 1)};
        };
        record_.add(
            t, h,
            [&](double theta) {
                const auto w = weights(theta);
                return MeanMotion{.slip = w[0] * s[0] + w[1] * s[1] + w[2] * s[2],
                                  .velocity = w[0] * v[0] + w[1] * v[1] + w[2] * v[2]};
            },
            [&](double theta, FaultFields& out) {
                const auto w = weights(theta);
                out.slip = w[0] * a.slip + w[1] * b.slip + w[2] * c.slip;
                out.velocity = w[0] * a.velocity + w[1] * b.velocity + w[2] * c.velocity;
                out.path = w[0] * a.path + w[1] * b.path + w[2] * c.path;
            });
    }

    /// Whether no element is driven beyond its strength.
    bool rests()
    {
        forces_.drive(now_.fields.slip, now_.fields.velocity, error_.slip);
        for (Index i = 0; i < fault_.size(); ++i) {
            const double path = now_.fields.path[i];
            const double forward = error_.slip[i] + fault_.weakening(i, path);
            if (forward > 0 || forward + 2 * fault_.strength(i, path) < 0) return false;
        }
        return true;
    }

    Rupture finish(Outcome outcome)
    {
        out_.outcome = outcome;
        record_.finish(t_, rest_time_, false, now_.fields);
        auto& s = out_.statistics;
        s.evaluations = forces_.evaluations() - evaluations_;
        s.products = forces_.product().count() - products_;
        if (const auto* learned = std::get_if<LearnedStep>(&controller_)) {
            s.asked = learned->asked;
            s.handed_over = learned->handed_over;
        }
        s.degree = forces_.root_of_stiffness().degree();
        s.bound = forces_.bound();
        return std::move(out_);
    }

    const StrikeSlipFault& fault_;
    const RuptureOptions& options_;
    const BatheOptions& bathe_;
    Rupture out_;
    FaultForces& forces_;
    std::uint64_t evaluations_;  // of the previous runs
    std::uint64_t products_;
    StepController controller_ = bathe_.controller;
    RuptureRecord record_;
    StageSolver solver_;
    StageOfFault stage_;
    Moment now_, next_, half_, coarse_;
    FaultFields middle_, first_middle_, error_;
    VectorXd unloaded_;
    double t_ = 0;
    double fastest_ = 0;
    double scaled_error_ = 0;  // of `step`
    StepView seen_;
    double rest_time_ = std::numeric_limits<double>::quiet_NaN();
};

constexpr detail::Refuse refuse_options{"BatheOptions"};

}  // namespace

void validate(const BatheOptions& o)
{
    validate(o.controller);
    if (o.first_stage == FirstStage::switch_aware) {
        refuse_options("the first stage of a fault is averaged or at_end");
    }
    const bool constant = std::holds_alternative<ConstantStep>(o.controller);
    if (!constant && o.estimate == ErrorEstimate::none)
        refuse_options("a controller needs an estimate of the error");
    if (o.estimate == ErrorEstimate::embedded && o.first_stage == FirstStage::at_end) {
        refuse_options("the embedded estimate is of the averaged first stage");
    }
    if (o.estimate == ErrorEstimate::embedded && o.norm == FaultNorm::components) {
        refuse_options("the norm of components is that of step doubling");
    }
    if (const auto* learned = std::get_if<LearnedStep>(&o.controller)) {
        if (o.estimate != ErrorEstimate::embedded) {
            refuse_options("a learned controller needs the embedded estimate of the error");
        }
        learned->policy->require(fault_step_layout());
    }
    if (!(o.rtol > 0)) refuse_options(fmt::format("rtol must be positive, got {}", o.rtol));
    if (!(o.atol >= 0))
        refuse_options(fmt::format("atol must be zero or positive, got {}", o.atol));
    if (!(o.floor > 0)) refuse_options(fmt::format("floor must be positive, got {}", o.floor));
    if (!(o.h_max >= 0))
        refuse_options(fmt::format("h_max must be zero or positive, got {}", o.h_max));
    if (!(o.tolerance > 0))
        refuse_options(fmt::format("tolerance must be positive, got {}", o.tolerance));
    if (o.max_iterations < 1 || o.max_inner < 1)
        refuse_options("at least one iteration must be allowed");
}

const StepLayout& fault_step_layout() noexcept
{
    static constexpr StepLayout layout{.system = StrikeSlipFault::name,
                                       .version = 1,
                                       .state = {{{"log_velocity", -4, 4},
                                                  {"asinh_growth", 0, 1},
                                                  {"log_time_to_stop", 2, 3},
                                                  {"exp_minus_path", 0.5, 0.5},
                                                  {"slipping", 1, 0.5},
                                                  {"log_strength_drop", 1.5, 1}}}};
    return layout;
}

struct BatheRuns::Parts {
    Parts(const StrikeSlipFault& of, double bound) : fault(of), forces(fault, bound) {}

    StrikeSlipFault fault;
    FaultForces forces;
};

BatheRuns::BatheRuns(const StrikeSlipFault& fault, double bound)
    : parts_(std::make_unique<Parts>(
          fault, detail::polynomial_bound(fault, {.t_end = 1, .polynomial_bound = bound})))
{
}
BatheRuns::BatheRuns(BatheRuns&&) noexcept = default;
BatheRuns& BatheRuns::operator=(BatheRuns&&) noexcept = default;
BatheRuns::~BatheRuns() = default;

const StrikeSlipFault& BatheRuns::fault() const noexcept
{
    return parts_->fault;
}

namespace {

void validate_both(const RuptureOptions& options, const BatheOptions& bathe)
{
    validate(options);
    validate(bathe);
    if (!(options.step > 0)) {
        throw std::invalid_argument(fmt::format(
            "RuptureOptions: step must be positive for implicit steps, got {}", options.step));
    }
}

}  // namespace

struct BatheMotion::Parts {
    Parts(const StrikeSlipFault& fault, FaultForces& forces, const RuptureOptions& o,
          const BatheOptions& b)
        : unit(fault.time_unit()), options(o), bathe(b), rupture(fault, forces, options, bathe)
    {
    }

    double unit;
    RuptureOptions options;
    BatheOptions bathe;
    BatheRupture rupture;
};

BatheMotion::BatheMotion(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
BatheMotion::BatheMotion(BatheMotion&&) noexcept = default;
BatheMotion& BatheMotion::operator=(BatheMotion&&) noexcept = default;
BatheMotion::~BatheMotion() = default;

bool BatheMotion::step(double h)
{
    return parts_->rupture.step(h / parts_->unit);
}
bool BatheMotion::ended() const noexcept
{
    return !(parts_->rupture.time() < parts_->rupture.end_time());
}
double BatheMotion::t() const noexcept
{
    return parts_->rupture.time() * parts_->unit;
}
bool BatheMotion::rests()
{
    return parts_->rupture.at_rest();
}
double BatheMotion::error() const noexcept
{
    return parts_->rupture.error();
}
const StepView& BatheMotion::view() const noexcept
{
    return parts_->rupture.seen();
}
const RuptureStatistics& BatheMotion::statistics() const noexcept
{
    return parts_->rupture.statistics();
}
double BatheMotion::mean_slip() const
{
    return parts_->rupture.mean_slip();
}

BatheMotion BatheRuns::start(const RuptureOptions& options, const BatheOptions& bathe)
{
    validate_both(options, bathe);
    return BatheMotion(
        std::make_unique<BatheMotion::Parts>(parts_->fault, parts_->forces, options, bathe));
}

Rupture BatheRuns::simulate(const RuptureOptions& options, const BatheOptions& bathe)
{
    validate_both(options, bathe);
    return BatheRupture(parts_->fault, parts_->forces, options, bathe).run();
}

Rupture simulate(const StrikeSlipFault& fault, const RuptureOptions& options,
                 const BatheOptions& bathe)
{
    validate_both(options, bathe);
    FaultForces forces(fault, detail::polynomial_bound(fault, options));
    return BatheRupture(fault, forces, options, bathe).run();
}

}  // namespace ricochet
