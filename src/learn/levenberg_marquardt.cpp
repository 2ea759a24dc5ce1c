#include "ricochet/learn/levenberg_marquardt.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <ctime>

namespace ricochet::learn {

namespace {

double processor_time()
{
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

}  // namespace

LevenbergMarquardtReport levenberg_marquardt(const SumOfSquares& problem, Eigen::VectorXd& p,
                                             const LevenbergMarquardtOptions& options)
{
    const double start = processor_time();
    const auto cancelled = [&] {
        return options.cancelled && options.cancelled->load(std::memory_order_relaxed);
    };
    LevenbergMarquardtReport report;
    Eigen::MatrixXd normal(p.size(), p.size());
    Eigen::VectorXd gradient(p.size());
    report.sum = problem(p, &normal, &gradient);
    Eigen::VectorXd scale = normal.diagonal();
    double damping = options.damping;
    double growth = 2;
    while (report.trials < 4 * options.iterations && report.iterations < options.iterations &&
           processor_time() - start < options.seconds && !cancelled()) {
        if (report.sum <= options.target) {
            report.converged = true;
            break;
        }
        // The scale never shrinks, so that a parameter without effect is held.
        scale = scale.cwiseMax(normal.diagonal()).cwiseMax(1e-30);
        Eigen::MatrixXd damped = normal;
        damped.diagonal() += damping * scale;
        const Eigen::VectorXd step = -damped.ldlt().solve(gradient);
        if (!(step.cwiseAbs().array() > options.step_tolerance * (1 + p.cwiseAbs().array()))
                 .any()) {
            report.converged = true;
            break;
        }
        const Eigen::VectorXd trial = p + step;
        const double sum = problem(trial, nullptr, nullptr);
        ++report.trials;
        // Predicted by the linear model: step^T (damping D step - gradient).
        const double predicted = step.dot(damping * scale.cwiseProduct(step) - gradient);
        const double gain = (report.sum - sum) / predicted;
        if (std::isfinite(sum) && sum < report.sum) {
            p = trial;
            ++report.iterations;
            report.sum = problem(p, &normal, &gradient);
            damping *= std::max(1.0 / 10, 1 - std::pow(2 * gain - 1, 3));
            growth = 2;
        } else {
            if (damping > 1e12) {
                report.converged = true;
                break;
            }
            damping *= growth;
            growth *= 2;
        }
    }
    return report;
}

}  // namespace ricochet::learn
