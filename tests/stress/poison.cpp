// Numbers that are none, at any call of a system's functions, and bounds that are none.
#include <fmt/format.h>

#include <limits>

#include "ricochet/detect/planned.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "stress.hpp"

namespace ricochet::stress {

namespace {

using Two = std::array<double, 2>;

enum Place : std::uint8_t { flow_at, guard_at, rate_at, reset_at, places };
constexpr std::string_view place_names[] = {"flow", "guard", "guard_rate", "reset"};

/// A forced oscillator on a wall, one call of which returns `value` in the place of its own.
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

/// What a NaN or an infinity did: the run says so, or it is as if it had not been. A number that is
/// finite, however strange, may change the motion, and then no more is asked than that the run ends
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
                // A rate is believed, an infinite one as well: the guard sqrt(x) has them.
                if (!refused.empty() || run.outcome == Outcome::non_finite) {
                    ++outcomes.named;
                } else if (std::isfinite(value) || (place == rate_at && std::isinf(value))) {
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

/// A ball above a floor that declares how fast its guard can change, and lies by a factor.
struct Liar {
    using State = Two;
    static constexpr bool unilateral = true;
    double truth = 1;  ///< the fraction of the true bound that is declared

    void flow(double /*t*/, const Two& x, Two& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double /*t*/, const Two& x) const { return x[0]; }
    void reset(double /*t*/, Two& x) const { x = {0, -0.9 * x[1]}; }
    [[nodiscard]] double speed_bound(double /*t*/, const Two& /*x*/) const { return truth * 15; }
};

}  // namespace

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
    // A bound that is no bound may cost events, which docs/limits.md says. It never invents any:
    // up to where the run ends or is named, every event that there is, is a true one; and a bound
    // that holds costs none.
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
