// Descriptions of differential inclusions; `ricochet-nonsmooth` runs them.
#include "entries.hpp"
#include "has_series.hpp"
#include "labels.hpp"
#include "problems/super_twisting.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::app {

// --- friction inclusion ---

// Long: one entry of the list of systems.
SystemEntry friction_inclusion_entry()
{
    return {
        .name = FrictionInclusion::name,
        .description = "A mass on a spring rubs on a belt, under one of several laws of friction.",
        .equations =
            {"mass u'' = -stiffness u + r,  s = |v - belt-speed|",
             "slipping: |r| = F(s), against v - belt-speed", "sticking: |r| <= F(0)",
             "law 0, constant:    F(s) = friction",
             "law 1, hyperbolic:  F(s) = friction / (1 + weakening s)",
             "law 2, exponential: F(s) = residual + (friction - residual) exp(-weakening s)",
             "law 3, humped:      F(s) = friction (1 - weakening s + weakening^2 s^2 / 3),",
             "                           at least residual"},
        .parameters = {{.name = "law",
                        .initial = 2,
                        .unit = "1",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "0 constant, 1 hyperbolic, 2 exponential, 3 humped"},
                       {.name = "mass",
                        .initial = 1,
                        .unit = "kg",
                        .range = {.lower = 0},
                        .meaning = "on the belt"},
                       {.name = "stiffness",
                        .initial = 1,
                        .unit = "N/m",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the spring"},
                       {.name = "belt-speed",
                        .initial = 0.2,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "of the belt"},
                       {.name = "friction",
                        .initial = 1,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "at rest on the belt"},
                       {.name = "weakening",
                        .initial = 3,
                        .unit = "s/m",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "with the sliding speed"},
                       {.name = "residual",
                        .initial = 0.2,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "at high speed, of the laws 2 and 3"},
                       {.name = "position",
                        .initial = 0,
                        .unit = "m",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "velocity",
                        .initial = 0.2,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "at the start"}},
        .state = {{.name = "u", .unit = "m", .meaning = "position"},
                  {.name = "v", .unit = "m/s", .meaning = "velocity"}},
        .guards = {{.name = "belt", .event = "switch"}},
        .modes = {"faster", "held", "slower", "set-valued"},
        .t_end = 30,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.01,
        .program = "nonsmooth",
    };
}

// --- sliding mode ---

SystemEntry sliding_mode_entry()
{
    return {
        .name = SlidingMode::name,
        .description = "A relay brings a disturbed state to zero and holds it there.",
        .source =
            "D. M. Riley and others, Reinforcement Learning-based adaptive "
            "time-integration for nonsmooth dynamics, section 5.1",
        .parameters = {{.name = "amplitude",
                        .initial = 1.75,
                        .unit = "1/s",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the disturbance"},
                       {.name = "frequency",
                        .initial = 50,
                        .unit = "rad/s",
                        .range = {.lower = 0},
                        .meaning = "of the disturbance"},
                       {.name = "gain",
                        .initial = 2,
                        .unit = "1/s",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the relay"},
                       {.name = "start",
                        .initial = SlidingMode::start,
                        .unit = "1",
                        .range = {},
                        .meaning = "w at the start"}},
        .state = {{.name = "w", .unit = "1", .meaning = "the controlled state"}},
        .guards = {{.name = "relay", .event = "switch"}},
        .modes = {"positive", "held", "negative", "set-valued"},
        .t_end = SlidingMode::t_end,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 1.25e-3,
        .published_errors = {"PI         48 steps, 0.678 s, L2 1.94e-4",
                             "heuristic  55 steps, 0.631 s, L2 1.70e-4",
                             "TQC        0.278 s, L2 2.94e-4", "TD3        0.297 s, L2 2.71e-4"},
        .known_solution = "the state at any time",
        .program = "nonsmooth",
    };
}

// --- super twisting ---

SystemEntry super_twisting_entry()
{
    return {
        .name = SuperTwisting::name,
        .description =
            "A continuous control with a relay in its integral holds a disturbed state at zero.",
        .source =
            "A. Levant, Sliding order and sliding accuracy in sliding mode control, "
            "International Journal of Control 58, 1993",
        .parameters =
            {{.name = "gain-1",
              .initial = 3,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the square root"},
             {.name = "gain-2",
              .initial = 2.2,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the relay"},
             {.name = "amplitude",
              .initial = 1,
              .unit = "1",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of the disturbance"},
             {.name = "frequency",
              .initial = 1,
              .unit = "rad/s",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of the disturbance"},
             {.name = "x1", .initial = 1, .unit = "1", .range = {}, .meaning = "at the start"},
             {.name = "x2", .initial = 0, .unit = "1", .range = {}, .meaning = "at the start"}},
        .state = {{.name = "x1", .unit = "1", .meaning = "the sliding variable"},
                  {.name = "x2", .unit = "1", .meaning = "integral part and disturbance"}},
        .guards = {{.name = "relay", .event = "switch"}},
        .modes = {"positive", "held", "negative", "set-valued"},
        .t_end = 10,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.005,
        .program = "nonsmooth",
    };
}

// --- diode circuit ---

// Long: one entry of the list of systems.
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
        .state = {{.name = "V1", .unit = "V", .meaning = "voltage at the element"},
                  {.name = "V2", .unit = "V", .meaning = "voltage at the coil"},
                  {.name = "i", .unit = "A", .meaning = "current through the coil"}},
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
