// What is refused at compile time. A line `// CASE n: text` says what the first error of case n
// contains; 0 compiles. Of a case `alone` no other error has a sentence of the library. `run.sh`
// checks this.

#include <array>
#include <cstddef>
#include <span>

#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/monitor.hpp"

using namespace ricochet;
using X = std::array<double, 2>;

struct Falling {
    using State = X;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x[1] = -x[1]; }
};

/// Events that change nothing.
struct Watched {
    using State = X;
    static constexpr bool resets = false;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    double guard(double, const X& x) const { return x[0]; }
};

/// Names with a purpose of their own.
struct Allowed : Falling {
    struct Rest {};
    double gard = 1, lower = 0;
    std::array<double, 3> gurds{};
    int resets = 0;
    void enable() const {}
};

/// Names that are intended.
struct Unchecked : Falling {
    static constexpr bool unchecked_names = true;
    void Reset() const {}

private:
    [[maybe_unused]] double rest = 1;
};

/// Two guards and two modes, `which` first.
struct Two : Falling {
    static constexpr std::size_t guard_count = 2;
    double guard(std::size_t which, Mode mode, double, const X& x) const
    {
        return x[which] + static_cast<double>(mode);
    }
    Mode reset(std::size_t, Mode mode, double, X&) const { return mode; }
    bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    double speed_bound(std::size_t, Mode, double, const X&) const { return 20; }
};

/// The same with numbers of another type, whose order cannot be told.
struct Untold : Falling {
    static constexpr std::size_t guard_count = 2;
    double guard(int which, int mode, double, const X& x) const { return x[which] + mode; }
    Mode reset(int, int mode, double, X&) const { return static_cast<Mode>(mode); }
};

struct System : Falling {
// CASE 5: found a reset that cannot be used: it is private
#if CASE == 5
private:
    void reset(double, X& x) const
    {
        x[1] = -x[1];
    }
// CASE 7: found a rest that cannot be used: it is private, or its requires-clause does not hold
#elif CASE == 7
    template <class V>
    void rest(double, V& x) const requires(sizeof(V) > 1000)
    {
        x = {};
    }
// CASE 8: found a guard_rate that is not const
#elif CASE == 8
    double guard_rate(double, const X&, const X& dxdt)
    {
        return dxdt[0];
    }
// CASE 9: found a reset that takes std::size_t first, in a system without guard_count
#elif CASE == 9
    Mode reset(std::size_t, double, X&) const
    {
        return 0;
    }
// CASE 10: found a unilateral whose parameters or result do not fit
#elif CASE == 10
    bool unilateral() const
    {
        return true;
    }
// CASE 22 alone: found a guard that is not const
#elif CASE == 22
    double guard(double, const X& x)
    {
        return x[0];
    }
    void reset(double, X& x) const
    {
        x[1] = -x[1];
    }
    void rest(double, X& x) const
    {
        x = {};
    }
// CASE 23 alone: found a guard whose parameters or result do not fit
#elif CASE == 23
    double guard(const X& x) const
    {
        return x[0];
    }
    void reset(double, X& x) const
    {
        x[1] = -x[1];
    }
// CASE 24 alone: found a next_time_event whose parameters or result do not fit
#elif CASE == 24
    double next_time_event(const X&, double t) const
    {
        return t + 1;
    }
    void time_reset(double, X& x) const
    {
        x[1] = -x[1];
    }
#endif
};

// CASE 1 alone: found a guard and no reset; expected a reset of that name or, where events are only
struct Renamed {
    using State = X;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    double guard(double, const X& x) const { return x[0]; }
    void jump(double, X& x) const { x[1] = -x[1]; }
};

struct Swapped : Two {
// CASE 33 alone: found a guard that takes the Mode before the number of the guard
#if CASE == 33
    double guard(Mode mode, std::size_t which, double, const X& x) const
    {
        return x[which] + static_cast<double>(mode);
    }
// CASE 34 alone: found a guard_rate that takes the Mode before the number of the guard
#elif CASE == 34
    double guard_rate(Mode, std::size_t which, double, const X&, const X& dxdt) const
    {
        return dxdt[which];
    }
// CASE 35 alone: found a reset that takes the Mode before the number of the guard
#elif CASE == 35
    Mode reset(Mode mode, std::size_t, double, X&) const
    {
        return mode;
    }
// CASE 36 alone: found a rest that takes the Mode before the number of the guard
#elif CASE == 36
    Mode rest(Mode mode, std::size_t, double, X&) const
    {
        return mode;
    }
// CASE 37 alone: found a enabled that takes the Mode before the number of the guard
#elif CASE == 37
    bool enabled(Mode mode, std::size_t which) const
    {
        return which == mode;
    }
// CASE 38 alone: found a enabled that takes the Mode before the number of the guard
#elif CASE == 38
    bool enabled(Mode mode, std::size_t which, double, const X&) const
    {
        return which == mode;
    }
// CASE 39 alone: found a speed_bound that takes the Mode before the number of the guard
#elif CASE == 39
    double speed_bound(Mode, std::size_t, double, const X&) const
    {
        return 20;
    }
// CASE 40 alone: found a guard that takes the Mode before the number of the guard
#elif CASE == 40
    template <class S>
    S guard(Mode, std::size_t which, const S&, const std::array<S, 2>& x) const
    {
        return x[which];
    }
#endif
};

/// The step of a host.
struct Step : HermiteStep {
    using HermiteStep::HermiteStep;
// CASE 28 alone: found a step with a restep that does not fit; expected void restep(double s,
#if CASE == 28
    void restep(double, X&) const {}
// CASE 29 alone: found a step with an interpolate_rate that does not fit
#elif CASE == 29
    void interpolate_rate(double, X&) const {}
#endif
};

// CASE 12: found no flow that fits the state
struct OtherFlow {
    using State = X;
    void Flow(double, const X& x, X& dxdt) const { dxdt = x; }
};

/// The inclusion would be ignored.
struct SetValued : Falling {
    int set_valued() const { return 0; }
};

struct Stateless {
    void flow(double, const X& x, X& dxdt) const { dxdt = x; }
};

int main()
{
    [[maybe_unused]] const Falling falling;
    [[maybe_unused]] const X x0{10, 0};
#if CASE == 0
    (void)integrate(falling, {10, 0}, {.t_end = 1, .rtol = 1e-6, .sample_times = {0.5}});
    (void)integrate(Watched{}, {10, 0}, {.t_end = 1});
    (void)integrate(Allowed{}, x0, {.t_end = 1}, FixedStep<Rk4>{});
    (void)integrate(Unchecked{}, {}, {.t_end = 1});
    EventMonitor monitor(falling, x0);
    (void)monitor.examine(Step(Instant{0}, 1, x0, x0, x0, x0));
    (void)integrate(Two{}, x0, {.t_end = 1});
    (void)integrate(Untold{}, x0, {.t_end = 1});
    Simulation braced(falling, {10, 0}, {.t_end = 1});
    Simulation own(Falling{}, {10, 0}, {.t_end = 1}, FixedStep<Rk4>{});
    EventMonitor braced_monitor(falling, {10, 0});
#elif CASE == 1
    (void)integrate(Renamed{}, x0, {.t_end = 1});
#elif CASE >= 33 && CASE <= 40
    (void)integrate(Swapped{}, x0, {.t_end = 1});
// CASE 41 alone: found a start with another number of components than System::State
#elif CASE == 41
    Simulation simulation(falling, {10, 0, 1}, {.t_end = 1});
// CASE 42 alone: found a start with another number of components than System::State
#elif CASE == 42
    Simulation simulation(Falling{}, {10}, {.t_end = 1}, FixedStep<Rk4>{});
// CASE 43 alone: found a start with another number of components than System::State
#elif CASE == 43
    EventMonitor monitor(falling, {10});
// CASE 44 alone: found no flow that fits the state
#elif CASE == 44
    EventMonitor monitor(OtherFlow{}, x0);
// CASE 45 alone: found no flow that fits the state
#elif CASE == 45
    const struct {
    } motionless;
    EventMonitor monitor(motionless, x0);
// CASE 46 alone: found a start of another type than System::State
#elif CASE == 46
    EventMonitor monitor(falling, std::vector<double>{10, 0});
// CASE 47 alone: found a start that is no state
#elif CASE == 47
    EventMonitor monitor(falling, "start");
// CASE 48 alone: found a start in braces for a system that declares no State
#elif CASE == 48
    EventMonitor monitor(Stateless{}, {10, 0});
// CASE 49 alone: found a start in braces for a system that declares no State
#elif CASE == 49
    Simulation simulation(Stateless{}, {10, 0}, {.t_end = 1});
// CASE 50 alone: found a start of another type than System::State
#elif CASE == 50
    Simulation simulation(falling, std::vector<double>{10, 0}, {.t_end = 1});
#elif CASE == 12
    (void)integrate(OtherFlow{}, x0, {.t_end = 1});
// CASE 13: found a start with another number of components than System::State
#elif CASE == 13
    (void)integrate(falling, {10, 0, 1}, {.t_end = 1});
// CASE 14: found a start with another number of components than System::State
#elif CASE == 14
    (void)integrate(Falling{}, {10}, {.t_end = 1}, FixedStep<Rk4>{});
// CASE 17: declares no State
#elif CASE == 17
    (void)integrate(Stateless{}, {10, 0}, {.t_end = 1});
// CASE 19: found no options
#elif CASE == 19
    (void)integrate(falling, {10, 0});
// CASE 20: found no options
#elif CASE == 20
    (void)integrate(Falling{}, x0);
// CASE 21: found a start of another type than System::State
#elif CASE == 21
    (void)integrate(falling, std::vector<double>{10, 0}, {.t_end = 1});
// CASE 26 alone: found a locator in the place of the detector; expected stepping, detector, locator
#elif CASE == 26
    (void)integrate(falling, x0, {.t_end = 1}, ErrorControlled<Fehlberg78>{}, Bisection{});
// CASE 27 alone: found a locator in the place of the detector
#elif CASE == 27
    Simulation simulation(falling, x0, {.t_end = 1}, FixedStep<Rk4>{}, Toms748{});
// CASE 31: found no stepping behind the options; expected ErrorControlled<Method> or FixedStep
#elif CASE == 31
    (void)integrate(falling, x0, {.t_end = 1}, Fehlberg78{});
// CASE 32: found no stepping behind the options
#elif CASE == 32
    Simulation simulation(falling, x0, {.t_end = 1}, Extremum{});
#elif CASE == 28 || CASE == 29
    EventMonitor monitor(falling, x0);
    return static_cast<int>(monitor.examine(Step(Instant{0}, 1, x0, x0, x0, x0)));
// CASE 54 alone: found a detector that does not have the members of one; expected those
#elif CASE == 54
    (void)integrate(falling, x0, {.t_end = 1}, FixedStep<Rk4>{}, Rk4{});
// CASE 55: found a locator without locate(GuardPath&, GuardSample, GuardSample, double) const
#elif CASE == 55
    (void)integrate(falling, x0, {.t_end = 1}, FixedStep<Rk4>{}, Extremum{}, Rk4{});
// CASE 56: found stepping by a type that is no method; expected one with template <class State>
#elif CASE == 56
    (void)integrate(falling, x0, {.t_end = 1}, FixedStep<Extremum>{});
// CASE 30 alone: found a detector that may miss events in Metered; expected one that keeps them all
#elif CASE == 30
    const auto measure = [](const Calibrated<>& gate) {
        return Metered(gate).metering().piece > 0;
    };
    (void)measure;
// CASE 51 alone: found a system with set_valued(); expected the target to link ricochet::nonsmooth
#elif CASE == 51
    EventMonitor monitor(SetValued{}, x0);
// CASE 52 alone: found a system with set_valued(); expected the target to link ricochet::nonsmooth
#elif CASE == 52
    (void)integrate(SetValued{}, x0, {.t_end = 1});
// CASE 53 alone: found a system with set_valued(); expected the target to link ricochet::nonsmooth
#elif CASE == 53
    Simulation simulation(SetValued{}, x0, {.t_end = 1});
// CASE 18: compiled with -ffast-math or -ffinite-math-only
#else
    (void)integrate(System{}, x0, {.t_end = 1});
#endif
}
