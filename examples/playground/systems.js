// What the page says of each system: its sliders, in the order in which play.cpp reads parameters, the
// words for its events, and the same program in C++ and Python.
"use strict";

// A slider: name, unit, lowest, highest and first value, step.
const slider = (name, unit, min, max, value, step) => ({ name, unit, min, max, value, step });

// A program in C++ around the lines that make `run`, a result with events.
const cpp = (headers, lines, after = "") => `${["<cstdio>", ...headers].map((h) => `#include ${h}\n`).join("")}
${after}int main()
{
    using namespace ricochet;
${lines.map((line) => `    ${line}\n`).join("")}    for (const auto& event : run.events) std::printf("%.17g s\\n", event.t);
    std::puts(describe(run.outcome).data());
}
`;
const precise = ".rtol = 1e-13, .atol = 1e-13";
const byFehlberg = "ErrorControlled<Fehlberg78>{}";

// A program in Python around the lines that make `run`.
const python = (lines, events = "run.events") => `${lines.join("\n")}
for t in ${events}["t"]:
    print(f"{t:.17g} s")
print(run.message)
`;
const precisely = 'method="fehlberg78", rtol=1e-13, atol=1e-13';

const systems = [
  {
    key: "ball",
    title: "A bouncing ball",
    text: "A ball falls onto a floor and loses speed at every impact. Infinitely many impacts end in finite time: then it rests.",
    sliders: [
      slider("gravity", "m/s²", 1, 20, 9.81, 0.01),
      slider("restitution", "", 0, 0.99, 0.9, 0.01),
      slider("height", "m", 0.5, 20, 10, 0.1),
      slider("velocity", "m/s", -10, 10, 0, 0.1),
      slider("until", "s", 1, 60, 20.5, 0.5),
    ],
    events: ["hits the floor", "rests"],
    paths: ["height [m]"],
    shown: "velocity [m/s]",
    closed: "the flights are a geometric series, whose ratio is the restitution",
    cpp: ([g, e, h, v, end]) => cpp(["<ricochet/ricochet.hpp>", "<ricochet/systems/bouncing_ball.hpp>"], [
      `const BouncingBall ball({.gravity = ${g}, .restitution = ${e}});`,
      `const auto run = integrate(ball, {${h}, ${v}}, {.t_end = ${end}, ${precise}},`,
      `                           ${byFehlberg});`,
    ]),
    python: ([g, e, h, v, end]) => python([
      "import ricochet",
      "",
      `ball = ricochet.BouncingBall(gravity=${g}, restitution=${e})`,
      `run = ricochet.integrate(ball, [${h}, ${v}], ${end}, ${precisely})`,
    ]),
  },
  {
    key: "belt",
    title: "A mass on a belt",
    text: "A spring holds a mass on a moving belt. Friction carries the mass along until the spring pulls harder than static friction holds; then it slips back and sticks again.",
    sliders: [
      slider("belt speed", "m/s", 0.05, 1, 0.3, 0.01),
      slider("static friction", "N", 0.1, 2, 1, 0.01),
      slider("kinetic friction", "N", 0, 2, 0.6, 0.01),
      slider("until", "s", 5, 100, 60, 1),
    ],
    events: ["slips", "sticks"],
    paths: ["position [m]"],
    shown: "position [m]",
    closed: "slipping is an arc of a harmonic oscillation around the kinetic friction, sticking a straight line",
    cpp: ([b, s, k, end]) => cpp(["<ricochet/ricochet.hpp>", "<ricochet/systems/friction_oscillator.hpp>"], [
      `const FrictionOscillator belt({.belt_speed = ${b}, .friction = ${k}, .static_friction = ${s}});`,
      `const auto run = integrate(belt, {0, ${b}},`,
      `                           {.t_end = ${end}, .mode = FrictionOscillator::stick,`,
      `                            ${precise}},`,
      `                           ${byFehlberg});`,
    ]),
    python: ([b, s, k, end]) => python([
      "import ricochet",
      "",
      `belt, static, kinetic = ${b}, ${s}, ${k}`,
      "",
      "class Mass(ricochet.System):",
      '    modes = ("slip", "stick")',
      "",
      "    def flow(self, mode, t, x):",
      '        return [belt, 0.0] if mode == "stick" else [x[1], kinetic - x[0]]',
      "",
      '    @ricochet.guard(in_modes=["slip"])',
      "    def stops(self, mode, t, x):",
      "        return belt - x[1]",
      "",
      "    @stops.reset",
      "    def stops(self, mode, t, x):",
      '        return "stick", [x[0], belt]',
      "",
      '    @ricochet.guard(in_modes=["stick"])',
      "    def pulled(self, mode, t, x):",
      "        return static - x[0]",
      "",
      "    @pulled.reset",
      "    def pulled(self, mode, t, x):",
      '        return "slip", [static, belt]',
      "",
      `run = ricochet.integrate(Mass(), [0.0, belt], ${end}, mode="stick",`,
      `                         ${precisely})`,
    ]),
  },
  {
    key: "pendulum",
    title: "A pendulum at a wall",
    text: "A pendulum hits a wall at its lowest point. This system is not one of the library's: its program has all of it.",
    sliders: [
      slider("gravity / length", "1/s²", 1, 20, 9.81, 0.01),
      slider("restitution", "", 0.3, 1, 0.9, 0.01),
      slider("angle", "rad", 0.1, 3, 1, 0.01),
      slider("until", "s", 1, 40, 20, 0.5),
    ],
    events: ["hits the wall"],
    paths: ["angle [rad]"],
    shown: "rate [rad/s]",
    closed: "half a period is π / (√(gravity / length) · agm(1, cos(amplitude / 2))), by the arithmetic-geometric mean",
    cpp: ([s, e, a, end]) => cpp(["<array>", "<cmath>", "<ricochet/ricochet.hpp>"], [
      `const auto run = integrate(Pendulum{}, {${a}, 0}, {.t_end = ${end}, ${precise}},`,
      `                           ${byFehlberg});`,
    ], `struct Pendulum {
    using State = std::array<double, 2>;  // angle, rate
    static constexpr bool unilateral = true;

    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -${s} * std::sin(x[0])}; }
    double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -${e} * x[1]}; }
};

`).replace("    using namespace ricochet;\n", "    using ricochet::ErrorControlled, ricochet::Fehlberg78;\n"),
    python: ([s, e, a, end]) => python([
      "import math",
      "import ricochet",
      "",
      "pendulum = ricochet.System(",
      `    lambda t, x: [x[1], -${s} * math.sin(x[0])],`,
      "    guards=[ricochet.Guard(lambda t, x: x[0], unilateral=True,",
      `                           reset=lambda t, x: [0.0, -${e} * x[1]])])`,
      `run = ricochet.integrate(pendulum, [${a}, 0.0], ${end}, ${precisely})`,
    ]),
  },
  {
    key: "thermostat",
    title: "A thermostat",
    text: "A heater is switched on where it is too cold and off where it is too warm: two modes that take turns.",
    sliders: [
      slider("rate", "1/s", 0.02, 1, 0.1, 0.01),
      slider("ambient", "°", -10, 15, 0, 1),
      slider("heated", "°", 20, 60, 30, 1),
      slider("low", "°", 5, 30, 18, 0.5),
      slider("high", "°", 5, 40, 22, 0.5),
      slider("start", "°", 5, 40, 20, 0.5),
      slider("until", "s", 5, 200, 60, 1),
    ],
    events: ["heater on", "heater off"],
    paths: ["temperature [°]"],
    shown: "temperature [°]",
    closed: "the temperature is an exponential, and the time between switches a logarithm",
    cpp: ([rate, ambient, heated, low, high, start, end]) => cpp(["<ricochet/ricochet.hpp>", "<ricochet/systems/thermostat.hpp>"], [
      `const Thermostat heater({.rate = ${rate}, .ambient = ${ambient}, .heated = ${heated},`,
      `                         .low = ${low}, .high = ${high}});`,
      `const auto run = integrate(heater, {${start}}, {.t_end = ${end}, ${precise}},`,
      `                           ${byFehlberg});`,
    ]),
    python: ([rate, ambient, heated, low, high, start, end]) => python([
      "import ricochet",
      "",
      `heater = ricochet.Thermostat(rate=${rate}, ambient=${ambient}, heated=${heated}, low=${low}, high=${high})`,
      `run = ricochet.integrate(heater, [${start}], ${end}, ${precisely})`,
    ]),
  },
  {
    key: "diode",
    title: "A circuit with a diode",
    text: "The diode's current has a constant magnitude and the sign of its voltage; at voltage zero it takes any value within this bound. That is a set-valued law, and the value is a part of the solution.",
    sliders: [
      slider("current", "A", 0, 3, 0.8, 0.05),
      slider("resistance", "Ω", 0.5, 5, 1.43, 0.01),
      slider("voltage", "V", 1, 20, 10, 0.1),
      slider("until", "s", 1, 40, 20, 0.5),
    ],
    events: ["holds zero", "lets go", "crosses zero"],
    paths: ["voltage V1 at the diode [V]", "voltage V2 [V]"],
    shown: "V2 [V]",
    closed: "between events the circuit is linear: power series, apart from the library",
    cpp: ([current, resistance, voltage, end]) => cpp(["<ricochet/nonsmooth/hand_over.hpp>", "<ricochet/systems/diode_circuit.hpp>"], [
      `const DiodeCircuit circuit({.resistance = ${resistance}, .current = ${current}});`,
      `const auto run = hand_over(circuit, {${voltage}, 1.980972, -10.908448},`,
      `                           {.t_end = ${end}, ${precise}});`,
    ]),
    python: ([current, resistance, voltage, end]) => python([
      "import numpy as np",
      "import ricochet",
      "",
      `current, resistance = ${current}, ${resistance}`,
      "",
      "def smooth(t, w):  # two voltages and the current of the coil",
      "    through = (w[1] - w[0]) / resistance",
      "    return [through, w[2] - through, -w[1]]",
      "",
      "def flow(t, w):",
      "    f = smooth(t, w)",
      "    return [9 * (f[0] - current * np.sign(w[0])), f[1], 7 * f[2]]",
      "",
      "diode = ricochet.Inclusion(smooth, bounds=lambda t, w: (-current, current),",
      "                           mass=np.diag([1 / 9, 1, 1 / 7]))",
      `run = ricochet.solve_ivp(flow, (0, ${end}), [${voltage}, 1.980972, -10.908448], set_valued=diode,`,
      '                         method="DOP853", rtol=1e-12, atol=1e-12)',
    ], "run.run.events"),
  },
  {
    key: "discs",
    title: "Two discs and a wall",
    text: "A heavy disc drives a light one against a wall, all without loss. For mass ratios of 100 to the power n the number of impacts has the first digits of π.",
    sliders: [
      slider("mass ratio", "", 1, 10000, 100, 1),
      slider("distance", "m", 0.2, 3, 1, 0.1),
      slider("speed", "m/s", 0.1, 5, 1, 0.1),
    ],
    logarithmic: ["mass ratio"],
    events: ["the discs meet", "hits the wall"],
    paths: ["place of the light disc [m]", "place of the heavy disc [m]"],
    shown: "velocity of the light disc [m/s]",
    closed: "in coordinates √mass · position the motion, unfolded at each impact, is a straight line (G. Galperin, 2003)",
    cpp: ([ratio, distance, speed], end) => cpp(["<ricochet/scene/simulate.hpp>"], [
      "Scene scene;",
      'scene.wall({.name = "wall", .point = {0, 0}, .normal = {1, 0}});',
      `scene.disc({.at = {${distance} + 0.05, 0}, .radius = 0.05});`,
      `scene.disc({.at = {${distance} + 1.15, 0}, .velocity = {-${speed}, 0}, .radius = 0.05, .mass = ${ratio}});`,
      `const auto run = simulate(scene, {.t_end = ${end}});`,
    ]),
    python: ([ratio, distance, speed], end) => python([
      "import ricochet",
      "",
      "scene = ricochet.Scene()",
      "scene.wall((0, 0), (1, 0))",
      `scene.disc((${distance} + 0.05, 0), radius=0.05)`,
      `scene.disc((${distance} + 1.15, 0), velocity=(-${speed}, 0), radius=0.05, mass=${ratio})`,
      `run = scene.simulate(${end})`,
    ]),
  },
];

if (typeof module !== "undefined") module.exports = systems;
