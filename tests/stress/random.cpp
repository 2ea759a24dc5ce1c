// Random systems of kinds whose events are known in closed form; those with polynomials, inclusions
// and mechanisms are in property_tests, random_inclusions_test and random_mechanisms_test.
#include <fmt/format.h>

#include <algorithm>

#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "stress.hpp"

namespace ricochet::stress {

namespace {

/// Balls with different restitutions above different floors.
struct Crowd {
    using State = std::vector<double>;
    std::vector<BouncingBall> balls;

    [[nodiscard]] std::size_t guard_count() const { return balls.size(); }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/)
    {
        return {.unilateral = true, .degree = 1};
    }
    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < balls.size(); ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = -balls[i].gravity();
        }
    }
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const State& x) const
    {
        return x[2 * which];
    }
    void reset(std::size_t which, double /*t*/, State& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -balls[which].restitution();
    }
};

}  // namespace

Tally oscillators(const Size& size)
{
    Tally tally;
    learn::Random random(size.seed);
    std::uint64_t impacts = 0;
    std::uint64_t ill = 0;
    for (std::uint64_t k = 0; k < size.cases(150, 50'000); ++k) {
        ImpactOscillator::Parameters p{.frequency = random.uniform(0.2, 3),
                                       .wall = random.uniform(0.05, 2),
                                       .restitution = random.uniform(0.1, 1),
                                       .damping = random.uniform(0.02, 0.5)};
        const ImpactOscillator system(p);
        const double t_end = 20 * system.period();
        const std::vector<double> exact = system.impacts(t_end);
        p.wall *= 1 + 1e-9;
        const std::vector<double> moved = ImpactOscillator(p).impacts(t_end);
        // The effect of a disturbance of 1e-9; that of the steps is a hundredth of it. If it
        // changes the number of impacts, or flights end in a rest, the answer is not unique.
        double doubt = 0;
        for (std::size_t i = 0; i < std::min(exact.size(), moved.size()); ++i) {
            doubt = std::max(doubt, std::fabs(exact[i] - moved[i]));
        }
        bool close = exact.size() != moved.size();
        for (std::size_t i = 1; i < exact.size(); ++i) close |= exact[i] - exact[i - 1] < 1e-3;
        if (close || doubt > 1e-6 || (!exact.empty() && t_end - exact.back() < 1e-3)) {
            ++ill;
            continue;
        }
        const auto run = integrate(system, ImpactOscillator::start,
                                   {.t_end = t_end, .rtol = 1e-12, .atol = 1e-12},
                                   ErrorControlled<Fehlberg78>{});
        double error = 0;
        for (std::size_t i = 0; i < std::min(exact.size(), run.events.size()); ++i) {
            error = std::max(error, std::fabs(run.events[i].t - exact[i]));
        }
        impacts += exact.size();
        tally.expect(run.outcome == Outcome::reached_end && run.events.size() == exact.size() &&
                         error <= 1e-10 + doubt,
                     [&] {
                         return fmt::format(
                             "oscillator {} of seed {}: {} impacts for {}, error "
                             "{:.1e} where {:.1e} is in doubt",
                             k, size.seed, run.events.size(), exact.size(), error, doubt);
                     });
    }
    tally.said = fmt::format("{} impacts; {} left out, whose answer hangs by 1e-9", impacts, ill);
    return tally;
}

Tally crowds(const Size& size)
{
    Tally tally;
    learn::Random random(size.seed);
    std::uint64_t impacts = 0;
    for (std::uint64_t k = 0; k < size.cases(60, 20'000); ++k) {
        const std::size_t n = 1 + random.below(12);
        Crowd crowd;
        std::vector<double> x0;
        for (std::size_t i = 0; i < n; ++i) {
            crowd.balls.emplace_back(BouncingBall::Parameters{
                .gravity = random.uniform(1, 20), .restitution = random.uniform(0.5, 1)});
            x0.push_back(random.uniform(0.5, 10));
            x0.push_back(random.uniform(-3, 3));
        }
        // Before half of the first accumulation, if there is one.
        double t_end = 10;
        for (std::size_t i = 0; i < n; ++i) {
            t_end = std::min(t_end, crowd.balls[i].impact_time(8, x0[2 * i], x0[2 * i + 1]));
        }
        const auto run = integrate(crowd, x0, {.t_end = t_end, .rtol = 1e-10, .atol = 1e-10});
        std::vector<int> seen(n, 0);
        double error = 0;
        for (const auto& event : run.events) {
            const std::size_t i = event.guard;
            const double exact = crowd.balls[i].impact_time(seen[i]++, x0[2 * i], x0[2 * i + 1]);
            error = std::max(error, std::fabs(event.t - exact));
        }
        bool complete = true;
        for (std::size_t i = 0; i < n; ++i) {
            const double next = crowd.balls[i].impact_time(seen[i], x0[2 * i], x0[2 * i + 1]);
            complete = complete && next > t_end - 1e-9;
            impacts += static_cast<std::uint64_t>(seen[i]);
        }
        tally.expect(run.outcome == Outcome::reached_end && complete && error <= 1e-9, [&] {
            return fmt::format("crowd {} of seed {}: {} balls, {}, {}, error {:.1e}", k, size.seed,
                               n, name(run.outcome), complete ? "complete" : "an impact is missing",
                               error);
        });
    }
    tally.said = fmt::format("{} impacts", impacts);
    return tally;
}

}  // namespace ricochet::stress
