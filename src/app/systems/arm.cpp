#include "entries.hpp"
#include "problems/planar_arm.hpp"
#include "run_system.hpp"
#include "scenes.hpp"

namespace ricochet::app {

namespace {

// the order of parameters
enum : std::size_t { obstacles, seed, reach, clearance, drive, damping, restitution, least_rate };

}  // namespace

Arm arm_of(const std::vector<double>& p)
{
    return Arm(ArmScene::Parameters{.obstacles = static_cast<std::size_t>(p[obstacles]),
                                    .seed = static_cast<std::uint64_t>(p[seed]),
                                    .reach = p[reach],
                                    .clearance = p[clearance],
                                    .drive = p[drive],
                                    .damping = p[damping],
                                    .restitution = p[restitution],
                                    .least_rate = p[least_rate]});
}

namespace {

std::vector<double> start(const std::vector<double>& p)
{
    const Arm::State x = arm_of(p).start();
    return {x.begin(), x.end()};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(arm_of(settings.parameters), start(settings.parameters), settings, repeats);
}

}  // namespace

SystemEntry arm_entry()
{
    const ArmScene::Parameters d;
    const Range positive{.lower = 0};
    return {
        .name = Arm::name,
        .description = "An arm of four joints bounces off the obstacles around it.",
        .parameters = {{"obstacles",
                        static_cast<double>(d.obstacles),
                        "1",
                        {.lower = 1, .upper = 1001, .lower_included = true},
                        "octagons"},
                       {"seed",
                        static_cast<double>(d.seed),
                        "1",
                        {.lower = 0, .lower_included = true},
                        "of obstacles and torques"},
                       {"reach", d.reach, "m", positive, "length of the arm"},
                       {"clearance", d.clearance, "m", positive, "kept from obstacles"},
                       {"drive", d.drive, "rad/s²", positive, "largest torque over inertia"},
                       {"damping", d.damping, "1/s", positive, "of the joints"},
                       {"restitution",
                        d.restitution,
                        "1",
                        {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
                        "of the joint rates at an impact"},
                       {"least_rate", d.least_rate, "rad/s", positive, "after an impact"}},
        .state = {{"q1", "rad", "joint angle"},
                  {"q2", "rad", "joint angle"},
                  {"q3", "rad", "joint angle"},
                  {"q4", "rad", "joint angle"},
                  {"w1", "rad/s", "rate of q1"},
                  {"w2", "rad/s", "rate of q2"},
                  {"w3", "rad/s", "rate of q3"},
                  {"w4", "rad/s", "rate of q4"}},
        .guards = {{"obstacle", "impact"}},
        .t_end = 10,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
