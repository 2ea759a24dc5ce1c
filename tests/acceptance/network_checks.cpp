// Acceptance checks of the network.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detail/assessment.hpp"
#include "ricochet/detect/gates.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/nn/model.hpp"
#include "score.hpp"

namespace ricochet::bench {

namespace {

using learn::Assessment;
using learn::BallModel;
using learn::BallTraining;

std::filesystem::path file_of(BallModel kind)
{
    return std::filesystem::path(RICOCHET_MODELS) / (kind == BallModel::fixed_step
                                                         ? "bouncing-ball-step-0.01.safetensors"
                                                         : "bouncing-ball.safetensors");
}

// --- on states ---

/// A seed that no training, threshold or report uses.
constexpr std::uint64_t fresh_seed = 20'250'101;

std::string figures(std::string_view set, const Assessment& a)
{
    const learn::Confusion& c = a.confusion;
    return fmt::format(
        "{:<10}{:>7} events, {} missed (at most {:.2g} % of such at 95 %); {:>6} clear, {} false "
        "alarms; {:.2f} % of the {} clear by more than {:.0f} % cleared",
        set, c.detected + c.missed, c.missed, 100 * a.miss_bound, c.false_alarms + c.cleared,
        c.false_alarms, 100 * a.cleared_share, a.well_clear, 100 * a.margin);
}

Measured assess_fixed_step()
{
    constexpr BallModel kind = BallModel::fixed_step;
    const Model model = load_model(file_of(kind));
    const BallTraining training = learn::ball_training(kind);
    const std::size_t half = training.states / 2;
    const learn::DataSet all =
        learn::sample_ball(kind, training, half, half, training.seed, false).data;
    const Assessment test = learn::assess(
        model, learn::split(all, training.training.test_share, training.seed).held_out,
        training.margin);
    const Assessment fresh = learn::assess(
        model, learn::sample_ball(kind, training, 40'000, 40'000, fresh_seed, true).data,
        training.margin);
    const learn::Confusion& c = test.confusion;
    return {.pass = c.missed == 0 && c.false_alarms == 0 && c.detected > 0 && c.cleared > 0,
            .text = fmt::format(
                "{} misses and {} false alarms on {} states; fresh: {} misses in "
                "{} events, {:.2f} % of the well clear states cleared",
                c.missed, c.false_alarms, c.detected + c.missed + c.false_alarms + c.cleared,
                fresh.confusion.missed, fresh.confusion.detected + fresh.confusion.missed,
                100 * fresh.cleared_share),
            .details = {figures("test set", test), figures("fresh", fresh)}};
}

/// |a| where slog(a) = s: its inverse, exact as the logarithm is linear in between.
double magnitude_of(double s)
{
    const double exponent = std::floor(std::abs(s));
    return 0.5 * (std::ldexp(1 + std::abs(s) - exponent, static_cast<int>(exponent)) - 1);
}

Measured assess_any_step()
{
    constexpr BallModel kind = BallModel::any_step;
    const Model model = load_model(file_of(kind));
    const BallTraining training = learn::ball_training(kind);
    const learn::DataSet fresh =
        learn::sample_ball(kind, training, 150'000, 150'000, fresh_seed, true).data;

    // The events with u / (g h^2) in ten decades, all there are in each.
    constexpr int lowest = -3;
    constexpr std::size_t decades = 10;
    std::array<std::size_t, decades> counts{};
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < fresh.size(); ++i) {
        if (fresh.labels[i] == 0) continue;
        const double decade = std::floor(std::log10(magnitude_of(fresh.row(i)[0]))) - lowest;
        if (!(decade >= 0 && decade < static_cast<double>(decades))) continue;
        ++counts[static_cast<std::size_t>(decade)];
        rows.push_back(i);
    }
    const Assessment all = learn::assess(model, fresh, training.margin);
    const Assessment ten = learn::assess(model, learn::select(fresh, rows), training.margin);
    const std::size_t events = ten.confusion.detected + ten.confusion.missed;
    std::string each;
    for (const std::size_t n : counts) each += fmt::format(" {}", n);
    return {
        .pass = all.confusion.missed == 0 && events >= 30'000 &&
                *std::min_element(counts.begin(), counts.end()) > 0 && all.cleared_share >= 0.95,
        .text = fmt::format("{} misses in {} events, at most {:.2g} % of such at 95 %; {:.2f} % "
                            "cleared",
                            ten.confusion.missed, events, 100 * ten.miss_bound,
                            100 * all.cleared_share),
        .details = {fmt::format("events per decade of |u| / (g h^2), from 1e{} to 1e{}:{}", lowest,
                                lowest + static_cast<int>(decades), each),
                    figures("fresh, all", all)}};
}

// --- on runs ---

/// Runs, scored together.
struct Runs {
    std::size_t runs = 0;
    std::size_t wrong = 0;    ///< another set of events, or one found late
    std::size_t cleared = 0;  ///< steps whose check the network saved
    std::size_t steps = 0;
    double error = 0;  ///< [s] largest
    std::string at;    ///< where

    template <class Stepping>
    void add(const BallProblem& problem, Options options, const Network& network,
             const std::string& setting)
    {
        options.t_end = problem.t_end;
        const auto run = integrate(problem.system, problem.x0, options, Stepping{}, network);
        std::vector<double> times;
        for (const auto& event : run.events) times.push_back(event.t);
        const Score found = score(times, problem.events);
        ++runs;
        if (run.outcome != Outcome::reached_end || !found.complete() ||
            run.statistics.missed_events != 0) {
            ++wrong;
        }
        cleared += run.statistics.checks_deferred;
        steps += run.statistics.steps;
        if (at.empty() || found.error > error) {
            error = found.error;
            at = fmt::format("{} {}", problem.name, setting);
        }
    }

    [[nodiscard]] std::string text() const
    {
        return fmt::format(
            "{} of {} runs with all impacts in time; largest error {:.1e} s ({}); checks put off "
            "in "
            "{:.1f} % of the steps",
            runs - wrong, runs, error, at,
            100 * static_cast<double>(cleared) / static_cast<double>(steps));
    }
};

Measured run_fixed_step()
{
    Runs runs;
    runs.add<FixedStep<Rk4>>(b1(), {.step = 0.01},
                             Network(load_model(file_of(BallModel::fixed_step))), "rk4 step 0.01");
    return {.pass = runs.wrong == 0 && runs.error <= 2e-14, .text = runs.text()};
}

Measured run_any_step()
{
    const Network network(load_model(file_of(BallModel::any_step)));
    Runs fixed;
    Runs controlled;
    for (const BallProblem& problem : {b1(), b2(), b3()}) {
        for (const double h :
             {1e-4, 3e-4, 1e-3, 3.7e-3, 0.01, 0.037, 0.05, 0.1, 0.3, 0.37, 0.7, 1.0}) {
            fixed.add<FixedStep<Rk4>>(problem, {.step = h}, network, fmt::format("step {:g}", h));
        }
        for (const double rtol : {1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12}) {
            controlled.add<ErrorControlled<Dopri5>>(problem, {.rtol = rtol, .atol = rtol}, network,
                                                    fmt::format("rtol {:g}", rtol));
        }
    }
    return {
        .pass = fixed.wrong == 0 && controlled.wrong == 0,
        .text = fmt::format("{} of {} runs, largest error {:.1e} s",
                            fixed.runs + controlled.runs - fixed.wrong - controlled.wrong,
                            fixed.runs + controlled.runs, std::max(fixed.error, controlled.error)),
        .details = {"rk4, 12 steps from 1e-4 s to 1 s: " + fixed.text(),
                    "dopri5, rtol 1e-3 to 1e-12:       " + controlled.text()}};
}

// --- training ---

std::vector<std::byte> bytes_of(const std::filesystem::path& path)
{
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    const auto* first = reinterpret_cast<const std::byte*>(text.data());
    return {first, first + text.size()};
}

Measured train_any_step()
{
    constexpr BallModel kind = BallModel::any_step;
    const std::clock_t start = std::clock();  // processor time of all threads
    const learn::Trained trained = learn::train_bouncing_ball(kind, learn::ball_training(kind));
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    const bool same = to_safetensors(trained.model) == bytes_of(file_of(kind));
    return {.pass = seconds <= 60 && same && trained.misses_none(),
            .text = fmt::format("{:.1f} s of processor time, sampling and report included; the "
                                "stored file's bytes: {}",
                                seconds, same ? "the same" : "OTHERS"),
            .details = {figures("held out", trained.report.held_out),
                        figures("fresh", *trained.report.fresh)}};
}

}  // namespace

std::vector<Check> network_checks()
{
    return {
        {.topic = "network",
         .id = "inference",
         .sentence = "inference, x86-64-v3, ReLU, 4 inputs, dependent calls, to the reference "
                     "after scaling by the multiply-add peak",
         .target = "every ratio <= 1.3",
         .run = time_inference},
        {.topic = "network",
         .id = "instruction-sets",
         .sentence = "three instruction sets and StaticMlp in one program, byte by byte",
         .target = "0 mismatches",
         .run = compare_instruction_sets},
        {.topic = "network",
         .id = "fixed-step-states",
         .sentence = "the fixed-step model on its test set, made again from its seed",
         .target = "0 misses, 0 false alarms",
         .run = assess_fixed_step},
        {.topic = "network",
         .id = "fixed-step-b1",
         .sentence = "the fixed-step model, bare: B1 at its own step",
         .target = "all 13 impacts, error <= 2e-14 s",
         .run = run_fixed_step},
        {.topic = "network",
         .id = "any-step-states",
         .sentence = "the any-step model on fresh events over ten decades of u / (g h^2)",
         .target = "0 misses in >= 30000, >= 95 % of states with margin > 10 % cleared",
         .run = assess_any_step},
        {.topic = "network",
         .id = "any-step-runs",
         .sentence = "the any-step model, bare: B1, B2, B3 at steps in [1e-4, 1] s and by dopri5",
         .target = "all 13, 6, 4 impacts in every run",
         .run = run_any_step},
        {.topic = "network",
         .id = "training",
         .sentence = "training the any-step model on one core",
         .target = "<= 60 s, and the stored file's bytes",
         .run = train_any_step},
        {.topic = "network",
         .id = "verified",
         .sentence = "the verified gate with any weights against its exact detector, bit for bit",
         .target = "0 differences",
         .run = compare_verified},
        {.topic = "network",
         .id = "overhead",
         .sentence = "detection overhead per detector and shape, with the exact line as rival",
         .target = "printed, at <= 2e-14 s",
         .run = compare_detectors},
    };
}

}  // namespace ricochet::bench
