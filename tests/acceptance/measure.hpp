// Acceptance checks by topic.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::bench {

/// Result of a check.
struct Measured {
    bool pass = false;
    std::string text;                    ///< the figure, in one line
    std::vector<std::string> details{};  ///< printed below it
};

inline constexpr std::array<std::string_view, 14> topics = {
    "ball",  "core",     "network", "events", "guards", "nonsmooth", "steps",
    "fault", "friction", "files",   "c",      "hosts",  "taylor",    "scenes"};

struct Check {
    std::string_view topic;  ///< one of `topics`
    std::string id;          ///< e.g. "b1-rk4"
    std::string sentence;    ///< the claim
    std::string target;
    std::function<Measured()> run;
    bool required = true;  ///< false: a desired property, which does not fail the run
};

/// Runs the checks that the arguments name, all by default. Returns the exit status: 1 if a check
/// fails, 2 if they could not be run.
[[nodiscard]] int run_checks(const std::vector<Check>& checks, int argc, char** argv);

/// The bouncing ball, end to end.
[[nodiscard]] std::vector<Check> ball_checks();

/// The compiled core: the costs of a step, a pointer and an impact in a large state.
[[nodiscard]] std::vector<Check> core_checks();

/// The interface for C; none if it is not built.
[[nodiscard]] std::vector<Check> c_checks();

/// The monitor in the integrators of other libraries; none without SUNDIALS.
[[nodiscard]] std::vector<Check> host_checks();

/// Taylor's method.
[[nodiscard]] std::vector<Check> taylor_checks();
[[nodiscard]] Measured time_taylor_lanes();

/// The network: kernels, models, training, gate.
[[nodiscard]] std::vector<Check> network_checks();

/// The semantics of events.
[[nodiscard]] std::vector<Check> event_checks();

/// Expensive guards: the planner, networks, certificates.
[[nodiscard]] std::vector<Check> guard_checks();

/// Set-valued motion.
[[nodiscard]] std::vector<Check> nonsmooth_checks();

/// The learned time step and the strike-slip fault.
[[nodiscard]] std::vector<Check> step_checks();

/// Rate-and-state friction.
[[nodiscard]] std::vector<Check> friction_checks();

/// Events where guards accumulate, decay, or move faster than the state.
[[nodiscard]] std::vector<Check> resolution_checks();

/// Scenes of many bodies, each with its own time.
[[nodiscard]] std::vector<Check> scene_checks();

/// Scenes: cost by dopri5, beside common steps and plain runs; labels, reversal, brute force,
/// cradles, rest, piles.
[[nodiscard]] Measured time_slowed_balls();
[[nodiscard]] Measured compare_one_state();
[[nodiscard]] Measured compare_common_steps();
[[nodiscard]] Measured compare_plain_run();
[[nodiscard]] Measured relabel_bodies();
[[nodiscard]] Measured reverse_gases();
[[nodiscard]] Measured compare_brute_force();
[[nodiscard]] Measured swing_cradles();
[[nodiscard]] Measured rest_for_long();
[[nodiscard]] Measured time_piles();

/// Saved runs, potential files, runs that cannot continue.
[[nodiscard]] std::vector<Check> file_checks();

/// The fault and the rules for its steps.
[[nodiscard]] std::vector<Check> fault_checks();

/// Inclusions where several relays, contacts and diodes meet.
[[nodiscard]] std::vector<Check> inclusion_checks();

/// The sliding mode and the diode circuit, handed over: changes, times, states.
[[nodiscard]] Measured hand_over_sliding_mode();
[[nodiscard]] Measured hand_over_circuit();

/// Run times of the two systems at the requested errors, also with Bathe's steps.
[[nodiscard]] Measured time_circuit_to_1e8();
[[nodiscard]] Measured time_sliding_mode();
[[nodiscard]] Measured time_bathe_on_circuit();
[[nodiscard]] Measured compare_work();

/// Bathe's orders, the growth of energy with friction, random contact problems.
[[nodiscard]] Measured observe_bathe_orders();
[[nodiscard]] Measured grow_energy();
[[nodiscard]] Measured solve_contacts();

/// Whether every state type gives the same events, bit for bit.
[[nodiscard]] Measured compare_state_types();

/// The observed order of convergence of every stepper, through events.
[[nodiscard]] Measured observe_orders();

/// The cost of one evaluation, against hand-written kernels.
[[nodiscard]] Measured time_inference();

/// Whether every kernel returns the same bytes.
[[nodiscard]] Measured compare_instruction_sets();

/// Whether the verified gate returns the bits of its exact detector.
[[nodiscard]] Measured compare_verified();

/// The cost of one step with each detector.
[[nodiscard]] Measured compare_detectors();

/// Every problem with a known solution, run in every possible way.
[[nodiscard]] Measured compare_systems();

/// Pairs of crossings very close together, and near misses.
[[nodiscard]] Measured find_near_tangent_pairs();

/// Balls that are equal to the bit.
[[nodiscard]] Measured drop_identical_balls();

/// Balls of every restitution for 1e7 s.
[[nodiscard]] Measured bounce_for_ever();

/// The energy of an elastic ball.
[[nodiscard]] Measured keep_elastic_energy();

/// An ensemble of 1e5 balls on one, two and four threads.
[[nodiscard]] Measured run_ensemble_of_balls();

/// Saving and restoring at random points.
[[nodiscard]] Measured restore_anywhere();

/// The guards of a system in a different order.
[[nodiscard]] Measured reorder_guards();

/// Random hybrid systems against their closed forms.
[[nodiscard]] Measured check_random_systems();

/// The impact oscillator: fastest setting within an error of 1e-8 s and 1e-12 s; four
/// errors beside odeint by hand; a thousand periods. `limit` in seconds.
[[nodiscard]] Measured time_impacts_to_1e8();
[[nodiscard]] Measured time_impacts_to_1e12(double limit);
[[nodiscard]] Measured compare_impacts();
[[nodiscard]] Measured time_long_impacts();

/// The cost of watching: crossings that are only recorded, guards that never fire.
[[nodiscard]] Measured time_recorded_crossings();
[[nodiscard]] Measured time_idle_guard();
[[nodiscard]] Measured time_hundred_idle_guards();

/// Scenes with expensive guards: the planner against a check at every step.
[[nodiscard]] Measured time_cavern();
[[nodiscard]] Measured time_cavern_dopri5();
[[nodiscard]] Measured compare_many_events();
[[nodiscard]] Measured count_location();
[[nodiscard]] Measured time_cave_body();
[[nodiscard]] Measured time_arms();
[[nodiscard]] Measured time_zones();
[[nodiscard]] Measured count_eigenvalues();
[[nodiscard]] Measured count_bounded_eigenvalues();
[[nodiscard]] Measured count_certified_eigenvalue();

/// Rate-and-state friction: exact potentials, histories, learned pairs, sliders, speed.
[[nodiscard]] Measured check_potentials();
[[nodiscard]] Measured compare_exact_friction();
[[nodiscard]] Measured identify_friction();
[[nodiscard]] Measured train_pair();
[[nodiscard]] Measured train_general();
[[nodiscard]] Measured count_internal_variables();
[[nodiscard]] Measured compare_internal_variables();
[[nodiscard]] Measured transfer_to_sliders();
[[nodiscard]] Measured count_unstable();
[[nodiscard]] Measured compare_forms();
[[nodiscard]] Measured take_adversarial_steps();
[[nodiscard]] Measured bound_convexity();
[[nodiscard]] Measured slider_accuracy();
[[nodiscard]] Measured time_friction();
[[nodiscard]] Measured learn_slip_law();

/// Networks with any weights before these guards: time with the meter on, and events.
[[nodiscard]] Measured time_metered_networks();
[[nodiscard]] Measured same_events_whatever_the_weights();

}  // namespace ricochet::bench
