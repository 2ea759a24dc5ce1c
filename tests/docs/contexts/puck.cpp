// A puck on a table, as in the program of the page.
// needs: nonsmooth
#include <cstdio>

#include <ricochet/nonsmooth/contact_motion.hpp>

using namespace ricochet;

namespace {
struct Puck {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;

    void mass(const Eigen::Vector2d&, Eigen::Matrix2d& M) const { M.setIdentity(); }
    void force(double, const Eigen::Vector2d&, const Eigen::Vector2d&, Eigen::Vector2d& F) const
    {
        F << 0, -9.81;
    }
    void gaps(const Eigen::Vector2d& q, Eigen::Matrix<double, 1, 1>& gap) const { gap[0] = q[1]; }
    void directions(const Eigen::Vector2d&, Eigen::Matrix2d& H) const { H << 0, 1, 1, 0; }
    double restitution(int) const { return 0.5; }
    double friction(int) const { return 0.2; }
};

[[maybe_unused]] void observe(double, const Eigen::Vector2d&, const Eigen::Vector2d&,
                              const Eigen::VectorXd&)
{
}
}  // namespace

int main()
{
    // clang-format off
BLOCK
    // clang-format on
}
