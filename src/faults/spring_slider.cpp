#include "ricochet/faults/spring_slider.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/require.hpp"
#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet {

SliderLoad::SliderLoad(double start, std::vector<Piece> pieces) : pieces_(std::move(pieces))
{
    if (pieces_.empty()) throw std::invalid_argument("SliderLoad: expected a piece, got none");
    detail::require_finite("SliderLoad", "start", start);
    position_ = {start};
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
        detail::require_finite("SliderLoad", "velocity", pieces_[i].velocity);
        detail::require_finite("SliderLoad", "time", pieces_[i].t);
        if (i == 0) continue;
        const double duration = pieces_[i].t - pieces_[i - 1].t;
        if (!(duration > 0)) {
            throw std::invalid_argument(
                fmt::format("SliderLoad: times must rise, got {} s after {} s", pieces_[i].t,
                            pieces_[i - 1].t));
        }
        position_.push_back(position_.back() + pieces_[i - 1].velocity * duration);
    }
}

double SliderLoad::next_corner(double t) const noexcept
{
    for (const Piece& piece : pieces_) {
        if (piece.t > t && &piece != &pieces_.front()) return piece.t;
    }
    return std::numeric_limits<double>::infinity();
}

std::string_view name(SliderEventKind kind) noexcept
{
    switch (kind) {
        case SliderEventKind::onset: return "onset";
        case SliderEventKind::arrest: return "arrest";
        case SliderEventKind::reversal: return "reversal";
    }
    return "";
}

namespace {

void validate_options(const SliderOptions& o)
{
    constexpr std::string_view name = "run_slider";
    detail::require_positive(name, "t_end", o.t_end);
    detail::require_not_negative(name, "step", o.step);
    detail::require_positive(name, "rtol", o.rtol);
    detail::require_positive(name, "first_step", o.first_step);
    detail::require_not_negative(name, "threshold", o.threshold);
}

SliderState between(const SliderState& a, const SliderState& b, const SliderState& slope_a,
                    const SliderState& slope_b, double t)
{
    const double h = b.t - a.t;
    const double s = (t - a.t) / h;
    const auto cubic = [&](double p, double q, double p_rate, double q_rate) {
        const double r = 1 - s;
        return r * r * (1 + 2 * s) * p + s * s * (3 - 2 * s) * q +
               s * r * h * (r * p_rate - s * q_rate);
    };
    return {t, cubic(a.x, b.x, slope_a.x, slope_b.x), cubic(a.v, b.v, slope_a.v, slope_b.v),
            cubic(a.xi, b.xi, slope_a.xi, slope_b.xi)};
}

/// One run of a slider with a law of a certain type.
template <class Law>
class SliderLoop {
public:
    SliderLoop(const SpringSlider& slider, const SliderOptions& options)
        : slider_(slider),
          options_(options),
          law_(slider.friction),
          step_(law_, slider.block, options.order),
          stopping_(law_, slider.block, 2)
    {
        validate_options(options);
    }

    SliderRun run(const SliderState& start)
    {
        const double t_end = start.t + options_.t_end;
        out_.state = start;
        spacing_ =
            options_.samples > 1 ? options_.t_end / static_cast<double>(options_.samples - 1) : 0;
        sample_until(start, start, start.t);
        double h = options_.step > 0 ? options_.step : options_.first_step;
        while (out_.state.t < t_end) {
            if (out_.steps >= options_.max_steps) return stop(Outcome::step_limit);
            if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
                return stop(Outcome::cancelled);
            }
            const double stop_at = std::min(t_end, slider_.load.next_corner(out_.state.t));
            const double room = stop_at - out_.state.t;
            // A step that would leave a remainder below a millionth of its length goes to the end.
            const bool to_stop = h > room * (1 - 1e-6);
            const double taken = to_stop ? room : h;
            SliderState to = out_.state;
            const StepReport report = take(to, taken);
            if (!std::isfinite(to.x + to.v + to.xi)) return stop(Outcome::non_finite);
            if (options_.step == 0) {
                const double error = report.solved() ? norm(report.error, to) : 1e6;
                const double factor =
                    0.9 * std::pow(std::max(error, 1e-10), -1.0 / estimate_order());
                if (error > 1) {
                    const double shorter = taken * std::clamp(factor, 0.1, 0.9);
                    if (shorter < 1e-14 * std::abs(out_.state.t) + 1e-300) {
                        if (!misses_slip_rate(report, to) || ++shortest_ > 1000) {
                            return stop(Outcome::step_underflow);
                        }
                        // By order 2, since order 4 may leave it creeping.
                        to = out_.state;
                        const StepReport last = stopping_.take(to, taken, slider_.load);
                        if (!last.solved()) return stop(Outcome::step_underflow);
                        if (to_stop) to.t = stop_at;
                        accept(to, last);
                        h = taken;
                        continue;
                    }
                    ++out_.rejected;
                    h = shorter;
                    continue;
                }
                shortest_ = 0;
                h = (to_stop ? std::max(h, taken) : taken) * std::clamp(factor, 0.2, 5.0);
            } else if (!report.solved()) {
                return stop(Outcome::not_converged);
            }
            if (to_stop) to.t = stop_at;
            accept(to, report);
        }
        out_.outcome = Outcome::reached_end;
        return std::move(out_);
    }

private:
    [[nodiscard]] double estimate_order() const { return options_.order == 1 ? 2 : options_.order; }

    /// A step; at order 1 under error control it is two halves, whose difference from the
    /// whole is the estimate.
    StepReport take(SliderState& to, double h) const
    {
        if (options_.order > 1 || options_.step > 0) return step_.take(to, h, slider_.load);
        SliderState whole = to;
        StepReport report = step_.take(whole, h, slider_.load);
        for (int half = 0; half < 2; ++half) {
            const StepReport r = step_.take(to, h / 2, slider_.load);
            report.iterations += r.iterations;
            report.most_iterations = std::max(report.most_iterations, r.most_iterations);
            report.unsolved += r.unsolved;
            report.not_convex += r.not_convex;
            report.residual = std::max(report.residual, r.residual);
        }
        report.error = {0, to.x - whole.x, to.v - whole.v, to.xi - whole.xi};
        return report;
    }

    [[nodiscard]] double norm(const SliderState& e, const SliderState& to) const
    {
        const RateStateParameters& p = slider_.friction;
        const double x = std::abs(e.x) / (std::abs(to.x) + p.d_rs);
        const double v =
            std::abs(e.v) / (std::max(std::abs(to.v), std::abs(out_.state.v)) + 1e-6 * p.v_star);
        return std::max({x, v, std::abs(e.xi)}) / options_.rtol;
    }

    /// Whether only the slip rate of a step misses the tolerance. Where a block stops or turns back
    /// it may change by decades within the resolution of time, and no shorter step is better.
    [[nodiscard]] bool misses_slip_rate(const StepReport& report, const SliderState& to) const
    {
        SliderState rest = report.error;
        rest.v = 0;
        return report.solved() && norm(rest, to) <= 1;
    }

    void accept(const SliderState& to, const StepReport& report)
    {
        ++out_.steps;
        out_.iterations += static_cast<std::size_t>(report.iterations);
        const int stages = options_.order == 4   ? 5
                           : options_.order == 2 ? 2
                           : options_.step > 0   ? 1
                                                 : 3;
        out_.stages += static_cast<std::size_t>(stages);
        out_.most_iterations = std::max(out_.most_iterations, report.most_iterations);
        out_.unsolved += static_cast<std::size_t>(report.unsolved);
        out_.not_convex += static_cast<std::size_t>(report.not_convex);
        out_.residual = std::max(out_.residual, report.residual);
        const SliderState from = out_.state;
        const auto known = static_cast<std::ptrdiff_t>(out_.events.size());
        if (options_.threshold > 0) {
            locate(from, to, options_.threshold, SliderEventKind::onset, SliderEventKind::arrest);
        }
        locate(from, to, 0, SliderEventKind::reversal, SliderEventKind::reversal);
        std::ranges::stable_sort(out_.events.begin() + known, out_.events.end(), {},
                                 [](const SliderEvent& event) { return event.at.t; });
        sample_until(from, to, to.t);
        out_.state = to;
    }

    [[nodiscard]] SliderState slope(const SliderState& s) const
    {
        const FrictionAndRate f = law_.evaluate(s.v, s.xi);
        const SpringBlock& b = slider_.block;
        return {1, s.v,
                (b.stiffness * (slider_.load(s.t) - s.x) - b.normal_force * f.friction) / b.mass,
                f.rate};
    }

    /// The crossings of `level` by the slip rate within a step.
    void locate(const SliderState& from, const SliderState& to, double level, SliderEventKind up,
                SliderEventKind down)
    {
        // If the step starts on the level, the side is taken from its end.
        const double start = from.v == level ? to.v : from.v;
        if ((start - level) * (to.v - level) < 0 || (to.v == level && start != level)) {
            add(from, level, 0, to.t - from.t, start < level ? up : down);
            return;
        }
        const double turn = turning_point(from, to);
        if (!(turn > 0)) return;
        SliderState middle = from;
        (void)step_.take(middle, turn, slider_.load);
        if ((start - level) * (middle.v - level) < 0) {
            add(from, level, 0, turn, start < level ? up : down);
            add(from, level, turn, to.t - from.t, start < level ? down : up);
        }
    }

    /// Place where the cubic through slip rates and accelerations turns, after `from`; else 0.
    [[nodiscard]] double turning_point(const SliderState& from, const SliderState& to) const
    {
        const double h = to.t - from.t;
        const double a = h * slope(from).v;
        const double b = h * slope(to).v;
        const double c = to.v - from.v;
        if (!(a * b < 0)) return 0;
        // v' = a + 2 q s + r s^2 over the step, s in [0, 1].
        const double q = 3 * c - 2 * a - b;
        const double r = 3 * (a + b - 2 * c);
        const double m = -(q + std::copysign(std::sqrt(std::max(q * q - a * r, 0.0)), q));
        for (const double s : {a / m, m / r}) {
            if (s > 0 && s < 1) return s * h;
        }
        return 0;
    }

    void add(const SliderState& from, double level, double lower, double upper,
             SliderEventKind kind)
    {
        SliderState at = from;
        const auto gap = [&](double h) {
            at = from;
            if (h > 0) (void)step_.take(at, h, slider_.load);
            return at.v - level;
        };
        const double g_lower = gap(lower);
        const double g_upper = gap(upper);
        double time = upper;
        if (g_lower * g_upper < 0) {
            std::uintmax_t calls = 100;
            time = boost::math::tools::toms748_solve(gap, lower, upper, g_lower, g_upper,
                                                     boost::math::tools::eps_tolerance<double>(52),
                                                     calls)
                       .second;
        }
        (void)gap(time);
        out_.events.push_back({kind, at});
    }

    void sample_until(const SliderState& from, const SliderState& to, double until)
    {
        const double start = out_.samples.empty() ? from.t : first_;
        first_ = start;
        while (out_.samples.size() < options_.samples) {
            const std::size_t n = out_.samples.size();
            const double t = n + 1 == options_.samples && n > 0
                                 ? start + options_.t_end
                                 : start + spacing_ * static_cast<double>(n);
            if (t > until) return;
            out_.samples.push_back(t == to.t || from.t == to.t ? to : inside(from, to, t));
        }
    }

    /// The state inside a step, from a step of shorter length. While the block sticks, its slip
    /// rate is far below the rounding of the accelerations, from which a polynomial would follow.
    [[nodiscard]] SliderState inside(const SliderState& from, const SliderState& to, double t) const
    {
        SliderState at = from;
        if (!take(at, t - from.t).solved()) at = between(from, to, slope(from), slope(to), t);
        at.t = t;
        return at;
    }

    SliderRun stop(Outcome outcome)
    {
        out_.outcome = outcome;
        return std::move(out_);
    }

    const SpringSlider& slider_;
    const SliderOptions& options_;
    Law law_;
    VariationalStep<Law> step_;
    VariationalStep<Law> stopping_;  // brings the block to rest
    SliderRun out_{};
    double spacing_ = 0, first_ = 0;
    int shortest_ = 0;  // number of consecutive steps of the shortest length
};

}  // namespace

SliderRun run_slider(const SpringSlider& slider, const SliderState& start,
                     const SliderOptions& options)
{
    for (const double component : {start.t, start.x, start.v, start.xi}) {
        detail::require_finite("run_slider", "start", component);
    }
    switch (slider.evolution) {
        case StateEvolution::slip: return SliderLoop<SlipLaw<>>(slider, options).run(start);
        case StateEvolution::prz: return SliderLoop<PrzLaw<>>(slider, options).run(start);
        case StateEvolution::ageing: break;
    }
    return SliderLoop<AgeingLaw<>>(slider, options).run(start);
}

double slider_friction(const SpringSlider& slider, const SliderState& state)
{
    return AgeingLaw<>(slider.friction).friction(state.v, state.xi);
}

std::vector<SliderCase> slider_cases(std::uint64_t seed)
{
    constexpr int soft = 35;
    constexpr int all = 77;
    detail::SplitMix random(seed);
    const auto log_uniform = [&](double lower, double upper) {
        return lower * std::exp(std::log(upper / lower) * random.uniform(0, 1));
    };
    std::vector<SliderCase> cases;
    for (int i = 0; i < all; ++i) {
        SliderCase c;
        const RateStateParameters& p = c.slider.friction;
        const double velocity = p.v_star * log_uniform(0.5, 2);
        c.stiffness_ratio = i < soft ? log_uniform(0.2, 0.95) : log_uniform(1.05, 5);
        SpringBlock& block = c.slider.block;
        block.stiffness =
            c.stiffness_ratio * critical_stiffness(p, block.mass, block.normal_force, velocity);
        c.slider.load = SliderLoad(block.normal_force * p.f_star / block.stiffness, velocity);
        cases.push_back(c);
    }
    return cases;
}

SliderState slider_case_start() noexcept
{
    return {.t = 0, .x = 0, .v = RateStateParameters{}.v_star, .xi = 0};
}

}  // namespace ricochet
