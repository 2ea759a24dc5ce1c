#include "ricochet/systems/diode_circuit.hpp"

#include "require.hpp"

namespace ricochet {

DiodeCircuit::DiodeCircuit(const Parameters& parameters) : p_(parameters)
{
    detail::require_positive("DiodeCircuit", "capacitance_1", p_.capacitance_1);
    detail::require_positive("DiodeCircuit", "capacitance_2", p_.capacitance_2);
    detail::require_positive("DiodeCircuit", "resistance", p_.resistance);
    detail::require_positive("DiodeCircuit", "inductance", p_.inductance);
    detail::require_not_negative("DiodeCircuit", "current", p_.current);
}

}  // namespace ricochet
