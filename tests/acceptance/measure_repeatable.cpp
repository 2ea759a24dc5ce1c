// The same bits again: after saving and restoring, and with guards in another order; and
// random systems against their closed forms.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "clustered_systems.hpp"
#include "measure.hpp"
#include "problems.hpp"
#include "problems/detest_f1.hpp"
#include "property_check.hpp"
#include "ricochet/detail/random.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet::bench {

namespace {

/// All data of an event, to be compared bit by bit.
template <class X>
auto row(const Event<X>& event)
{
    return std::make_tuple(event.t, event.guard, static_cast<int>(event.kind), event.mode_before,
                           event.mode_after, event.before, event.after, event.bracket.lo,
                           event.bracket.hi);
}

// --- saving ---

/// A run that is saved after so many of its steps, restored elsewhere and continued with.
struct Interruptible {
    std::string name;
    std::uint64_t steps = 0;
    std::function<bool(std::uint64_t after)> same_bits;
};

template <class Stepping, class System, class X>
Interruptible interruptible(std::string name, const System& system, const X& x0,
                            const Options& options)
{
    using Run = Simulation<System, X, Stepping>;
    std::uint64_t steps = 0;
    {
        Run whole(system, x0, options);
        while (whole.step()) ++steps;
    }
    const auto same_bits = [=](std::uint64_t after) {
        Run whole(system, x0, options);
        for (std::uint64_t i = 0; i < after; ++i) whole.step();
        const std::size_t seen = whole.run().events.size();
        const std::string saved = to_text(whole.save());
        Run other(system, x0, options);
        other.restore(snapshot_from_text(saved));
        const auto a = whole.take();
        const auto b = other.take();
        if (a.outcome != b.outcome || a.t != b.t || a.x != b.x || a.mode != b.mode) return false;
        if (a.events.size() - seen != b.events.size()) return false;
        for (std::size_t i = 0; i < b.events.size(); ++i) {
            if (row(a.events[seen + i]) != row(b.events[i])) return false;
        }
        return true;
    };
    return {.name = std::move(name), .steps = steps, .same_bits = same_bits};
}

std::vector<Interruptible> interruptible_runs()
{
    using Dopri = ErrorControlled<Dopri5>;
    using Fehlberg = ErrorControlled<Fehlberg78>;
    const test::Balls balls{.balls = 3};
    auto heights = balls.drop(1);
    heights[2] = 1.5;  // the other two are equal
    return {
        interruptible<Dopri>("thermostat", Thermostat(), Thermostat::start, {.t_end = 100}),
        interruptible<FixedStep<Rk4>>("ball, to its rest", BouncingBall(),
                                      BouncingBall::State{10, 0}, {.t_end = 40, .step = 0.037}),
        interruptible<Dopri>("three balls", balls, heights, {.t_end = 5}),
        interruptible<Fehlberg>("impact oscillator", ImpactOscillator(), ImpactOscillator::start,
                                {.t_end = 200, .rtol = 1e-10, .atol = 1e-10}),
        interruptible<Dopri>("coulomb oscillator", CoulombOscillator(), CoulombOscillator::start,
                             {.t_end = 20, .mode = CoulombOscillator::start_mode}),
        interruptible<Dopri>("stick-slip", StickSlip(), StickSlip::start,
                             {.t_end = 50, .mode = StickSlip::start_mode}),
        interruptible<Dopri>("synchronous", test::Synchronous{.acts = true},
                             test::Synchronous::start, {.t_end = 6.28, .event_window = 1e-9}),
        interruptible<Dopri>("detest f1, time events", DetestF1(), DetestF1::start, {.t_end = 20}),
    };
}

// --- order ---

/// A thermostat with its guards in the other order.
class SwappedThermostat {
public:
    using State = Thermostat::State;
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t which)
    {
        return Thermostat::guard_info(1 - which);
    }
    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode)
    {
        return Thermostat::enabled(1 - which, mode);
    }
    template <class X>
    void flow(Mode mode, double t, const X& x, X& dxdt) const
    {
        thermostat_.flow(mode, t, x, dxdt);
    }
    template <class X>
    [[nodiscard]] ScalarOf<X> guard(std::size_t which, const ScalarOf<X>& t, const X& x) const
    {
        return thermostat_.guard(1 - which, t, x);
    }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, X& x) const
    {
        return thermostat_.reset(1 - which, mode, t, x);
    }

private:
    Thermostat thermostat_;
};

/// Balls whose floors are watched in a different order from that of their positions.
struct ReorderedBalls : test::Balls {
    std::vector<std::size_t> order;

    template <class X>
    [[nodiscard]] double guard(std::size_t which, double t, const X& x) const
    {
        return Balls::guard(order[which], t, x);
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double t, const X& x, const D& dxdt) const
    {
        return Balls::guard_rate(order[which], t, x, dxdt);
    }
    template <class X>
    void reset(std::size_t which, double t, X& x) const
    {
        Balls::reset(order[which], t, x);
    }
};

/// A run in comparable form, with guard i called `names[i]`.
template <class X>
auto renamed(const Run<X>& run, const std::vector<std::size_t>& names)
{
    std::vector<decltype(row(run.events[0]))> rows;
    for (Event<X> event : run.events) {
        if (event.guard != no_guard) event.guard = names[event.guard];
        rows.push_back(row(event));
    }
    std::sort(rows.begin(), rows.end());
    return std::make_tuple(run.outcome, run.t, run.x, run.mode, std::move(rows));
}

const std::vector<std::size_t> pair{0, 1};
const std::vector<std::size_t> swapped_pair{1, 0};

bool thermostat_in_any_order()
{
    const Options options{.t_end = 100};
    return renamed(integrate(Thermostat(), Thermostat::start, options), pair) ==
           renamed(integrate(SwappedThermostat(), Thermostat::start, options), swapped_pair);
}

bool synchronous_in_any_order(bool acts)
{
    const Options options{.t_end = 6.28, .rtol = 1e-12, .atol = 1e-12, .event_window = 1e-10};
    const auto start = test::Synchronous::start;
    return renamed(integrate(test::Synchronous{.acts = acts}, start, options), pair) ==
           renamed(integrate(test::Synchronous{.swapped = true, .acts = acts}, start, options),
                   swapped_pair);
}

/// Balls from few heights, so that many of them bounce together.
std::size_t differing_orders_of_balls(int orders)
{
    learn::Random random(7);
    ReorderedBalls balls{{.balls = 24}, {}};
    auto x0 = balls.drop(1);
    for (std::size_t i = 0; i < balls.balls; ++i) {
        x0[2 * i] = 1 + 0.25 * static_cast<double>(random.below(6));
    }
    std::vector<std::size_t> names(balls.balls);
    for (std::size_t i = 0; i < names.size(); ++i) names[i] = i;
    balls.order = names;
    const Options options{.t_end = 4};
    const auto reference = renamed(integrate(balls, x0, options), names);
    std::size_t differing = 0;
    for (int k = 0; k < orders; ++k) {
        balls.order = learn::permutation(balls.balls, random);
        differing += renamed(integrate(balls, x0, options), balls.order) != reference;
    }
    return differing;
}

}  // namespace

Measured restore_anywhere()
{
    constexpr int points = 100;
    learn::Random random(20'260'102);
    const std::vector<Interruptible> runs = interruptible_runs();
    std::vector<int> taken(runs.size(), 0);
    std::vector<int> same(runs.size(), 0);
    for (int k = 0; k < points; ++k) {
        const std::size_t i = static_cast<std::size_t>(k) % runs.size();
        ++taken[i];
        same[i] += runs[i].same_bits(random.below(runs[i].steps + 1));
    }
    int right = 0;
    std::vector<std::string> details;
    for (std::size_t i = 0; i < runs.size(); ++i) {
        right += same[i];
        details.push_back(fmt::format("{:<24}{:>3} of {:>2} points among {} steps", runs[i].name,
                                      same[i], taken[i], runs[i].steps));
    }
    return {.pass = right == points,
            .text = fmt::format("{} of {} points, saved as text, go on with the same bits", right,
                                points),
            .details = std::move(details)};
}

Measured reorder_guards()
{
    constexpr int orders = 50;
    const bool thermostat = thermostat_in_any_order();
    const bool synchronous = synchronous_in_any_order(false) && synchronous_in_any_order(true);
    const std::size_t balls = differing_orders_of_balls(orders);
    const auto said = [](bool same) { return same ? "the same" : "OTHERS"; };
    return {.pass = thermostat && synchronous && balls == 0,
            .text = fmt::format("thermostat {}, synchronous {}, 24 balls from six heights {} of {} "
                                "orders the same",
                                said(thermostat), said(synchronous),
                                static_cast<std::size_t>(orders) - balls, orders)};
}

Measured check_random_systems()
{
    const test::PropertyReport report = test::check_random_systems(2, 100'000);
    return {
        .pass = report.wrong() == 0,
        .text = fmt::format("{} unfinished, {} with missed, {} with spurious, {} with misplaced "
                            "events, {} astray, {} that depend on the order of guards",
                            report.unfinished, report.missed, report.spurious, report.misplaced,
                            report.astray, report.order_dependent),
        .details = {
            fmt::format("{} systems, {} events in {} instants, {} of several guards, {} cascades; "
                        "{} more systems were thrown away because their answer hangs by a thread",
                        report.problems, report.events, report.sets, report.together,
                        report.cascades, report.irregular),
            fmt::format("largest error of a time {:.1e} of max(1, |t|); forward and backward, "
                        "dopri5, fehlberg78, rk4, extremum and bernstein, every one twice",
                        report.error)}};
}

}  // namespace ricochet::bench
