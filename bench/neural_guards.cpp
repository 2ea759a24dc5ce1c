// Guards that are networks: what a proof that no event is lost costs beside a check of the ends of
// steps.
//
//     ricochet_neural_guards              times beside Ends and Extremum
//     ricochet_neural_guards --orbits N   crossings that are lost, of N random networks and orbits
//
// The networks are fitted here, from a fixed seed: a distance from six posts in the plane, and that
// of a planar arm of six joints from eight discs.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "neural_orbits.hpp"
#include "ricochet/enclosed.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nn/guard_network.hpp"

namespace ricochet {
namespace {

using Matrix = Eigen::MatrixXd;

/// Processor time of this thread [s], so that waiting for other programs is not counted.
[[nodiscard]] double seconds()
{
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// --- fitted networks ---

/// A row of inputs, and the distance there.
using Sample = std::function<double(std::mt19937_64&, double* x)>;

/// One fully connected layer with Adam's moments.
class FittedLayer {
public:
    FittedLayer(Eigen::Index inputs, Eigen::Index outputs, std::mt19937_64& random)
        : weight_(outputs, inputs),
          bias_(Matrix::Zero(outputs, 1)),
          first_(Matrix::Zero(outputs, inputs + 1)),
          second_(first_)
    {
        std::normal_distribution<double> normal(0, std::sqrt(2.0 / static_cast<double>(inputs)));
        for (double& w : weight_.reshaped()) w = normal(random);
    }

    [[nodiscard]] Matrix forward(const Matrix& x) const
    {
        return (weight_ * x).colwise() + bias_.col(0);
    }
    [[nodiscard]] Matrix backward(const Matrix& d) const { return weight_.transpose() * d; }

    void learn(const Matrix& d, const Matrix& x, double rate, int step)
    {
        Matrix gradient(weight_.rows(), weight_.cols() + 1);
        gradient << d * x.transpose(), d.rowwise().sum();
        first_ = 0.9 * first_ + 0.1 * gradient;
        second_ = 0.999 * second_ + 0.001 * gradient.cwiseAbs2();
        const double a = rate / (1 - std::pow(0.9, step));
        const double b = 1 / (1 - std::pow(0.999, step));
        const Matrix change = (a * first_.array() / ((b * second_.array()).sqrt() + 1e-8)).matrix();
        weight_ -= change.leftCols(weight_.cols());
        bias_ -= change.rightCols(1);
    }

    [[nodiscard]] DenseLayer dense() const
    {
        DenseLayer layer{static_cast<std::size_t>(weight_.cols()),
                         static_cast<std::size_t>(weight_.rows()),
                         {},
                         {}};
        for (Eigen::Index j = 0; j < weight_.rows(); ++j) {
            for (Eigen::Index i = 0; i < weight_.cols(); ++i) layer.weight.push_back(weight_(j, i));
            layer.bias.push_back(bias_(j, 0));
        }
        return layer;
    }

private:
    Matrix weight_, bias_, first_, second_;
};

[[nodiscard]] Matrix activated(Activation activation, const Matrix& z, Matrix& rate)
{
    if (activation == Activation::relu) {
        rate = (z.array() > 0).cast<double>();
        return z.cwiseMax(0);
    }
    if (activation == Activation::tanh) {
        const Matrix y = z.array().tanh();
        rate = 1 - y.array().square();
        return y;
    }
    const Matrix s = 1 / (1 + (-z.array()).exp());
    rate = s.array() * (1 + z.array() * (1 - s.array()));
    return z.array() * s.array();
}

/// A network with two hidden layers of 64, by Adam on the mean square of its error.
[[nodiscard]] Model fitted(std::size_t inputs, Activation activation, int steps,
                           const Sample& sample)
{
    constexpr Eigen::Index batch = 256;
    std::mt19937_64 random(1);
    const auto n = static_cast<Eigen::Index>(inputs);
    std::vector<FittedLayer> layers{{n, 64, random}, {64, 64, random}, {64, 1, random}};
    Matrix x(n, batch), d(1, batch);
    double error = 0;
    for (int k = 1; k <= steps; ++k) {
        for (Eigen::Index c = 0; c < batch; ++c) d(0, c) = sample(random, x.col(c).data());
        Matrix rate1, rate2;
        const Matrix y1 = activated(activation, layers[0].forward(x), rate1);
        const Matrix y2 = activated(activation, layers[1].forward(y1), rate2);
        const Matrix e = layers[2].forward(y2) - d;
        const double pace = 0.5 * (1 + std::cos(std::numbers::pi * k / steps));
        const double rate = 3e-3 * pace + 1e-5;
        const Matrix d3 = e / static_cast<double>(batch);
        const Matrix d2 = layers[2].backward(d3).cwiseProduct(rate2);
        const Matrix d1 = layers[1].backward(d2).cwiseProduct(rate1);
        layers[2].learn(d3, y2, rate, k);
        layers[1].learn(d2, y1, rate, k);
        layers[0].learn(d1, x, rate, k);
        error = std::sqrt(e.squaredNorm() / static_cast<double>(batch));
    }
    Model model;
    model.kind = "guard";
    model.activation = activation;
    for (const FittedLayer& layer : layers) model.layers.push_back(layer.dense());
    fmt::print("  fitted {}-64-64-1 {}: rms error {:.3f}\n", inputs, name(activation), error);
    return model;
}

/// Post k of six in the plane.
[[nodiscard]] std::array<double, 2> post(int k)
{
    const double r = 0.35 + 0.1 * k, angle = 2.39996 * k + 0.4;
    return {r * std::cos(angle), 0.8 * r * std::sin(angle)};
}

/// Distance from the posts, of radius 0.09.
[[nodiscard]] double distance_from_posts(const double* x)
{
    double least = 10;
    for (int k = 0; k < 6; ++k) {
        const auto at = post(k);
        least = std::min(least, std::hypot(x[0] - at[0], x[1] - at[1]));
    }
    return least - 0.09;
}

[[nodiscard]] Model posts(Activation activation, int steps)
{
    return fitted(2, activation, steps, [](std::mt19937_64& random, double* x) {
        std::uniform_real_distribution<double> u(-1, 1);
        std::normal_distribution<double> near(0, 0.15);
        x[0] = 2 * u(random);
        x[1] = 1.5 * u(random);
        if (u(random) > 0) {
            const auto at = post(static_cast<int>(random() % 6));
            x[0] = at[0] + near(random);
            x[1] = at[1] + near(random);
        }
        return distance_from_posts(x);
    });
}

/// Distance of a planar arm, of six links of 1/3, from eight discs.
[[nodiscard]] double distance_of_arm(const double* q)
{
    double x = 0, y = 0, angle = 0, least = 10;
    for (int j = 0; j < 6; ++j) {
        angle += q[j];
        const double dx = std::cos(angle) / 3, dy = std::sin(angle) / 3;
        for (int k = 0; k < 8; ++k) {
            const double r = 0.8 + 0.15 * k, a = 2.39996 * k;
            const double px = r * std::cos(a) - x, py = r * std::sin(a) - y;
            const double part = std::clamp((px * dx + py * dy) * 9, 0.0, 1.0);
            least = std::min(least, std::hypot(px - part * dx, py - part * dy) - 0.1);
        }
        x += dx;
        y += dy;
    }
    return least;
}

[[nodiscard]] Model arm(Activation activation, int steps)
{
    return fitted(6, activation, steps, [](std::mt19937_64& random, double* q) {
        std::uniform_real_distribution<double> u(-1, 1);
        q[0] = std::numbers::pi * u(random);
        for (int j = 1; j < 6; ++j) q[j] = 1.2 * u(random);
        return distance_of_arm(q);
    });
}

// --- systems ---

/// A mass on two springs that rebounds from a learned surface.
struct Posts {
    using State = std::array<double, 4>;
    GuardNetwork surface;
    std::uint32_t stop_after = 0;

    template <class S>
    void flow(const S&, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt = {x[2], x[3], -x[0], -2.0 * x[1]};
    }
    template <class S>
    [[nodiscard]] S guard(const S&, const std::array<S, 4>& x) const
    {
        return surface(x[0], x[1]);
    }
    void reset(double, State& x) const
    {
        const auto n = surface.normal(x[0], x[1]);
        const double v = x[2] * n[0] + x[3] * n[1];
        if (v >= 0) return;
        x[2] -= 2 * v * n[0];
        x[3] -= 2 * v * n[1];
    }
    [[nodiscard]] GuardInfo guard_info() const { return {.stop_after = stop_after}; }
};

/// The same motion without the surface.
struct Springs {
    using State = Posts::State;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], -x[0], -2 * x[1]}; }
};

/// Six joints that swing; crossings of a learned distance are recorded.
struct Arm {
    using State = std::array<double, 12>;
    static constexpr bool resets = false;
    static constexpr std::array<double, 6> frequency{.31, .53, .71, .97, 1.19, 1.37};  // [rad/s]
    GuardNetwork distance;

    template <class S>
    void flow(const S&, const std::array<S, 12>& x, std::array<S, 12>& dxdt) const
    {
        for (std::size_t i = 0; i < 6; ++i) {
            dxdt[i] = x[6 + i];
            dxdt[6 + i] = -frequency[i] * frequency[i] * x[i];
        }
    }
    /// Of a view, so that no more components are enclosed than are read.
    template <class X>
    [[nodiscard]] ScalarOf<X> guard(const ScalarOf<X>&, const X& x) const
    {
        return distance(x[0], x[1], x[2], x[3], x[4], x[5]);
    }
    [[nodiscard]] static GuardInfo guard_info() { return {.crossing = Crossing::either}; }
    [[nodiscard]] static State start()
    {
        State x{};
        for (std::size_t i = 0; i < 6; ++i) {
            const double size = i == 0 ? 3 : 1.1, phase = static_cast<double>(i);
            x[i] = size * std::sin(phase);
            x[6 + i] = size * frequency[i] * std::cos(phase);
        }
        return x;
    }
};

struct FreeArm {
    using State = Arm::State;
    void flow(double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < 6; ++i) {
            dxdt[i] = x[6 + i];
            dxdt[6 + i] = -Arm::frequency[i] * Arm::frequency[i] * x[i];
        }
    }
};

// --- rows ---

struct Row {
    double time = 0;  ///< [s]
    Statistics counts;
};

/// The shortest of `repeats` times of a run.
template <class Run>
[[nodiscard]] Row measure(int repeats, const Run& run)
{
    Row row;
    for (int k = 0; k < repeats; ++k) {
        const double start = seconds();
        const Statistics counts = run();
        const double time = seconds() - start;
        if (k == 0 || time < row.time) row = {time, counts};
    }
    return row;
}

/// @param bare  the run without a guard
void print(const std::string& name, const Row& row, const Row& bare, const Row& ends)
{
    const Statistics& c = row.counts;
    const double steps = static_cast<double>(c.steps);
    const auto& e = c.evidence;
    const double all = static_cast<double>(e.proved + e.checked + e.gated + e.assumed);
    fmt::print(
        "  {:10} {:7.3f} us a step, {:5.3f} of Ends; for the guard {:7.3f} us, {:5.3f}; "
        "{:6.3f} calls, {:6.3f} enclosures a step; {:5} events; proved {:5.1f} %\n",
        name, 1e6 * row.time / steps, row.time / ends.time, 1e6 * (row.time - bare.time) / steps,
        (row.time - bare.time) / (ends.time - bare.time),
        static_cast<double>(c.guard_calls) / steps, static_cast<double>(c.bound_calls) / steps,
        c.events, all > 0 ? 100 * static_cast<double>(e.proved) / all : 0);
}

template <class System, class Free, class State>
void compare(const std::string& title, const System& system, const Free& free, const State& x0,
             const Options& options, int repeats)
{
    fmt::print("{}\n", title);
    const auto run = [&](const auto& of, const auto& detector) {
        return measure(repeats, [&] {
            return integrate(of, x0, options, FixedStep<Rk4>{}, detector).statistics;
        });
    };
    const Row bare =
        measure(repeats, [&] { return integrate(free, x0, options, FixedStep<Rk4>{}).statistics; });
    const Row ends = run(system, Ends{});
    print("no guard", bare, bare, ends);
    print("Ends", ends, bare, ends);
    print("Extremum", run(system, Extremum{}), bare, ends);
    print("Enclosed", run(system, Enclosed{}), bare, ends);
}

/// Flights up to the first event, by dopri5 under error control.
void compare_flights(const std::string& title, const GuardNetwork& surface, int flights)
{
    fmt::print("{}\n", title);
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> u(-1, 1);
    std::vector<Posts::State> starts;
    while (starts.size() < static_cast<std::size_t>(flights)) {
        const Posts::State x{1.2 * u(random), 0.9 * u(random), 1.2 * u(random), 1.2 * u(random)};
        if (surface(x[0], x[1]) > 0.03) starts.push_back(x);
    }
    const Options options{.t_end = 20, .rtol = 1e-8, .atol = 1e-8};
    const auto run = [&](const auto& system, const auto& detector) {
        return measure(2, [&] {
            Statistics sum;
            for (const Posts::State& x0 : starts) {
                const auto flight =
                    integrate(system, x0, options, ErrorControlled<Dopri5>{}, detector);
                const Statistics& c = flight.statistics;
                sum.steps += c.steps;
                sum.guard_calls += c.guard_calls;
                sum.bound_calls += c.bound_calls;
                sum.events += c.events;
                sum.evidence.proved += c.evidence.proved;
                sum.evidence.checked += c.evidence.checked;
                sum.evidence.assumed += c.evidence.assumed;
            }
            return sum;
        });
    };
    const Posts first{surface, 1};
    const Row extremum = run(first, Extremum{});
    // Without a guard every flight takes 20 s: its time a step is taken.
    Row bare = run(Springs{}, Extremum{});
    bare.time *=
        static_cast<double>(extremum.counts.steps) / static_cast<double>(bare.counts.steps);
    const Row enclosed = run(first, Enclosed{});
    fmt::print("  (of Extremum in place of Ends)\n");
    print("no guard", bare, bare, extremum);
    print("Extremum", extremum, bare, extremum);
    print("Ends", run(first, Ends{}), bare, extremum);
    print("Enclosed", enclosed, bare, extremum);
}

void compare_all(int fit_steps, int repeats)
{
    for (const Activation activation : {Activation::relu, Activation::tanh, Activation::silu}) {
        const GuardNetwork surface(posts(activation, fit_steps));
        const std::string kind(name(activation));
        const Posts::State x0{0.1, -0.2, 1.0, 0.7};
        for (const double step : {5e-3, 1e-3}) {
            const Options options{.t_end = 200'000 * step, .step = step};
            compare(fmt::format("posts, {}, rk4 {} ms", kind, 1e3 * step), Posts{surface},
                    Springs{}, x0, options, repeats);
        }
        compare_flights(fmt::format("posts, {}, first events by dopri5", kind), surface, 500);
        const GuardNetwork distance(arm(activation, fit_steps));
        const Options options{.t_end = 100, .step = 1e-3};
        compare(fmt::format("arm, {}, rk4 1 ms", kind), Arm{distance}, FreeArm{}, Arm::start(),
                options, repeats);
    }
}

void count_all(std::uint64_t orbits)
{
    std::array<NeuralOrbitCounts, 4> counts;
    for (std::uint64_t seed = 1; seed <= orbits; ++seed) {
        NeuralOrbit::State start{};
        const NeuralOrbit orbit = random_neural_orbit(seed, start);
        const std::vector<double> reference = reference_crossings(orbit, start);
        const auto lost = [&](const auto& stepping, const auto& detector, const Options& options) {
            return count_lost(orbit, start, reference, stepping, detector, options);
        };
        const Options steps{.step = 0.005}, tolerances{.rtol = 1e-9, .atol = 1e-9};
        counts[0].add(lost(FixedStep<Rk4>{}, Enclosed{}, steps));
        counts[1].add(lost(ErrorControlled<Dopri5>{}, Enclosed{}, tolerances));
        counts[2].add(lost(FixedStep<Rk4>{}, Ends{}, steps));
        counts[3].add(lost(ErrorControlled<Dopri5>{}, Extremum{}, tolerances));
    }
    constexpr std::array names{"Enclosed, rk4 5 ms", "Enclosed, dopri5 1e-9", "Ends, rk4 5 ms",
                               "Extremum, dopri5 1e-9"};
    for (std::size_t k = 0; k < counts.size(); ++k) {
        const NeuralOrbitCounts& c = counts[k];
        const double all =
            static_cast<double>(c.evidence.proved + c.evidence.checked + c.evidence.assumed);
        fmt::print(
            "{}: {} networks and orbits, {} crossings of the reference, {} events, {} lost, "
            "proved {:.2f} % of steps\n",
            names[k], c.orbits, c.crossings, c.found, c.lost,
            100 * static_cast<double>(c.evidence.proved) / all);
    }
}

}  // namespace
}  // namespace ricochet

int main(int argc, char** argv)
{
    CLI::App app("What a proof that no event of a neural guard is lost costs");
    std::uint64_t orbits = 0;
    int fit_steps = 6000, repeats = 3;
    app.add_option("--orbits", orbits, "Count the crossings lost of so many networks and orbits");
    app.add_option("--fit-steps", fit_steps, "Steps of the fit of each network");
    app.add_option("--repeats", repeats, "Runs of which the shortest time is taken");
    CLI11_PARSE(app, argc, argv);
    if (orbits > 0) {
        ricochet::count_all(orbits);
    } else {
        ricochet::compare_all(fit_steps, repeats);
    }
}
