// Internal: the declarations of this header may change without notice.
//
// Moreau's steps as the phases of a run need them, for any number of coordinates. States are arrays
// of twice as many doubles, (q, v).
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ricochet/nonsmooth/contact_results.hpp"
#include "ricochet/nonsmooth/detail/moreau_step.hpp"

namespace ricochet::detail {

/// Start of a step.
struct ContactStart {
    Mode mode;
    double t;
    const double* x;
};

class ContactSteps {
public:
    ContactSteps() = default;
    ContactSteps(const ContactSteps&) = delete;
    ContactSteps& operator=(const ContactSteps&) = delete;
    virtual ~ContactSteps() = default;

    /// The longest step of length h, h/2, h/4, ... that is possible, or the shortest of those
    /// tried.
    [[nodiscard]] virtual double reach(const ContactStart& from, double h) = 0;
    /// Whether the step was shortened by that.
    [[nodiscard]] virtual bool was_halved() const noexcept = 0;
    /// Whether the last attempt at a step had no solution.
    [[nodiscard]] virtual bool has_failed() const noexcept = 0;
    /// Takes a step; false where that is impossible.
    [[nodiscard]] virtual bool take(const ContactStart& from, double h, double* x1) = 0;
    /// A step to an inner time; the step that was taken stays as it is.
    [[nodiscard]] virtual bool take_to(const ContactStart& from, double s, double* x) = 0;
    /// The mean rate of a step of length h from anywhere.
    virtual void mean_rate(const ContactStart& from, double h, double* dxdt) = 0;
    /// Whether some contact is closed and at rest at a start, where forces neither press on it nor
    /// lift it by more than rounding, and is pressed on within the next h [s].
    [[nodiscard]] virtual bool will_push(const ContactStart& from, double h) const = 0;
    /// Whether no contact pushed in the step that was taken, all are open at (t, x) after it, and
    /// dry friction holds nothing.
    [[nodiscard]] virtual bool is_free(double t, const double* x) const = 0;
    /// The first contact whose gap is negative at (t, after) and smaller than at (t, before), by
    /// more than rounding, or -1.
    [[nodiscard]] virtual int driven_in(double t, const double* before,
                                        const double* after) const = 0;
    /// Of the step that was taken; zero before the first.
    [[nodiscard]] virtual ContactForces forces() const = 0;

    [[nodiscard]] virtual const TimeSteppingStatistics& statistics() const noexcept = 0;
    [[nodiscard]] virtual const ContactReport& failure() const noexcept = 0;

    virtual void save(std::vector<double>& memory) const = 0;
    virtual void restore(const double* memory) = 0;
};

template <int N>
class RICOCHET_ALIGNED ContactStepsOf final : public ContactSteps {
    using Step = MoreauStep<N>;
    using State = typename Step::State;
    using Vector = typename Step::Vector;

public:
    explicit ContactStepsOf(const AnyMechanism<N>& system) : step_(system, {})
    {
        from_ = to_ = probe_ = step_.start(0, Vector::Zero(), Vector::Zero());
        to_.t = std::numeric_limits<double>::quiet_NaN();
    }

    double reach(const ContactStart& from, double h) override
    {
        halvings_ = 0;
        while (!solve(from, h) && halvings_ < most_halvings) {
            ++halvings_;
            ++step_.statistics().unsolved;
            h /= 2;
        }
        gave_up_ = !solved_;
        return h;
    }
    bool was_halved() const noexcept override { return halvings_ > 0; }
    bool has_failed() const noexcept override { return !solved_; }
    bool take(const ContactStart& from, double h, double* x1) override
    {
        if (!solve(from, h)) return false;
        write(to_, x1);
        return true;
    }
    bool take_to(const ContactStart& from, double s, double* x) override
    {
        place(from);
        if (!step_.take(from.mode, from_, s, probe_)) return false;
        write(probe_, x);
        return true;
    }
    void mean_rate(const ContactStart& from, double h, double* dxdt) override
    {
        State start = from_;
        start.t = from.t;
        read(from.x, start);
        start.impulse.setZero();
        start.friction.setZero();
        Eigen::Map<Vector> v(dxdt), a(dxdt + N);
        if (step_.take(from.mode, start, h, probe_)) {
            v = (probe_.q - start.q) / h;
            a = (probe_.v - start.v) / h;
        } else {
            Vector free;
            step_.system().acceleration({from.mode, from.t}, start.q, start.v, free);
            v = start.v;
            a = free;
        }
    }
    [[nodiscard]] bool will_push(const ContactStart& from, double h) const override
    {
        State at = step_.start(from.t, Vector::Zero(), Vector::Zero());
        read(from.x, at);
        const auto& system = step_.system();
        for (int c = 0; c < system.contacts; ++c) {
            if (!rests(c, at)) continue;
            const double bend = change_of_rate(c, from.mode, at, 0, 1e-5 * h);
            const double later = change_of_rate(c, from.mode, at, h / 2, h);
            if (std::fabs(bend) <= 1e-6 && later < -1e-9) return true;
        }
        return false;
    }
    [[nodiscard]] int driven_in(double t, const double* before, const double* after) const override
    {
        const Vector from = Eigen::Map<const Vector>(before), to = Eigen::Map<const Vector>(after);
        const double rounding = 1e-12 * (1 + to.template lpNorm<Eigen::Infinity>());
        for (int c = 0; c < step_.system().contacts && from != to; ++c) {
            const double gap = step_.system().gap(c, t, to);
            if (gap < -rounding && gap < step_.system().gap(c, t, from) - rounding) return c;
        }
        return -1;
    }
    [[nodiscard]] bool is_free(double t, const double* x) const override
    {
        if (!to_.impulse.isZero(0)) return false;
        const Vector q = Eigen::Map<const Vector>(x);
        for (int c = 0; c < step_.system().contacts; ++c) {
            if (!(step_.system().gap(c, t, q) > 0)) return false;
        }
        constexpr double rounding = 1e-9;  // the solver's tolerance is a tenth of it
        for (std::size_t k = 0; k < step_.dry().size(); ++k) {
            const DryFriction& dry = step_.dry()[k];
            const double p = to_.friction[static_cast<Eigen::Index>(k)];
            const bool slips = std::fabs(p) >= (1 - rounding) * length_ * dry.force;
            if (!slips || !(p * x[N + dry.coordinate] < 0)) return false;
        }
        return true;
    }
    [[nodiscard]] ContactForces forces() const override
    {
        ContactForces out{Eigen::VectorXd::Zero(to_.impulse.size()), Eigen::VectorXd::Zero(N)};
        if (!(length_ > 0)) return out;
        out.contacts = to_.impulse / length_;
        for (std::size_t k = 0; k < step_.dry().size(); ++k) {
            out.coordinates[step_.dry()[k].coordinate] =
                to_.friction[static_cast<Eigen::Index>(k)] / length_;
        }
        return out;
    }
    const TimeSteppingStatistics& statistics() const noexcept override
    {
        return step_.statistics();
    }
    const ContactReport& failure() const noexcept override { return step_.failure(); }

    void save(std::vector<double>& memory) const override
    {
        memory.push_back(to_.t);
        memory.push_back(length_);
        for (const auto* v : {&to_.impulse, &to_.friction}) {
            memory.insert(memory.end(), v->data(), v->data() + v->size());
        }
        memory.insert(memory.end(), to_.q.data(), to_.q.data() + N);
        memory.insert(memory.end(), to_.v.data(), to_.v.data() + N);
    }
    void restore(const double* memory) override
    {
        to_.t = *memory++;
        length_ = *memory++;
        for (auto* v : {&to_.impulse, &to_.friction}) {
            for (Eigen::Index i = 0; i < v->size(); ++i) (*v)[i] = *memory++;
        }
        for (Eigen::Index i = 0; i < N; ++i) to_.q[i] = *memory++;
        for (Eigen::Index i = 0; i < N; ++i) to_.v[i] = *memory++;
        from_.t = std::numeric_limits<double>::quiet_NaN();
    }

private:
    /// Whether a contact is closed and at rest, up to rounding.
    [[nodiscard]] bool rests(int c, const State& at) const
    {
        constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();
        const auto is_zero = [](double value, const Vector& terms) {
            return std::fabs(value) <= rounding * terms.template lpNorm<Eigen::Infinity>();
        };
        return is_zero(step_.system().gap(c, at.t, at.q), at.q) &&
               is_zero(step_.system().gap_rate(c, at.t, at.q, at.v), at.v);
    }
    /// Change of the rate of a gap in s [s] of a motion with the free acceleration `lag` [s] after
    /// its start, in parts of the change of the velocity.
    [[nodiscard]] double change_of_rate(int c, Mode mode, const State& at, double lag,
                                        double s) const
    {
        const auto& system = step_.system();
        Vector a;
        system.acceleration({mode, at.t + lag}, at.q + lag * at.v, at.v, a);
        const Vector v = at.v + s * a, q = at.q + (s / 2) * (at.v + v);
        const double size = s * a.template lpNorm<Eigen::Infinity>();
        const double change =
            system.gap_rate(c, at.t + s, q, v) - system.gap_rate(c, at.t, at.q, at.v);
        return size > 0 ? change / size : 0;
    }
    static void read(const double* x, State& to)
    {
        to.q = Eigen::Map<const Vector>(x);
        to.v = Eigen::Map<const Vector>(x + N);
    }
    static void write(const State& from, double* x)
    {
        Eigen::Map<Vector> q(x), v(x + N);
        q = from.q;
        v = from.v;
    }
    /// Whether (t, x) is where a state is, up to the rounding with which a step is accepted.
    [[nodiscard]] static bool is_at(const State& there, const ContactStart& from)
    {
        constexpr double ulps = 8 * std::numeric_limits<double>::epsilon();
        const auto alike = [](double a, double b) {
            return std::fabs(a - b) <= ulps * std::fabs(b);
        };
        if (!alike(from.t, there.t)) return false;
        for (Eigen::Index i = 0; i < N; ++i) {
            if (!alike(from.x[i], there.q[i]) || !alike(from.x[N + i], there.v[i])) return false;
        }
        return true;
    }
    /// Sets the start of a step, with the impulses of the step before if it goes on from there.
    void place(const ContactStart& from)
    {
        const bool again = from_.t == from.t && from_mode_ == from.mode && is_exactly(from);
        if (again) return;
        gave_up_ = false;
        const bool goes_on = is_at(to_, from);
        from_.t = from.t;
        from_mode_ = from.mode;
        read(from.x, from_);
        length_ = 0;
        solved_ = false;
        if (goes_on) {
            from_.impulse = to_.impulse;
            from_.friction = to_.friction;
        } else {
            from_.impulse.setZero();
            from_.friction.setZero();
        }
    }
    [[nodiscard]] bool is_exactly(const ContactStart& from) const
    {
        return from_.q == Eigen::Map<const Vector>(from.x) &&
               from_.v == Eigen::Map<const Vector>(from.x + N);
    }
    [[nodiscard]] bool solve(const ContactStart& from, double h)
    {
        place(from);
        if (gave_up_) return false;
        if (h == length_) return solved_;
        solved_ = step_.take(from.mode, from_, h, to_);
        length_ = h;
        return solved_;
    }

    Step step_;
    Mode from_mode_ = 0;
    State from_, to_;    ///< of the step that was taken
    double length_ = 0;  ///< [s] of it, or of the attempt
    bool solved_ = false;
    int halvings_ = 0;
    bool gave_up_ = false;  ///< no length that was tried is possible
    State probe_;
};

}  // namespace ricochet::detail
