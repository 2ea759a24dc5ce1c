#include "ricochet/systems/diode_circuit.hpp"

#include <algorithm>

#include "base/require.hpp"

namespace ricochet {

DiodeCircuit::DiodeCircuit(const Parameters& parameters) : p_(parameters)
{
    detail::require_positive("DiodeCircuit", "capacitance_1", p_.capacitance_1);
    detail::require_positive("DiodeCircuit", "capacitance_2", p_.capacitance_2);
    detail::require_positive("DiodeCircuit", "resistance", p_.resistance);
    detail::require_positive("DiodeCircuit", "inductance", p_.inductance);
    detail::require_not_negative("DiodeCircuit", "current", p_.current);
}

const StepLayout& DiodeCircuit::step_layout() noexcept
{
    static constexpr StepLayout layout{.system = name,
                                       .version = 1,
                                       .state = {{{"log_energy", 1, 2},
                                                  {"log_voltage", 0, 3},
                                                  {"asinh_rate", 0, 2},
                                                  {"log_time_to_switch", 2, 3},
                                                  {"reaction", 0.7, 0.5},
                                                  {"asinh_load", 0, 2}}}};
    return layout;
}

void DiodeCircuit::step_inputs(double /*t*/, const Vector& w, const Vector& rate,
                               const Eigen::Matrix<double, 1, 1>& reaction,
                               std::array<double, StepView::state_inputs>& out) const noexcept
{
    // The motion is symmetric: signs are those of V1, or, where V1 is zero, follow from the
    // reaction.
    const double sign = w[0] > 0 || (w[0] == 0 && reaction[0] < 0) ? 1 : -1;
    const double current = std::max(p_.current, 1e-300);
    const double voltage = current * p_.resistance;
    const double energy = p_.capacitance_1 * w[0] * w[0] + p_.capacitance_2 * w[1] * w[1] +
                          p_.inductance * w[2] * w[2];
    const double distance = std::abs(w[0]) / voltage;
    const double speed = sign * rate[0] * step_unit() / voltage;
    constexpr double far = 8;  // used as the logarithm of an infinite time
    const double reached =
        distance > 0 && speed < 0 ? std::clamp(std::log(distance / -speed), -far, far) : far;
    out = {0.5 * std::log(std::max(energy / (p_.capacitance_2 * voltage * voltage), 1e-16)),
           std::log(std::max(distance, 1e-6)),
           std::asinh(speed),
           reached,
           std::abs(reaction[0]) / current,
           std::asinh(sign * w[1] / voltage)};
}

}  // namespace ricochet
