// Scenes with expensive guards.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "../input.hpp"
#include "entries.hpp"
#include "labels.hpp"
#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "problems/zones.hpp"
#include "run_system.hpp"
#include "scenes.hpp"

namespace ricochet::app {

namespace {

/// @throws BadInput unless the value is a whole number that is exact as a double
std::uint64_t whole(std::string_view name, double value)
{
    constexpr double most = 9007199254740992;  // 2^53
    if (value != std::floor(value) || value > most) {
        throw BadInput(
            fmt::format("{} must be a whole number up to {}, got {}", name, most, value));
    }
    return static_cast<std::uint64_t>(value);
}

}  // namespace

// --- arm ---

namespace arm {
namespace {

// the order of parameters
enum : std::size_t { obstacles, seed, reach, clearance, drive, damping, restitution, least_rate };

}  // namespace
}  // namespace arm

Arm arm_of(const std::vector<double>& p)
{
    using namespace arm;
    return Arm(ArmScene::Parameters{.obstacles = whole("obstacles", p[obstacles]),
                                    .seed = whole("seed", p[seed]),
                                    .reach = p[reach],
                                    .clearance = p[clearance],
                                    .drive = p[drive],
                                    .damping = p[damping],
                                    .restitution = p[restitution],
                                    .least_rate = p[least_rate]});
}

namespace arm {
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
}  // namespace arm

SystemEntry arm_entry()
{
    using namespace arm;
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

// --- cavern ---

namespace cavern {
namespace {

// the order of parameters
enum : std::size_t { segments, seed, size, radius, gravity, turn, drag, restitution, kick, launch };

}  // namespace
}  // namespace cavern

Cavern cavern_of(const std::vector<double>& p)
{
    using namespace cavern;
    return Cavern({.segments = whole("segments", p[segments]),
                   .seed = whole("seed", p[seed]),
                   .size = p[size],
                   .radius = p[radius],
                   .gravity = p[gravity],
                   .turn = p[turn],
                   .drag = p[drag],
                   .restitution = p[restitution],
                   .kick = p[kick],
                   .launch_speed = p[launch]});
}

namespace cavern {
namespace {

std::vector<double> start(const std::vector<double>& p)
{
    return {0, 0, p[launch], 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(cavern_of(settings.parameters), start(settings.parameters), settings,
                      repeats);
}

}  // namespace
}  // namespace cavern

SystemEntry cavern_entry()
{
    using namespace cavern;
    const Cavern::Parameters d;
    const Range positive{.lower = 0};
    const Range not_negative{.lower = 0, .lower_included = true};
    return {
        .name = Cavern::name,
        .description = "A ball flies through a closed cavern whose wall has many segments.",
        .parameters = {{"segments",
                        static_cast<double>(d.segments),
                        "1",
                        {.lower = 8, .upper = 1e7, .lower_included = true},
                        "of the wall"},
                       {"seed", static_cast<double>(d.seed), "1", not_negative, "of its shape"},
                       {"size", d.size, "m", positive, "mean distance of the wall"},
                       {"radius", d.radius, "m", positive, "of the ball"},
                       {"gravity", d.gravity, "m/s²", not_negative, "acceleration"},
                       {"turn", d.turn, "rad/s", {}, "of gravity"},
                       {"drag", d.drag, "1/m", positive, "deceleration over speed squared"},
                       {"restitution",
                        d.restitution,
                        "1",
                        {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
                        "at an impact"},
                       {"kick", d.kick, "m/s", not_negative, "least speed after an impact"},
                       {"launch", d.launch_speed, "m/s", not_negative, "speed at the start"}},
        .state = {{"x", "m", "to the right"},
                  {"y", "m", "up, at the start"},
                  {"vx", "m/s", "rate of x"},
                  {"vy", "m/s", "rate of y"}},
        .guards = {{"wall", "impact"}},
        .t_end = 10,
        .start = start,
        .run = run,
    };
}

// --- zones ---

namespace zones {
namespace {

enum : std::size_t { seed, size, frequency, turn };  // the order of parameters

Zones system(const std::vector<double>& p)
{
    return Zones({.seed = whole("seed", p[seed]),
                  .size = p[size],
                  .frequency = p[frequency],
                  .turn = p[turn]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[size], p[size], 0, 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

std::vector<GuardLabel> zone_labels()
{
    static const std::vector<std::string> names = [] {
        std::vector<std::string> out;
        for (std::size_t i = 0; i < Zones::Parameters{}.count; ++i) {
            out.push_back("zone-" + std::to_string(i));
        }
        return out;
    }();
    std::vector<GuardLabel> out;
    for (const std::string& name : names) out.push_back({name, "edge"});
    return out;
}

}  // namespace
}  // namespace zones

SystemEntry zones_entry()
{
    using namespace zones;
    const Zones::Parameters d;
    const Range positive{.lower = 0};
    const Range not_negative{.lower = 0, .lower_included = true};
    return {
        .name = Zones::name,
        .description = "A point on two springs enters and leaves 256 turning zones.",
        .parameters = {{"seed", static_cast<double>(d.seed), "1", not_negative, "of the zones"},
                       {"size", d.size, "m", positive, "half the side of the field"},
                       {"frequency", d.frequency, "rad/s", positive, "of the slower spring"},
                       {"turn", d.turn, "rad/s", not_negative, "of the fastest zone"}},
        .state = {{"x", "m", "position"},
                  {"y", "m", "position"},
                  {"vx", "m/s", "rate of x"},
                  {"vy", "m/s", "rate of y"}},
        .guards = zone_labels(),
        .t_end = 20,
        .start = start,
        .run = run,
    };
}

// --- eigenvalue ---

namespace eigenvalue {
namespace {

enum : std::size_t { level, amplitude, frequency, slow, seed, table };  // the order of parameters

}  // namespace
}  // namespace eigenvalue

LeastEigenvalue eigenvalue_of(const std::vector<double>& p)
{
    using namespace eigenvalue;
    return LeastEigenvalue({.level = p[level],
                            .amplitude = p[amplitude],
                            .frequency = p[frequency],
                            .slow = p[slow],
                            .seed = whole("seed", p[seed]),
                            .table = whole("table", p[table])});
}

namespace eigenvalue {
namespace {

std::vector<double> start(const std::vector<double>& p)
{
    const LeastEigenvalue::State q = eigenvalue_of(p).start();
    return {q.begin(), q.end()};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(eigenvalue_of(settings.parameters), start(settings.parameters), settings,
                      repeats);
}

}  // namespace
}  // namespace eigenvalue

SystemEntry eigenvalue_entry()
{
    using namespace eigenvalue;
    const LeastEigenvalue::Parameters d;
    return {
        .name = LeastEigenvalue::name,
        .description = "The smallest eigenvalue of a stiffness under four loads meets a level.",
        .parameters = {{"level", d.level, "1", {}, "of the eigenvalue"},
                       {"amplitude", d.amplitude, "1", {.lower = 0}, "of the loads"},
                       {"frequency", d.frequency, "rad/s", {.lower = 0}, "of the slowest load"},
                       {"slow",
                        d.slow,
                        "s",
                        {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
                        "that a call of the guard takes longer"},
                       {"seed",
                        static_cast<double>(d.seed),
                        "1",
                        {.lower = 0, .lower_included = true},
                        "of the matrices"},
                       {"table",
                        static_cast<double>(d.table),
                        "1",
                        {.lower = 0, .upper = 48, .lower_included = true, .upper_included = true},
                        "cells along a load, for bounds of the value; 0: none"}},
        .state = {{"q0", "1", "load"},
                  {"q1", "1", "load"},
                  {"q2", "1", "load"},
                  {"q3", "1", "load"}},
        .guards = labels(LeastEigenvalue{}, {"level met"}),
        .t_end = 40,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
