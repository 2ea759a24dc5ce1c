// What inclusions refuse at compile time; see refused.cpp.

#include <Eigen/Core>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/planned.hpp"

using namespace ricochet;
using State = Eigen::Vector2d;
using Reaction = Eigen::Matrix<double, 1, 1>;

// CASE 2: found a member `offset` whose parameters or result do not fit
// CASE 3: found a member `observe` that is not const
// CASE 4: found a member `observe` whose parameters or result do not fit
// CASE 5: found a member `offset` that changes a copy
// CASE 6: found a member `branch_bound` whose parameters or result do not fit
// CASE 7: found no `smooth` that fits
// CASE 8: found no `reaction_set` that fits
// CASE 9: found a system that is no inclusion
// CASE 11 alone: found a system with set_valued() and a detector whose predictions or bounds are
// CASE 12 alone: found matrices or steps of an inclusion in its own size, which the library has not
// compiled
// CASE 10 alone: found an inclusion of more than 8 components or 4 reactions, which the library has
// not compiled
struct Block {
#if CASE != 9
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
#endif
#if CASE == 7
    State smooth(double, const State& w) const
    {
        return {w[1], -w[0]};
    }
#else
    void smooth(double, const State& w, State& f) const
    {
        f = {w[1], -w[0]};
    }
#endif
#if CASE == 8
    sets::IntervalSet reaction_set(const State&) const
#else
    sets::IntervalSet reaction_set(double, const State&) const
#endif
    {
        return {-0.3, 0.3};
    }
#if CASE == 3
    void observe(Eigen::Matrix<double, 1, 2>& E)
#elif CASE == 4
    void observe(Eigen::Matrix<double, 2, 1>& E) const
#else
    void observe(Eigen::Matrix<double, 1, 2>& E) const
#endif
    {
        E << 0, 1;
    }
#if CASE == 2
    double offset(double) const
    {
        return 0.2;
    }
#elif CASE == 5
    void offset(double, Reaction s) const
    {
        s[0] = 0.2;
    }
#else
    void offset(double, Reaction& s) const
    {
        s[0] = 0.2;
    }
#endif
#if CASE == 6
    double branch_bound(double, const State&) const
    {
        return 0.3;
    }
#endif
};

/// A system that declares bounds of its guard, for `Planned`.
struct Beside {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    static void flow(double, const State& x, State& dxdt) { dxdt = {x[1], -x[0]}; }
    static double guard(double, const State& x) { return x[1]; }
    static double speed_bound(double, const State&) { return 1; }
    static Block set_valued() { return {}; }
};

struct Wide {
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 2;
    void smooth(double, const State& w, State& f) const { f = -w; }
    sets::Ball<2> reaction_set(double, const State&) const { return sets::Ball<2>(1); }
};

struct Large {
    static constexpr int state_size = 9;
    static constexpr int reaction_size = 1;
    using Vector = Eigen::Matrix<double, 9, 1>;
    void smooth(double, const Vector& w, Vector& f) const { f = -w; }
    sets::IntervalSet reaction_set(double, const Vector&) const { return {-0.3, 0.3}; }
};

void run()
{
#if CASE == 10
    (void)hand_over(Large{}, Large::Vector::Zero(), {.t_end = 1});
#elif CASE == 11
    const Beside::State x0{1, 0};
    Simulation simulation(Beside{}, x0, {.t_end = 1}, ErrorControlled<Dopri5>{}, Planned{});
#elif CASE == 12
    CompositeStep<Wide> step(Wide{});
#else
    (void)hand_over(Block{}, State(0, 0), {.t_end = 1});
#endif
}
