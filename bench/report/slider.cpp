// A block on a spring with rate-and-state friction: six cycles of stick-slip, whose slip rate
// passes through a threshold twice in each.
//
// ricochet takes variational steps, or integrates the slider as any system; CVODE takes the same
// system by BDF. Radau, BDF and LSODA of SciPy are in scipy_peer.py.
#include "ricochet/faults/spring_slider.hpp"

#include "cells.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/rosenbrock.hpp"
#ifdef RICOCHET_REPORT_CVODE
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "hosts/sundials_setup.hpp"
#include "sundials.hpp"
#endif

namespace ricochet::report {

namespace {

constexpr double slider_end = 1;    ///< [s]
constexpr double threshold = 2e-4;  ///< [m/s]
constexpr std::size_t onset = 0;    ///< guards in the list of events
constexpr std::size_t arrest = 1;

/// 0.61 of the critical stiffness; the spring is drawn to N f* at the start.
[[nodiscard]] SpringSlider slider()
{
    SpringSlider out;
    out.block.stiffness = 3e4;
    out.load =
        SliderLoad(out.block.normal_force * out.friction.f_star / out.block.stiffness, 1.5e-4);
    return out;
}

/// Fehlberg's method of order 8 in arithmetic of 34 digits with tolerances of 1e-21 and 1e-24,
/// which agree within 2e-20 s. The numbers of the slider are the doubles nearest to those written.
[[nodiscard]] Reference slider_reference()
{
    Reference out{.problem = "slider",
                  .title = "Rate-and-state slider, 6 cycles of stick-slip",
                  .t_end = slider_end};
    for (const double t :
         {0.02480938044777085738, 0.12586213800770682525, 0.26204366722666989677,
          0.43614490372980431902, 0.63127274557432172839, 0.83461222808376022475}) {
        out.events.push_back({t, onset});
    }
    for (const double t :
         {0.05157370167935762800, 0.15200120996463707651, 0.28687453207387460551,
          0.46065846780939153332, 0.65571657861306350245, 0.85903793114264280503}) {
        out.events.push_back({t, arrest});
    }
    return out;
}

Answer by_variational_steps(int order, double tolerance)
{
    const SliderRun run = run_slider(
        slider(), slider_case_start(),
        {.t_end = slider_end, .order = order, .rtol = tolerance, .threshold = threshold});
    Answer answer{.finished = run.outcome == Outcome::reached_end, .steps = run.steps};
    for (const SliderEvent& event : run.events) {
        answer.add(event.at.t, event.kind == SliderEventKind::onset ? onset : arrest);
    }
    if (!answer.finished) answer.note = describe(run.outcome);
    return answer;
}

template <class Method>
Answer by_event_loop(double tolerance)
{
    const RateStateSlider system(slider(), threshold);
    const auto run = integrate(
        system, system.start(slider_case_start()),
        {.t_end = slider_end, .rtol = tolerance, .atol = tolerance, .event_states = false},
        ErrorControlled<Method>{});
    Answer answer{.finished = run.outcome == Outcome::reached_end,
                  .steps = run.statistics.steps,
                  .flow_calls = run.statistics.flow_calls,
                  .guard_calls = run.statistics.guard_calls};
    for (const auto& event : run.events) {
        if (event.kind == EventKind::crossing)
            answer.add(event.t, event.slope > 0 ? onset : arrest);
    }
    if (!answer.finished) answer.note = describe(run.outcome);
    return answer;
}

#ifdef RICOCHET_REPORT_CVODE

int level_of(double t, N_Vector x, double* g, void* user)
{
    const auto* flow = static_cast<const hosts_test::FlowOf<RateStateSlider>*>(user);
    g[0] = flow->system->guard(t, RateStateSlider::State{0, NV_Ith_S(x, 1), 0});
    return 0;
}

/// As CVODE's manual recommends: a dense Jacobian by differences, one root in either direction,
/// which is only recorded.
Answer by_cvode(double tolerance)
{
    Mode mode{};
    const RateStateSlider system(slider(), threshold);
    const auto x0 = system.start(slider_case_start());
    hosts_test::CvodeOf<RateStateSlider, CV_BDF> made(system, mode, x0, {tolerance, tolerance});
    void* memory = made.memory();
    const State at(x0.size());
    require(CVodeRootInit(memory, 1, level_of), "CVodeRootInit");
    require(CVodeSetNoInactiveRootWarn(memory), "CVodeSetNoInactiveRootWarn");
    Answer answer;
    for (double t = 0; t < slider_end;) {
        const int flag = CVode(memory, slider_end, at.x, &t, CV_NORMAL);
        if (flag < 0) {
            answer.note = "error flag " + std::to_string(flag);
            return answer;
        }
        if (flag != CV_ROOT_RETURN) continue;
        int direction = 0;
        CVodeGetRootInfo(memory, &direction);
        answer.add(t, direction > 0 ? onset : arrest);
    }
    long steps = 0;
    CVodeGetNumSteps(memory, &steps);
    answer.steps = static_cast<std::uint64_t>(steps);
    answer.finished = true;
    return answer;
}

#endif

template <class Solve>
void add(Cells& cells, const std::string& peer, const std::string& how, Solve solve,
         double least = 0)
{
    for (const double tolerance : tolerances_of("slider")) {
        if (tolerance < least) continue;
        cells.add(
            {"slider", peer, how, tolerance, [=] { return [=] { return solve(tolerance); }; }});
    }
}

}  // namespace

void add_slider(Cells& cells)
{
    cells.add_reference(slider_reference);
    for (const int order : {2, 4}) {
        add(
            cells, "ricochet", "variational, order " + std::to_string(order),
            [order](double tolerance) { return by_variational_steps(order, tolerance); },
            order == 2 ? 1e-8 : 0);  // smaller tolerances take seconds
    }
    add(cells, "ricochet", "Rosenbrock4", by_event_loop<Rosenbrock4>);
    add(cells, "ricochet", "dopri5", by_event_loop<Dopri5>);
    add(cells, "ricochet", "fehlberg78", by_event_loop<Fehlberg78>);
#ifdef RICOCHET_REPORT_CVODE
    add(cells, "CVODE", "BDF, root finding", by_cvode);
#endif
}

}  // namespace ricochet::report
