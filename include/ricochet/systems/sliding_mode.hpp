// A sliding-mode controller: a relay holds a disturbed state at zero.
#pragma once

#include <cmath>
#include <string_view>

#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {

/// A first-order sliding-mode controller under a periodic disturbance.
///
///     w' = amplitude sin(frequency t) + r,     r in -gain Sgn(w)
///
/// With gain > amplitude w reaches 0 in finite time and stays there, r balancing the
/// disturbance. (D. M. Riley and others, Reinforcement Learning-based adaptive
/// time-integration for nonsmooth dynamics, section 5.1.)
///
/// Known solution, from w(0) > 0 and until it first vanishes:
///
///     w = w(0) + (amplitude / frequency) (1 - cos(frequency t)) - gain t
class SlidingMode {
public:
    struct Parameters {
        double amplitude = 1.75;  ///< [1/s], zero or positive
        double frequency = 50;    ///< [rad/s], positive
        double gain = 2;          ///< [1/s], zero or positive
    };

    SlidingMode() = default;
    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit SlidingMode(const Parameters& parameters);

    static constexpr std::string_view name = "sliding-mode";
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    static constexpr bool affine = true;
    using Vector = Eigen::Matrix<double, 1, 1>;

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }

    void smooth(double t, const Vector& /*w*/, Vector& f) const
    {
        f[0] = p_.amplitude * std::sin(p_.frequency * t);
    }
    void smooth_jacobian(double /*t*/, const Vector& /*w*/, Eigen::Matrix<double, 1, 1>& j) const
    {
        j(0, 0) = 0;
    }
    [[nodiscard]] sets::IntervalSet reaction_set(double /*t*/, const Vector& /*w*/) const
    {
        return sets::IntervalSet::symmetric(p_.gain);
    }

    /// Layout for step policies: times are measured in radians of the disturbance.
    [[nodiscard]] static const StepLayout& step_layout() noexcept;
    [[nodiscard]] double step_unit() const noexcept { return 1 / p_.frequency; }
    void step_inputs(double t, const Vector& w, const Vector& rate, const Vector& reaction,
                     std::array<double, StepView::state_inputs>& out) const noexcept;

    /// w(t) from w(0) = `from` > 0, for gain > amplitude.
    [[nodiscard]] double exact(double t, double from) const noexcept;

    /// Time [s] at which w first vanishes from w(0) = `from` > 0, for gain > amplitude, exact to
    /// neighbouring doubles of the closed form.
    [[nodiscard]] double reaching_time(double from) const noexcept;

    static constexpr double start = 0.15;  ///< [-]
    static constexpr double t_end = 0.5;   ///< [s]

private:
    [[nodiscard]] double reaching(double t, double from) const noexcept;
    Parameters p_;
};

}  // namespace ricochet
