#include "scene_rows.hpp"

#include <fmt/format.h>

namespace ricochet::bench {

namespace {

/// Steps that a forecast checks ahead.
constexpr std::size_t horizon = 2048;

GuardBound bound_at(const SeenGuard& seen, double value, double sign)
{
    return {.distance = sign * value, .speed = seen.speed, .acceleration = seen.acceleration};
}

bool closes(const SeenGuard& from, double value, const SeenGuard& to, double end, double sign,
            double margin)
{
    return stays_clear(bound_at(from, value, sign), bound_at(to, end, sign), to.time - from.time,
                       margin, 0);
}

}  // namespace

std::uint64_t count_checks(const std::vector<SeenGuard>& piece, double margin, bool with_bounds)
{
    std::uint64_t checks = 0;
    std::size_t at = 0;  // index of the last exact evaluation
    while (at + 1 < piece.size()) {
        const double value = piece[at].value;
        const double sign = value < 0 ? -1 : 1;
        std::size_t best = at;
        std::size_t free = at;  // index up to which lower bounds alone have closed
        const auto cheap = [&](std::size_t k) {
            return sign < 0 ? piece[k].upper : piece[k].lower;
        };
        const auto closed_to = [&](std::size_t k, double end) {
            return closes(piece[at], value, piece[k], end, sign, margin) ||
                   (free > at && closes(piece[free], cheap(free), piece[k], end, sign, margin));
        };
        for (std::size_t k = at + 1; k < piece.size(); ++k) {
            if (k > std::max(best, free) + horizon) break;
            const bool whole = closed_to(k, piece[k].value);
            if (whole) best = k;
            if (!with_bounds || !(sign * cheap(k) > 0)) continue;
            if (closed_to(k, cheap(k))) free = k;
        }
        if (free + 1 == piece.size()) return checks;
        // The step that lower bounds reach is evaluated only if no later evaluation closes; a step
        // that no two evaluations close costs one at its end.
        at = best > free ? best : free > at ? free : at + 1;
        ++checks;
    }
    return checks;
}

double SceneRow::location() const
{
    if (every.events == 0) return 0;
    const double ends = static_cast<double>(guards) * static_cast<double>(every.steps + 1);
    return (static_cast<double>(every.guard_calls) - ends) / static_cast<double>(every.events);
}

double SceneRow::oracle_calls(std::uint64_t checks) const
{
    const double all = static_cast<double>(checks) + location() * static_cast<double>(every.events);
    return all / static_cast<double>(oracle.steps);
}

namespace {

std::string heading()
{
    return fmt::format(
        "{:<32}{:>7}{:>7}{:>8}{:>10}{:>8}{:>9}{:>8}{:>8}{:>8} |{:>8}{:>8}{:>8}{:>8}{:>7}", "",
        "steps", "events", "alone", "brute", "built", "p.brute", "p.built", "times", "p.times",
        "every", "planned", "oracle", "bounded", "locate");
}

std::string line(const SceneRow& row)
{
    const auto steps = static_cast<double>(row.every.steps);
    const auto each = [&](double seconds) { return 1e6 * seconds / steps; };
    const auto calls = [&](std::uint64_t n) { return static_cast<double>(n) / steps; };
    return fmt::format(
        "{:<32}{:>7}{:>7}{:>8.3f}{:>10.3f}{:>8.3f}{:>9.3f}{:>8.3f}{:>7.1f}x{:>7.1f}x "
        "|{:>8.3f}{:>8.4f}{:>8.4f}"
        "{:>8.4f}{:>7.2f}{}",
        row.name, row.every.steps, row.every.events, each(row.alone), each(row.every_brute),
        each(row.every_built), each(row.planned_brute), each(row.planned_built), row.time_ratio(),
        row.brute_ratio(), calls(row.every.guard_calls), calls(row.planned.guard_calls),
        row.oracle_calls(row.oracle.checks), row.oracle_calls(row.oracle.bounded_checks),
        row.location(), row.same ? "" : "  OTHER EVENTS");
}

}  // namespace

Measured scene_table(const std::vector<SceneRow>& rows, std::size_t demanded, double target,
                     double (SceneRow::*ratio)() const)
{
    Measured out{
        .pass = true,
        .text = {},
        .details = {"us of processor time a step: without guards (alone), with a look at every "
                    "step (brute: at all segments, edges or faces; built: by trees), planned "
                    "(p.); times: brute over p.built, p.times: brute over p.brute.",
                    "Exact calls a step, location included: a look at every step, planned, a "
                    "forecast that knows the future (oracle), which also has lower bounds for "
                    "nothing (bounded); calls to locate an event.",
                    heading()}};
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const SceneRow& row = rows[i];
        out.pass = out.pass && row.same && row.every.events > 0;
        out.details.push_back(line(row));
        if (i >= demanded) continue;
        out.pass = out.pass && (row.*ratio)() >= target;
        out.text += fmt::format("{}{:.1f}x", i == 0 ? "" : ", ", (row.*ratio)());
    }
    return out;
}

}  // namespace ricochet::bench
