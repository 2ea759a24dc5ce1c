#include "ricochet/faults/friction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "base/require.hpp"
#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet {

namespace {

constexpr detail::Refuse refuse_history{"friction history"};

double log_uniform(detail::SplitMix& random, double lower, double upper)
{
    return lower * std::exp(std::log(upper / lower) * random.uniform(0, 1));
}

std::size_t below(detail::SplitMix& random, std::size_t n)
{
    return static_cast<std::size_t>(random.uniform(0, static_cast<double>(n)));
}

/// `n` different sample indices between the first and the last, sorted.
std::vector<std::size_t> instants(detail::SplitMix& random, std::size_t n, std::size_t samples)
{
    std::vector<std::size_t> out;
    while (out.size() < n) {
        const std::size_t i = 1 + below(random, samples - 2);
        if (std::find(out.begin(), out.end(), i) == out.end()) out.push_back(i);
    }
    std::sort(out.begin(), out.end());
    return out;
}

constexpr std::size_t samples = 100;
constexpr double spacing = 0.02;  // [s]

FrictionHistory with_jumps(detail::SplitMix& random, double v_star)
{
    FrictionHistory h{.between = FrictionHistory::Between::constant};
    const std::vector<std::size_t> jumps = instants(random, 1 + below(random, 5), samples);
    double v = v_star * log_uniform(random, 1e-3, 10);
    std::size_t next = 0;
    for (std::size_t n = 0; n < samples; ++n) {
        if (next < jumps.size() && n == jumps[next]) {
            v = v_star * log_uniform(random, 1e-3, 10);
            ++next;
        }
        h.t.push_back(spacing * static_cast<double>(n));
        h.v.push_back(v);
    }
    return h;
}

FrictionHistory with_corners(detail::SplitMix& random, double v_star)
{
    FrictionHistory h{.between = FrictionHistory::Between::linear};
    std::vector<std::size_t> knots = instants(random, 2 + below(random, 7), samples);
    knots.insert(knots.begin(), 0);
    knots.push_back(samples - 1);
    std::vector<double> level;
    for (std::size_t i = 0; i < knots.size(); ++i) {
        level.push_back(v_star * log_uniform(random, 1e-3, 10));
    }
    std::size_t piece = 0;
    for (std::size_t n = 0; n < samples; ++n) {
        if (n > knots[piece + 1]) ++piece;
        const double share = static_cast<double>(n - knots[piece]) /
                             static_cast<double>(knots[piece + 1] - knots[piece]);
        h.t.push_back(spacing * static_cast<double>(n));
        h.v.push_back((1 - share) * level[piece] + share * level[piece + 1]);
    }
    return h;
}

}  // namespace

void validate(const FrictionHistory& history)
{
    const std::size_t n = history.t.size();
    if (n < 2) refuse_history(fmt::format("expected at least two samples, found {}", n));
    if (history.v.size() != n) {
        refuse_history(fmt::format("expected {} slip rates, one for every time, found {}", n,
                                   history.v.size()));
    }
    if (!history.friction.empty() && history.friction.size() != n) {
        refuse_history(
            fmt::format("expected {} friction coefficients, found {}", n, history.friction.size()));
    }
    for (std::size_t i = 0; i < n; ++i) {
        if (i > 0 && !(history.t[i] > history.t[i - 1])) {
            refuse_history(fmt::format("times must rise, found {} s after {} s at sample {}",
                                       history.t[i], history.t[i - 1], i));
        }
        if (!(history.v[i] > 0 && std::isfinite(history.v[i]))) {
            refuse_history(
                fmt::format("slip rates must be positive and finite, found {} m/s at sample {}",
                            history.v[i], i));
        }
        if (!history.friction.empty() && !std::isfinite(history.friction[i])) {
            refuse_history(fmt::format("friction must be finite, found {} at sample {}",
                                       history.friction[i], i));
        }
    }
}

AgeingState advance_ageing(const AgeingState& from, double d_rs, double v0, double v1, double h)
{
    const double slip = h * (v0 + v1) / 2 / d_rs;  // in D_RS
    const double decay = std::exp(-slip);
    AgeingState to{from.theta * decay, from.by_log_l * decay + from.theta * decay * slip};
    if (v0 == v1) {
        const double steady = d_rs / v0;
        to.theta += -steady * std::expm1(-slip);
        // d/dlog L of (L/V)(1 - e^-s), s = V h / L.
        to.by_log_l += steady * (-std::expm1(-slip) - slip * decay);
        return to;
    }
    // Panels in which the exponent changes by at most two; of the past beyond e^-45 nothing
    // remains. Time runs backwards from the end: r = h - t.
    const double slope = (v1 - v0) / h;
    const auto panels = static_cast<int>(std::ceil(std::max(v0, v1) * h / d_rs / 2));
    const double width = h / panels;
    const auto exponent = [&](double r) { return (v1 * r - slope * r * r / 2) / d_rs; };
    using Gauss = boost::math::quadrature::gauss<double, 15>;
    for (int i = 0; i < panels; ++i) {
        const double start = width * i;
        if (exponent(start) > 45) break;
        to.theta += Gauss::integrate([&](double r) { return std::exp(-exponent(r)); }, start,
                                     start + width);
        to.by_log_l += Gauss::integrate(
            [&](double r) { return exponent(r) * std::exp(-exponent(r)); }, start, start + width);
    }
    return to;
}

std::vector<double> ageing_friction(const RateStateParameters& parameters,
                                    const FrictionHistory& history, double xi)
{
    validate(history);
    const AgeingLaw<DirectEffect::log> law(parameters);
    AgeingState state{law.theta_of_xi(xi), 0};
    std::vector<double> out;
    out.reserve(history.t.size());
    for (std::size_t n = 0; n < history.t.size(); ++n) {
        if (n > 0) {
            const double v0 = history.v[n - 1];
            const bool linear = history.between == FrictionHistory::Between::linear;
            state = advance_ageing(state, parameters.d_rs, v0, linear ? history.v[n] : v0,
                                   history.t[n] - history.t[n - 1]);
        }
        out.push_back(law.friction(history.v[n], law.xi_of_theta(state.theta)));
    }
    return out;
}

double relative_error(const std::vector<double>& found, const std::vector<double>& expected)
{
    return relative_error_beyond(found, expected, 0);
}

double relative_error_beyond(const std::vector<double>& found, const std::vector<double>& expected,
                             double f_star)
{
    if (found.size() != expected.size()) {
        throw std::invalid_argument(
            fmt::format("relative_error: {} values beside {}", found.size(), expected.size()));
    }
    double error = 0;
    double size = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
        error += (found[i] - expected[i]) * (found[i] - expected[i]);
        size += (expected[i] - f_star) * (expected[i] - f_star);
    }
    return std::sqrt(error / size);
}

std::vector<FrictionHistory> make_histories(std::size_t count, std::uint64_t seed,
                                            const RateStateParameters& parameters)
{
    validate(parameters);
    detail::SplitMix random(seed);
    std::vector<FrictionHistory> out;
    out.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        out.push_back(i % 2 == 0 ? with_jumps(random, parameters.v_star)
                                 : with_corners(random, parameters.v_star));
        out.back().friction = ageing_friction(parameters, out.back());
    }
    return out;
}

FrictionData make_friction_data(std::uint64_t seed, const RateStateParameters& parameters)
{
    // splitmix64 mixes neighbouring seeds.
    return {make_histories(480, 3 * seed, parameters),
            make_histories(160, 3 * seed + 1, parameters),
            make_histories(160, 3 * seed + 2, parameters)};
}

void add_noise(std::vector<FrictionHistory>& histories, double deviation, std::uint64_t seed)
{
    detail::SplitMix random(seed);
    for (FrictionHistory& history : histories) {
        for (double& f : history.friction) {
            // Box and Muller.
            const double r = std::sqrt(-2 * std::log(1 - random.uniform(0, 1)));
            f += deviation * r * std::cos(2 * std::numbers::pi * random.uniform(0, 1));
        }
    }
}

}  // namespace ricochet
