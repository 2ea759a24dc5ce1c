#include "identify_friction.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <stdexcept>

#include "ricochet/learn/levenberg_marquardt.hpp"

namespace ricochet::learn {

namespace {

using Histories = std::vector<FrictionHistory>;

/// log(V* theta / L) along a history and its derivatives by log L and by the start.
struct StatePath {
    std::vector<double> xi, by_log_l, by_start;
};

StatePath path(const FrictionHistory& h, double v_star, double log_l, double xi_start)
{
    const double l = std::exp(log_l);
    StatePath out;
    const double theta = l / v_star * std::exp(xi_start);
    // d theta / d log L at the start: theta itself, since xi is held fixed.
    AgeingState s{theta, theta};
    double by_start = theta;
    for (std::size_t n = 0; n < h.t.size(); ++n) {
        if (n > 0) {
            const double v0 = h.v[n - 1];
            const double v1 = h.between == FrictionHistory::Between::linear ? h.v[n] : v0;
            const double dt = h.t[n] - h.t[n - 1];
            s = advance_ageing(s, l, v0, v1, dt);
            by_start *= std::exp(-dt * (v0 + v1) / 2 / l);
        }
        out.xi.push_back(std::log(v_star * s.theta / l));
        out.by_log_l.push_back(s.by_log_l / s.theta - 1);
        out.by_start.push_back(by_start / s.theta);
    }
    return out;
}

/// Parameters in the order f*, a, b, log L, xi at the start.
double sum_of_squares(const Histories& histories, double v_star, const Eigen::VectorXd& p,
                      Eigen::MatrixXd* normal, Eigen::VectorXd* gradient)
{
    if (normal != nullptr) normal->setZero(p.size(), p.size());
    if (gradient != nullptr) gradient->setZero(p.size());
    double sum = 0;
    for (const FrictionHistory& h : histories) {
        const StatePath s = path(h, v_star, p[3], p[4]);
        for (std::size_t n = 0; n < h.t.size(); ++n) {
            const double y = std::log(h.v[n] / v_star);
            const double r = p[0] + p[1] * y + p[2] * s.xi[n] - h.friction[n];
            sum += r * r;
            if (normal == nullptr) continue;
            Eigen::Matrix<double, 5, 1> row;
            row << 1, y, s.xi[n], p[2] * s.by_log_l[n], p[2] * s.by_start[n];
            *normal += row * row.transpose();
            *gradient += r * row;
        }
    }
    return sum;
}

/// The best f*, a, b for a given D_RS, xi = 0 at the start.
Eigen::VectorXd best_for(const Histories& histories, double v_star, double log_l, double& sum)
{
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double square = 0;
    for (const FrictionHistory& h : histories) {
        const StatePath s = path(h, v_star, log_l, 0);
        for (std::size_t n = 0; n < h.t.size(); ++n) {
            const Eigen::Vector3d row(1, std::log(h.v[n] / v_star), s.xi[n]);
            normal += row * row.transpose();
            right += h.friction[n] * row;
            square += h.friction[n] * h.friction[n];
        }
    }
    const Eigen::Vector3d best = normal.ldlt().solve(right);
    sum = square - best.dot(right);
    Eigen::VectorXd p(5);
    p << best, log_l, 0;
    return p;
}

Eigen::VectorXd start(const Histories& histories, double v_star)
{
    Eigen::VectorXd best;
    double least = std::numeric_limits<double>::infinity();
    for (double log_l = std::log(1e-9); log_l < std::log(1e-2); log_l += 0.5) {
        double sum = 0;
        const Eigen::VectorXd p = best_for(histories, v_star, log_l, sum);
        if (p[1] > 0 && p[2] > 0 && sum < least) {
            least = sum;
            best = p;
        }
    }
    if (best.size() == 0) {
        throw std::invalid_argument(
            "identify_ageing_law: friction does not rise with slip rate and state for any D_RS in "
            "[1e-9, 1e-2] m");
    }
    return best;
}

}  // namespace

IdentifiedFriction identify_ageing_law(const Histories& histories, double v_star,
                                       const std::atomic<bool>* cancelled)
{
    if (histories.empty()) {
        throw std::invalid_argument("identify_ageing_law: expected histories, got none");
    }
    if (!(v_star > 0 && std::isfinite(v_star))) {
        throw std::invalid_argument(
            fmt::format("identify_ageing_law: V* must be positive and finite, got {}", v_star));
    }
    std::size_t samples = 0;
    for (const FrictionHistory& h : histories) {
        validate(h);
        if (h.friction.empty()) {
            throw std::invalid_argument("identify_ageing_law: a history without friction");
        }
        samples += h.t.size();
    }
    Eigen::VectorXd p = start(histories, v_star);
    const SumOfSquares problem = [&](const Eigen::VectorXd& at, Eigen::MatrixXd* normal,
                                     Eigen::VectorXd* gradient) {
        return sum_of_squares(histories, v_star, at, normal, gradient);
    };
    const LevenbergMarquardtReport report = levenberg_marquardt(
        problem, p, {.iterations = 60, .damping = 1e-6, .cancelled = cancelled});

    Eigen::MatrixXd normal(5, 5);
    Eigen::VectorXd gradient(5);
    const double sum = problem(p, &normal, &gradient);
    const double variance = sum / static_cast<double>(samples - 5);
    const Eigen::VectorXd error = (variance * normal.inverse().diagonal().cwiseMax(0)).cwiseSqrt();
    return {.parameters =
                {.a = p[1], .b = p[2], .f_star = p[0], .v_star = v_star, .d_rs = std::exp(p[3])},
            .xi_start = p[4],
            .a_error = error[1],
            .b_error = error[2],
            .f_star_error = error[0],
            .log_d_rs_error = error[3],
            .xi_error = error[4],
            .residual = std::sqrt(sum / static_cast<double>(samples)),
            .iterations = report.iterations,
            .converged = report.converged};
}

}  // namespace ricochet::learn
