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
// CASE 7: found no `surface_rates` that fits
// CASE 8: found `gaps` with a time, and no `surface_rates`
// CASE 9: found no `dry_friction` that fits
// CASE 10: found a mechanism with `rest`
// CASE 11: found a reset whose parameters or result do not fit
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
#elif CASE == 8
    void gaps(double t, const Vector& q, Eigen::Matrix<double, 1, 1>& g) const
    {
        g[0] = q[1] - t;
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
#if CASE == 7
    void surface_rates(const Vector&, Vector& b) const
    {
        b.setZero();
    }
#elif CASE == 9
    void dry_friction(Vector& forces) const
    {
        forces.setZero();
    }
#elif CASE >= 10
    double guard(double, const std::array<double, 4>& x) const
    {
        return x[0];
    }
#if CASE == 10
    void reset(double, std::array<double, 4>& x) const
    {
        x[2] = -x[2];
    }
    void rest(double, std::array<double, 4>& x) const
    {
        x[2] = 0;
    }
#else
    double reset(const std::array<double, 4>& x) const
    {
        return -x[2];
    }
#endif
#endif
};

int main()
{
    const auto run =
        hand_over(Point{}, Vector{0, 1}, Vector{0, 0}, {.t_end = 1, .set_valued = {.step = 0.1}});
    return run.t > 0 ? 0 : 1;
}
