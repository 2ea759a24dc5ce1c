// Cells of the report: one problem, solved by one peer at one setting.
//
// Each cell is run in a process of its own (main.cpp), so that a crash affects no other cell. The
// result of a cell is scored by the program that runs it (run.py).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "gas.hpp"
#include "problems.hpp"
#include "sliding.hpp"

namespace ricochet::report {

/// Result of one run; a peer leaves out what it does not count.
struct Answer {
    bool finished = false;              ///< the run reached its end
    std::vector<double> times{};        ///< [s] of events, in the order found
    std::vector<std::size_t> guards{};  ///< of events
    std::vector<std::vector<double>> samples{};
    std::optional<std::uint64_t> steps{};
    std::optional<std::uint64_t> flow_calls{};
    std::optional<std::uint64_t> guard_calls{};
    std::optional<double> energy_change{};  ///< relative, over a run that conserves energy
    std::string note{};                     ///< why it did not finish

    void add(double t, std::size_t guard)
    {
        times.push_back(t);
        guards.push_back(guard);
    }
};

struct Cell {
    std::string problem;                            ///< e.g. "impacts"
    std::string peer;                               ///< e.g. "CVODE"
    std::string how;                                ///< e.g. "Adams, root finding"
    double value = 0;                               ///< the tolerance or the step; 0: none
    std::function<std::function<Answer()>()> make;  ///< sets up what is run over and over

    [[nodiscard]] std::string name() const;
};

struct Reference {
    std::string problem;
    std::string title;
    double t_end = 0;
    double scored_until = INFINITY;  ///< [s] later events are not compared
    std::vector<Expected> events{};
    std::vector<double> sample_times{};
    std::vector<std::vector<double>> samples{};
};

/// All cells, problems, and versions of the peers that are built in.
class Cells {
public:
    void add(Cell cell) { cells_.push_back(std::move(cell)); }
    /// `make` is called when the reference is needed, since some references take a while.
    void add_reference(std::function<Reference()> make) { references_.push_back(std::move(make)); }
    void add_version(std::string peer, std::string version)
    {
        versions_.emplace_back(std::move(peer), std::move(version));
    }

    [[nodiscard]] const std::vector<Cell>& all() const { return cells_; }
    [[nodiscard]] const std::vector<std::function<Reference()>>& references() const
    {
        return references_;
    }
    [[nodiscard]] const std::vector<std::pair<std::string, std::string>>& versions() const
    {
        return versions_;
    }

private:
    std::vector<Cell> cells_;
    std::vector<std::function<Reference()>> references_;
    std::vector<std::pair<std::string, std::string>> versions_;
};

/// Tolerances at which every peer solves a problem; a single one where a run takes seconds.
[[nodiscard]] inline std::span<const double> tolerances_of(const std::string& problem)
{
    static constexpr double all[] = {1e-4, 1e-6, 1e-8, 1e-10, 1e-12};
    const bool is_large = problem == "balls-10000" || problem == "balls-100000";
    return is_large ? std::span<const double>(all).subspan(3, 1) : all;
}

/// Calls `visit(name, title, make_task)` once for every problem; `make_task` returns the task. A
/// problem of several runs has a vector of tasks.
template <class Visit>
void for_each_problem(Visit visit)
{
    visit("ball", "Bouncing ball, 13 impacts", [] { return std::vector{ball()}; });
    visit("impacts", "Impact oscillator, 200 impacts in 200 periods",
          [] { return std::vector{impact_oscillator(1.2, 200)}; });
    visit("impacts-1000", "Impact oscillator, 1000 periods",
          [] { return std::vector{impact_oscillator(1.2, 1000)}; });
    visit("henon-heiles", "Henon-Heiles, section", [] { return std::vector{henon_heiles()}; });
    visit("arenstorf", "Arenstorf orbit, section", [] { return std::vector{arenstorf()}; });
    visit("stick-slip", "Stick-slip on a belt, 100 periods",
          [] { return std::vector{stick_slip()}; });
    for (const int digits : {2, 4, 6, 8, 10, 12}) {
        visit("near-tangent-1e-" + std::to_string(digits),
              "Near-tangent pairs, depth 1e-" + std::to_string(digits), [digits] {
                  std::vector<Task<NearTangentPairs>> tasks;
                  for (std::size_t k = 0; k < tangent_phases; ++k) {
                      tasks.push_back(near_tangent(std::pow(10.0, -digits), tangent_phase(k)));
                  }
                  return tasks;
              });
    }
    for (const std::size_t n : {1U, 10U, 100U, 1000U, 10000U, 100000U}) {
        visit("balls-" + std::to_string(n), std::to_string(n) + " balls",
              [n] { return std::vector{balls(n)}; });
    }
    visit("block", "Block that slides to rest", [] { return std::vector{sliding_block()}; });
    visit("rolling", "Ball that slides, then rolls", [] { return std::vector{rolling_ball()}; });
    visit("gas-" + std::to_string(gas_in_one_state), gas_title(gas_in_one_state),
          [] { return std::vector{gas(gas_in_one_state)}; });
    for (const std::size_t n : {10U, 100U}) {
        visit("thermostats-" + std::to_string(n), "Bank of " + std::to_string(n) + " thermostats",
              [n] { return std::vector{thermostats(n)}; });
    }
    for (const std::size_t n : {20U, 200U, 2000U}) {
        visit("plain-" + std::to_string(n), std::to_string(n) + " components without guards",
              [n] { return std::vector{rotations(n)}; });
    }
    visit("guards-0", "Pendulum without guards", [] { return std::vector{pendulum(Unwatched{})}; });
    for (const std::size_t n : {1U, 10U, 100U}) {
        visit("guards-" + std::to_string(n), "Pendulum with " + std::to_string(n) + " idle guards",
              [n] { return std::vector{pendulum(Watched{.guards_ = n})}; });
    }
}

/// One answer of several runs: the guards of run k are counted from 1000 k.
inline constexpr std::size_t guards_of_a_run = 1000;

template <class S>
[[nodiscard]] Reference reference_of(std::string name, std::string title,
                                     const std::vector<Task<S>>& tasks)
{
    Reference out{.problem = std::move(name),
                  .title = std::move(title),
                  .t_end = tasks[0].t_end,
                  .scored_until = tasks[0].scored_until};
    for (std::size_t k = 0; k < tasks.size(); ++k) {
        for (const Expected& event : tasks[k].events) {
            out.events.push_back({event.t, event.guard + guards_of_a_run * k});
        }
    }
    return out;
}

/// Records the relative change of energy up to the last state, for a system that conserves it.
template <class S, class X>
void note_energy(const Task<S>& task, const X& x, Answer& answer)
{
    if constexpr (requires { task.system.energy(x); }) {
        answer.energy_change = task.system.energy(x) / task.system.energy(task.x0) - 1;
    }
}

/// Runs `solve(task, answer, offset)` for every task.
template <class S, class Solve>
[[nodiscard]] std::function<Answer()> over(std::vector<Task<S>> tasks, Solve solve)
{
    return [tasks = std::move(tasks), solve]() mutable {
        Answer answer{.finished = true, .steps = 0, .flow_calls = 0, .guard_calls = 0};
        for (std::size_t k = 0; k < tasks.size() && answer.finished; ++k) {
            answer.finished = solve(tasks[k], answer, guards_of_a_run * k);
        }
        return answer;
    };
}

void add_ours(Cells& cells);
void add_taylor(Cells& cells);
void add_odeint(Cells& cells);
#ifdef RICOCHET_REPORT_CVODE
void add_cvode(Cells& cells);
#endif
#ifdef RICOCHET_REPORT_ARKODE
void add_arkode(Cells& cells);
#endif
#ifdef RICOCHET_REPORT_GSL
void add_gsl(Cells& cells);
#endif
#ifdef RICOCHET_REPORT_ODE
void add_ode(Cells& cells);
#endif
#ifdef RICOCHET_REPORT_BULLET
void add_bullet(Cells& cells);
#endif
void add_scene(Cells& cells);
void add_gas(Cells& cells);
void add_sliding(Cells& cells);
void add_slider(Cells& cells);
void add_fault(Cells& cells);
void add_set_valued(Cells& cells);
void add_stiff(Cells& cells);

}  // namespace ricochet::report
