#include "work_precision.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string_view>

#include "odeint_by_hand.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::bench {

namespace {

constexpr auto fixed_steps = {1e-4, 1e-3, 1e-2, 0.037, 0.1, 0.3, 1.0};  // [s]
constexpr auto tolerances = {1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13};

template <class Method, class P, class Detector>
void add_fixed(CaseList& cases, const P& problem, const std::string& method,
               const std::string& name, const Detector& detector)
{
    for (const double step : fixed_steps) {
        cases.add(problem, {method, name, "step", step}, {.step = step}, FixedStep<Method>{},
                  detector);
    }
}

template <class Method, class P, class Detector>
void add_controlled(CaseList& cases, const P& problem, const std::string& method,
                    const std::string& name, const Detector& detector)
{
    for (const double rtol : tolerances) {
        cases.add(problem, {method, name, "rtol", rtol}, {.rtol = rtol, .atol = rtol},
                  ErrorControlled<Method>{}, detector);
    }
}

/// Every method with detector `name`.
template <class P, class Detector>
void add_methods(CaseList& cases, const P& problem, const std::string& name,
                 const Detector& detector)
{
    add_fixed<Rk4>(cases, problem, "rk4", name, detector);
    add_controlled<Dopri5>(cases, problem, "dopri5", name, detector);
    add_controlled<Fehlberg78>(cases, problem, "fehlberg78", name, detector);
}

Answer answer_by_hand(const ByHand& run)
{
    return {.times = run.times,
            .steps = run.steps,
            .flow_calls = run.flow_calls,
            .guard_calls = run.guard_calls};
}

void add_rivals(CaseList& cases, const BallProblem& problem)
{
    const BouncingBall& ball = problem.system;
    const auto x0 = problem.x0;
    const double t_end = problem.t_end;

    cases.add_rival(
        problem.name, problem.events, {"closed-form", "-", "", 0},
        [=] {
            std::vector<double> times;
            for (int n = 0;; ++n) {
                const double t = ball.impact_time(n, x0[0], x0[1]);
                if (!(t <= t_end)) return times;
                times.push_back(t);
            }
        },
        [](std::vector<double> times) { return Answer{.times = std::move(times)}; });

    for (const double rtol : tolerances) {
        cases.add_rival(
            problem.name, problem.events, {"odeint-by-hand", "dense-output", "rtol", rtol},
            [=] { return by_hand_on_dense_output(ball, x0, t_end, rtol); }, answer_by_hand);
        cases.add_rival(
            problem.name, problem.events, {"odeint-by-hand", "step-map", "rtol", rtol},
            [=] { return by_hand_on_step_map(ball, x0, t_end, rtol); }, answer_by_hand);
    }
}

std::string count(const std::optional<std::uint64_t>& n)
{
    return n ? fmt::format("{}", *n) : "-";
}

std::string knob(const Setting& setting)
{
    return setting.knob.empty() ? "" : fmt::format("{}={:g}", setting.knob, setting.value);
}

nlohmann::json number(const std::optional<std::uint64_t>& n)
{
    return n ? nlohmann::json(*n) : nlohmann::json(nullptr);
}

nlohmann::json to_json(const Timing& time)
{
    return {{"median", time.median},
            {"p10", time.p10},
            {"p90", time.p90},
            {"samples", time.samples},
            {"repetitions", time.repetitions}};
}

}  // namespace

std::string Case::name() const
{
    const std::string base = problem + "/" + setting.method + "/" + setting.detector;
    return setting.knob.empty() ? base : base + "/" + knob(setting);
}

CaseList standard_cases(const std::filesystem::path& models)
{
    const BareNetwork network(load_model(models / "bouncing-ball-step-0.01.safetensors"));
    CaseList cases;
    for (const BallProblem& problem : {b1(), b2(), b3()}) {
        add_methods(cases, problem, "ends", Ends{});
        add_methods(cases, problem, "extremum", Extremum{});
        cases.add(problem, {"rk4", "network", "step", 0.01}, {.step = 0.01}, FixedStep<Rk4>{},
                  network);
        add_rivals(cases, problem);
    }
    return cases;
}

Row solve(const Case& c)
{
    Answer answer = c.solve();
    const Score result = score(answer.times, c.reference);
    return {.problem = c.problem,
            .setting = c.setting,
            .events = c.reference.size(),
            .score = result,
            .answer = std::move(answer)};
}

Row run(const Case& c, const TimingOptions& options)
{
    Row row = solve(c);
    if (row.answer.finished && row.score.complete()) row.time = time_alone(c.work, options);
    return row;
}

std::string table(std::span<const Row> rows, const Timing& yardstick)
{
    std::string text = fmt::format(
        "yardstick {:.3g} ns (reference {:.3g} ns); times are medians [p10 - p90]\n\n"
        "{:<8}{:<15}{:<13}{:<12}{:>7}{:>7}{:>9}{:>10}{:>9}{:>9}{:>9}{:>9}{:>11}{:>11}  {}\n",
        yardstick.median * 1e9, yardstick_reference * 1e9, "problem", "method", "detector",
        "setting", "events", "missed", "spurious", "error [s]", "steps", "flow", "guard", "network",
        "time [us]", "scaled", "spread [us]");
    for (const Row& row : rows) {
        text += fmt::format("{:<8}{:<15}{:<13}{:<12}{:>7}{:>7}{:>9}{:>10.1e}{:>9}{:>9}{:>9}{:>9}",
                            row.problem, row.setting.method, row.setting.detector,
                            knob(row.setting), row.events, row.score.missed, row.score.spurious,
                            row.score.error, count(row.answer.steps), count(row.answer.flow_calls),
                            count(row.answer.guard_calls), count(row.answer.network_calls));
        if (row.time) {
            text += fmt::format("{:>11.3f}{:>11.3f}  [{:.3f} - {:.3f}]\n", row.time->median * 1e6,
                                scaled(row.time->median, yardstick) * 1e6, row.time->p10 * 1e6,
                                row.time->p90 * 1e6);
        } else {
            text += "  not timed: the answer is wrong\n";
        }
    }
    return text;
}

nlohmann::json to_json(std::span<const Row> rows, const Timing& yardstick)
{
    nlohmann::json list = nlohmann::json::array();
    for (const Row& row : rows) {
        list.push_back({{"problem", row.problem},
                        {"method", row.setting.method},
                        {"detector", row.setting.detector},
                        {"knob", row.setting.knob},
                        {"value", row.setting.value},
                        {"events", row.events},
                        {"missed", row.score.missed},
                        {"spurious", row.score.spurious},
                        {"error", row.score.error},
                        {"finished", row.answer.finished},
                        {"steps", number(row.answer.steps)},
                        {"flow_calls", number(row.answer.flow_calls)},
                        {"guard_calls", number(row.answer.guard_calls)},
                        {"network_calls", number(row.answer.network_calls)},
                        {"time", row.time ? to_json(*row.time) : nlohmann::json(nullptr)}});
    }
    return {{"yardstick", to_json(yardstick)},
            {"yardstick_reference", yardstick_reference},
            {"rows", std::move(list)}};
}

}  // namespace ricochet::bench
