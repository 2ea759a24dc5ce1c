// What systems with contacts refuse at compile time; see refused.cpp.

#include <Eigen/Core>

#include "ricochet/nonsmooth/contact_motion.hpp"

using namespace ricochet;
using Vector = Eigen::Vector2d;

// CASE 1: found no `mass` that fits
// CASE 2: found no `force` that fits
// CASE 3: found no `gaps` that fits
// CASE 4: found no `directions` that fits
// CASE 5: found no `restitution` or `friction` that fits
// CASE 6: found tangents outside its range
struct Point {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = CASE == 6 ? 0 : 1;

#if CASE == 1
    void mass(Eigen::Matrix2d& m) const
#else
    void mass(const Vector&, Eigen::Matrix2d& m) const
#endif
    {
        m.setIdentity();
    }
#if CASE == 2
    void force(double, const Vector&, Vector& f) const
#else
    void force(double, const Vector&, const Vector&, Vector& f) const
#endif
    {
        f = {0, -9.81};
    }
#if CASE == 3
    double gaps(const Vector& q) const
    {
        return q[1];
    }
#else
    void gaps(const Vector& q, Eigen::Matrix<double, 1, 1>& g) const
    {
        g[0] = q[1];
    }
#endif
#if CASE == 4
    void directions(const Vector&, Eigen::Matrix<double, 1, 2>& h) const
    {
        h << 0, 1;
    }
#else
    void directions(const Vector&, Eigen::Matrix<double, 1 + tangents, 2>& h) const
    {
        h.setIdentity();
    }
#endif
#if CASE == 5
    double friction() const
#else
    double friction(int) const
#endif
    {
        return 0.3;
    }
    double restitution(int) const
    {
        return 0;
    }
};

int main()
{
    const auto run =
        hand_over(Point{}, Vector{0, 1}, Vector{0, 0}, {.t_end = 1, .set_valued = {.step = 0.1}});
    return run.t > 0 ? 0 : 1;
}
