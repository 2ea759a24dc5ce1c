// With all headers and `using namespace ricochet`, everyday names remain the user's own.

#include <gtest/gtest.h>

#include <array>

#include "geometry/box_tree.hpp"
#include "geometry/concave_table.hpp"
#include "geometry/distance_grid.hpp"
#include "geometry/mesh.hpp"
#include "geometry/outline.hpp"
#include "geometry/segments.hpp"
#include "geometry/triangles.hpp"
#include "problems/cave_body.hpp"
#include "problems/cavern.hpp"
#include "problems/detest_f1.hpp"
#include "problems/detest_f2.hpp"
#include "problems/detest_f3.hpp"
#include "problems/detest_f4.hpp"
#include "problems/detest_f5.hpp"
#include "problems/grow_decay.hpp"
#include "problems/henon_heiles.hpp"
#include "problems/hidden_pair.hpp"
#include "problems/incline_block.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/near_tangent.hpp"
#include "problems/opaque.hpp"
#include "problems/planar_arm.hpp"
#include "problems/rolling_ball.hpp"
#include "problems/super_twisting.hpp"
#include "problems/three_body.hpp"
#include "problems/zones.hpp"
#include "ricochet/detail/adam.hpp"
#include "ricochet/detail/affine_law.hpp"
#include "ricochet/detail/along_history.hpp"
#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/around.hpp"
#include "ricochet/detail/assessment.hpp"
#include "ricochet/detail/ballistic_line.hpp"
#include "ricochet/detail/baselines.hpp"
#include "ricochet/detail/bounds.hpp"
#include "ricochet/detail/branch_modes.hpp"
#include "ricochet/detail/checkpoint.hpp"
#include "ricochet/detail/classifier.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/composite_step.hpp"
#include "ricochet/detail/contact_problem.hpp"
#include "ricochet/detail/data_set.hpp"
#include "ricochet/detail/debug_checks.hpp"
#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/detail/differences.hpp"
#include "ricochet/detail/directions.hpp"
#include "ricochet/detail/fault_friction_stage.hpp"
#include "ricochet/detail/fault_kernel.hpp"
#include "ricochet/detail/fault_stiffness.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/detail/filippov_decision.hpp"
#include "ricochet/detail/filippov_motion.hpp"
#include "ricochet/detail/filippov_rates.hpp"
#include "ricochet/detail/finding.hpp"
#include "ricochet/detail/free_flight.hpp"
#include "ricochet/detail/friction_oscillator.hpp"
#include "ricochet/detail/friction_stage.hpp"
#include "ricochet/detail/friction_study.hpp"
#include "ricochet/detail/gate.hpp"
#include "ricochet/detail/gate_features.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/identify_friction.hpp"
#include "ricochet/detail/inclusion_stage.hpp"
#include "ricochet/detail/incremental.hpp"
#include "ricochet/detail/instant.hpp"
#include "ricochet/detail/levenberg_marquardt.hpp"
#include "ricochet/detail/linear_cases.hpp"
#include "ricochet/detail/linearization.hpp"
#include "ricochet/detail/meter.hpp"
#include "ricochet/detail/minimal_selection.hpp"
#include "ricochet/detail/parameters.hpp"
#include "ricochet/detail/random.hpp"
#include "ricochet/detail/refused_calls.hpp"
#include "ricochet/detail/runge_kutta.hpp"
#include "ricochet/detail/saltation.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/detail/semismooth_newton.hpp"
#include "ricochet/detail/shrinking_intervals.hpp"
#include "ricochet/detail/sparse_direction.hpp"
#include "ricochet/detail/stage_cases.hpp"
#include "ricochet/detail/stage_fixed_point.hpp"
#include "ricochet/detail/stage_newton.hpp"
#include "ricochet/detail/step_control.hpp"
#include "ricochet/detail/step_environment.hpp"
#include "ricochet/detail/step_layout.hpp"
#include "ricochet/detail/stiffness_series.hpp"
#include "ricochet/detail/surface.hpp"
#include "ricochet/detail/trainable_mlp.hpp"
#include "ricochet/detail/undefined.hpp"
#include "ricochet/detail/variational.hpp"
#include "ricochet/detail/variational_step.hpp"
#include "ricochet/detail/wright_omega.hpp"
#include "ricochet/detect/bernstein.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/gates.hpp"
#include "ricochet/detect/network.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/detect/step_probe.hpp"
#include "ricochet/faults/fault_bathe.hpp"
#include "ricochet/faults/laws.hpp"
#include "ricochet/faults/potentials.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/hybrid/event.hpp"
#include "ricochet/hybrid/filippov.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/hybrid/statistics.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/outcome.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/simulation.hpp"
#include "ricochet/integrate/snapshot.hpp"
#include "ricochet/integrate/solution.hpp"
#include "ricochet/learn/bouncing_ball.hpp"
#include "ricochet/learn/certify.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/evolution.hpp"
#include "ricochet/learn/gate.hpp"
#include "ricochet/learn/policies.hpp"
#include "ricochet/learn/step_control.hpp"
#include "ricochet/learn/train_friction.hpp"
#include "ricochet/learn/train_gate.hpp"
#include "ricochet/locate/locators.hpp"
#include "ricochet/nn/certificate.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/contact_motion.hpp"
#include "ricochet/nonsmooth/convex_sets.hpp"
#include "ricochet/nonsmooth/event_hand_over.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "ricochet/nonsmooth/step_policy.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"
#include "ricochet/odeint.hpp"
#include "ricochet/ricochet.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "ricochet/systems/two_contact_block.hpp"
#include "ricochet/systems/woodpecker.hpp"

using namespace ricochet;

// One type for each name, and a use of it, which would be ambiguous if the library had the name.
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
