#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "compare.hpp"
#include "faults/fault.hpp"
#include "faults/step_progress.hpp"
#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "run_watch.hpp"
#include "studies.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();
constexpr int samples = 600;

/// One method of integration with its setting.
struct Way {
    std::string label;
    RuptureOptions options;
    std::optional<BatheOptions> bathe{};
};

struct WayTaken {
    std::string label;
    Rupture run;
    double seconds = 0;
    double slip_error = 0;      ///< relative
    double velocity_error = 0;  ///< of all elements over all time, relative L2
};

RuptureOptions sampled(double t_end, double step, double rtol = unbounded)
{
    RuptureOptions out{.t_end = t_end, .step = step, .rtol = rtol};
    out.progress = [](double) { return !Interrupts::any(); };
    for (int i = 1; i <= samples; ++i) out.snapshot_times.push_back(t_end * i / samples);
    return out;
}

std::vector<Way> ways(double t_end, double scale)
{
    std::vector<Way> out;
    out.push_back({"explicit, default", sampled(t_end, 0, 1e-4)});
    for (const double h : {0.25, 0.0625}) {
        out.push_back({fmt::format("explicit, {:.4g} s", h * scale), sampled(t_end, h * scale)});
    }
    const auto bathe = [&](std::string label, double h, const BatheOptions& options) {
        out.push_back({std::move(label), sampled(t_end, h * scale), options});
    };
    for (const double h : {0.5, 0.125, 0.03125}) {
        bathe(fmt::format("bathe, constant {:.4g} s", h * scale), h, {});
    }
    bathe(fmt::format("bathe, bound extrapolated, {:.4g} s", 0.125 * scale), 0.125,
          {.bound = FaultBound::extrapolated});
    for (const double rtol : {1e-2, 1e-3, 1e-4}) {
        bathe(fmt::format("bathe, free estimate, {:.0e}", rtol), 0.125,
              {.controller = ErrorStep{.order = 3, .reject_above = 100},
               .estimate = ErrorEstimate::embedded,
               .rtol = rtol});
    }
    const auto doubling = [](const StepController& controller, FirstStage first) {
        return BatheOptions{.first_stage = first,
                            .controller = controller,
                            .estimate = ErrorEstimate::doubling,
                            .norm = FaultNorm::components};
    };
    bathe("bathe, heuristic (eq. 5)", 0.125, doubling(HeuristicStep{}, FirstStage::averaged));
    bathe("bathe, filter h211b", 0.125, doubling(FilteredStep::h211b(4), FirstStage::averaged));
    bathe("bathe, PI 3333", 0.125, doubling(FilteredStep::pi3333(), FirstStage::averaged));
    for (const double h : {0.5, 0.1}) {
        bathe(fmt::format("published, constant {:.4g} s", h * scale), h,
              {.first_stage = FirstStage::at_end});
    }
    bathe("published, its controller", 0.05,
          doubling(ClassicStep{.order = 1, .up = 1.8}, FirstStage::at_end));
    return out;
}

/// Relative L2 error of the velocities, from the samples of both.
double velocity_error(const Rupture& run, const Rupture& exact)
{
    double of_error = 0;
    double of_all = 0;
    for (std::size_t i = 0; i < exact.snapshots.size(); ++i) {
        const auto& v = exact.snapshots[i].velocity;
        of_all += v.squaredNorm();
        of_error += i < run.snapshots.size() ? (run.snapshots[i].velocity - v).squaredNorm()
                                             : v.squaredNorm();
    }
    return std::sqrt(of_error / of_all);
}

WayTaken measure(const StrikeSlipFault& fault, const Way& way, const Rupture& exact,
                 LongRun& progress)
{
    WayTaken row{.label = way.label, .run = {}};
    const RuptureOptions options = shown(way.options, progress, way.label);
    const auto start = std::chrono::steady_clock::now();
    row.run = way.bathe ? ricochet::simulate(fault, options, *way.bathe)
                        : ricochet::simulate(fault, options);
    row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    row.slip_error = std::abs(row.run.mean_slip / exact.mean_slip - 1);
    row.velocity_error = velocity_error(row.run, exact);
    row.run.snapshots.clear();
    return row;
}

std::string text(const StrikeSlipFault& fault, const Rupture& exact,
                 const std::vector<WayTaken>& rows)
{
    std::string out = fmt::format(
        "fault of {0} x {0} elements: mean slip {1:.6f} m by explicit steps of {2:.3g} s, "
        "the reference\n\n{3:<36}{4:>6}{5:>6}{6:>7}{7:>7}{8:>9}{9:>12}{10:>10}{11:>10}\n",
        fault.elements(), exact.mean_slip, exact.longest_step, "", "steps", "rej.", "solves",
        "iter.", "products", "time", "slip", "L2 of v");
    for (const WayTaken& row : rows) {
        const RuptureStatistics& s = row.run.statistics;
        out += fmt::format("{:<36}{:>6}{:>6}{:>7}{:>7}{:>9}{:>12}{:>10.2e}{:>10.2e}\n", row.label,
                           s.steps, s.rejected, s.solves, s.iterations, s.products,
                           duration(row.seconds), row.slip_error, row.velocity_error);
    }
    return out +
           "\nsolves: implicit stages; iterations: of Newton's method; products: with K, the "
           "unit of work; errors are relative and true.\n";
}

std::string json(const StrikeSlipFault& fault, const Rupture& exact,
                 const std::vector<WayTaken>& rows)
{
    Json methods = Json::array();
    for (const WayTaken& row : rows) {
        const RuptureStatistics& s = row.run.statistics;
        methods.push_back({{"method", row.label},
                           {"outcome", ricochet::name(row.run.outcome)},
                           {"steps", s.steps},
                           {"rejected", s.rejected},
                           {"solves", s.solves},
                           {"iterations", s.iterations},
                           {"stiffness_products", s.products},
                           {"seconds", row.seconds},
                           {"mean_slip", row.run.mean_slip},
                           {"slip_error", row.slip_error},
                           {"velocity_error", row.velocity_error}});
    }
    Json out{{"system", "fault"},
             {"elements", fault.elements()},
             {"reference_mean_slip", exact.mean_slip},
             {"methods", std::move(methods)}};
    if (Interrupts::any()) out["incomplete"] = Interrupts::cause();
    return json_text(out);
}

}  // namespace

int compare_fault(const CompareRequest& request)
{
    const SystemEntry& system = find_system("fault");
    if (request.csv) throw BadInput("--csv is of event times, and a fault has none; take --json");
    const std::vector<double> values = parameter_values(system, request.set);
    if (has_rate_and_state(values)) {
        throw BadInput("compare fault is of friction that weakens with slip, not rate_and_state=1");
    }
    refuse_rate_and_state(request.set, system);
    StrikeSlipFault::Parameters parameters = fault_parameters(values);
    // Without a mesh of one's own: large enough for arrests one after the other.
    const bool given = std::any_of(request.set.begin(), request.set.end(),
                                   [](const auto& text) { return text.starts_with("elements="); });
    if (!given) parameters.elements = 10;
    constexpr int most = 60;  // all samples of all elements are kept
    if (parameters.elements > most) {
        throw BadInput(fmt::format("compare fault takes at most {0} x {0} elements, got {1}", most,
                                   parameters.elements));
    }
    const Interrupts interrupts;
    const RunWatch watch(0.25);
    const StrikeSlipFault fault(parameters);
    const double scale = fault.time_unit() / 0.8660254037844386;  // 1 at 3 km
    const double t_end = system.t_end * scale;
    RuptureOptions finest = sampled(t_end, 0.0078125 * scale);
    finest.polynomial_bound = 1e-7;
    LongRun progress;
    const Rupture exact = ricochet::simulate(fault, shown(finest, progress, "reference"));
    std::vector<WayTaken> rows;
    bool ended = true;
    const std::vector<Way> all = ways(t_end, scale);
    for (const Way& way : all) {
        if (Interrupts::any()) break;
        rows.push_back(measure(fault, way, exact, progress));
        ended = ended && rows.back().run.outcome == Outcome::at_rest;
    }
    progress.clear();
    const bool complete = !Interrupts::any();
    if (!complete && !rows.empty()) rows.pop_back();
    if (!complete && rows.empty()) return ended_early("before anything was compared");
    print(request.json ? json(fault, exact, rows) : text(fault, exact, rows));
    if (!complete) {
        return ended_early(fmt::format("after {} of {} methods", rows.size(), all.size()));
    }
    return ended ? 0 : 1;
}

}  // namespace ricochet::app
