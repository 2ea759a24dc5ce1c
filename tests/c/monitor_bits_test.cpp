// The monitor of the C interface finds the same events as the C++ one in the same host, to the bit,
// and runs by callbacks are those of the C++ template.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "ball.h"
#include "check.h"
#include "ricochet/integrate.hpp"
#include "ricochet/monitor.hpp"
#include "rk4_host.hpp"

namespace ricochet::monitor_bits_test {
namespace {

// --- systems ---

/// Balls side by side, x = (height, velocity) each, that come to rest.
template <std::size_t count>
struct Balls {
    using X = std::array<double, 2 * count>;
    static constexpr std::size_t guard_count = count;
    static constexpr bool has_rest = true;
    static constexpr bool unilateral = true;
    double restitution = 0.9;

    void flow(double, const X& x, X& dxdt) const
    {
        for (std::size_t i = 0; i < 2 * count; i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -9.81;
        }
    }
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const { return x[2 * which]; }
    void reset(std::size_t which, double, X& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -restitution;
    }
    void rest(std::size_t which, double, X& x) const { x[2 * which] = x[2 * which + 1] = 0; }
};

/// A ball in the wind that has no rest rule.
struct Restless {
    using X = std::array<double, 2>;
    static constexpr std::size_t guard_count = 1;
    static constexpr bool has_rest = false;
    static constexpr bool unilateral = false;

    void flow(double t, const X& x, X& dxdt) const
    {
        dxdt = {x[1], -9.81 + 0.1 * std::sin(t) - 0.05 * x[1]};
    }
    [[nodiscard]] double guard(std::size_t, double, const X& x) const { return x[0]; }
    void reset(std::size_t, double, X& x) const { x = {0, -0.5 * x[1]}; }
};

/// A clock that strikes every second speeds up a body that moves against a wall.
struct Clock {
    using X = std::array<double, 2>;
    static constexpr std::size_t guard_count = 1;
    static constexpr bool has_rest = false;
    static constexpr bool unilateral = false;

    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -0.1 * x[0]}; }
    [[nodiscard]] double guard(std::size_t, double, const X& x) const { return 2.5 - x[0]; }
    void reset(std::size_t, double, X& x) const { x[1] = -0.5 * x[1]; }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    void time_reset(double, X& x) const { x[1] += 1; }
};

/// A ball on a high floor, and its passages through a height, whose guards and rates come from one
/// call each.
struct Together {
    using X = std::array<double, 2>;
    static constexpr std::size_t guard_count = 2;
    static constexpr bool has_rest = false;
    static constexpr bool unilateral = false;

    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    void guards(double, const X& x, std::span<double> g) const
    {
        g[0] = x[0] - 1000;
        g[1] = x[0] - 1002;
    }
    void guard_rates(double, const X&, const X& dxdt, std::span<double> rates) const
    {
        rates[0] = rates[1] = dxdt[0];
    }
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) x = {1000, -0.5 * x[1]};
    }
};

template <class System>
concept RatedTogether = requires(const System& system, const typename System::X& x,
                                 std::span<double> numbers)
{
    system.guard_rates(0, x, x, numbers);
};

template <class System>
concept Timed = requires(const System& system)
{
    system.next_time_event(0.0);
};

/// A system of C++ as callbacks.
template <class System>
class Callbacks {
    using X = typename System::X;

    static const System& at(void* user) { return *static_cast<const System*>(user); }
    static X read(const double* x)
    {
        X at;
        std::copy_n(x, at.size(), at.begin());
        return at;
    }
    static void write(const X& from, double* x) { std::copy(from.begin(), from.end(), x); }

    static int flow(void* user, rc_mode, double t, const double* x, double* dxdt, std::size_t)
    {
        X rate;
        at(user).flow(t, read(x), rate);
        write(rate, dxdt);
        return 0;
    }
    static int guard(void* user, std::size_t which, rc_mode, double t, const double* x, std::size_t,
                     double* g)
    {
        if constexpr (!RatedTogether<System>) *g = at(user).guard(which, t, read(x));
        return 0;
    }
    static int guards(void* user, rc_mode, double t, const double* x, std::size_t, double* g,
                      std::size_t count)
    {
        if constexpr (RatedTogether<System>) at(user).guards(t, read(x), {g, count});
        return 0;
    }
    static int rates(void* user, rc_mode, double t, const double* x, const double* dxdt,
                     std::size_t, double* rates, std::size_t count)
    {
        if constexpr (RatedTogether<System>) {
            at(user).guard_rates(t, read(x), read(dxdt), {rates, count});
        }
        return 0;
    }
    static int reset(void* user, std::size_t which, rc_mode*, double t, double* x, std::size_t)
    {
        X state = read(x);
        at(user).reset(which, t, state);
        write(state, x);
        return 0;
    }
    static int rest(void* user, std::size_t which, rc_mode*, double t, double* x, std::size_t)
    {
        X state = read(x);
        if constexpr (System::has_rest) at(user).rest(which, t, state);
        write(state, x);
        return 0;
    }
    static int next_time(void* user, double t, double* next)
    {
        if constexpr (Timed<System>) *next = at(user).next_time_event(t);
        return 0;
    }
    static int time_reset(void* user, rc_mode*, double t, double* x, std::size_t)
    {
        X state = read(x);
        if constexpr (Timed<System>) at(user).time_reset(t, state);
        write(state, x);
        return 0;
    }

public:
    [[nodiscard]] static rc_system* make(System& system)
    {
        std::array<rc_guard_info, System::guard_count> infos{};
        for (rc_guard_info& info : infos) {
            info.size = sizeof info;
            info.unilateral = System::unilateral;
        }
        rc_callbacks callbacks{};
        callbacks.size = sizeof callbacks;
        callbacks.dimension = X().size();
        callbacks.guard_count = System::guard_count;
        callbacks.guard_infos = infos.data();
        callbacks.user = &system;
        callbacks.flow = &flow;
        if (RatedTogether<System>) {
            callbacks.guards = &guards;
            callbacks.guard_rates = &rates;
        } else {
            callbacks.guard = &guard;
        }
        callbacks.reset = &reset;
        if (System::has_rest) callbacks.rest = &rest;
        if (Timed<System>) {
            callbacks.next_time_event = &next_time;
            callbacks.time_reset = &time_reset;
        }
        rc_system* made = nullptr;
        CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &made));
        return made;
    }
};

// --- one host, two monitors ---

/// The recorded events, as numbers that are compared bit by bit.
using Story = std::vector<double>;

void tell(Story& story, double t, double remainder, std::span<const double> before,
          std::span<const double> after)
{
    story.insert(story.end(), {t, remainder});
    story.insert(story.end(), before.begin(), before.end());
    story.insert(story.end(), after.begin(), after.end());
}

template <class System>
class OfCpp {
public:
    using X = typename System::X;
    explicit OfCpp(System& system) : monitor_(system, X{}) {}

    Verdict start(const X& x, const X& rate, double h)
    {
        return monitor_.start(Instant{0}, x, rate, h);
    }
    template <class Step>
    Verdict examine(const Step& step, bool restep)
    {
        if (restep) return monitor_.examine(step);
        return monitor_.examine(
            HermiteStep(step.t0(), step.h(), step.x0(), step.x1(), step.rate0(), step.rate1()));
    }
    Verdict resume(const X& rate, double h) { return monitor_.resume(rate, h); }
    Verdict hold(double t) { return monitor_.hold(t); }
    [[nodiscard]] double must_stop_at() const { return monitor_.must_stop_at(); }
    [[nodiscard]] Instant cut(X& after, Story& story) const
    {
        const auto& cut = monitor_.cut();
        after = cut.after;
        tell(story, cut.t.value, cut.t.remainder, cut.before, cut.after);
        for (const std::size_t which : cut.fired) story.push_back(static_cast<double>(which));
        story.insert(story.end(), {cut.s, static_cast<double>(cut.on_time),
                                   static_cast<double>(cut.accumulation),
                                   static_cast<double>(cut.state_changed)});
        return cut.t;
    }
    void finish(Story& story) const
    {
        for (const auto& event : monitor_.events()) {
            tell(story, event.t, event.slope, event.before, event.after);
            story.insert(story.end(),
                         {static_cast<double>(event.guard), static_cast<double>(event.kind),
                          event.bracket.lo, event.bracket.hi, event.error});
        }
        const Statistics& of = monitor_.statistics();
        for (const auto count : {of.steps, of.resteps, of.flow_calls, of.guard_calls, of.events,
                                 of.evidence.checked, of.evidence.assumed}) {
            story.push_back(static_cast<double>(count));
        }
        tell(story, monitor_.t().value, monitor_.t().remainder, monitor_.x(), {});
        story.insert(story.end(), {static_cast<double>(monitor_.outcome()),
                                   static_cast<double>(monitor_.guard()),
                                   static_cast<double>(monitor_.side(0))});
    }

private:
    EventMonitor<System, X> monitor_;
};

template <class Step>
int interpolate(void* step, double s, double* x, std::size_t n)
{
    static_cast<const Step*>(step)->interpolate(s, {x, n});
    return 0;
}
template <class Step>
int interpolate_rate(void* step, double s, double* x, std::size_t n)
{
    static_cast<const Step*>(step)->interpolate_rate(s, {x, n});
    return 0;
}
template <class Step>
int restep_of(void* step, double s, double* x, std::size_t n)
{
    static_cast<const Step*>(step)->restep(s, {x, n});
    return 0;
}

template <class System>
class OfC {
public:
    using X = typename System::X;
    static constexpr std::size_t n = X().size();

    /// @param moves  every verdict is followed by a snapshot, and another monitor continues
    OfC(System& system, bool moves) : system_(Callbacks<System>::make(system)), moves_(moves)
    {
        CHECK_STATUS(RC_OK, rc_monitor_new(system_, nullptr, &monitor_));
    }
    OfC(const OfC&) = delete;
    OfC& operator=(const OfC&) = delete;
    ~OfC()
    {
        CHECK_STATUS(RC_OK, rc_monitor_free(monitor_));
        rc_system_free(system_);
    }

    Verdict start(const X& x, const X& rate, double h)
    {
        CHECK_STATUS(RC_OK,
                     rc_monitor_start(monitor_, 0, x.data(), rate.data(), n, 0, h, &answer_));
        return verdict();
    }
    template <class Step>
    Verdict examine(const Step& shown, bool restep)
    {
        rc_host_step step{};
        step.size = sizeof step;
        step.n = n;
        step.t0 = shown.t0().value;
        step.t0_remainder = shown.t0().remainder;
        step.h = shown.h();
        step.x0 = shown.x0().data();
        step.x1 = shown.x1().data();
        step.rate0 = shown.rate0().data();
        step.rate1 = shown.rate1().data();
        if (restep) {
            step.user = const_cast<Step*>(&shown);
            step.interpolate = &interpolate<Step>;
            step.interpolate_rate = &interpolate_rate<Step>;
            step.restep = &restep_of<Step>;
        }
        CHECK_STATUS(RC_OK, rc_monitor_examine(monitor_, &step, &answer_));
        return verdict();
    }
    Verdict resume(const X& rate, double h)
    {
        CHECK_STATUS(RC_OK, rc_monitor_resume(monitor_, rate.data(), n, h, &answer_));
        return verdict();
    }
    Verdict hold(double t)
    {
        CHECK_STATUS(RC_OK, rc_monitor_hold(monitor_, t, &answer_));
        return verdict();
    }
    [[nodiscard]] double must_stop_at() const { return rc_monitor_must_stop_at(monitor_); }
    [[nodiscard]] Instant cut(X& after, Story& story) const
    {
        rc_cut cut;
        cut.size = sizeof cut;
        CHECK_STATUS(RC_OK, rc_monitor_cut(monitor_, &cut));
        std::copy_n(cut.after, n, after.begin());
        tell(story, cut.t, cut.t_remainder, {cut.before, n}, {cut.after, n});
        for (std::size_t i = 0; i < cut.fired_count; ++i) {
            story.push_back(static_cast<double>(cut.fired[i]));
        }
        story.insert(story.end(), {cut.s, static_cast<double>(cut.on_time),
                                   static_cast<double>(cut.accumulation),
                                   static_cast<double>(cut.state_changed)});
        return {cut.t, cut.t_remainder};
    }
    void finish(Story& story)
    {
        rc_statistics of;
        of.size = sizeof of;
        for (std::size_t i = 0; i < rc_monitor_event_count(monitor_); ++i) {
            rc_event event;
            event.size = sizeof event;
            CHECK_STATUS(RC_OK, rc_monitor_event_at(monitor_, i, &event));
            tell(story, event.t, event.slope, {event.before, n}, {event.after, n});
            story.insert(story.end(),
                         {static_cast<double>(event.guard), static_cast<double>(event.kind),
                          event.bracket_lo, event.bracket_hi, event.error});
        }
        CHECK_STATUS(RC_OK, rc_monitor_statistics(monitor_, &of));
        for (const auto count : {of.steps, of.resteps, of.flow_calls, of.guard_calls, of.events,
                                 of.checked, of.assumed}) {
            story.push_back(static_cast<double>(count));
        }
        double remainder = 0;
        const double t = rc_monitor_time(monitor_, &remainder);
        tell(story, t, remainder, {rc_monitor_state(monitor_), n}, {});
        const rc_outcome_code outcome = rc_monitor_outcome(monitor_);
        rc_side side = RC_PLATEAU;
        CHECK_STATUS(RC_OK, rc_monitor_side(monitor_, 0, &side));
        // In C++ it is reached_end where the run has not ended.
        story.insert(story.end(), {static_cast<double>(outcome == RC_RUNNING ? 0 : outcome),
                                   static_cast<double>(rc_monitor_guard(monitor_)),
                                   static_cast<double>(side + 1)});
    }

private:
    [[nodiscard]] Verdict verdict()
    {
        if (moves_ && (answer_ == RC_STANDS || answer_ == RC_RESTS)) {
            std::size_t size = 0;
            CHECK_STATUS(RC_OK, rc_monitor_save(monitor_, nullptr, &size));
            std::string bytes(size, '\0');
            CHECK_STATUS(RC_OK, rc_monitor_save(monitor_, bytes.data(), &size));
            rc_monitor* other = nullptr;
            CHECK_STATUS(RC_OK, rc_monitor_new(system_, nullptr, &other));
            CHECK_STATUS(RC_OK, rc_monitor_restore(other, bytes.data(), size));
            CHECK_STATUS(RC_OK, rc_monitor_free(monitor_));
            monitor_ = other;
        }
        return static_cast<Verdict>(answer_);
    }

    rc_system* system_;
    rc_monitor* monitor_ = nullptr;
    rc_verdict answer_ = RC_NO_VERDICT;
    bool moves_;
};

struct Told {
    Story cuts, end;
    std::size_t number = 0;  ///< of cuts
    Verdict verdict = Verdict::stands;
};

/// @param restep  the host offers its own map and interpolant, else the cubic of its ends
template <class System, class Monitor>
Told drive(System& system, Monitor&& monitor, const typename System::X& x0, double t_end, double h,
           bool restep)
{
    using X = typename System::X;
    using Host = test::Rk4Host<System, X().size()>;
    Host host(system, 0, x0);
    Told told;
    Verdict verdict = monitor.start(x0, host.rate(), h);
    for (;;) {
        while (verdict == Verdict::cut) {
            X after;
            const Instant t = monitor.cut(after, told.cuts);
            ++told.number;
            host.restart(t, after, 0);
            verdict = monitor.resume(host.rate(), h);
        }
        if (verdict == Verdict::rests && monitor.must_stop_at() <= t_end) {
            verdict = monitor.hold(monitor.must_stop_at());
            continue;
        }
        if (verdict != Verdict::stands || host.t() >= t_end) break;
        const double ahead = host.until(std::min(t_end, monitor.must_stop_at()));
        const typename Host::Step step(host, h * (1 + 1e-9) < ahead ? h : ahead);
        verdict = monitor.examine(step, restep);
        if (verdict == Verdict::stands) host.accept(step);
    }
    monitor.finish(told.end);
    told.verdict = verdict;
    return told;
}

/// Equality in which NaN, a slope that was not computed, equals itself.
bool same_bits(const Story& a, const Story& b)
{
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

template <class System>
std::size_t compare(const char* name, System system, const typename System::X& x0, double t_end,
                    double h, Verdict expected)
{
    std::size_t cuts = 0;
    for (const bool restep : {true, false}) {
        const Told cpp = drive(system, OfCpp<System>(system), x0, t_end, h, restep);
        const Told c = drive(system, OfC<System>(system, false), x0, t_end, h, restep);
        const Told moved = drive(system, OfC<System>(system, true), x0, t_end, h, restep);
        CHECK(cpp.verdict == expected && c.verdict == expected && moved.verdict == expected);
        CHECK(c.number == cpp.number);
        CHECK(same_bits(c.cuts, cpp.cuts));
        CHECK(same_bits(c.end, cpp.end));
        CHECK(same_bits(moved.cuts, cpp.cuts));
        std::printf("%s, steps of %g s, %s: %zu sets of events, the same bits\n", name, h,
                    restep ? "its own map" : "the cubic", cpp.number);
        if (restep) cuts = cpp.number;
    }
    return cuts;
}

// --- whole runs ---

/// As in ball.h.
struct PlainBall {
    using State = std::array<double, 2>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -0.9 * x[1]}; }
};

struct Rotations {
    using State = std::vector<double>;
    static int in_c(void*, rc_mode, double, const double* x, double* dxdt, std::size_t n)
    {
        for (std::size_t i = 0; i < n; i += 2) {
            dxdt[i] = x[i + 1];
            dxdt[i + 1] = -x[i];
        }
        return 0;
    }
    void flow(double t, const State& x, State& dxdt) const
    {
        (void)in_c(nullptr, 0, t, x.data(), dxdt.data(), x.size());
    }
};

template <class System, class X>
void compare_runs(const System& system, const X& x0, double t_end, const rc_callbacks& callbacks)
{
    const auto run = integrate(system, x0, {.t_end = t_end});
    const rc_options options = options_until(t_end);
    rc_system* in_c = nullptr;
    rc_simulation* simulation = nullptr;
    CHECK_STATUS(RC_OK, rc_system_new(&callbacks, &in_c));
    CHECK_STATUS(RC_OK, rc_simulation_new(in_c, x0.data(), x0.size(), &options, &simulation));
    CHECK_STATUS(RC_OK, rc_run(simulation));
    CHECK(rc_event_count(simulation) == run.events.size());
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        CHECK(event_at(simulation, i).t == run.events[i].t);
    }
    CHECK(std::memcmp(rc_state(simulation), run.x.data(), run.x.size() * sizeof(double)) == 0);
    CHECK(statistics_of(simulation).steps == run.statistics.steps);
    CHECK_STATUS(RC_OK, rc_simulation_free(simulation));
    rc_system_free(in_c);
}

void compare_runs()
{
    compare_runs(PlainBall{}, PlainBall::State{10, 0}, 20.5, ball_callbacks());
    rc_callbacks rotations{};
    rotations.size = sizeof rotations;
    rotations.dimension = 200;
    rotations.flow = Rotations::in_c;
    Rotations::State x0(200);
    for (std::size_t i = 0; i < x0.size(); ++i) x0[i] = 1.0 / static_cast<double>(1 + i % 7);
    compare_runs(Rotations{}, x0, 20, rotations);
}

}  // namespace
}  // namespace ricochet::monitor_bits_test

int main()
{
    using namespace ricochet::monitor_bits_test;
    using namespace ricochet;
    compare_runs();
    for (const double h : {0.5, 0.1}) {
        CHECK(compare("a ball", Balls<1>{}, {10, 0}, 20.5, h, Verdict::stands) == 13);
        CHECK(compare("two equal balls", Balls<2>{}, {10, 0, 10, 0}, 20.5, h, Verdict::stands) ==
              13);
    }
    CHECK(compare("two balls", Balls<2>{}, {10, 0, 7, 1}, 20.5, 0.1, Verdict::stands) > 26);
    CHECK(compare("a ball that comes to rest", Balls<1>{0.5}, {10, 0}, 20, 0.1, Verdict::rests) >
          5);
    CHECK(compare("one without rest", Restless{}, {10, 0}, 20, 0.1, Verdict::ended) > 5);
    CHECK(compare("rates together", Together{}, {1003, 0}, 4, 0.1, Verdict::ended) > 5);
    CHECK(compare("a clock", Clock{}, {0, 0}, 12.5, 0.3, Verdict::stands) >= 12);
    return 0;
}
