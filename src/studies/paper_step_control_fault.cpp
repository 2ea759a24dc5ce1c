// Section 5.3 of D. M. Riley, A. Stathas, D. Gutierrez-Oribio and I. Stefanou, Reinforcement
// learning-based adaptive time-integration for nonsmooth dynamics: a strike-slip fault.
//
// The paper's policies are trained by TQC for a trade-off alpha. Ours multiply the step proposed by
// a classical rule for a tolerance, so the columns of the tile plots are tolerances here.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "interrupt.hpp"
#include "learn/step_environment.hpp"
#include "paper_step_control.hpp"
#include "policy_lookup.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "studies.hpp"

namespace ricochet::app {

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double reference_step = 0.05;  // [s] as the paper's
constexpr std::array tolerances{1e-1, 3e-2, 1e-2, 3e-3, 1e-3};
constexpr std::array sides{3000.0, 5000.0};

std::vector<int> meshes(const ExhibitSize& size)
{
    return size.full ? std::vector{25, 50, 75, 100} : std::vector{1, 4, 8, 12};
}

StrikeSlipFault fault_of(double side, int elements)
{
    return StrikeSlipFault({.elements = elements, .side = side});
}

/// [s] 30 at 3 km.
double end_of(const StrikeSlipFault& fault)
{
    return fault.parameters().side / 100;
}

/// One rule on one fault.
struct FaultRun {
    std::string name;
    Rupture rupture{};
    double seconds = none;
    std::vector<double> t{}, h{};           ///< [s] start and length of every step
    std::vector<double> at{}, v{}, slip{};  ///< means at the starts and middles of the steps
    [[nodiscard]] bool ended() const { return rupture.outcome == Outcome::at_rest; }
};

FaultRun run_rule(std::string name, const StrikeSlipFault& fault, BatheOptions bathe,
                  double first_step, bool timed, const std::vector<double>& snapshots = {})
{
    check_exhibit();
    FaultRun out{.name = std::move(name)};
    RuptureOptions options{.t_end = end_of(fault),
                           .step = first_step,
                           .snapshot_times = snapshots,
                           .max_steps = 20'000,
                           .progress = [](double) { return !Interrupts::any(); }};
    const BatheOptions plain = bathe;
    const bool halves = bathe.estimate == ErrorEstimate::doubling;
    bool second = false;
    bathe.observer = [&](const BatheStep& step) {
        const double t = step.t * fault.time_unit();
        const double h = step.h * fault.time_unit();
        if (second) {
            out.h.back() += h;
        } else {
            out.t.push_back(t);
            out.h.push_back(h);
        }
        second = halves && !second;
        for (const std::size_t part : {0U, 1U}) {
            out.at.push_back(t + 0.5 * h * static_cast<double>(part));
            out.v.push_back(fault.mean(*step.velocity[part]) * fault.velocity_unit());
            out.slip.push_back(fault.mean(*step.path[part]) * fault.slip_unit());
        }
    };
    const auto start = std::chrono::steady_clock::now();
    out.rupture = ricochet::simulate(fault, options, bathe);
    check_exhibit();
    if (!timed) return out;
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (out.seconds > 0.5) return out;
    options.snapshot_times.clear();
    BatheRuns runs(fault);
    out.seconds = seconds_of([&] { (void)runs.simulate(options, plain); }, 0.3);
    check_exhibit();
    return out;
}

/// The published scheme: the reaction at the end of the first stage, errors by doubling.
BatheOptions published_rule(const StepController& controller)
{
    return {.first_stage = FirstStage::at_end,
            .controller = controller,
            .estimate = ErrorEstimate::doubling,
            .norm = FaultNorm::components};
}

FaultRun constant(const StrikeSlipFault& fault, const std::vector<double>& snapshots = {})
{
    return run_rule(fmt::format("constant, {} s", reference_step), fault,
                    {.first_stage = FirstStage::at_end}, reference_step, false, snapshots);
}

FaultRun heuristic(const StrikeSlipFault& fault, bool timed = true,
                   const std::vector<double>& snapshots = {})
{
    return run_rule("heuristic, eq. 5", fault, published_rule(HeuristicStep{}), reference_step,
                    timed, snapshots);
}

FaultRun pi_as_coded(const StrikeSlipFault& fault, bool timed = true)
{
    return run_rule("PI as coded, h211b", fault, published_rule(FilteredStep::h211b(4)),
                    reference_step, timed);
}

FaultRun learned(const StrikeSlipFault& fault, double tolerance, bool timed = true,
                 const std::vector<double>& snapshots = {})
{
    return run_rule(
        fmt::format("learned factor, {:.0e}", tolerance), fault,
        {.controller = LearnedStep{.policy = named_policy(fault_step_layout(), std::nullopt)},
         .estimate = ErrorEstimate::embedded,
         .rtol = tolerance},
        reference_step, timed, snapshots);
}

/// A run by the shipped actor, trained with the paper's reward on one element; it may not reach the
/// end.
FaultRun tqc(const StrikeSlipFault& fault, bool timed = true,
             const std::vector<double>& snapshots = {})
{
    const Model actor = shipped_actor(StrikeSlipFault::name);
    learn::StepEnvironmentOptions options = judged(actor);
    options.watch = [](double) { return !Interrupts::any(); };
    options.max_attempts = 500;  // ten times as many as a run takes
    const auto lengths = lengths_of(learn::step_environment(fault, end_of(fault), options), actor);
    check_exhibit();
    const std::string name = fmt::format("TQC, alpha {}", actor.parameters.at("alpha"));
    if (lengths.empty()) {
        FaultRun out{.name = name};
        out.rupture.outcome = Outcome::not_converged;
        return out;
    }
    return run_rule(name, fault,
                    published_rule(PrescribedSteps{
                        .lengths = std::make_shared<const std::vector<double>>(lengths)}),
                    lengths.front(), timed, snapshots);
}

/// Runs of every rule on one fault, and the slip of constant steps.
struct MeshStudy {
    int elements = 0;
    double slip = 0;  ///< [m] of constant steps
    std::optional<FaultRun> heuristic{}, pi{};
    std::vector<FaultRun> learned{};  ///< by tolerance, then that of TQC
    [[nodiscard]] double error(const FaultRun& run) const
    {
        return run.ended() ? std::fabs(run.rupture.mean_slip / slip - 1) : none;
    }
};

struct StudyParts {
    bool heuristic = true, pi = false, timed = true;
};

MeshStudy study(double side, int elements, const StudyParts& parts)
{
    const StrikeSlipFault fault = fault_of(side, elements);
    MeshStudy out{.elements = elements};
    out.slip = constant(fault).rupture.mean_slip;
    if (parts.heuristic) out.heuristic = heuristic(fault, parts.timed);
    if (parts.pi) out.pi = pi_as_coded(fault, parts.timed);
    for (const double tolerance : tolerances) {
        out.learned.push_back(learned(fault, tolerance, parts.timed));
    }
    out.learned.push_back(tqc(fault, parts.timed));
    return out;
}

std::vector<std::string> tile_columns()
{
    std::vector<std::string> out;
    for (const double tolerance : tolerances) out.push_back(fmt::format("{:.0e}", tolerance));
    out.push_back("TQC");
    return out;
}

/// Tiles and rows of one number for every mesh and learned rule.
class TilePlot {
public:
    explicit TilePlot(std::string kind) : kind_(std::move(kind))
    {
        out_.columns = tile_columns();
        out_.format = "{:.3g}";
    }

    template <class Value>
    std::vector<double> add(double side, const std::vector<MeshStudy>& studies, const Value& value)
    {
        std::vector<double> all;
        Tiles tiles{.x = {tolerances.begin(), tolerances.end()}, .numbered = true};
        for (const MeshStudy& each : studies) {
            tiles.y.push_back(each.elements);
            ExhibitRow row{.name = fmt::format("{}, {:g} km, {} x {}", kind_, side / 1000,
                                               each.elements, each.elements)};
            for (const FaultRun& run : each.learned) {
                const double x = run.ended() ? value(each, run) : none;
                const bool actor = row.value.size() == tolerances.size();
                row.value.push_back(x);
                if (actor) break;
                tiles.value.push_back(x);
                if (std::isfinite(x)) all.push_back(x);
            }
            out_.rows.push_back(std::move(row));
        }
        out_.panels.push_back({.title = fmt::format("{}, {:g} km", kind_, side / 1000),
                               .x_label = "tolerance",
                               .y_label = "elements per side",
                               .tiles = std::move(tiles)});
        return all;
    }
    [[nodiscard]] Exhibit& exhibit() { return out_; }
    void kind(std::string name) { kind_ = std::move(name); }

private:
    Exhibit out_;
    std::string kind_;
};

double mean_of(const std::vector<double>& x)
{
    double sum = 0;
    for (const double value : x) sum += value;
    return sum / static_cast<double>(x.size());
}

std::vector<MeshStudy> studies(double side, const ExhibitSize& size, const StudyParts& parts)
{
    std::vector<MeshStudy> out;
    for (const int elements : meshes(size)) out.push_back(study(side, elements, parts));
    return out;
}

double products(const FaultRun& run)
{
    return static_cast<double>(run.rupture.statistics.products);
}

/// The ratios that the text of the paper prints: least, mean and largest.
struct PaperRatios {
    double side, least, mean, most;
};

constexpr std::string_view tile_remark =
    "Columns: tolerances of the learned factor, and the actor trained by TQC with the paper's "
    "reward "
    "(-: it does not come to the end). Ratios above 1: the learned steps are faster. Times are of "
    "the "
    "runs alone, the least of up to five.";

Exhibit ratios(const ExhibitSize& size, const StudyParts& parts,
               std::optional<FaultRun> MeshStudy::*rival, const std::vector<PaperRatios>& paper)
{
    TilePlot plot("run time");
    std::vector<std::vector<MeshStudy>> all;
    for (const PaperRatios& p : paper) {
        all.push_back(studies(p.side, size, parts));
        plot.kind("run time");
        const std::vector<double> ratio =
            plot.add(p.side, all.back(), [rival](const MeshStudy& s, const FaultRun& run) {
                return (s.*rival)->seconds / run.seconds;
            });
        plot.exhibit().agreements.push_back(
            {fmt::format("mean ratio of run times, {:g} km", p.side / 1000), mean_of(ratio), p.mean,
             1, 10 * p.mean});
        plot.exhibit().remark += fmt::format("Paper, {:g} km: {} to {}, mean {}. ", p.side / 1000,
                                             p.least, p.most, p.mean);
    }
    plot.kind("products with K");
    for (std::size_t i = 0; i < paper.size(); ++i) {
        (void)plot.add(paper[i].side, all[i], [rival](const MeshStudy& s, const FaultRun& run) {
            return products(*(s.*rival)) / products(run);
        });
    }
    plot.exhibit().remark += tile_remark;
    return std::move(plot.exhibit());
}

}  // namespace

Exhibit fault_figure_5(const ExhibitSize& size)
{
    return ratios(size, {}, &MeshStudy::heuristic,
                  {{sides[0], 4, 11.02, 19.45}, {sides[1], 10, 18, 35}});
}

Exhibit fault_figure_6(const ExhibitSize& size)
{
    // The paper prints numbers for 3 km only.
    return ratios(size, {.heuristic = false, .pi = true}, &MeshStudy::pi,
                  {{sides[0], 5, 12.83, 30}});
}

Exhibit fault_figure_7(const ExhibitSize& size)
{
    const StrikeSlipFault fault = fault_of(sides[0], size.full ? 50 : 10);
    const std::vector<FaultRun> runs{pi_as_coded(fault, false), heuristic(fault, false),
                                     learned(fault, 1e-2, false), tqc(fault, false)};
    Exhibit out{.columns = {"steps", "rejected", "shortest [s]", "longest [s]"}};
    for (const FaultRun& run : runs) {
        if (!run.ended()) {
            out.rows.push_back({run.name, std::vector<double>(4, none)});
            continue;
        }
        const auto [least, most] = std::minmax_element(run.h.begin(), run.h.end());
        out.rows.push_back({run.name,
                            {static_cast<double>(run.rupture.statistics.steps),
                             static_cast<double>(run.rupture.statistics.rejected), *least, *most}});
        out.panels.push_back({.title = run.name,
                              .x_label = "t [s]",
                              .y_label = "h [s]",
                              .curves = {{.name = "accepted steps",
                                          .x = run.t,
                                          .y = run.h,
                                          .style = Curve::Style::points}},
                              .log_y = true});
    }
    const auto steps = [&](std::size_t i) { return out.rows[i].value[0] + out.rows[i].value[1]; };
    out.agreements = {{"attempts of the heuristic over those of the learned steps, above 1",
                       steps(1) / steps(2), 401.0 / 23, 1,
                       std::numeric_limits<double>::infinity()}};
    out.remark = fmt::format(
        "{0} x {0} elements, until the fault is at rest; the paper's steps go on to 30 s. An "
        "attempt "
        "of the heuristic is six solves, one of the learned steps two. The paper's 401 and 23 "
        "steps "
        "are those that its code records on 100 x 100 elements.",
        fault.elements());
    return out;
}

Exhibit fault_figure_8(const ExhibitSize& size)
{
    const StrikeSlipFault fault = fault_of(sides[0], size.full ? 50 : 10);
    constexpr double when = 8.2;  // [s]
    const std::vector<double> at{when};
    std::vector<FaultRun> runs{constant(fault, at), heuristic(fault, false, at),
                               learned(fault, 1e-2, false, at)};
    if (FaultRun actor = tqc(fault, false, at); actor.ended()) runs.push_back(std::move(actor));
    Exhibit out{
        .panels = {{.title = "mean velocity", .x_label = "t [s]", .y_label = "v [m/s]"},
                   {.title = "mean slip", .x_label = "t [s]", .y_label = "slip [m]"}},
        .columns = {"steps", "peak v [m/s]", "slip [m]", "slip off by", "largest v - v_true"}};
    const Eigen::VectorXd& exact = runs[0].rupture.snapshots.at(0).velocity;
    for (const FaultRun& run : runs) {
        for (const auto& [panel, y] :
             {std::pair{&out.panels[0], &run.v}, {&out.panels[1], &run.slip}}) {
            panel->curves.push_back({.name = run.name, .x = run.at, .y = *y});
            if (run.name != runs[0].name) panel->curves.back().style = Curve::Style::dashed;
        }
        const Rupture& r = run.rupture;
        out.rows.push_back({run.name,
                            {static_cast<double>(r.statistics.steps), r.peak_velocity, r.mean_slip,
                             std::fabs(r.mean_slip / runs[0].rupture.mean_slip - 1),
                             (r.snapshots.at(0).velocity - exact).cwiseAbs().maxCoeff()}});
    }
    const auto map = [&](std::string title, const Eigen::VectorXd& field) {
        const int n = fault.elements();
        const double side = fault.parameters().side / 1000;
        Tiles tiles{.x = even(side * 0.5 / n, side * (n - 0.5) / n, static_cast<std::size_t>(n))};
        tiles.y = tiles.x;
        tiles.value.assign(field.data(), field.data() + field.size());
        out.panels.push_back({.title = std::move(title),
                              .x_label = "x [km]",
                              .y_label = "depth [km]",
                              .tiles = std::move(tiles),
                              .downwards = true});
    };
    map(fmt::format("velocity of {} at {} s [m/s]", runs[2].name, when),
        runs[2].rupture.snapshots.at(0).velocity);
    map("the same less constant steps [m/s]", runs[2].rupture.snapshots.at(0).velocity - exact);
    out.agreements = {{"largest velocity difference [m/s]", out.rows[2].value[4], 0.03, 0, 0.03}};
    out.remark =
        fmt::format("{0} x {0} elements; the paper's has 50 x 50, alpha 2.", fault.elements());
    return out;
}

Exhibit fault_figure_9(const ExhibitSize& size)
{
    TilePlot plot("error of the slip");
    constexpr std::array paper_error{0.0985, 0.0742};
    constexpr std::array paper_ratio{0.074, 0.023};
    std::array<std::vector<MeshStudy>, 2> all;
    for (std::size_t i = 0; i < sides.size(); ++i) {
        all[i] = studies(sides[i], size, {.timed = false});
        const std::vector<double> errors = plot.add(
            sides[i], all[i], [](const MeshStudy& s, const FaultRun& run) { return s.error(run); });
        plot.exhibit().agreements.push_back(
            {fmt::format("mean error of the slip, {:g} km", sides[i] / 1000), mean_of(errors),
             paper_error[i], 0, paper_error[i]});
    }
    plot.kind("heuristic's error over it");
    for (std::size_t i = 0; i < sides.size(); ++i) {
        const std::vector<double> ratio =
            plot.add(sides[i], all[i], [](const MeshStudy& s, const FaultRun& run) {
                return s.error(*s.heuristic) / s.error(run);
            });
        plot.exhibit().remark +=
            fmt::format("Mean of the last ratio at {:g} km: {:.3g}, paper {}. ", sides[i] / 1000,
                        mean_of(ratio), paper_ratio[i]);
    }
    plot.exhibit().remark +=
        "Errors are against constant steps of 0.05 s of the paper's scheme, as the paper's, which "
        "are "
        "themselves off by about 2e-3: smaller ones mean nothing. Columns: tolerances, and TQC's "
        "actor (-: it does not come to the end).";
    return std::move(plot.exhibit());
}

Exhibit fault_figure_10(const ExhibitSize& size)
{
    constexpr double tolerance = 1e-2;
    Exhibit out{.panels = {{.title = "run time: heuristic / learned",
                            .x_label = "elements per side",
                            .y_label = "ratio"},
                           {.title = "error of the slip: heuristic / learned",
                            .x_label = "elements per side",
                            .y_label = "ratio",
                            .log_y = true}},
                .columns = {"run time", "products with K", "error"},
                .format = "{:.3g}"};
    for (const double side : sides) {
        Curve time{.name = fmt::format("{:g} km", side / 1000)};
        Curve error = time;
        for (const int elements : meshes(size)) {
            const StrikeSlipFault fault = fault_of(side, elements);
            MeshStudy s{.elements = elements, .slip = constant(fault).rupture.mean_slip};
            const FaultRun rule = heuristic(fault);
            const FaultRun run = learned(fault, tolerance);
            time.x.push_back(elements);
            time.y.push_back(rule.seconds / run.seconds);
            error.x.push_back(elements);
            error.y.push_back(s.error(rule) / s.error(run));
            out.rows.push_back({fmt::format("{:g} km, {} x {}", side / 1000, elements, elements),
                                {time.y.back(), products(rule) / products(run), error.y.back()}});
        }
        out.panels[0].curves.push_back(std::move(time));
        out.panels[1].curves.push_back(std::move(error));
    }
    const ExhibitRow last = out.rows.back();
    if (size.full) {
        out.rows.push_back({"5 km, 100 x 100, before transfer", {23, none, none}, true});
        out.rows.push_back({"5 km, 100 x 100, after transfer", {35, none, none}, true});
    }
    out.agreements = {
        {"products on the finest mesh, heuristic / learned", last.value[1], 35, 1, 350}};
    out.remark = fmt::format(
        "The paper trains on one element and once more on 30 x 30; our policy has seen 1 x 1 to 3 "
        "x 3 "
        "elements and nothing more. Tolerance {}; the paper's alpha is 8.",
        tolerance);
    return out;
}

}  // namespace ricochet::app
