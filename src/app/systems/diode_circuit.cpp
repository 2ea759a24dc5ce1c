#include "ricochet/systems/diode_circuit.hpp"

#include "entries.hpp"

namespace ricochet::app {

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
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.05,
        .published_errors = {"PI         293 steps, 25.3 s, relative L2 3.8e-3",
                             "heuristic  414 steps, 34.8 s, relative L2 4.4e-3",
                             "TQC        41 steps, 2.67 s, relative L2 0.196",
                             "TD3        4572 steps, 260.7 s, relative L2 0.272"},
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
