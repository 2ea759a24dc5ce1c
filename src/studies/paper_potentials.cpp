// S. Liu, K. Bhattacharya and N. Lapusta, Learning a potential formulation for rate-and-state
// friction, arXiv 2507.09796, 2025.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "along_history.hpp"
#include "identify_friction.hpp"
#include "interrupt.hpp"
#include "model_lookup.hpp"
#include "paper_potentials.hpp"
#include "papers.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/variational_step.hpp"

namespace ricochet::app {

namespace {

/// The pair that is shipped with the library, trained on histories alone.
AdditivePair stored_pair()
{
    return load_pair(find_model("ageing-friction.json"));
}

/// A curve over time; quantities that are constant between samples are drawn as steps.
Curve over_time(std::string name, const FrictionHistory& h, const std::vector<double>& y,
                Curve::Style style = Curve::Style::line)
{
    Curve out{.name = std::move(name), .style = style};
    const bool steps = h.between == FrictionHistory::Between::constant;
    for (std::size_t i = 0; i < h.t.size(); ++i) {
        if (steps && i > 0) {
            out.x.push_back(h.t[i]);
            out.y.push_back(y[i - 1]);
        }
        out.x.push_back(h.t[i]);
        out.y.push_back(y[i]);
    }
    return out;
}

Panel slip_rates(const FrictionHistory& h, std::string title)
{
    return {.title = std::move(title),
            .x_label = "t [s]",
            .y_label = "V [m/s]",
            .curves = {over_time("slip rate", h, h.v)},
            .log_y = true};
}

const FrictionHistory& example(FrictionHistory::Between between)
{
    const Histories& test = friction_data().test;
    return *std::find_if(test.begin(), test.end(),
                         [between](const FrictionHistory& h) { return h.between == between; });
}

/// Friction along a history, by training progress; the paper shows a diagram here.
Exhibit figure_1(const ExhibitSize& size)
{
    const Histories some = part(friction_data().training, 0, size.full ? 48 : 8);
    const FrictionHistory& h = example(FrictionHistory::Between::constant);
    Panel friction{.title = "friction along a test history", .x_label = "t [s]", .y_label = "f"};
    friction.curves.push_back(over_time("empirical law", h, h.friction));
    Curve loss{.name = "loss (11)", .style = Curve::Style::points};
    for (const int iterations : {1, 2, 4, 8, 16}) {
        const learn::LearnedFriction learned = fit(some, iterations);
        loss.x.push_back(iterations);
        loss.y.push_back(learned.training_error);
        if (iterations == 1 || iterations == 4 || iterations == 16) {
            friction.curves.push_back(over_time(fmt::format("network, {} iterations", iterations),
                                                h, learned.friction(h), Curve::Style::dashed));
        }
    }
    Exhibit out{.panels = {std::move(friction),
                           {.title = "training",
                            .x_label = "iterations",
                            .y_label = "relative error",
                            .curves = {loss},
                            .log_x = true,
                            .log_y = true}}};
    out.agreements = {
        at_most("loss after 16 iterations (table 1: training error)", loss.y.back(), 4e-4, 4e-4)};
    out.remark = "The paper's figure is a diagram of the loop; ours is what it does.";
    return out;
}

Exhibit figure_2(const ExhibitSize& /*size*/)
{
    const AdditivePair pair = stored_pair();
    Exhibit out{.columns = {"loss"}, .format = "{:.2e}"};
    for (const auto between :
         {FrictionHistory::Between::constant, FrictionHistory::Between::linear}) {
        const FrictionHistory& h = example(between);
        const std::string kind = between == FrictionHistory::Between::constant
                                     ? "velocity jumps"
                                     : "continuous variation";
        const std::vector<double> learned = friction_along(pair, h, 0);
        const double loss = relative_error(learned, h.friction);
        out.panels.push_back(slip_rates(h, kind));
        out.panels.push_back(
            {.title = fmt::format("loss {:.1e}", loss),
             .x_label = "t [s]",
             .y_label = "f",
             .curves = {over_time("empirical law", h, h.friction),
                        over_time("learned pair", h, learned, Curve::Style::dashed)}});
        out.rows.push_back({.name = kind, .value = {loss}});
        out.agreements.push_back(
            at_most("loss, " + kind + " (table 1: mean of the tests)", loss, 5e-4, 5e-4));
    }
    return out;
}

/// The measurement is not published; in its place the law with noise of the size of its misfit.
Exhibit figure_3(const ExhibitSize& /*size*/)
{
    constexpr double misfit = 0.0015;
    const FrictionHistory& clean = example(FrictionHistory::Between::constant);
    Histories measured{clean};
    add_noise(measured, misfit * RateStateParameters{}.f_star, 101);
    const learn::IdentifiedFriction law =
        learn::identify_ageing_law(measured, 1e-4, Interrupts::flag());
    const std::vector<double> fitted = ageing_friction(law.parameters, clean, law.xi_start);
    const double error = relative_error(fitted, measured[0].friction);
    Curve points = over_time("with noise", measured[0], measured[0].friction, Curve::Style::points);
    points.x = clean.t;
    points.y = measured[0].friction;
    Exhibit out{.panels = {slip_rates(clean, "imposed"),
                           {.title = fmt::format("relative L2 error {:.2g}", error),
                            .x_label = "t [s]",
                            .y_label = "f",
                            .curves = {std::move(points),
                                       over_time("best fit of the law", clean, fitted)}}},
                .columns = {"a", "b", "f*", "D_RS [m]", "error"}};
    const RateStateParameters true_ones;
    const auto row = [&](std::string name, const RateStateParameters& p, double e) {
        out.rows.push_back({.name = std::move(name), .value = {p.a, p.b, p.f_star, p.d_rs, e}});
    };
    row("law behind the noise", true_ones, std::nan(""));
    row("fitted", law.parameters, error);
    out.rows.push_back({"experiment of T. Kim",
                        {std::nan(""), std::nan(""), std::nan(""), std::nan(""), misfit},
                        true});
    out.agreements = {{"relative L2 error of the fit", error, misfit, 0.8 * misfit, 1.2 * misfit}};
    out.remark =
        "The paper's measurement is not published: ours is the law with normal noise as "
        "large as the misfit that the paper prints, so that the error is no finding.";
    return out;
}

/// A curve of Ddag less its value at V*, over V.
template <class Pair>
Curve rate_potential(std::string name, const Pair& pair, double xi, double v_star,
                     Curve::Style style)
{
    Curve out{.name = std::move(name), .x = geometric(1e-7, 1e-3, 81), .style = style};
    const double offset = pair.rate_potential(v_star, xi).value;
    for (const double v : out.x) out.y.push_back(pair.rate_potential(v, xi).value - offset);
    return out;
}

/// (V, xi) of the exact law along a history.
Curve visited(std::string name, const FrictionHistory& h, Curve::Style style)
{
    const RateStateParameters p;
    Curve out{.name = std::move(name), .style = style};
    for (std::size_t i = 0; i < h.t.size(); ++i) {
        out.x.push_back(h.v[i]);
        out.y.push_back((h.friction[i] - p.f_star - p.a * std::log(h.v[i] / p.v_star)) / p.b);
    }
    return out;
}

Exhibit figure_4(const ExhibitSize& /*size*/)
{
    const AdditivePair pair = stored_pair();
    const AgeingPotential<DirectEffect::log> exact;
    const RateStateParameters& p = exact.law().parameters();
    const double unit = p.b / pair.parameters().beta;  // xi of the pair over that of the law
    Panel dual{.title = "D*", .x_label = "d", .y_label = "D*(d)"};
    Curve of_law{.name = "exact: d^2 / (2 b D_RS)", .x = even(-1.5e-5, 1.5e-5, 121)};
    Curve of_pair{.name = "learned", .x = of_law.x, .style = Curve::Style::dashed};
    double off = 0;
    double least_dual = std::numeric_limits<double>::infinity();
    double least_rate = least_dual;
    for (const double d : of_law.x) {
        of_law.y.push_back(exact.dual(d).value);
        const ScalarJet learned = pair.dual(d / unit);
        of_pair.y.push_back(learned.value);
        least_dual = std::min(least_dual, learned.second);
        off = std::max(off, std::fabs(of_pair.y.back() - of_law.y.back()));
    }
    off /= of_law.y.front();
    dual.curves = {of_law, of_pair};
    Panel rate{.title = "Ddag, less its value at V*",
               .x_label = "V [m/s]",
               .y_label = "Ddag",
               .log_x = true};
    for (const double xi : {-2.0, 2.0, 6.0}) {
        rate.curves.push_back(rate_potential(fmt::format("exact, xi = {}", xi), exact, xi, p.v_star,
                                             Curve::Style::line));
        rate.curves.push_back(rate_potential(fmt::format("learned, xi = {}", xi), pair, unit * xi,
                                             p.v_star, Curve::Style::dashed));
        for (const double v : rate.curves.back().x) {
            least_rate = std::min(least_rate, pair.rate_potential(v, unit * xi).vv);
        }
    }
    Panel where{.title = "where the histories go",
                .x_label = "V [m/s]",
                .y_label = "xi",
                .curves = {visited("continuous variation",
                                   example(FrictionHistory::Between::linear), Curve::Style::points),
                           visited("velocity jumps", example(FrictionHistory::Between::constant),
                                   Curve::Style::points)},
                .log_x = true};
    Exhibit out{.panels = {std::move(dual), std::move(rate), std::move(where)}};
    constexpr double inf = std::numeric_limits<double>::infinity();
    out.agreements = {{"least d2D*/dd2: convex", least_dual, std::nan(""), 0, inf},
                      {"least d2Ddag/dV2: convex in V, which the paper's is not", least_rate,
                       std::nan(""), 0, inf},
                      at_most("D* learned against exact, largest difference over largest value",
                              off, std::nan(""), 0.05)};
    out.remark =
        "Drives as large as the ends of D* last for a millisecond after a jump, between two "
        "samples: they hardly count in a fit.";
    return out;
}

/// Correlation of y with x.
double correlation(const std::vector<double>& x, const std::vector<double>& y)
{
    const auto mean = [](const std::vector<double>& v) {
        double sum = 0;
        for (const double value : v) sum += value;
        return sum / static_cast<double>(v.size());
    };
    const double mx = mean(x);
    const double my = mean(y);
    double xx = 0;
    double yy = 0;
    double xy = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - mx) * (x[i] - mx);
        yy += (y[i] - my) * (y[i] - my);
        xy += (x[i] - mx) * (y[i] - my);
    }
    return xy / std::sqrt(xx * yy);
}

Exhibit figure_5(const ExhibitSize& size)
{
    const std::size_t histories = size.full ? 48 : 8;
    const int iterations = size.full ? 100 : 20;
    const FrictionHistory& h = example(FrictionHistory::Between::linear);
    std::array<std::vector<double>, 3> xi;
    Exhibit out{.panels = {{.title = "internal variables", .x_label = "t [s]", .y_label = "xi"},
                           {.title = "one against the others",
                            .x_label = "xi of model 1",
                            .y_label = "xi of models 2, 3"}}};
    for (std::size_t k = 0; k < xi.size(); ++k) {
        xi[k] = fit(part(friction_data().training, k * histories, histories), iterations, k + 1)
                    .internal(h)[0];
        out.panels[0].curves.push_back(
            over_time(fmt::format("model {}", k + 1), h, xi[k],
                      k == 0 ? Curve::Style::line : Curve::Style::dashed));
        if (k == 0) continue;
        out.panels[1].curves.push_back({.name = fmt::format("model {}", k + 1),
                                        .x = xi[0],
                                        .y = xi[k],
                                        .style = Curve::Style::points});
    }
    for (const auto& [i, j] : {std::pair<std::size_t, std::size_t>{0, 1}, {0, 2}, {1, 2}}) {
        out.agreements.push_back({fmt::format("correlation of models {} and {}", i + 1, j + 1),
                                  std::abs(correlation(xi[i], xi[j])), 0.98, 0.98, 1 + 1e-12});
    }
    return out;
}

/// x, V and f of a slider over time.
struct SliderPath {
    std::vector<double> t{}, x{}, v{}, f{};
};

constexpr double slider_end = 2;  // [s]

template <class Law>
SliderPath slide(const Law& law, const SpringSlider& slider)
{
    constexpr int steps = 16384;
    const VariationalStep<Law> step(law, slider.block, 4);
    SliderState s = slider_case_start();
    SliderPath out;
    for (int n = 1; n <= steps; ++n) {
        const double end = slider_end * n / steps;
        const double corner = slider.load.next_corner(s.t);
        if (corner < end) {
            (void)step.take(s, corner - s.t, slider.load);
            s.t = corner;
        }
        if (end > s.t) (void)step.take(s, end - s.t, slider.load);
        s.t = end;
        if (n % 16 != 0) continue;
        out.t.push_back(s.t);
        out.x.push_back(s.x);
        out.v.push_back(s.v);
        out.f.push_back(law.gradient(s.v, s.xi).friction);
    }
    return out;
}

SpringSlider loaded(double ratio, double first, double second)
{
    SpringSlider out;
    const RateStateParameters& p = out.friction;
    out.block.stiffness =
        ratio * critical_stiffness(p, out.block.mass, out.block.normal_force, 2 * p.v_star);
    out.load = SliderLoad(out.block.normal_force * p.f_star / out.block.stiffness,
                          {{0, first * p.v_star}, {0.6, second * p.v_star}});
    return out;
}

FrictionHistory history_of(const SliderPath& path, const RateStateParameters& p)
{
    FrictionHistory h{.between = FrictionHistory::Between::linear};
    for (std::size_t i = 0; i < path.t.size(); i += 10) {
        h.t.push_back(path.t[i]);
        h.v.push_back(path.v[i]);
    }
    h.friction = ageing_friction(p, h);
    return h;
}

/// The slider of figure 7 as it is drawn in the paper, and how it moves.
Exhibit figure_6(const ExhibitSize& /*size*/)
{
    const SpringSlider slider = loaded(1.5, 0.6, 1.8);
    const SliderPath path = slide(AgeingLaw<DirectEffect::log>(), slider);
    Curve spring{.name = "spring: k (x_p - x)", .x = {4, 5}, .y = {0.7, 0.7}};
    for (int i = 0; i < 12; ++i) {
        spring.x.push_back(5 + i / 6.0);
        spring.y.push_back(i % 2 == 0 ? 1.0 : 0.4);
    }
    for (const double x : {7.0, 8.0}) {
        spring.x.push_back(x);
        spring.y.push_back(0.7);
    }
    Curve load{.name = "loading point x_p(t)", .x = path.t};
    Curve stretch{.name = "force of the spring over N", .x = path.t};
    for (std::size_t i = 0; i < path.t.size(); ++i) {
        const double x_p = slider.load(path.t[i]);
        load.y.push_back(x_p - slider.load(0));
        stretch.y.push_back(slider.block.stiffness * (x_p - path.x[i]) / slider.block.normal_force);
    }
    return {
        .panels =
            {{.title = "a block on a spring",
              .x_label = "along the base",
              .y_label = "height",
              .curves = {{.name = "block: mass m", .x = {2, 4, 4, 2, 2}, .y = {0, 0, 1.4, 1.4, 0}},
                         std::move(spring),
                         {.name = "loading point: x_p(t)", .x = {8, 8}, .y = {0.2, 1.2}},
                         {.name = "base: friction N f(V, xi)", .x = {0, 10}, .y = {0, 0}}}},
             {.title = "displacement from the start",
              .x_label = "t [s]",
              .y_label = "[m]",
              .curves = {std::move(load), {.name = "block x(t)", .x = path.t, .y = path.x}}},
             {.title = "what balances",
              .x_label = "t [s]",
              .y_label = "over N",
              .curves = {std::move(stretch),
                         {.name = "friction coefficient",
                          .x = path.t,
                          .y = path.f,
                          .style = Curve::Style::dashed}}}},
        .remark =
            "The paper's figure is a drawing of the set-up; beside ours is its motion under "
            "the loading of figure 7."};
}

Exhibit figure_7(const ExhibitSize& size)
{
    const AgeingLaw<DirectEffect::log> law;
    const SpringSlider slider = loaded(1.5, 0.6, 1.8);
    const learn::LearnedFriction first =
        fit(part(friction_data().training, 0, size.full ? 48 : 16), size.full ? 100 : 30);
    Histories others;
    for (const auto& [ratio, from, to] :
         {std::array{2.0, 1.5, 0.5}, {1.6, 0.7, 1.4}, {3.0, 1.0, 2.0}}) {
        others.push_back(history_of(slide(law, loaded(ratio, from, to)), law.parameters()));
    }
    check_exhibit();
    const learn::LearnedFriction further = learn::train_further(
        first, others,
        {.iterations = 20, .seconds = 600, .target = 1e-9, .cancelled = Interrupts::flag()});
    check_exhibit();
    const std::array names{"empirical law", "trained", "further trained"};
    const std::array paths{slide(law, slider), slide(*first.pair(), slider),
                           slide(*further.pair(), slider)};
    Panel load{.title = "loading point",
               .x_label = "t [s]",
               .y_label = "velocity [m/s]",
               .curves = {{.name = "load",
                           .x = {0, 0.6, 0.6, slider_end},
                           .y = {0.6e-4, 0.6e-4, 1.8e-4, 1.8e-4}}}};
    Exhibit out{.panels = {std::move(load)}, .columns = {"x", "V", "f"}, .format = "{:.1e}"};
    const std::array<std::pair<std::string, std::vector<double> SliderPath::*>, 3> what{
        {{"x [m]", &SliderPath::x}, {"V [m/s]", &SliderPath::v}, {"f", &SliderPath::f}}};
    for (const auto& [label, member] : what) {
        Panel panel{.title = label, .x_label = "t [s]", .y_label = label};
        for (std::size_t k = 0; k < paths.size(); ++k) {
            panel.curves.push_back({.name = names[k],
                                    .x = paths[k].t,
                                    .y = paths[k].*member,
                                    .style = k == 0 ? Curve::Style::line : Curve::Style::dashed});
        }
        out.panels.push_back(std::move(panel));
    }
    const auto error = [&](std::size_t k, std::size_t i) {
        return relative_error(paths[k].*what[i].second, paths[0].*what[i].second);
    };
    for (const std::size_t k : {1U, 2U}) {
        out.rows.push_back({names[k], {error(k, 0), error(k, 1), error(k, 2)}});
    }
    out.rows.push_back({"NN, table 2", {1.9e-5, 2.7e-4, 0.030}, true});
    out.rows.push_back({"NN', table 2", {5.4e-6, 1.6e-4, 0.016}, true});
    out.agreements = {at_most("error of V, trained", error(1, 1), 2.7e-4, 2.7e-4),
                      at_most("error of f, trained", error(1, 2), 0.030, 0.030),
                      at_most("error of f, further trained", error(2, 2), 0.016, 0.016)};
    return out;
}

}  // namespace

const FrictionData& friction_data()
{
    static const FrictionData data = make_friction_data(1);
    return data;
}

Histories part(const Histories& from, std::size_t first, std::size_t count)
{
    const auto begin = from.begin() + static_cast<long>(first);
    return {begin, begin + static_cast<long>(count)};
}

learn::LearnedFriction fit(const Histories& histories, int iterations, std::uint64_t seed)
{
    check_exhibit();
    learn::LearnedFriction out = learn::train_friction(
        histories,
        {.seed = seed, .iterations = iterations, .seconds = 600, .cancelled = Interrupts::flag()});
    check_exhibit();
    return out;
}

Agreement at_most(std::string what, double ours, double paper, double upper)
{
    return {.what = std::move(what), .ours = ours, .paper = paper, .lower = 0, .upper = upper};
}

Paper potentials_paper()
{
    return {.name = "potentials",
            .source =
                "S. Liu, K. Bhattacharya and N. Lapusta, Learning a potential formulation for "
                "rate-and-state friction",
            .exhibits = {
                {ExhibitKind::table, 1, "errors of friction by number of internal variables",
                 potentials_table_1},
                {ExhibitKind::table, 2, "errors inside sliders, before and after transfer",
                 potentials_table_2},
                {ExhibitKind::table, 3, "share of sliders that become unstable by step",
                 potentials_table_3},
                {ExhibitKind::table, 4, "errors in slip rate by step", potentials_table_4},
                {ExhibitKind::figure, 1, "potentials trained by fitting friction", figure_1},
                {ExhibitKind::figure, 2,
                 "two test histories and the friction of learned potentials", figure_2},
                {ExhibitKind::figure, 3, "a fit of the empirical law to a measurement", figure_3},
                {ExhibitKind::figure, 4, "the learned potentials D* and Ddag", figure_4},
                {ExhibitKind::figure, 5, "internal variables of three trainings", figure_5},
                {ExhibitKind::figure, 6, "a block on a spring, loaded at its far end", figure_6},
                {ExhibitKind::figure, 7, "a slider under the empirical law and learned potentials",
                 figure_7},
                {ExhibitKind::figure, 8, "growth of the error in slip rate with the step",
                 potentials_figure_8},
            }};
}

}  // namespace ricochet::app
