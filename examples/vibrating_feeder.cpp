// A part on a track that shakes obliquely hops forward: contacts with a surface that moves, a guard
// that ends the run, and the forces of contact.
//
// Flights are located by events. Where the part lies on the track, or its hops become too small to
// count, Moreau's time stepping follows it, until the track falls away from under it.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ricochet/nonsmooth/contact_motion.hpp"

namespace {

/// q = (way along the track, height) [m].
struct Part {
    static constexpr bool resets = false;
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using State = std::array<double, 4>;
    double amplitude = 5e-4;  ///< [m]
    double angle = 0.5;       ///< [rad] of the shaking
    double frequency = 314;   ///< [rad/s]

    static void mass(const Eigen::Vector2d&, Eigen::Matrix2d& M) { M.setIdentity(); }
    static void force(double, const Eigen::Vector2d&, const Eigen::Vector2d&, Eigen::Vector2d& F)
    {
        F << 0, -9.81;
    }
    void gaps(double t, const Eigen::Vector2d& q, Eigen::Matrix<double, 1, 1>& gap) const
    {
        gap[0] = q[1] - amplitude * std::sin(angle) * std::sin(frequency * t);
    }
    static void directions(const Eigen::Vector2d&, Eigen::Matrix2d& H) { H << 0, 1, 1, 0; }
    void surface_rates(double t, const Eigen::Vector2d&, Eigen::Vector2d& b) const
    {
        const double speed = amplitude * frequency * std::cos(frequency * t);
        b << -speed * std::sin(angle), -speed * std::cos(angle);
    }
    static double restitution(int) { return 0.1; }
    static double friction(int) { return 0.4; }

    /// The end of the track.
    static double guard(double, const State& x) { return 0.05 - x[0]; }
    static ricochet::GuardInfo guard_info() { return {.stop_after = 1}; }
};

}  // namespace

int main()
{
    using namespace ricochet;
    const Part part;
    ContactMotion motion(part, {0, 0}, {0, part.amplitude * part.frequency * std::sin(part.angle)},
                         {.t_end = 10}, 1e-5);
    double most = 0;
    while (motion.step()) most = std::max(most, motion.forces().contacts[0]);
    const auto& run = motion.run();
    std::printf("%s after %.4f s: %.1f mm/s, %zu impacts, %zu phases, pressed by up to %.1f N\n",
                name(run.outcome).data(), motion.t(), 50 / motion.t(), run.events.size() - 1,
                motion.phases().size(), most);

    // By steps of 1e-4, 3e-5, 1e-5, 3e-6 and 1e-6 s: 0.43253, 0.432491, 0.4324883, 0.4324876,
    // 0.4324875. Time stepping alone gives 0.43195 and 0.43243 by steps of 1e-5 and 1e-6.
    return std::abs(motion.t() - 0.4324875) < 2e-6 ? 0 : 1;
}
