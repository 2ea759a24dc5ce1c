// Acceptance checks of the hand-over where several relays, contacts and diodes meet: random
// inclusions against backward Euler, at three step lengths.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "inclusions_of_six.hpp"
#include "measure.hpp"
#include "random_inclusions.hpp"
#include "random_mechanisms.hpp"

namespace ricochet::bench {

namespace {

using namespace test;

constexpr int samples = 10;
constexpr double divisions[] = {200, 1000, 5000};  // of the run, for the step

struct Tally {
    int systems = 0, unclear = 0, runs = 0, set_valued = 0;
    int right = 0, of_the_step = 0, wrong = 0, reported = 0, broken_law = 0;
    double longest = 0;  // [s]
    std::string first;

    void add(const Tally& other)
    {
        systems += other.systems, unclear += other.unclear, runs += other.runs;
        set_valued += other.set_valued, right += other.right, of_the_step += other.of_the_step;
        wrong += other.wrong, reported += other.reported, broken_law += other.broken_law;
        longest = std::max(longest, other.longest);
    }
};

template <int M>
void run_one(const RandomInclusion<M>& system, const ReferenceMotion& reference, double division,
             std::uint64_t seed, Tally& tally)
{
    using Clock = std::chrono::steady_clock;
    HandOverOptions options{.t_end = system.t_end, .max_steps = 1'000'000};
    options.sample_times = equal_times(system.t_end, samples);
    options.set_valued.step = system.t_end / division;
    ++tally.runs;
    const Clock::time_point start = Clock::now();
    std::string ended;
    double off = 0;
    try {
        const auto run = hand_over(system, system.start, options);
        if (run.outcome != Outcome::reached_end) ended = name(run.outcome);
        for (std::size_t i = 0; i < run.trajectory.x.size(); ++i) {
            off = std::max(off, reference.error(i, run.trajectory.x[i]));
        }
        tally.set_valued += run.statistics.to_set_valued > 0;
        const InclusionMatrices<RandomInclusion<M>> matrices(system);
        tally.broken_law +=
            ended.empty() && law_violation(matrices, run.state.t, run.state.w, run.state.reaction,
                                           options.set_valued.step) > 1e-6;
    } catch (const std::invalid_argument& refused) {
        ended = refused.what();
    }
    tally.longest =
        std::max(tally.longest, std::chrono::duration<double>(Clock::now() - start).count());
    const bool wrong = ended.empty() && !(off <= reference.allowed(options.set_valued.step));
    if (!ended.empty()) {
        ++tally.reported;
    } else if (wrong) {
        ++tally.wrong;
    } else if (off <= 1e-3 * reference.size + 3 * reference.uncertainty) {
        ++tally.right;
    } else {
        ++tally.of_the_step;
    }
    if ((wrong || !ended.empty()) && tally.first.size() < 200) {
        tally.first +=
            fmt::format(" seed {} T/{}: {};", seed, division,
                        ended.empty() ? fmt::format("{:.1e}", off / reference.size) : ended);
    }
}

template <int M>
[[nodiscard]] Tally run_family(InclusionFamily family, std::uint64_t seeds)
{
    Tally tally;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        const auto system = random_inclusion<M>(family, seed);
        // For small or accumulating motions backward Euler needs more steps.
        const ReferenceMotion reference(system, system.reactions > 2 ? 10'000 : 50'000, samples);
        ++tally.systems;
        // The motion is not known where backward Euler has not converged.
        if (!reference.solved || reference.uncertainty > 1e-2 * reference.size) {
            ++tally.unclear;
            continue;
        }
        for (const double division : divisions) {
            run_one(system, reference, division, seed, tally);
        }
    }
    return tally;
}

Measured meet()
{
    constexpr std::uint64_t seeds = 1000;
    Tally all;
    Measured out;
    for (std::size_t i = 0; i < family_names.size(); ++i) {
        const auto family = static_cast<InclusionFamily>(i);
        const Tally tally = family == InclusionFamily::five_contacts ? run_family<5>(family, seeds)
                                                                     : run_family<4>(family, seeds);
        all.add(tally);
        out.details.push_back(fmt::format(
            "{}: {} runs, {} with set-valued steps; {} right, {} within the order of "
            "the step, {} wrong, {} reported; at most {:.2f} s; {} unclear{}",
            family_names[i], tally.runs, tally.set_valued, tally.right, tally.of_the_step,
            tally.wrong, tally.reported, tally.longest, tally.unclear, tally.first));
    }
    out.pass =
        all.wrong == 0 && all.broken_law == 0 && all.reported * 1000 < all.runs && all.longest < 10;
    out.text = fmt::format(
        "{} runs: {} right, {} within the order of the step, {} wrong, {} "
        "reported, {} break the law; at most {:.2f} s",
        all.runs, all.right, all.of_the_step, all.wrong, all.reported, all.broken_law, all.longest);
    return out;
}

/// Blocks and woodpeckers by time stepping, each step checked; balls by hand-over.
Measured follow_mechanisms()
{
    constexpr std::uint64_t seeds = 1000;
    test::MechanismTally tally;
    std::uint64_t balls_wrong = 0;
    std::string first;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        test::MechanismMaker(seed).block(tally);
        test::MechanismMaker(seed).woodpecker(tally);
        const std::string fault = test::follow_ball(seed, 50'000, tally.reported);
        balls_wrong += !fault.empty();
        if (first.empty()) first = fault;
    }
    Measured out{.pass = tally.fault.empty() && balls_wrong == 0 && tally.reported <= 5,
                 .text = fmt::format("{} steps of {} runs, {} impacts, energy off by {:.1e} of its "
                                     "terms; {} of {} balls wrong; {} reported",
                                     tally.steps, tally.runs, tally.impacts, tally.largest,
                                     balls_wrong, 3 * seeds, tally.reported)};
    for (const std::string& fault : {tally.fault, first}) {
        if (!fault.empty()) out.details.push_back(fault);
    }
    return out;
}

}  // namespace

std::vector<Check> inclusion_checks()
{
    return {
        {.topic = "nonsmooth",
         .id = "hand-over-families",
         .sentence = "14 families of 1000 random inclusions, T/200, T/1000, T/5000",
         .target = "0 wrong beyond the order of the step (was 68 of 496), 0 hang, < 1 in 1000 "
                   "reported, 0 break the law",
         .run = meet},
        {.topic = "nonsmooth",
         .id = "mechanisms",
         .sentence = "1000 tipping blocks, woodpeckers and balls on moving plates: the contact "
                     "laws and the balance of energy in every step, balls against backward Euler",
         .target = "0 break the law, energy to 1e-11 of its terms, 0 wrong, < 1 in 1000 reported",
         .run = follow_mechanisms},
    };
}

}  // namespace ricochet::bench
