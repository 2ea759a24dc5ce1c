// Inclusions: a sliding mode and a circuit with a diode. ricochet hands over between events and
// set-valued steps, or takes set-valued steps alone.
#include "cells.hpp"
#include "piecewise_linear.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::report {

namespace {

constexpr std::size_t intervals = 100;  ///< between the times at which states are compared

std::vector<double> evenly(double t_end)
{
    std::vector<double> t;
    for (std::size_t i = 0; i <= intervals; ++i) {
        t.push_back(t_end * static_cast<double>(i) / static_cast<double>(intervals));
    }
    return t;
}

template <class Vector>
std::vector<double> plain(const Vector& w)
{
    return {w.data(), w.data() + w.size()};
}

SlidingMode::Vector start_of(const SlidingMode& /*system*/)
{
    return SlidingMode::Vector::Constant(SlidingMode::start);
}
Eigen::Vector3d start_of(const DiodeCircuit& /*system*/)
{
    return DiodeCircuit::start();
}

template <class System>
Answer by_hand_over(double tolerance)
{
    const System system;
    const auto run = hand_over(system, start_of(system),
                               {.t_end = System::t_end,
                                .rtol = tolerance,
                                .atol = tolerance,
                                .sample_times = evenly(System::t_end)},
                               ErrorControlled<Fehlberg78>{});
    Answer answer{.finished = run.outcome == Outcome::reached_end};
    for (const auto& w : run.trajectory.x) answer.samples.push_back(plain(w));
    return answer;
}

/// Straight lines between the nodes of Bathe's steps of constant length.
template <class System>
Answer by_steps(double step)
{
    const System system;
    const std::vector<double> t = evenly(System::t_end);
    SetValuedMotion<System> motion(system, start_of(system),
                                   {.t_end = System::t_end, .step = step});
    Answer answer;
    answer.samples.push_back(plain(start_of(system)));
    while (motion.outcome() == Outcome::running) {
        (void)motion.advance();
        const auto& a = motion.before();
        const auto& b = motion.state();
        while (answer.samples.size() < t.size() && t[answer.samples.size()] <= b.t * (1 + 1e-15)) {
            const double fraction = (t[answer.samples.size()] - a.t) / (b.t - a.t);
            answer.samples.push_back(plain((a.w + fraction * (b.w - a.w)).eval()));
        }
    }
    answer.finished = motion.outcome() == Outcome::reached_end;
    answer.steps = motion.statistics().stages;
    return answer;
}

template <class System, class Exact>
void add_inclusion(Cells& cells, const std::string& name, const std::string& title,
                   std::vector<double> steps, Exact exact)
{
    cells.add_reference([=] {
        Reference out{.problem = name,
                      .title = title,
                      .t_end = System::t_end,
                      .sample_times = evenly(System::t_end)};
        const auto solution = exact();
        for (const double t : out.sample_times) out.samples.push_back(solution(t));
        return out;
    });
    for (const double tolerance : tolerances_of(name)) {
        cells.add({name, "ricochet", "hand-over, fehlberg78", tolerance, [tolerance] {
                       return [tolerance] { return by_hand_over<System>(tolerance); };
                   }});
    }
    for (const double step : steps) {
        cells.add({name, "ricochet", "Bathe, constant step", step,
                   [step] { return [step] { return by_steps<System>(step); }; }});
    }
}

}  // namespace

void add_set_valued(Cells& cells)
{
    add_inclusion<SlidingMode>(
        cells, "sliding-mode", "Sliding mode, relay", {1e-2, 2.5e-3, 6.25e-4, 1.5625e-4}, [] {
            return [](double t) {
                return std::vector<double>{SlidingMode().exact(t, SlidingMode::start)};
            };
        });
    add_inclusion<DiodeCircuit>(cells, "diode-circuit", "Diode circuit, 12 changes of mode",
                                {0.2, 0.05, 0.0125, 0.003125}, [] {
                                    testing_support::ExactCircuit circuit;
                                    circuit.run(DiodeCircuit::start(), DiodeCircuit::t_end);
                                    return [circuit](double t) { return plain(circuit.state(t)); };
                                });
}

}  // namespace ricochet::report
