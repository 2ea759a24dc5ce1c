// An expensive guard without geometry: savings by bounds of its value beside bounds of its rate.
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>

#include "measure.hpp"
#include "problems/least_eigenvalue.hpp"
#include "ricochet/detect/gates.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "scene_rows.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;

constexpr double duration = 120;  // [s]
constexpr double step = 1e-3;     // [s]
constexpr std::size_t demanded = 8;

double ratio(std::uint64_t a, std::uint64_t b)
{
    return static_cast<double>(a) / static_cast<double>(b);
}

double per_step(std::uint64_t calls)
{
    return static_cast<double>(calls) * step / duration;
}

struct Planning {
    Statistics counts;
    std::uint64_t hash;
    double seconds;
};

Planning plan(const LeastEigenvalue& system, const Options& options)
{
    const auto go = [&] { return integrate(system, system.start(), options, Fixed{}, planner()); };
    const auto run = go();
    return {.counts = run.statistics,
            .hash = hash_of(run),
            .seconds = time_alone(repeated(go), {.budget = 0.2, .fewest = 3}).median};
}

/// Evaluations that oracles need, including location.
std::string ceilings(const LeastEigenvalue& system, const Options& options, const Statistics& every)
{
    const OracleCalls oracle = count_oracle<Fixed>(system, system.start(), options);
    const std::uint64_t location = every.guard_calls - every.steps - 1;
    return fmt::format("oracle {:.5f}, with the bounds {:.5f}", per_step(oracle.checks + location),
                       per_step(oracle.bounded_checks + location));
}

void measure_level(double level, Measured& out)
{
    const Options options{.t_end = duration, .step = step};
    const LeastEigenvalue plain({.level = level});
    const auto every = integrate(plain, plain.start(), options, Fixed{}, Extremum{});
    const std::uint64_t hash = hash_of(every);
    const Planning cover = plan(plain, options);
    out.pass = out.pass && cover.hash == hash && every.statistics.events > 0;
    out.details.push_back(
        fmt::format("level {}, {} events; a look at every step: {:.4f} calls/step", level,
                    every.statistics.events, per_step(every.statistics.guard_calls)));
    out.details.push_back(
        fmt::format("  two-ended cover      {:.5f} calls/step, {:.3f} us/step; {}",
                    per_step(cover.counts.guard_calls), 1e6 * cover.seconds * step / duration,
                    ceilings(plain, options, every.statistics)));
    for (const std::size_t cells : {2U, 4U, 8U, 16U}) {
        const LeastEigenvalue system({.level = level, .table = cells});
        const Planning with = plan(system, options);
        const double gain = ratio(cover.counts.guard_calls, with.counts.guard_calls);
        const double saved = per_step(cover.counts.guard_calls - with.counts.guard_calls) / step;
        out.pass = out.pass && with.hash == hash && (cells != demanded || gain >= 1.5);
        out.details.push_back(fmt::format(
            "  table of {:>5} nodes {:.5f} calls/step, {:.3f} us/step; {}; {:.2f}x in calls, "
            "{:.2f}x "
            "in time, repays its making after {:.0f} s of motion",
            system.tabulated(), per_step(with.counts.guard_calls),
            1e6 * with.seconds * step / duration, ceilings(system, options, every.statistics), gain,
            cover.seconds / with.seconds, static_cast<double>(system.tabulated()) / saved));
        if (cells != demanded) continue;
        out.text += fmt::format("{}{:.2f}x", out.text.empty() ? "" : ", ", gain);
    }
}

/// Measures the time if a call takes a millisecond longer.
void measure_slow(Measured& out)
{
    const Options options{.t_end = 20, .step = step};
    const LeastEigenvalue plain({.level = 1.55, .slow = 1e-3});
    const LeastEigenvalue bounded({.level = 1.55, .slow = 1e-3, .table = demanded});
    const Planning cover = plan(plain, options);
    const Planning with = plan(bounded, options);
    out.pass = out.pass && cover.hash == with.hash;
    out.details.push_back(fmt::format(
        "guard made 1 ms slower, level 1.55, 20 s: {:.3f} s and {:.3f} s with the table, {:.2f}x",
        cover.seconds, with.seconds, cover.seconds / with.seconds));
}

}  // namespace

Measured count_bounded_eigenvalues()
{
    Measured out{.pass = true, .text = {}, .details = {}};
    for (const double level : {1.3, 1.55}) measure_level(level, out);
    measure_slow(out);
    out.text += fmt::format(" with {} cells along a load, the same events", demanded);
    return out;
}

Measured count_certified_eigenvalue()
{
    const Model model =
        load_model(std::filesystem::path(RICOCHET_MODELS) / "eigenvalue-certified.safetensors");
    const std::string why = why_void(model);
    const Options options{.t_end = duration, .step = step};
    const LeastEigenvalue system;
    const auto every = integrate(system, system.start(), options, Fixed{}, Extremum{});
    const auto cover = integrate(system, system.start(), options, Fixed{}, planner());
    const Certified<> detector(model, {.check_bounds = false});
    const auto proved = integrate(system, system.start(), options, Fixed{}, detector);
    const double gain = ratio(cover.statistics.guard_calls, proved.statistics.guard_calls);
    Measured out{.pass = why.empty() && gain >= 1.5 && every.statistics.events > 0 &&
                         hash_of(cover) == hash_of(every) && hash_of(proved) == hash_of(every),
                 .text = fmt::format("{:.2f}x, {} events", gain, every.statistics.events),
                 .details = {}};
    out.details.push_back(fmt::format(
        "two-ended cover {:.5f} calls/step, with the network {:.5f}, which is asked {:.4f} times a "
        "step; certificate {}",
        per_step(cover.statistics.guard_calls), per_step(proved.statistics.guard_calls),
        per_step(proved.statistics.network_calls), why.empty() ? "holds" : why));
    for (const CertificateLevel& l : detector.certificate().levels) {
        out.details.push_back(fmt::format("guard > {} below a logit of {:.4f}: {} boxes, {:.2f} s",
                                          l.margin, l.threshold, l.boxes, l.seconds));
    }
    return out;
}

}  // namespace ricochet::bench
