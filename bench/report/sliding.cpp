// Further methods of ricochet for sliding bodies, beside those for all problems: the block as a
// scene and as an inclusion, and both bodies by the time stepping of Moreau and Jean.
#include "sliding.hpp"

#include "cells.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"
#include "ricochet/scene/simulate.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/two_contact_block.hpp"

namespace ricochet::report {

namespace {

[[nodiscard]] Scene scene_of_block()
{
    Scene scene({.gravity = {0, -sliding::gravity}});
    const MaterialId floor = scene.material({.restitution = 0, .friction = sliding::friction});
    scene.wall({.point = {0, 0}, .normal = {0, 1}, .material = floor});
    scene.point({.at = {0, 0}, .velocity = {sliding::start, 0}, .material = floor});
    return scene;
}

Answer by_scene(const Scene& scene)
{
    const SceneRun run = simulate(scene, {.t_end = sliding::t_end});
    Answer answer{.finished = run.outcome == Outcome::reached_end, .note = run.message};
    for (const SceneEvent& event : run.events) {
        if (event.kind == SceneEvent::Kind::stopped) answer.add(event.t, 0);
    }
    return answer;
}

Answer by_hand_over(double tolerance)
{
    const FrictionInclusion block({.stiffness = 0, .friction = sliding::braking});
    const auto run = hand_over(block, FrictionInclusion::Vector(0, sliding::start),
                               {.t_end = sliding::t_end, .rtol = tolerance, .atol = tolerance});
    Answer answer{.finished = run.outcome == Outcome::reached_end};
    for (const auto& event : run.events) answer.add(event.t, event.guard);
    return answer;
}

/// A ball of 1 kg on the floor: coordinates x, height, angle.
struct BallOnFloor {
    static constexpr int coordinates = 3;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using Vector = Eigen::Vector3d;

    void mass(const Vector& /*q*/, Eigen::Matrix3d& m) const
    {
        m = Eigen::Vector3d(1, 1, 0.4 * sliding::radius * sliding::radius).asDiagonal();
    }
    void force(double /*t*/, const Vector& /*q*/, const Vector& /*v*/, Vector& f) const
    {
        f << 0, -sliding::gravity, 0;
    }
    void gaps(const Vector& q, Eigen::Matrix<double, 1, 1>& g) const { g[0] = q[1]; }
    void directions(const Vector& /*q*/, Eigen::Matrix<double, 2, 3>& h) const
    {
        h << 0, 1, 0,  //
            1, 0, -sliding::radius;
    }
    [[nodiscard]] double restitution(int /*contact*/) const { return 0; }
    [[nodiscard]] double friction(int /*contact*/) const { return sliding::friction; }
};

template <class System>
Answer by_time_stepping(const System& system, double radius, double step)
{
    using Vector = Eigen::Vector3d;
    TimeStepping<System> motion(system, Vector::Zero(), Vector(sliding::start, 0, 0),
                                {.t_end = sliding::t_end, .step = step});
    Answer answer;
    EndOfSliding end;
    while (motion.advance() == Outcome::running) {
        const auto& state = motion.state();
        end.see(state.t, state.v[0] - radius * state.v[2], answer);
    }
    answer.finished = motion.outcome() == Outcome::reached_end;
    answer.steps = motion.statistics().steps;
    return answer;
}

}  // namespace

void add_sliding(Cells& cells)
{
    cells.add({"block", "ricochet", "scene", 0,
               [] { return [scene = scene_of_block()] { return by_scene(scene); }; }});
    for (const double tolerance : tolerances_of("block")) {
        cells.add({"block", "ricochet", "hand-over", tolerance,
                   [tolerance] { return [tolerance] { return by_hand_over(tolerance); }; }});
    }
    const TwoContactBlock block{.half_height = 0.05, .coefficient = sliding::friction};
    for (const double step : {1e-2, 1e-3, 1e-4}) {
        cells.add({"block", "ricochet", "Moreau-Jean", step,
                   [=] { return [=] { return by_time_stepping(block, 0, step); }; }});
        cells.add({"rolling", "ricochet", "Moreau-Jean", step, [=] {
                       return
                           [=] { return by_time_stepping(BallOnFloor{}, sliding::radius, step); };
                   }});
    }
}

}  // namespace ricochet::report
