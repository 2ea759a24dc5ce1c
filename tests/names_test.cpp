// With all headers and `using namespace ricochet`, everyday names are still the user's own.

#include <gtest/gtest.h>

#include <array>

#include "ricochet/detect/around.hpp"
#include "ricochet/detect/ballistic_line.hpp"
#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/calibrated.hpp"
#include "ricochet/detect/certified.hpp"
#include "ricochet/detect/cover.hpp"
#include "ricochet/detect/ends.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/features.hpp"
#include "ricochet/detect/finding.hpp"
#include "ricochet/detect/gate.hpp"
#include "ricochet/detect/gate_features.hpp"
#include "ricochet/detect/meter.hpp"
#include "ricochet/detect/metered.hpp"
#include "ricochet/detect/network.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/detect/step_probe.hpp"
#include "ricochet/detect/verified.hpp"
#include "ricochet/friction/additive_pair.hpp"
#include "ricochet/friction/affine_law.hpp"
#include "ricochet/friction/along_history.hpp"
#include "ricochet/friction/baselines.hpp"
#include "ricochet/friction/histories.hpp"
#include "ricochet/friction/incremental.hpp"
#include "ricochet/friction/laws.hpp"
#include "ricochet/friction/parameters.hpp"
#include "ricochet/friction/potentials.hpp"
#include "ricochet/friction/spring_slider.hpp"
#include "ricochet/friction/stage.hpp"
#include "ricochet/friction/variational_step.hpp"
#include "ricochet/friction/wright_omega.hpp"
#include "ricochet/geometry/box_tree.hpp"
#include "ricochet/geometry/concave_table.hpp"
#include "ricochet/geometry/distance_grid.hpp"
#include "ricochet/geometry/mesh.hpp"
#include "ricochet/geometry/outline.hpp"
#include "ricochet/geometry/segments.hpp"
#include "ricochet/geometry/triangles.hpp"
#include "ricochet/hybrid/arithmetic.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/hybrid/components.hpp"
#include "ricochet/hybrid/debug_checks.hpp"
#include "ricochet/hybrid/declarations.hpp"
#include "ricochet/hybrid/dense_polynomial.hpp"
#include "ricochet/hybrid/event.hpp"
#include "ricochet/hybrid/filippov.hpp"
#include "ricochet/hybrid/filippov_decision.hpp"
#include "ricochet/hybrid/filippov_motion.hpp"
#include "ricochet/hybrid/filippov_rates.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/hybrid/guard_view.hpp"
#include "ricochet/hybrid/instant.hpp"
#include "ricochet/hybrid/scratch.hpp"
#include "ricochet/hybrid/statistics.hpp"
#include "ricochet/hybrid/step.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/integrate/event_search.hpp"
#include "ricochet/integrate/explicit_step.hpp"
#include "ricochet/integrate/guard_bank.hpp"
#include "ricochet/integrate/initial_step.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/merged_resets.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/outcome.hpp"
#include "ricochet/integrate/planner.hpp"
#include "ricochet/integrate/refused_calls.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/runge_kutta.hpp"
#include "ricochet/integrate/shrinking_intervals.hpp"
#include "ricochet/integrate/simulation.hpp"
#include "ricochet/integrate/snapshot.hpp"
#include "ricochet/integrate/solution.hpp"
#include "ricochet/integrate/step_control.hpp"
#include "ricochet/integrate/step_controllers.hpp"
#include "ricochet/integrate/tentative_steps.hpp"
#include "ricochet/learn/adam.hpp"
#include "ricochet/learn/assessment.hpp"
#include "ricochet/learn/bouncing_ball.hpp"
#include "ricochet/learn/certify.hpp"
#include "ricochet/learn/checkpoint.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/data_set.hpp"
#include "ricochet/learn/environment.hpp"
#include "ricochet/learn/evolution.hpp"
#include "ricochet/learn/friction_study.hpp"
#include "ricochet/learn/gate.hpp"
#include "ricochet/learn/identify_friction.hpp"
#include "ricochet/learn/levenberg_marquardt.hpp"
#include "ricochet/learn/policy_training.hpp"
#include "ricochet/learn/random.hpp"
#include "ricochet/learn/step_control.hpp"
#include "ricochet/learn/step_environment.hpp"
#include "ricochet/learn/surface.hpp"
#include "ricochet/learn/td3.hpp"
#include "ricochet/learn/tqc.hpp"
#include "ricochet/learn/train_friction.hpp"
#include "ricochet/learn/train_gate.hpp"
#include "ricochet/learn/trainable_mlp.hpp"
#include "ricochet/locate/bisection.hpp"
#include "ricochet/locate/newton.hpp"
#include "ricochet/locate/toms748.hpp"
#include "ricochet/nn/bounds.hpp"
#include "ricochet/nn/certificate.hpp"
#include "ricochet/nn/classifier.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nn/safetensors.hpp"
#include "ricochet/nn/static_mlp.hpp"
#include "ricochet/nonsmooth/branch_modes.hpp"
#include "ricochet/nonsmooth/composite_step.hpp"
#include "ricochet/nonsmooth/contact_motion.hpp"
#include "ricochet/nonsmooth/contact_problem.hpp"
#include "ricochet/nonsmooth/convex_sets.hpp"
#include "ricochet/nonsmooth/event_hand_over.hpp"
#include "ricochet/nonsmooth/free_flight.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/linear_cases.hpp"
#include "ricochet/nonsmooth/minimal_selection.hpp"
#include "ricochet/nonsmooth/semismooth_newton.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/nonsmooth/sparse_direction.hpp"
#include "ricochet/nonsmooth/stage.hpp"
#include "ricochet/nonsmooth/stage_cases.hpp"
#include "ricochet/nonsmooth/stage_fixed_point.hpp"
#include "ricochet/nonsmooth/stage_newton.hpp"
#include "ricochet/nonsmooth/step_layout.hpp"
#include "ricochet/nonsmooth/step_policy.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"
#include "ricochet/odeint.hpp"
#include "ricochet/ricochet.hpp"
#include "ricochet/sensitivity/differences.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/sensitivity/linearization.hpp"
#include "ricochet/sensitivity/saltation.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/sensitivity/shooting.hpp"
#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/sensitivity/variational.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/cave_body.hpp"
#include "ricochet/systems/cavern.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/detest_f1.hpp"
#include "ricochet/systems/detest_f2.hpp"
#include "ricochet/systems/detest_f3.hpp"
#include "ricochet/systems/detest_f4.hpp"
#include "ricochet/systems/detest_f5.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/fault_bathe.hpp"
#include "ricochet/systems/fault_friction_stage.hpp"
#include "ricochet/systems/fault_kernel.hpp"
#include "ricochet/systems/fault_rate_state.hpp"
#include "ricochet/systems/fault_rupture.hpp"
#include "ricochet/systems/fault_stiffness.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/friction_oscillator.hpp"
#include "ricochet/systems/grow_decay.hpp"
#include "ricochet/systems/henon_heiles.hpp"
#include "ricochet/systems/hidden_pair.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/incline_block.hpp"
#include "ricochet/systems/least_eigenvalue.hpp"
#include "ricochet/systems/near_tangent.hpp"
#include "ricochet/systems/opaque.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/planar_arm.hpp"
#include "ricochet/systems/rate_state_slider.hpp"
#include "ricochet/systems/rolling_ball.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/stiffness_series.hpp"
#include "ricochet/systems/strike_slip_fault.hpp"
#include "ricochet/systems/super_twisting.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "ricochet/systems/three_body.hpp"
#include "ricochet/systems/two_contact_block.hpp"
#include "ricochet/systems/woodpecker.hpp"
#include "ricochet/systems/zones.hpp"

using namespace ricochet;

// One type of each name, and a use of it, which would be ambiguous if the library had one.
#define EVERYDAY(name)                                 \
    struct name {                                      \
        double value = 1;                              \
    };                                                 \
    [[maybe_unused]] inline double value_of(name from) \
    {                                                  \
        return from.value;                             \
    }
EVERYDAY(Box)
EVERYDAY(Step)
EVERYDAY(Gate)
EVERYDAY(Stage)
EVERYDAY(Product)
EVERYDAY(Cone)
EVERYDAY(Orthant)
EVERYDAY(Body)
EVERYDAY(Wall)
EVERYDAY(Floor)
EVERYDAY(World)
EVERYDAY(Spring)
EVERYDAY(Mass)
EVERYDAY(Force)
EVERYDAY(Contact)
EVERYDAY(Plant)
EVERYDAY(Tank)
EVERYDAY(Valve)
EVERYDAY(Point)
EVERYDAY(Segment)
EVERYDAY(Mesh)
EVERYDAY(Grid)
EVERYDAY(Tree)
EVERYDAY(Guard)
EVERYDAY(Flow)
EVERYDAY(Clock)
EVERYDAY(Sphere)
EVERYDAY(Line)
EVERYDAY(Table)
EVERYDAY(Cell)
EVERYDAY(Node)
EVERYDAY(Edge)

#undef EVERYDAY

struct Ball {
    using State = std::array<double, 2>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -0.5 * x[1]}; }
};

TEST(Names, EverydayNamesAreTheUsers)
{
    const Ball ball;
    const auto run = integrate(ball, {1, 0}, {.t_end = 0.6});
    EXPECT_EQ(run.events.size(), 1u);
    EXPECT_EQ(value_of(Step{}) + value_of(Box{}) + value_of(Gate{}) + value_of(Stage{}), 4);
}
