#include "baselines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "base/require.hpp"

namespace ricochet {

namespace {

using State = std::array<double, 3>;  // x, V, theta or xi

State operator+(const State& a, const State& b)
{
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
State operator*(double s, const State& a)
{
    return {s * a[0], s * a[1], s * a[2]};
}

struct Flow {
    const SpringSlider& slider;
    StateForm form;

    State operator()(double t, const State& y) const
    {
        const RateStateParameters& p = slider.friction;
        const SpringBlock& b = slider.block;
        const double v = y[1];
        double friction = 0;
        double rate = 0;
        if (form == StateForm::theta) {
            friction =
                p.f_star + p.a * std::log(v / p.v_star) + p.b * std::log(p.v_star * y[2] / p.d_rs);
            rate = 1 - v * y[2] / p.d_rs;
        } else {
            // dDdag/dV and dDdag/dxi of AgeingPotential, without the check that refuses V <= 0.
            friction = p.f_star + p.a * std::log(v / p.v_star) + p.b * y[2];
            const double d = p.b * p.v_star * std::exp(-y[2]) - p.b * v;
            rate = d / (p.b * p.d_rs);
        }
        const double pull = b.stiffness * (slider.load(t) - y[0]);
        return {v, (pull - b.normal_force * friction) / b.mass, rate};
    }
};

/// The 3/8 rule.
State rk4(const Flow& flow, double t, const State& y, double h)
{
    const State k1 = flow(t, y);
    const State k2 = flow(t + h / 3, y + (h / 3) * k1);
    const State k3 = flow(t + 2 * h / 3, y + (-h / 3) * k1 + h * k2);
    const State k4 = flow(t + h, y + h * k1 + (-h) * k2 + h * k3);
    return y + (h / 8) * (k1 + 3 * k2 + 3 * k3 + k4);
}

/// Coefficients of backward differences: of the predictor 1, 1/2, 5/12, ..., of the
/// corrector 1, -1/2, -1/12, ... (E. Hairer, S. P. Norsett and G. Wanner, Solving Ordinary
/// Differential Equations I, eqs. III.1.7 and III.1.12).
std::array<double, 13> differences(bool implicit)
{
    std::array<double, 13> gamma{};
    for (std::size_t j = 0; j < gamma.size(); ++j) {
        gamma[j] = implicit && j > 0 ? 0 : 1;
        for (std::size_t i = 0; i < j; ++i) gamma[j] -= gamma[i] / static_cast<double>(j + 1 - i);
    }
    return gamma;
}

/// The same as weights of the values themselves, newest first.
std::array<double, 13> weights(std::size_t order, bool implicit)
{
    const std::array<double, 13> gamma = differences(implicit);
    std::array<double, 13> w{};
    for (std::size_t j = 0; j < order; ++j) {
        double binomial = 1;
        for (std::size_t i = 0; i <= j; ++i) {
            w[i] += gamma[j] * binomial;
            binomial *= -static_cast<double>(j - i) / static_cast<double>(i + 1);
        }
    }
    return w;
}

class Adams {
public:
    Adams(const Flow& flow, const BaselineOptions& options) : flow_(flow), options_(options)
    {
        for (std::size_t k = 1; k <= 12; ++k) {
            predictor_[k] = weights(k, false);
            corrector_[k] = weights(k, true);
        }
    }

    State step(double t, const State& y, double h)
    {
        std::rotate(history_.begin(), history_.end() - 1, history_.end());
        history_[0] = flow_(t, y);
        known_ = std::min(known_ + 1, static_cast<std::size_t>(options_.adams_order) - 1);
        if (known_ < 3) return rk4(flow_, t, y, h);
        State change{};
        for (std::size_t i = 0; i < known_; ++i) {
            change = change + (h * predictor_[known_][i]) * history_[i];
        }
        State past{};
        for (std::size_t i = 0; i < known_; ++i) {
            past = past + (h * corrector_[known_ + 1][i + 1]) * history_[i];
        }
        for (int i = 0; i < options_.corrections; ++i) {
            const State before = change;
            change = (h * corrector_[known_ + 1][0]) * flow_(t + h, y + change) + past;
            if (close(before, change)) break;
        }
        return y + change;
    }

private:
    [[nodiscard]] bool close(const State& a, const State& b) const
    {
        for (std::size_t i = 0; i < a.size(); ++i) {
            const double tolerance =
                options_.atol + options_.rtol * std::max(std::abs(a[i]), std::abs(b[i]));
            if (!(std::abs(a[i] - b[i]) < tolerance)) return false;
        }
        return true;
    }

    Flow flow_;
    BaselineOptions options_;
    std::array<std::array<double, 13>, 13> predictor_{}, corrector_{};
    std::array<State, 12> history_{};
    std::size_t known_ = 0;
};

/// Backward Euler, whose two equations in (V, theta) are solved by plain Newton's method.
State newton_step(const Flow& flow, double t, const State& y, double h)
{
    const RateStateParameters& p = flow.slider.friction;
    const SpringBlock& b = flow.slider.block;
    double v = y[1];
    double state = y[2];
    for (int i = 0; i < 50; ++i) {
        const State now{y[0] + h * v, v, state};
        const State f = flow(t + h, now);
        const double r1 = v - y[1] - h * f[1];
        const double r2 = state - y[2] - h * f[2];
        const bool theta = flow.form == StateForm::theta;
        const double a11 = 1 + h * (b.stiffness * h + b.normal_force * p.a / v) / b.mass;
        const double a12 = h * b.normal_force / b.mass * (theta ? p.b / state : p.b);
        const double a21 = h / p.d_rs * (theta ? state : 1);
        const double a22 = 1 + h / p.d_rs * (theta ? v : p.v_star * std::exp(-state));
        const double determinant = a11 * a22 - a12 * a21;
        const double dv = (r1 * a22 - r2 * a12) / determinant;
        const double ds = (a11 * r2 - a21 * r1) / determinant;
        v -= dv;
        state -= ds;
        if (std::abs(dv) <= 1e-12 * std::abs(v) && std::abs(ds) <= 1e-12 * std::abs(state)) {
            return {y[0] + h * v, v, state};
        }
        if (!std::isfinite(v + state)) break;
    }
    const double nan = std::nan("");
    return {nan, nan, nan};
}

}  // namespace

BaselineRun run_baseline(const SpringSlider& slider, const SliderState& start,
                         const BaselineOptions& options)
{
    constexpr std::string_view name = "run_baseline";
    detail::require_positive(name, "step", options.step);
    detail::require_positive(name, "t_end", options.t_end);
    detail::require(options.adams_order >= 4 && options.adams_order <= 12, name, "adams_order",
                    "lie in [4, 12]", options.adams_order);
    const AgeingLaw<DirectEffect::log> law(slider.friction);
    const Flow flow{slider, options.form};
    const bool theta = options.form == StateForm::theta;
    State y{start.x, start.v, theta ? law.theta_of_xi(start.xi) : start.xi};
    Adams adams(flow, options);
    BaselineRun out;
    const auto steps = std::max(1L, std::lround(options.t_end / options.step));
    for (long n = 0; n < steps; ++n) {
        const double t = start.t + static_cast<double>(n) * options.step;
        switch (options.method) {
            case Baseline::rk4: y = rk4(flow, t, y, options.step); break;
            case Baseline::adams: y = adams.step(t, y, options.step); break;
            case Baseline::backward_euler: y = newton_step(flow, t, y, options.step); break;
        }
        if (!std::isfinite(y[0] + y[1] + y[2]) || std::abs(y[1]) > 1e6 * slider.friction.v_star) {
            return out;
        }
        out.velocity.push_back(y[1]);
    }
    out.stable = true;
    return out;
}

}  // namespace ricochet
