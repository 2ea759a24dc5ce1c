// B. E. Saunders, A. Steyer and R. J. Kuether, Machine learning for event detection in non-smooth
// initial value problems.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "papers.hpp"
#include "registry.hpp"
#include "settings.hpp"

namespace ricochet::app {

namespace {

const SystemEntry& ball()
{
    return find_system("bouncing-ball");
}

/// The paper's ball with fixed steps and one of our detectors; events are located to rounding.
TimedRun run_ball(std::string_view detector, std::size_t samples)
{
    check_exhibit();
    RunRequest request{.detector = std::string(detector), .step = ball().comparison_step};
    RunSettings settings = resolve(ball(), request);
    if (samples > 0) settings.options.sample_times = even(0, settings.options.t_end, samples);
    return ball().run(settings, 1);
}

std::vector<double> event_times(const TimedRun& timed)
{
    std::vector<double> out;
    for (const auto& event : timed.run.events) out.push_back(event.t);
    return out;
}

std::vector<double> closed_form()
{
    const RunSettings settings = resolve(ball(), RunRequest{});
    return ball().exact_events(settings.parameters, settings.options.t_end);
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b)
{
    if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
    double out = 0;
    for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, std::fabs(a[i] - b[i]));
    return out;
}

/// [s] Tolerance of the paper's bisection.
constexpr double paper_tolerance = 1e-10;

Exhibit table_1(const ExhibitSize& /*size*/)
{
    const std::vector<double> exact = closed_form();
    const std::vector<double> network = event_times(run_ball("network", 0));
    const std::vector<double> simple = event_times(run_ball("ends", 0));
    const std::vector<Published> paper = ball().published;
    Exhibit out{.columns = {"paper: network", "paper: simple", "ours: network", "ours: ends",
                            "closed form"},
                .format = "{:.15f}"};
    for (std::size_t i = 0; i < exact.size(); ++i) {
        const auto at = [i](const std::vector<double>& times) {
            return i < times.size() ? times[i] : std::nan("");
        };
        out.rows.push_back(
            {.name = fmt::format("event {}", i + 1),
             .value = {at(paper[0].times), at(paper[1].times), at(network), at(simple), exact[i]}});
    }
    const auto largest = [&](std::string_view what, const std::vector<double>& ours,
                             const std::vector<double>& theirs, double most) {
        out.agreements.push_back({.what = fmt::format("{}, largest difference [s]", what),
                                  .ours = largest_difference(ours, theirs),
                                  .paper = std::nan(""),
                                  .lower = 0,
                                  .upper = most});
    };
    largest("our network and the paper's", network, paper[0].times, paper_tolerance);
    largest("our ends and the paper's simple approach", simple, paper[1].times, paper_tolerance);
    largest("our network and the closed form", network, exact, 1e-13);
    largest("the paper's network and the closed form", paper[0].times, exact, paper_tolerance);
    out.remark = fmt::format(
        "Ours: RK4 with steps of {} s, which are exact on this ball but for rounding, events to "
        "neighbouring doubles.",
        ball().comparison_step);
    return out;
}

/// Component i over time; the line is broken where the ball jumps.
Curve component(const TimedRun& timed, std::size_t i, std::string label, Curve::Style style)
{
    Curve out{.name = std::move(label), .style = style};
    const auto& trajectory = timed.run.trajectory;
    std::size_t next = 0;
    const auto& events = timed.run.events;
    const auto add = [&](double t, double x) {
        out.x.push_back(t);
        out.y.push_back(x);
    };
    for (std::size_t k = 0; k < trajectory.t.size(); ++k) {
        for (; next < events.size() && events[next].t <= trajectory.t[k]; ++next) {
            add(events[next].t, events[next].before[i]);
            add(events[next].t, events[next].after[i]);
        }
        add(trajectory.t[k], trajectory.x[k][i]);
    }
    return out;
}

Exhibit figure_1(const ExhibitSize& /*size*/)
{
    const TimedRun network = run_ball("network", 1001);
    const TimedRun simple = run_ball("ends", 1001);
    const std::vector<Published> paper = ball().published;
    Exhibit out;
    constexpr std::array labels{"u [m]", "v [m/s]"};
    for (std::size_t i = 0; i < 2; ++i) {
        out.panels.push_back(
            {.title = labels[i],
             .x_label = "time [s]",
             .y_label = labels[i],
             .curves = {component(network, i, "neural network", Curve::Style::line),
                        component(simple, i, "simple approach", Curve::Style::dashed)}});
    }
    out.panels[0].curves.push_back({.name = "event times of the paper's network",
                                    .x = paper[0].times,
                                    .y = std::vector<double>(paper[0].times.size(), 0.0),
                                    .style = Curve::Style::crosses,
                                    .published = true});
    double apart = 0;
    for (std::size_t k = 0; k < network.run.trajectory.x.size(); ++k) {
        for (std::size_t i = 0; i < 2; ++i) {
            apart = std::max(
                apart, std::fabs(network.run.trajectory.x[k][i] - simple.run.trajectory.x[k][i]));
        }
    }
    out.agreements = {{.what = "largest distance of the two runs, 'effectively identical'",
                       .ours = apart,
                       .paper = std::nan(""),
                       .lower = 0,
                       .upper = 1e-12}};
    return out;
}

}  // namespace

Paper event_detection_paper()
{
    return {.name = "event-detection",
            .source =
                "B. E. Saunders, A. Steyer and R. J. Kuether, Machine learning for event "
                "detection in non-smooth initial value problems",
            .exhibits = {{ExhibitKind::table, 1,
                          "event times by a network and by the simple approach", table_1},
                         {ExhibitKind::figure, 1,
                          "height and velocity of the ball by both approaches", figure_1}}};
}

}  // namespace ricochet::app
