#include "ricochet/sensitivity/sensitivities.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <complex>

#include "base/require.hpp"

namespace ricochet {

std::string_view name(ShootingEnd end) noexcept
{
    switch (end) {
        case ShootingEnd::closed: return "closed";
        case ShootingEnd::equilibrium: return "equilibrium";
        case ShootingEnd::iteration_limit: return "iteration_limit";
        case ShootingEnd::stalled: return "stalled";
        case ShootingEnd::run_ended: return "run_ended";
        case ShootingEnd::other_mode: return "other_mode";
        case ShootingEnd::undefined_derivative: return "undefined_derivative";
    }
    return "unknown";
}

std::string_view describe(ShootingEnd end) noexcept
{
    switch (end) {
        case ShootingEnd::closed: return "the orbit closes";
        case ShootingEnd::equilibrium:
            return "the search has led to a point at which the motion stands still; start nearer "
                   "to the orbit";
        case ShootingEnd::iteration_limit:
            return "as many corrections were made as allowed; allow more or start nearer";
        case ShootingEnd::stalled:
            return "no correction brings the ends of the orbit closer; tighten rtol and atol of "
                   "the run, or start nearer to an orbit";
        case ShootingEnd::run_ended:
            return "the run from the guess ends before a period is over; its outcome says why";
        case ShootingEnd::other_mode:
            return "after a period the motion is in another mode or dimension; start elsewhere "
                   "on the orbit, or with another period";
        case ShootingEnd::undefined_derivative:
            return "the motion meets an event through which there is no derivative, such as a "
                   "grazing one; start elsewhere";
    }
    return "unknown";
}

void validate(const Shooting& shooting)
{
    constexpr detail::Require require{"Shooting"};
    const Shooting& s = shooting;
    require(std::isfinite(s.period) && s.period > 0, "period must be positive and finite [s]",
            s.period);
    require(std::isfinite(s.tolerance) && s.tolerance > 0, "tolerance must be positive and finite",
            s.tolerance);
    require(s.max_iterations >= 0, "max_iterations must be zero or positive", s.max_iterations);
}

Eigen::VectorXcd floquet_multipliers(const Eigen::MatrixXd& monodromy)
{
    if (!monodromy.allFinite()) {
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        return Eigen::VectorXcd::Constant(monodromy.rows(), std::complex<double>(nan, nan));
    }
    Eigen::VectorXcd values = monodromy.eigenvalues();
    std::sort(values.begin(), values.end(),
              [](const auto& a, const auto& b) { return std::abs(a) > std::abs(b); });
    return values;
}

namespace detail {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Singular values below this fraction of the largest belong to directions along a family of
/// orbits: the monodromy matrix is known to about 1e-12.
constexpr double rank_threshold = 1e-9;

/// x(T) - x0 in units of max(1, |x0|).
[[nodiscard]] Eigen::VectorXd scaled_gap(const Shot& shot, const Eigen::VectorXd& x)
{
    return ((shot.end - x).array() / x.array().abs().max(1.0)).matrix();
}

[[nodiscard]] bool usable(const Shot& shot)
{
    return shot.problem == ShootingEnd::closed || shot.problem == ShootingEnd::undefined_derivative;
}

/// Gap below which the damping is not reduced further: well above the singular values that noise in
/// the monodromy matrix produces, and far below values that slow down convergence.
constexpr double least_damping = 1e-6;

struct Correction {
    Eigen::VectorXd dx;
    double dt;
};

/// The correction of a forced orbit: Newton's.
[[nodiscard]] Correction forced_correction(const Shot& shot, const Eigen::VectorXd& x)
{
    const Eigen::Index n = x.size();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition(n, n);
    decomposition.setThreshold(rank_threshold);
    decomposition.compute(shot.monodromy - Eigen::MatrixXd::Identity(n, n));
    return {decomposition.solve(x - shot.end), 0.0};
}

/// The correction of an autonomous orbit: of Levenberg and Marquardt, with the square of
/// the gap as parameter.
[[nodiscard]] Correction autonomous_correction(const Shot& shot, const Eigen::VectorXd& x,
                                               const Eigen::VectorXd& phase)
{
    const Eigen::Index n = x.size();
    const Eigen::VectorXd gap = scaled_gap(shot, x);
    const Eigen::VectorXd unit = x.array().abs().max(1.0).inverse().matrix();
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(2 * (n + 1), n + 1);
    jacobian.topLeftCorner(n, n) =
        unit.asDiagonal() * (shot.monodromy - Eigen::MatrixXd::Identity(n, n));
    jacobian.block(0, n, n, 1) = unit.cwiseProduct(shot.end_rate);
    jacobian.block(n, 0, 1, n) = phase.transpose();
    jacobian.bottomRows(n + 1).diagonal().setConstant(std::max(gap.norm(), least_damping));
    Eigen::VectorXd target = Eigen::VectorXd::Zero(2 * (n + 1));
    target.head(n) = -gap;
    const Eigen::VectorXd step = jacobian.colPivHouseholderQr().solve(target);
    return {step.head(n), step[n]};
}

/// A search in progress.
class Search {
public:
    Search(const std::function<Shot(const Eigen::VectorXd&, double)>& shoot,
           const Eigen::VectorXd& guess, const Shooting& shooting)
        : shoot_(shoot), shooting_(shooting), x_(guess), period_(shooting.period)
    {
    }

    [[nodiscard]] ShotOrbit take()
    {
        shot_ = shoot_(x_, period_);
        if (!usable(shot_)) return result(shot_.problem);
        phase_ = shot_.start_rate.normalized();
        for (;;) {
            const double residual = scaled_gap(shot_, x_).lpNorm<Eigen::Infinity>();
            if (residual <= shooting_.tolerance) {
                return result(stands_still() ? ShootingEnd::equilibrium : ShootingEnd::closed);
            }
            if (shot_.problem != ShootingEnd::closed) return result(shot_.problem);
            if (iterations_ == shooting_.max_iterations) {
                return result(ShootingEnd::iteration_limit);
            }
            if (!correct()) return result(ShootingEnd::stalled);
            ++iterations_;
        }
    }

private:
    /// Whether the motion closes only because nothing moves.
    [[nodiscard]] bool stands_still() const
    {
        const double moves =
            (period_ * shot_.start_rate.array().abs() / x_.array().abs().max(1.0)).maxCoeff();
        return shooting_.autonomous && moves <= 100 * shooting_.tolerance;
    }

    /// Applies the correction, halved until it reduces the gap.
    [[nodiscard]] bool correct()
    {
        const Correction whole = shooting_.autonomous ? autonomous_correction(shot_, x_, phase_)
                                                      : forced_correction(shot_, x_);
        if (!whole.dx.allFinite() || !std::isfinite(whole.dt)) return false;
        const double gap = scaled_gap(shot_, x_).norm();
        double part = 1;
        for (int halvings = 0; halvings <= most_halvings; ++halvings, part /= 2) {
            const Eigen::VectorXd x = x_ + part * whole.dx;
            const double period = period_ + part * whole.dt;
            if (!(std::fabs(period - period_) <= period_ / 4)) continue;
            Shot shot = shoot_(x, period);
            if (!usable(shot)) continue;
            if (!(scaled_gap(shot, x).norm() <= (1 - part / 4) * gap)) continue;
            x_ = x;
            period_ = period;
            shot_ = std::move(shot);
            return true;
        }
        return false;
    }

    [[nodiscard]] ShotOrbit result(ShootingEnd end) const
    {
        const Eigen::Index n = x_.size();
        ShotOrbit orbit{.end = end,
                        .x = x_,
                        .period = period_,
                        .residual = nan,
                        .iterations = iterations_,
                        .monodromy = Eigen::MatrixXd::Constant(n, n, nan),
                        .multipliers = {}};
        if (usable(shot_)) {
            orbit.residual = scaled_gap(shot_, x_).lpNorm<Eigen::Infinity>();
            orbit.monodromy = shot_.monodromy;
        }
        orbit.multipliers = floquet_multipliers(orbit.monodromy);
        return orbit;
    }

    static constexpr int most_halvings = 7;

    const std::function<Shot(const Eigen::VectorXd&, double)>& shoot_;
    const Shooting& shooting_;
    Eigen::VectorXd x_;
    double period_;
    Eigen::VectorXd phase_;
    Shot shot_;
    int iterations_ = 0;
};

}  // namespace

ShotOrbit shoot_orbit(const std::function<Shot(const Eigen::VectorXd&, double)>& shoot,
                      const Eigen::VectorXd& guess, const Shooting& shooting)
{
    return Search(shoot, guess, shooting).take();
}

}  // namespace detail

}  // namespace ricochet
