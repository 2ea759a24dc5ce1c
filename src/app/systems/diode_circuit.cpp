#include "ricochet/systems/diode_circuit.hpp"

#include "entries.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

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

SystemEntry diode_circuit_entry()
{
    return {
        .name = DiodeCircuit::name,
        .description =
            "A circuit with an element whose voltage is held at zero, or only has a "
            "sign.",
        .source =
            "D. M. Riley and others, Reinforcement Learning-based adaptive "
            "time-integration for nonsmooth dynamics, section 5.2",
        .parameters = {{.name = "capacitance-1",
                        .initial = 1.0 / 9,
                        .unit = "F",
                        .range = {.lower = 0},
                        .meaning = "beside the element"},
                       {.name = "capacitance-2",
                        .initial = 1,
                        .unit = "F",
                        .range = {.lower = 0},
                        .meaning = "beside the coil"},
                       {.name = "resistance",
                        .initial = 1 / 0.7,
                        .unit = "Ohm",
                        .range = {.lower = 0},
                        .meaning = "between the capacitors"},
                       {.name = "inductance",
                        .initial = 1.0 / 7,
                        .unit = "H",
                        .range = {.lower = 0},
                        .meaning = "of the coil"},
                       {.name = "current",
                        .initial = 0.8,
                        .unit = "A",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "that the element carries at most"},
                       {.name = "V1",
                        .initial = DiodeCircuit::start()[0],
                        .unit = "V",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "V2",
                        .initial = DiodeCircuit::start()[1],
                        .unit = "V",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "i",
                        .initial = DiodeCircuit::start()[2],
                        .unit = "A",
                        .range = {},
                        .meaning = "at the start"}},
        .state = {{.name = "V1", .unit = "V", .meaning = "at the element"},
                  {.name = "V2", .unit = "V", .meaning = "at the coil"},
                  {.name = "i", .unit = "A", .meaning = "through the coil"}},
        .guards = {{.name = "element", .event = "switch"}},
        .modes = {"positive", "held", "negative", "set-valued"},
        .t_end = DiodeCircuit::t_end,
        .start = start,
        .run = run,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.05,
        .published_errors = {"PI         293 steps, 25.3 s, relative L2 3.8e-3",
                             "heuristic  414 steps, 34.8 s, relative L2 4.4e-3",
                             "TQC        41 steps, 2.67 s, relative L2 0.196",
                             "TD3        4572 steps, 260.7 s, relative L2 0.272"},
    };
}

}  // namespace ricochet::app
