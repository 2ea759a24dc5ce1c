#include "ricochet/systems/diode_circuit.hpp"

#include "complete.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace diode_circuit {
namespace {

enum : std::size_t {
    capacitance_1,
    capacitance_2,
    resistance,
    inductance,
    current,
    voltage_1,
    voltage_2,
    coil_current
};  // the order of parameters

DiodeCircuit system(const std::vector<double>& p)
{
    return DiodeCircuit({.capacitance_1 = p[capacitance_1],
                         .capacitance_2 = p[capacitance_2],
                         .resistance = p[resistance],
                         .inductance = p[inductance],
                         .current = p[current]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[voltage_1], p[voltage_2], p[coil_current]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion<Fehlberg78>(
        system(p), Eigen::Vector3d(p[voltage_1], p[voltage_2], p[coil_current]), settings, repeats);
}

}  // namespace
}  // namespace diode_circuit

void complete_diode_circuit(SystemEntry& entry)
{
    using namespace diode_circuit;
    entry.start = start;
    entry.run = run;
}

}  // namespace ricochet::app
