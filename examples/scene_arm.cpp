// An arm among falling discs: a hybrid system as a body of a scene, with its own guards as stops.
//
//     example_scene_arm [arm.svg]    also draws its motion, for a browser
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <vector>

#include "ricochet/scene/simulate.hpp"
#include "ricochet/scene/system.hpp"

namespace {

using ricochet::Vector2;

/// A link that turns about the origin, with a spring and a damper in its joint and a stop on either
/// side; x = (angle [rad], rate [rad/s]). Others meet a disc at its middle and one at its tip.
class Arm {
public:
    using State = std::array<double, 2>;
    static constexpr std::size_t shape_count = 2;
    static constexpr std::size_t guard_count = 2;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = (-stiffness * x[0] - damping * x[1]) / inertia;
    }

    // The stops.
    double guard(std::size_t which, double /*t*/, const State& x) const
    {
        return which == 0 ? x[0] + stop : stop - x[0];
    }
    void reset(std::size_t /*which*/, double /*t*/, State& x) const { x[1] *= -0.5; }

    double shape_radius(std::size_t k) const { return k == 0 ? 0.1 : 0.15; }
    ricochet::SystemDisc shape(std::size_t k, double /*t*/, const State& x) const
    {
        const double r = place(k);
        const double c = std::cos(x[0]);
        const double s = std::sin(x[0]);
        return {{r * c, r * s}, {-r * x[1] * s, r * x[1] * c}};
    }
    /// The energy never increases; it bounds angle and rate, and these bound the acceleration.
    double shape_acceleration(std::size_t k, double /*t*/, const State& x) const
    {
        const double twice = inertia * x[1] * x[1] + stiffness * x[0] * x[0];
        const double rate = std::sqrt(twice / inertia);
        const double angle = std::sqrt(twice / stiffness);
        return place(k) * (rate * rate + (stiffness * angle + damping * rate) / inertia);
    }
    void push(std::size_t k, double /*t*/, State& x, const Vector2& impulse) const
    {
        x[1] += place(k) * (std::cos(x[0]) * impulse[1] - std::sin(x[0]) * impulse[0]) / inertia;
    }

private:
    static double place(std::size_t k) { return k == 0 ? 0.6 : 1.2; }

    static constexpr double inertia = 0.8;   // [kg m^2]
    static constexpr double stiffness = 30;  // [N m/rad]
    static constexpr double damping = 0.4;   // [N m s/rad]
    static constexpr double stop = 0.6;      // [rad]
};

/// Draws animated circles from the samples, 1 m as 200 pixels.
void draw(const char* file, const ricochet::Scene& scene, const ricochet::SceneRun& run)
{
    std::ofstream out(file);
    const auto pixel = [](const Vector2& p) {
        return Vector2{200 * (p[0] + 0.6), 200 * (3 - p[1])};
    };
    const auto animate = [&](const char* attribute, std::size_t body, std::size_t c) {
        out << "<animate attributeName='" << attribute << "' dur='" << run.t
            << "s' repeatCount='indefinite' values='";
        for (std::size_t k = 0; k < run.samples.size(); ++k) {
            out << (k ? ";" : "") << std::round(10 * pixel(run.samples[k][body].at)[c]) / 10;
        }
        out << "'/>";
    };
    out << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 480 800'>\n"
           "<rect width='100%' height='100%' fill='white'/>\n";
    const Vector2 joint = pixel({0, 0});
    const auto tip = static_cast<std::size_t>(scene.systems()[0].first + 1);
    const Vector2 end = pixel(run.samples[0][tip].at);
    out << "<line stroke='#404040' stroke-width='6' x1='" << joint[0] << "' y1='" << joint[1]
        << "' x2='" << end[0] << "' y2='" << end[1] << "'>";
    animate("x2", tip, 0);
    animate("y2", tip, 1);
    out << "</line>\n<g stroke='#404040' fill-opacity='0.7'>\n";
    for (std::size_t i = 0; i < run.bodies.size(); ++i) {
        const Vector2 at = pixel(run.samples[0][i].at);
        const bool arm = scene.system_of(static_cast<std::uint32_t>(i)) != nullptr;
        out << "<circle r='" << 200 * scene.bodies()[i].radius << "' cx='" << at[0] << "' cy='"
            << at[1] << "' fill='" << (arm ? "#d55e00" : "#0072b2") << "'>";
        animate("cx", i, 0);
        animate("cy", i, 1);
        out << "</circle>\n";
    }
    out << "</g>\n</svg>\n";
}

}  // namespace

int main(int argc, char** argv)
{
    using namespace ricochet;
    Scene scene({.gravity = {0, -9.81}});
    const MaterialId rubber = scene.material({.name = "rubber", .restitution = 0.8});
    for (int k = 0; k < 8; ++k) {
        scene.disc({.at = {0.3 + 0.23 * (k * 3 % 5), 1.2 + 0.4 * k},
                    .radius = 0.08,
                    .mass = 0.3,
                    .material = rubber});
    }
    const SystemId arm = scene.system(
        {.name = "arm", .motion = system_body(Arm{}, Arm::State{0.1, 0}), .material = rubber});

    SceneOptions options{.t_end = 1.5};
    for (int k = 0; k <= 75; ++k) options.sample_times.push_back(0.02 * k);
    const SceneRun run = simulate(scene, options);
    for (const SceneEvent& event : run.events) {
        std::printf("%.12f s  %s meets %s\n", event.t, scene.name_of(BodyId{event.body}).c_str(),
                    scene.name_of(BodyId{event.other.index}).c_str());
    }
    std::printf("the arm ends at %.6f rad\n", run.systems[arm.index][0]);
    if (run.outcome != Outcome::reached_end) std::puts(run.message.c_str());
    if (argc > 1) draw(argv[1], scene, run);
    return run.outcome == Outcome::reached_end ? 0 : 1;
}
