// Runs that are interrupted: by a lack of memory, by saving and restoring, by their end.
#include <fmt/format.h>

#include <cstdlib>
#include <new>

#include "random_systems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "stress.hpp"

namespace {

/// Allocations until one fails; 0: none fails.
thread_local std::uint64_t left = 0;

void* allocate(std::size_t size)
{
    if (left > 0 && --left == 0) throw std::bad_alloc();
    void* const memory = std::malloc(size > 0 ? size : 1);
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
}

}  // namespace

void* operator new(std::size_t size)
{
    return allocate(size);
}
void operator delete(void* memory) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::size_t /*size*/) noexcept
{
    std::free(memory);
}

namespace ricochet::stress {

namespace {

/// Balls in a state that is sized at run time.
struct Balls {
    using State = std::vector<double>;
    std::size_t balls = 3;

    [[nodiscard]] std::size_t guard_count() const { return balls; }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/)
    {
        return {.unilateral = true, .degree = 1};
    }
    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < balls; ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = -9.81;
        }
    }
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const State& x) const
    {
        return x[2 * which];
    }
    void reset(std::size_t which, double /*t*/, State& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -0.9;
    }
};

const std::vector<double> start{1, 0, 1.5, 0, 2.5, 0};

Options recorded()
{
    return {.t_end = 3, .record_steps = true, .sample_times = {0.5, 1, 1.5, 2, 2.5}};
}

using test::RandomProblem;
using test::RandomProblems;
using test::RandomSystem;

Options options_of(const RandomProblem& problem)
{
    return {.t_start = problem.t_start,
            .t_end = problem.t_end,
            .mode = problem.mode,
            .rtol = 1e-10,
            .atol = 1e-10,
            .max_steps = 100'000};
}

using Random3 = Simulation<RandomSystem, RandomSystem::State>;

}  // namespace

Tally memory(const Size& size)
{
    Tally tally;
    const Balls system;
    const auto clean = integrate(system, start, recorded());
    std::uint64_t n = 1;
    for (bool failed = true; failed; ++n) {
        failed = false;
        Run<Balls::State> run;
        left = n;
        try {
            run = integrate(system, start, recorded());
        } catch (const std::bad_alloc&) {
            failed = true;
        }
        left = 0;
        // The failure has left no trace: the next run is unchanged.
        const bool again = size.long_form || n % 16 == 0;
        if (!failed || again) {
            if (failed) run = integrate(system, start, recorded());
            tally.expect(same(run, clean),
                         [&] { return fmt::format("after a failure at allocation {}", n); });
        } else {
            ++tally.cases;
        }
    }
    tally.said = fmt::format("{} allocations, each failed once", n - 2);
    return tally;
}

Tally saves(const Size& size)
{
    Tally tally;
    RandomProblems problems(size.seed);
    std::uint64_t saved = 0;
    for (std::uint64_t k = 0; k < size.cases(300, 100'000); ++k) {
        const RandomProblem problem = problems();
        const Options options = options_of(problem);
        Random3 whole(problem.system, problem.x0, options);
        while (whole.advance()) {
        }
        // A new simulation for every part, from the text of the last one's snapshot. A part ends at
        // each of the first 500 events; since a text holds all events so far, those of the few runs
        // with ten thousands of them would take days, and further parts grow.
        std::uint64_t parts = 0, length = 1;
        Snapshot snapshot = Random3(problem.system, problem.x0, options).save();
        std::vector<double> times;
        Run<RandomSystem::State> end;
        bool lossless = true;
        for (bool going = true; going;) {
            const std::string text = to_text(snapshot);
            lossless = lossless && to_text(snapshot_from_text(text)) == text;
            Random3 next(problem.system, problem.x0, options);
            next.restore(snapshot_from_text(text));
            const std::size_t before = next.run().events.size();
            if (++parts > 500) length *= 2;
            for (std::uint64_t i = 0; going && i < length; ++i) going = next.advance();
            const auto& events = next.run().events;
            for (std::size_t i = before; i < events.size(); ++i) times.push_back(events[i].t);
            snapshot = next.save();
            ++saved;
            if (!going) end = next.finish();
        }
        const auto clean = whole.finish();
        // The limit of steps is that of one simulation: the parts together go further.
        const bool cut = clean.outcome == Outcome::step_limit;
        bool holds = lossless && (cut ? times.size() >= clean.events.size()
                                      : end.outcome == clean.outcome && same_bits(end.t, clean.t) &&
                                            same_bits(end.x, clean.x) && end.mode == clean.mode &&
                                            times.size() == clean.events.size());
        for (std::size_t i = 0; holds && i < clean.events.size(); ++i) {
            holds = same_bits(times[i], clean.events[i].t);
        }
        tally.expect(holds, [&] {
            return fmt::format("problem {} of seed {}: {} events for {}, {} for {}", k, size.seed,
                               times.size(), clean.events.size(), name(end.outcome),
                               name(clean.outcome));
        });
    }
    tally.said = fmt::format("{} times saved and restored", saved);
    return tally;
}

Tally cancels(const Size& size)
{
    Tally tally;
    RandomProblems problems(size.seed + 1);
    for (std::uint64_t k = 0; k < size.cases(60, 10'000); ++k) {
        const RandomProblem problem = problems();
        const Options options = options_of(problem);
        const auto clean = integrate(problem.system, problem.x0, options);
        for (std::uint64_t steps = 0;; steps = 2 * steps + 1) {
            Random3 simulation(problem.system, problem.x0, options);
            bool going = true;
            for (std::uint64_t i = 0; i < steps && going; ++i) going = simulation.step();
            const auto run = simulation.finish();
            bool holds = going ? run.outcome == Outcome::cancelled : same(run, clean);
            holds = holds && run.events.size() <= clean.events.size() && all_finite(run.x);
            for (std::size_t i = 0; holds && i < run.events.size(); ++i) {
                holds = same_bits(run.events[i].t, clean.events[i].t);
            }
            tally.expect(holds, [&] {
                return fmt::format("problem {} of seed {} after {} steps: {}, {} events", k,
                                   size.seed + 1, steps, name(run.outcome), run.events.size());
            });
            if (!going) break;
        }
    }
    return tally;
}

}  // namespace ricochet::stress
