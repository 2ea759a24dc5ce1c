// A circuit with a set-valued diode.
#pragma once

#include <cmath>
#include <string_view>

#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {

/// Two capacitors, a coil and an element whose current has a constant magnitude and the sign of its
/// voltage, and is set-valued at voltage zero.
///
/// State w = (V1 [V], V2 [V], i [A]):
///
///     capacitance_1 V1' = (V2 - V1) / resistance + r,     r in -current Sgn(V1)
///     capacitance_2 V2' = (V1 - V2) / resistance + i
///     inductance i'     = -V2
///
/// V1 leaves zero when |V2| / resistance exceeds the current that the element carries.
/// (D. M. Riley and others, Reinforcement Learning-based adaptive time-integration for
/// nonsmooth dynamics, section 5.2; the value of `current` is that of their code.)
///
/// Between switches the solution is that of a linear system.
class DiodeCircuit {
public:
    struct Parameters {
        double capacitance_1 = 1.0 / 9;  ///< [F], positive
        double capacitance_2 = 1;        ///< [F], positive
        double resistance = 1 / 0.7;     ///< [Ohm], positive
        double inductance = 1.0 / 7;     ///< [H], positive
        double current = 0.8;            ///< [A], zero or positive
    };

    DiodeCircuit() = default;
    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit DiodeCircuit(const Parameters& parameters);

    static constexpr std::string_view name = "diode-circuit";
    static constexpr int state_size = 3;
    static constexpr int reaction_size = 1;
    static constexpr bool affine = true;
    using Vector = Eigen::Vector3d;

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }

    void smooth(double /*t*/, const Vector& w, Vector& f) const
    {
        const double through = (w[1] - w[0]) / p_.resistance;
        f[0] = through;
        f[1] = w[2] - through;
        f[2] = -w[1];
    }
    void smooth_jacobian(double /*t*/, const Vector& /*w*/, Eigen::Matrix3d& j) const
    {
        const double g = 1 / p_.resistance;
        j << -g, g, 0, g, -g, 1, 0, -1, 0;
    }
    void mass(Eigen::Matrix3d& a) const
    {
        a.setZero();
        a.diagonal() << p_.capacitance_1, p_.capacitance_2, p_.inductance;
    }
    [[nodiscard]] sets::IntervalSet reaction_set(double /*t*/, const Vector& /*w*/) const
    {
        return sets::IntervalSet::symmetric(p_.current);
    }

    /// Layout for step policies: times are measured in sqrt(inductance capacitance_2).
    [[nodiscard]] static const StepLayout& step_layout() noexcept;
    [[nodiscard]] double step_unit() const noexcept
    {
        return std::sqrt(p_.inductance * p_.capacitance_2);
    }
    void step_inputs(double t, const Vector& w, const Vector& rate,
                     const Eigen::Matrix<double, 1, 1>& reaction,
                     std::array<double, StepView::state_inputs>& out) const noexcept;

    [[nodiscard]] static Vector start() { return {9.998048, 1.980972, -10.908448}; }
    static constexpr double t_end = 20;  ///< [s]

private:
    Parameters p_;
};

}  // namespace ricochet
