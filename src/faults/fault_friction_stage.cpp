#include "fault_friction_stage.hpp"

#include <cmath>

namespace ricochet {

namespace {

double root(double eigenvalue)
{
    return std::sqrt(eigenvalue);
}

}  // namespace

StageStiffness::StageStiffness(const StrikeSlipFault& fault, double bound)
    : damping_(2 * fault.parameters().damping), product_(fault.stiffness())
{
    const detail::Spectrum spectrum = fault.stiffness().spectrum();
    root_ = StiffnessSeries::within(root, spectrum, bound);
    rough_root_ = StiffnessSeries::within(root, spectrum, rough);
    bound_ = root_.relative_error(root);

    const Eigen::Index n = fault.elements();
    const Eigen::Index middle = (n / 2) * n + n / 2;
    Eigen::VectorXd x = Eigen::VectorXd::Unit(fault.size(), middle);
    Eigen::VectorXd y(fault.size());
    product_(x, y);
    k_middle_ = y[middle];
    root_.apply(product_, x, y, scratch_);
    h_middle_ = damping_ * y[middle];
    x.setOnes();
    k_ones_.resize(fault.size());
    product_(x, k_ones_);
    root_.apply(product_, x, y, scratch_);
    h_ones_ = damping_ * y;
}

void StageStiffness::set_length(double g)
{
    if (g == g_) return;
    g_ = g;
    m_.combine(root_, 1 / g, g, damping_);
    rough_m_.combine(rough_root_, 1 / g, g, damping_);
}

double StageStiffness::diagonal() const noexcept
{
    return 1 / g_ + h_middle_ + g_ * k_middle_;
}

void StageStiffness::apply(const Eigen::VectorXd& x, Eigen::VectorXd& y)
{
    apply(m_, x, y);
}

void StageStiffness::approximate(const Eigen::VectorXd& x, Eigen::VectorXd& y)
{
    apply(rough_m_, x, y);
}

void StageStiffness::apply(const StiffnessSeries& series, const Eigen::VectorXd& x,
                           Eigen::VectorXd& y)
{
    if (damping_ > 0) return series.apply(product_, x, y, scratch_);
    product_(x, y);
    y = x / g_ + g_ * y;
}

}  // namespace ricochet
