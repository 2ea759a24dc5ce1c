// NaN and infinity at any call of a system's functions, and bounds that are not valid.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <span>

#include "ricochet/bernstein.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/planned.hpp"
#include "rk4_host.hpp"
#include "stress.hpp"

namespace ricochet::stress {

namespace {

using Two = std::array<double, 2>;

enum Place : std::uint8_t { flow_at, guard_at, rate_at, reset_at, places };
constexpr std::string_view place_names[] = {"flow", "guard", "guard_rate", "reset"};

/// A forced oscillator on a wall, one call of which returns `value` in place of its own value.
struct Poisoned {
    using State = Two;
    static constexpr bool unilateral = true;
    Place place = places;
    std::uint64_t call = 0;
    double value = 0;
    std::array<std::uint64_t, places>* calls = nullptr;

    [[nodiscard]] bool now(Place at) const { return (*calls)[at]++ == call && at == place; }
    void flow(double t, const Two& x, Two& dxdt) const
    {
        dxdt = {x[1], std::cos(0.8 * t) - x[0] - 0.1 * x[1]};
        if (now(flow_at)) dxdt[1] = value;
    }
    [[nodiscard]] double guard(double /*t*/, const Two& x) const
    {
        return now(guard_at) ? value : 1.2 - x[0];
    }
    [[nodiscard]] double guard_rate(double /*t*/, const Two& /*x*/, const Two& dxdt) const
    {
        return now(rate_at) ? value : -dxdt[0];
    }
    void reset(double /*t*/, Two& x) const
    {
        x = {1.2, -0.8 * x[1]};
        if (now(reset_at)) x[1] = value;
    }
};

struct Outcomes {
    std::uint64_t unharmed = 0, named = 0, other = 0;
};

template <class Stepping>
Run<Two> run_of(const Poisoned& system, const Stepping& stepping, const Options& options)
{
    return integrate(system, Two{0, 0}, options, stepping);
}

/// Whether two runs have the same events, to the accuracy of the method.
bool same_events(const Run<Two>& a, const Run<Two>& b)
{
    if (a.events.size() != b.events.size()) return false;
    for (std::size_t i = 0; i < a.events.size(); ++i) {
        if (!(std::fabs(a.events[i].t - b.events[i].t) <= 1e-4)) return false;
    }
    return true;
}

/// Checks the effect of a NaN or an infinity: the run reports it, or is unaffected. A finite
/// number, however strange, may change the motion; then the run is only required to end
/// with numbers.
template <class Stepping>
void poison_all(Tally& tally, Outcomes& outcomes, const Size& size, const Stepping& stepping,
                Options options)
{
    learn::Random random(size.seed);
    std::array<std::uint64_t, places> total{};
    options.max_steps = 20'000;
    const auto clean = run_of({.calls = &total}, stepping, options);
    constexpr double inf = std::numeric_limits<double>::infinity();
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    for (int place = 0; place < places; ++place) {
        const std::uint64_t few = size.cases(120, total[static_cast<std::size_t>(place)]);
        for (std::uint64_t k = 0; k < few; ++k) {
            const auto calls = total[static_cast<std::size_t>(place)];
            if (calls == 0) break;
            const std::uint64_t call = size.long_form ? k : random.below(calls);
            for (const double value : {nan, inf, -inf, 5e-324, -5e-324, 1e300}) {
                std::array<std::uint64_t, places> counted{};
                const Poisoned system{.place = static_cast<Place>(place),
                                      .call = call,
                                      .value = value,
                                      .calls = &counted};
                std::string refused;
                Run<Two> run;
                try {
                    run = run_of(system, stepping, options);
                } catch (const std::invalid_argument& error) {
                    refused = error.what();  // at the start
                }
                bool holds = true;
                if (!refused.empty() || run.outcome == Outcome::non_finite) {
                    ++outcomes.named;
                } else if (std::isfinite(value)) {
                    ++outcomes.other;
                    holds = all_finite(run.x);
                } else {
                    holds = run.outcome == Outcome::reached_end && same_events(run, clean);
                    ++outcomes.unharmed;
                }
                tally.expect(holds, [&] {
                    return fmt::format("{} at call {} of {}: {}, {} events for {}, state {}, {}",
                                       value, call, place_names[place], name(run.outcome),
                                       run.events.size(), clean.events.size(), run.x[0], run.x[1]);
                });
            }
        }
    }
}

/// A ball above a floor that declares how fast its guard can change, wrong by a factor.
struct Liar {
    using State = Two;
    static constexpr bool unilateral = true;
    double truth = 1;  ///< the fraction of the true bound that is declared

    void flow(double /*t*/, const Two& x, Two& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double /*t*/, const Two& x) const { return x[0]; }
    void reset(double /*t*/, Two& x) const { x = {0, -0.9 * x[1]}; }
    [[nodiscard]] double speed_bound(double /*t*/, const Two& /*x*/) const { return truth * 15; }
};

// --- rates of guards ---

/// A number in the place of one of the rates that a guard returns.
struct BadRate {
    std::uint64_t call = ~std::uint64_t{0};
    double value = 0;
    std::uint64_t* calls = nullptr;

    [[nodiscard]] double operator()(double rate) const { return (*calls)++ == call ? value : rate; }
};

struct RatedBall : Liar {
    BadRate bad;
    [[nodiscard]] double guard_rate(double /*t*/, const Two& /*x*/, const Two& dxdt) const
    {
        return bad(dxdt[0]);
    }
};

/// A forced oscillator between two walls, whose rates come all together.
struct RatedOscillator {
    using State = Two;
    static constexpr std::size_t guard_count = 2;
    BadRate bad;
    void flow(double t, const Two& x, Two& dxdt) const
    {
        dxdt = {x[1], std::cos(0.8 * t) - x[0] - 0.1 * x[1]};
    }
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const Two& x) const
    {
        return which == 0 ? 0.8 - x[0] : 0.9 + x[0];
    }
    void guard_rates(double /*t*/, const Two& /*x*/, const Two& dxdt, std::span<double> r) const
    {
        r[0] = bad(-dxdt[0]);
        r[1] = bad(dxdt[0]);
    }
    void reset(std::size_t which, double /*t*/, Two& x) const
    {
        x = {which == 0 ? 0.8 : -0.9, -0.8 * x[1]};
    }
    [[nodiscard]] double speed_bound(std::size_t /*which*/, double /*t*/, const Two& /*x*/) const
    {
        return 10;
    }
};

/// A mass on a spring and a moving belt, which sticks and slips.
struct RatedBelt {
    using State = Two;
    enum : Mode { slips, sticks };
    static constexpr std::size_t mode_count = 2;
    static constexpr double belt = 0.5;
    BadRate bad;
    void flow(Mode mode, double /*t*/, const Two& x, Two& dxdt) const
    {
        dxdt = {mode == slips ? x[1] : belt, mode == slips ? 0.6 - x[0] : 0};
    }
    [[nodiscard]] double guard(Mode mode, double /*t*/, const Two& x) const
    {
        return mode == slips ? belt - x[1] : 1 - x[0];
    }
    [[nodiscard]] double guard_rate(Mode mode, double /*t*/, const Two& /*x*/,
                                    const Two& dxdt) const
    {
        return bad(mode == slips ? -dxdt[1] : -dxdt[0]);
    }
    [[nodiscard]] Mode reset(Mode mode, double /*t*/, Two& x) const
    {
        x[1] = belt;
        return mode == slips ? sticks : slips;
    }
    [[nodiscard]] double speed_bound(Mode /*mode*/, double /*t*/, const Two& /*x*/) const
    {
        return 2;
    }
};

/// A host's step, one of whose rates has such a number in a component.
template <class Step>
struct BadStep {
    const Step& of;
    Two r0, r1;
    [[nodiscard]] const Instant& t0() const { return of.t0(); }
    [[nodiscard]] double h() const { return of.h(); }
    [[nodiscard]] std::span<const double> x0() const { return of.x0(); }
    [[nodiscard]] std::span<const double> x1() const { return of.x1(); }
    [[nodiscard]] std::span<const double> rate0() const { return r0; }
    [[nodiscard]] std::span<const double> rate1() const { return r1; }
    void interpolate(double s, std::span<double> x) const { of.interpolate(s, x); }
    void interpolate_rate(double s, std::span<double> dxdt) const
    {
        HermiteStep(t0(), h(), x0(), x1(), r0, r1).interpolate_rate(s, dxdt);
    }
    void restep(double s, std::span<double> x) const { of.restep(s, x); }
};

struct BadRates {
    std::size_t component = 0;
    BadRate bad;
    [[nodiscard]] Two rate(Two dxdt) const
    {
        dxdt[component] = bad(dxdt[component]);
        return dxdt;
    }
    template <class Step>
    [[nodiscard]] BadStep<Step> step(const Step& taken) const
    {
        return {taken, rate({taken.rate0()[0], taken.rate0()[1]}),
                rate({taken.rate1()[0], taken.rate1()[1]})};
    }
};

/// Events as reported by a run, of the library or of a host.
struct Told {
    Outcome outcome = Outcome::reached_end;
    std::size_t guard = no_guard;
    std::vector<Event<Two>> events;
};

[[nodiscard]] bool same_events(const Told& a, const Told& b)
{
    if (a.outcome != b.outcome || a.events.size() != b.events.size()) return false;
    for (std::size_t i = 0; i < a.events.size(); ++i) {
        const auto& p = a.events[i];
        const auto& q = b.events[i];
        if (p.guard != q.guard || p.kind != q.kind || p.mode_after != q.mode_after) return false;
        if (!(std::fabs(p.t - q.t) <= 1e-6)) return false;
    }
    return true;
}

/// An invalid rate leaves the events unchanged, or the run names its guard.
void spoil_rates(Tally& tally, std::uint64_t& named, const Size& size, std::string_view what,
                 const auto& run_with)
{
    std::uint64_t calls = 0;
    const Told clean = run_with(BadRate{.calls = &calls});
    tally.expect(clean.events.size() >= 3 && calls > 0,
                 [&] { return fmt::format("{}: {} events", what, clean.events.size()); });
    const std::uint64_t stride = std::max<std::uint64_t>(1, calls / size.cases(400, calls));
    constexpr double inf = std::numeric_limits<double>::infinity();
    for (std::uint64_t call = 0; call < calls; call += stride) {
        for (const double value : {inf, -inf, std::numeric_limits<double>::quiet_NaN()}) {
            std::uint64_t counted = 0;
            const Told told = run_with(BadRate{.call = call, .value = value, .calls = &counted});
            const bool says = told.outcome == Outcome::non_finite && told.guard != no_guard;
            named += says;
            tally.expect(says || same_events(told, clean), [&] {
                return fmt::format("{}, {} as rate {} of {}: {}, {} events for {}", what, value,
                                   call, calls, name(told.outcome), told.events.size(),
                                   clean.events.size());
            });
        }
    }
}

template <class System, class Detector, class Stepping>
[[nodiscard]] Told rated_run(const System& system, const Two& x0, const Detector& detector,
                             const Stepping& stepping)
{
    const Options options{.t_end = 8, .step = 0.02, .rtol = 1e-9, .atol = 1e-9};
    const auto run = integrate(system, x0, options, stepping, detector);
    return {run.outcome, run.guard, run.events};
}

template <class System, class Detector, class Shown = test::AsItIs>
[[nodiscard]] Told hosted_run(const System& system, const Two& x0, const Detector& detector,
                              const Shown& shown = {})
{
    EventMonitor<System, Two, Detector> monitor(system, Two{}, {}, detector);
    const auto run = test::drive(system, monitor, x0, 8, 0.02, 0, shown);
    return {run.outcome, monitor.guard(), run.events};
}

template <class System, class Detector>
void spoil_detector(Tally& tally, std::uint64_t& named, const Size& size, std::string_view what,
                    const Two& x0, const Detector& detector)
{
    const auto with = [](const BadRate& bad) {
        System system;
        system.bad = bad;
        return system;
    };
    spoil_rates(tally, named, size, fmt::format("{}, fixed steps", what), [&](const BadRate& bad) {
        return rated_run(with(bad), x0, detector, FixedStep<Rk4>{});
    });
    spoil_rates(tally, named, size, fmt::format("{}, controlled steps", what),
                [&](const BadRate& bad) {
                    return rated_run(with(bad), x0, detector, ErrorControlled<Dopri5>{});
                });
    spoil_rates(tally, named, size, fmt::format("{}, a host's steps", what),
                [&](const BadRate& bad) { return hosted_run(with(bad), x0, detector); });
    for (const std::size_t component : {0, 1}) {
        spoil_rates(tally, named, size, fmt::format("{}, a host's rate {}", what, component),
                    [&](const BadRate& bad) {
                        std::uint64_t unused = 0;
                        const System system = with({.calls = &unused});
                        return hosted_run(system, x0, detector, BadRates{component, bad});
                    });
    }
}

template <class System>
void spoil_system(Tally& tally, std::uint64_t& named, const Size& size, std::string_view what,
                  const Two& x0)
{
    const auto with = [&](std::string_view detector) {
        return fmt::format("{}, {}", what, detector);
    };
    spoil_detector<System>(tally, named, size, with("Extremum"), x0, Extremum{});
    spoil_detector<System>(tally, named, size, with("Bernstein"), x0, Bernstein{});
    spoil_detector<System>(tally, named, size, with("Planned"), x0, Planned<Extremum>{});
}

}  // namespace

Tally rates(const Size& size)
{
    Tally tally;
    std::uint64_t named = 0;
    spoil_system<RatedBall>(tally, named, size, "ball", Two{10, 0});
    spoil_system<RatedOscillator>(tally, named, size, "oscillator", Two{0, 3});
    spoil_system<RatedBelt>(tally, named, size, "belt", Two{0, 0});
    tally.said = fmt::format("{} named", named);
    return tally;
}

Tally poison(const Size& size)
{
    Tally tally;
    Outcomes outcomes;
    poison_all(tally, outcomes, size, ErrorControlled<Dopri5>{},
               {.t_end = 60, .rtol = 1e-8, .atol = 1e-8});
    poison_all(tally, outcomes, size, ErrorControlled<Fehlberg78>{},
               {.t_end = 60, .rtol = 1e-10, .atol = 1e-10});
    poison_all(tally, outcomes, size, FixedStep<Rk4>{}, {.t_end = 60, .step = 0.02});
    tally.said = fmt::format("{} named, {} as if it had not been, {} other motions", outcomes.named,
                             outcomes.unharmed, outcomes.other);
    return tally;
}

Tally bounds(const Size& size)
{
    // An invalid bound may lose events, as docs/limits.md states, but never adds any: every event
    // before the end of the run, or before the guard is reported, is a true one. A valid bound
    // loses no event.
    Tally tally;
    learn::Random random(size.seed);
    std::uint64_t found_out = 0;
    std::uint64_t lost = 0;
    const Options options{.t_end = 20.5, .step = 1e-3};
    const auto exact = integrate(Liar{}, Two{10, 0}, options, FixedStep<Rk4>{});
    for (std::uint64_t k = 0; k < size.cases(60, 5000); ++k) {
        const Liar liar{.truth = k % 3 == 0 ? 1 : std::pow(10.0, random.uniform(-6, 0))};
        const auto run =
            integrate(liar, Two{10, 0}, options, FixedStep<Rk4>{}, Planned<Extremum>{});
        bool holds = run.outcome == Outcome::reached_end || run.outcome == Outcome::wrong_bound ||
                     run.outcome == Outcome::zeno || run.outcome == Outcome::outside_mode;
        if (liar.truth == 1) {
            holds = same(run, exact);
        } else {
            found_out += run.outcome == Outcome::wrong_bound;
            lost += run.outcome == Outcome::reached_end && run.events.size() < exact.events.size();
        }
        tally.expect(holds && all_finite(run.x), [&] {
            return fmt::format("speed bound {} of the true one: {}, {} events for {}", liar.truth,
                               name(run.outcome), run.events.size(), exact.events.size());
        });
    }
    tally.said = fmt::format("{} lies found out, {} not", found_out, lost);
    return tally;
}

}  // namespace ricochet::stress
