// Members of an inclusion, in a base class of it.
// needs: nonsmooth
#include <cmath>

#include <ricochet/nonsmooth/hand_over.hpp>

using namespace ricochet;

namespace {
struct Mass {  // a mass on a spring, and on the ground, whose friction weakens with the speed
    static constexpr int state_size = 2, reaction_size = 1;
    static double friction(double speed) { return 0.5 + 0.3 / (1 + speed); }
    void smooth(double, const Eigen::Vector2d& w, Eigen::Vector2d& f) const { f << w[1], -w[0]; }
    void observe(Eigen::Matrix<double, 1, 2>& E) const { E << 0, 1; }
};
// clang-format off
struct Braked : Mass
BLOCK
;
// clang-format on
}  // namespace

int main()
{
    const auto run = ricochet::hand_over(Braked{}, {3, 0}, {.t_end = 20});
    return run.outcome == ricochet::Outcome::reached_end && run.x[1] == 0 ? 0 : 1;
}
