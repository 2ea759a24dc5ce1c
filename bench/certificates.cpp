// Cost of certificates, and the fraction of states that they clear: a ball in a cavern, a planar
// arm of two, three and four joints among few obstacles, and a smallest eigenvalue under four
// loads.
//
// Networks are trained here, on the distance, unless DIR holds them. For each scene the program
// prints the shape, the boxes and seconds (wall and processor) of the proof, the estimate that was
// made before it, the fraction of the states beyond a tenth of the scene's scale that are cleared,
// and the lowest logit among a million adversarially searched states within the margin, which must
// not be below the threshold.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "certificates.hpp"
#include "learn/trainable_mlp.hpp"
#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/learn/adam.hpp"
#include "ricochet/learn/certify.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::bench {
namespace {

using learn::Random;

/// The guard on the components that it depends on, which come first in the state.
struct Scene {
    std::string name;
    std::size_t dimension;   ///< components that the guard depends on
    std::size_t components;  ///< number of components of the state
    std::vector<ValueRange> domain;
    double margin;
    double far;  ///< a tenth of the scene's scale
    std::vector<std::size_t> hidden;
    std::size_t iterations;
    learn::GuardProblem problem;
};

Scene cavern()
{
    const auto system = std::make_shared<const Cavern>(Cavern::Parameters{.grid = 0});
    const double v = system->top_speed();
    return {.name = "cavern",
            .dimension = 2,
            .components = 4,
            .domain = {{-9, 9}, {-9, 9}, {-v, v}, {-v, v}},
            .margin = 0.1,
            .far = 1,
            .hidden = {32, 32},
            .iterations = 4000,
            .problem = {.guard =
                            [system](const double* x) {
                                return system->guard(0, Cavern::State{x[0], x[1], x[2], x[3]});
                            },
                        // A distance is 1-Lipschitz; 1e-12 m is far above its rounding.
                        .slack = [](const double* h) { return std::hypot(h[0], h[1]) + 1e-12; }}};
}

template <std::size_t N>
Scene arm()
{
    const auto system =
        std::make_shared<const PlanarArm<N>>(ArmScene::Parameters{.obstacles = 8, .grid = 0});
    const double link = system->scene().parameters().reach / N;
    const auto start = system->start();
    std::vector<ValueRange> domain;
    for (std::size_t i = 0; i < N; ++i) domain.push_back({start[i] - 1.5, start[i] + 1.5});
    for (std::size_t i = 0; i < N; ++i) domain.push_back({-2, 2});
    return {.name = fmt::format("arm{}", N),
            .dimension = N,
            .components = 2 * N,
            .domain = domain,
            .margin = 0.02,
            .far = 0.2,
            .hidden = N < 4 ? std::vector<std::size_t>{32, 32} : std::vector<std::size_t>{64, 64},
            .iterations = N < 4 ? std::size_t{6000} : std::size_t{8000},
            .problem = {.guard =
                            [system](const double* x) {
                                typename PlanarArm<N>::State state;
                                std::copy_n(x, 2 * N, state.begin());
                                return system->guard(0, state);
                            },
                        // Turning a joint by dq moves the part beyond it by at most its reach dq.
                        .slack =
                            [link](const double* h) {
                                double sum = 1e-12;
                                for (std::size_t i = 0; i < N; ++i) {
                                    sum += link * static_cast<double>(N - i) * h[i];
                                }
                                return sum;
                            }}};
}

/// The scene of the smallest eigenvalue. Its bound over a box comes from a table at the corners.
Scene eigenvalue()
{
    const auto system =
        std::make_shared<const LeastEigenvalue>(LeastEigenvalue::Parameters{.table = 16});
    using State = LeastEigenvalue::State;
    const auto state = [](const double* x) { return State{x[0], x[1], x[2], x[3]}; };
    return {.name = "eigenvalue",
            .dimension = 4,
            .components = 4,
            .domain = std::vector<ValueRange>(4, {-1, 1}),
            .margin = 0.02,
            .far = 0.1,
            .hidden = {64, 64},
            .iterations = 12'000,
            .problem = {
                .guard = [system, state](const double* x) { return system->guard(0, state(x)); },
                .slack = [system, state](const double* h) { return system->guard_slack(state(h)); },
                .least =
                    [system, state](const double* lower, const double* upper) {
                        return system->guard_least(state(lower), state(upper));
                    }}};
}

/// Regression by classification: a state is called an event with the probability
/// 1 / (1 + exp((g - middle) / width)), so that the logit that fits best is (middle - g) / width.
class Training {
public:
    explicit Training(const Scene& scene)
        : scene_(scene),
          middle_(0.5 * (scene.margin + scene.far)),
          width_(0.2 * (scene.far - scene.margin)),
          mlp_(scene.dimension, scene.hidden, Activation::relu, random_),
          adam_(mlp_.parameters().size(), {})
    {
        for (std::size_t i = 0; i < scene.dimension; ++i) {
            const ValueRange& range = scene.domain[i];
            offset_.push_back(0.5 * (range.lower + range.upper));
            scale_.push_back(4 / (range.upper - range.lower));
        }
    }

    Model run(std::size_t iterations)
    {
        constexpr std::size_t batch = 512;
        constexpr std::size_t hard = batch / 4;
        std::vector<double> gradient(mlp_.parameters().size());
        for (std::size_t k = 0; k < iterations; ++k) {
            std::vector<double> states;
            std::vector<std::uint8_t> labels;
            if (k % 500 == 0 && k > 0) find_hard();
            for (std::size_t i = 0; i < batch; ++i) {
                const bool again = i < hard && !hard_.empty();
                const State s = again ? hard_[random_.below(hard_.size())] : near();
                states.insert(states.end(), s.x.begin(), s.x.end());
                const double p = 1 / (1 + std::exp((s.guard - middle_) / width_));
                labels.push_back(again || random_.chance(p) ? 1 : 0);
            }
            mlp_.loss_and_gradient(states, labels, gradient);
            const double share = static_cast<double>(k) / static_cast<double>(iterations);
            adam_.step(mlp_.parameters(), gradient,
                       3e-3 * (1 + std::cos(3.14159 * share)) / 2 + 1e-5);
        }
        return model();
    }

private:
    struct State {
        std::vector<double> x;  ///< normalised
        double guard;
    };

    State draw()
    {
        std::vector<double> full(scene_.components);
        State s{.x = std::vector<double>(scene_.dimension), .guard = 0};
        for (std::size_t i = 0; i < scene_.dimension; ++i) {
            full[i] = random_.uniform(scene_.domain[i].lower, scene_.domain[i].upper);
            s.x[i] = (full[i] - offset_[i]) * scale_[i];
        }
        s.guard = scene_.problem.guard(full.data());
        return s;
    }

    /// Draws a state, mostly where the network still has something to learn.
    State near()
    {
        for (;;) {
            State s = draw();
            if (s.guard < 2 * scene_.far || random_.chance(0.3)) return s;
        }
    }

    /// Finds the states within the margin that have the lowest logits.
    void find_hard()
    {
        constexpr std::size_t drawn = 20'000;
        constexpr std::size_t kept = 256;
        std::vector<State> within;
        std::vector<double> rows;
        for (std::size_t i = 0; i < drawn; ++i) {
            State s = draw();
            if (s.guard > 1.5 * scene_.margin) continue;
            rows.insert(rows.end(), s.x.begin(), s.x.end());
            within.push_back(std::move(s));
        }
        std::vector<double> logits(within.size());
        mlp_.evaluate(rows, logits);
        std::vector<std::size_t> order(within.size());
        for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
        std::sort(order.begin(), order.end(),
                  [&](std::size_t a, std::size_t b) { return logits[a] < logits[b]; });
        hard_.clear();
        for (std::size_t i = 0; i < std::min(kept, order.size()); ++i) {
            hard_.push_back(within[order[i]]);
        }
    }

    /// The columns of components that the guard does not depend on are zero.
    Model model() const
    {
        Model out;
        out.system = scene_.name;
        out.recipe = "state";
        out.domain = scene_.domain;
        out.offset = offset_;
        out.scale = scale_;
        out.offset.resize(scene_.components, 0);
        out.scale.resize(scene_.components, 1);
        out.layers = mlp_.layers();
        DenseLayer& first = out.layers.front();
        std::vector<double> wide(first.outputs * scene_.components);
        for (std::size_t j = 0; j < first.outputs; ++j) {
            for (std::size_t i = 0; i < scene_.dimension; ++i) {
                wide[j * scene_.components + i] = first.weight[j * scene_.dimension + i];
            }
        }
        first.weight = wide;
        first.inputs = scene_.components;
        return out;
    }

    const Scene& scene_;
    double middle_, width_;
    Random random_{1};
    std::vector<double> offset_, scale_;
    learn::TrainableMlp mlp_;
    learn::Adam adam_;
    std::vector<State> hard_;
};

/// Fraction of the states beyond `far` that the certificate clears.
double cleared_share(const Scene& scene, const Model& model)
{
    const CertifiedClassifier certified(model);
    Random random(11);
    std::vector<double> x(scene.components);
    std::size_t beyond = 0;
    std::size_t cleared = 0;
    for (int i = 0; i < 200'000; ++i) {
        for (std::size_t k = 0; k < x.size(); ++k) {
            x[k] = random.uniform(scene.domain[k].lower, scene.domain[k].upper);
        }
        if (!(scene.problem.guard(x.data()) > scene.far)) continue;
        ++beyond;
        if (certified.clears(x.data())) ++cleared;
    }
    return static_cast<double>(cleared) / static_cast<double>(beyond);
}

struct Proof {
    bool holds = false;  ///< proved, and no searched state contradicts it
    double seconds = 0;  ///< [s] total wall time
    double boxes = 0;    ///< examined, over the estimate made before
    double share = 0;    ///< of the states beyond `far` that are cleared
};

Proof measure(const Scene& scene, const std::filesystem::path& models, std::size_t iterations,
              const learn::CertifyOptions& given)
{
    const std::filesystem::path file = models / (scene.name + ".safetensors");
    Model model;
    if (!models.empty() && std::filesystem::exists(file)) {
        model = load_model(file);
    } else {
        const std::clock_t start = std::clock();
        model = Training(scene).run(iterations > 0 ? iterations : scene.iterations);
        fmt::print("{}: trained in {:.1f} s\n", scene.name,
                   static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
        if (!models.empty()) save_model(model, file);
    }
    learn::CertifyOptions options = given;
    options.margin = scene.margin;
    const std::clock_t start = std::clock();
    double estimated = 0;
    const learn::CertifiedModel out =
        learn::certify(model, scene.problem, options, [&](const learn::CertifyProgress& now) {
            if (now.boxes == 0) {
                estimated = now.estimate.boxes;
                fmt::print("{}: threshold {:.4f}, estimate {:.3g} boxes (+- {:.0f} %), {:.2f} s\n",
                           scene.name, now.threshold, now.estimate.boxes, 100 * now.estimate.error,
                           now.estimate.seconds);
                std::fflush(stdout);
            }
            return true;
        });
    const double processor = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    fmt::print("{}: {}; {:.2f} s in all, {:.2f} s of processors\n", scene.name,
               learn::describe(out.report.outcome), out.report.seconds, processor);
    if (!out.proved()) {
        const learn::Estimate& e = out.report.estimates.back();
        fmt::print("{}: estimate {:.3g} boxes, {:.1f} s, {:.3g} unproved\n", scene.name, e.boxes,
                   e.seconds, e.unproved);
        return {.seconds = out.report.seconds};
    }
    double boxes = 0;
    for (const CertificateLevel& level : out.report.levels) {
        fmt::print("{}: guard > {} below {:.4f}: {} boxes, {:.2f} s, {} unproved\n", scene.name,
                   level.margin, level.threshold, level.boxes, level.seconds,
                   level.unproved.size());
        boxes += static_cast<double>(level.boxes);
    }
    const double share = cleared_share(scene, out.model);
    const learn::LowestLogit worst =
        learn::lowest_logit(model, scene.problem, scene.margin, 1'000'000, 99);
    const bool holds = worst.logit >= out.model.threshold || !out.report.levels[0].unproved.empty();
    fmt::print(
        "{}: clears {:.1f} % of the states beyond {}; lowest logit of 1e6 within the margin "
        "{:.4f}, {}\n",
        scene.name, 100 * share, scene.far, worst.logit,
        holds ? "above the threshold" : "BELOW THE THRESHOLD");
    return {
        .holds = holds, .seconds = out.report.seconds, .boxes = boxes / estimated, .share = share};
}

std::vector<Scene> scenes()
{
    return {cavern(), arm<2>(), arm<3>(), arm<4>(), eigenvalue()};
}

}  // namespace

Model certified_network(std::string_view scene, std::size_t iterations,
                        learn::CertifyOptions options)
{
    for (const Scene& one : scenes()) {
        if (one.name != scene) continue;
        const Model model = Training(one).run(iterations > 0 ? iterations : one.iterations);
        options.margin = one.margin;
        learn::CertifiedModel out = learn::certify(model, one.problem, options);
        if (!out.proved()) {
            throw std::runtime_error(fmt::format("certified_network: {}: {}", scene,
                                                 learn::describe(out.report.outcome)));
        }
        return std::move(out.model);
    }
    throw std::invalid_argument(fmt::format(
        "certified_network: scene must be cavern, arm2, arm3, arm4 or eigenvalue, got {}", scene));
}

bool certify_scenes(const std::string& only, const std::string& models, std::size_t iterations,
                    const learn::CertifyOptions& options)
{
    bool good = true;
    for (const Scene& scene : scenes()) {
        if (!only.empty() && only != scene.name) continue;
        const Proof proof = measure(scene, models, iterations, options);
        const double allowed = scene.dimension == 2 ? 1 : scene.dimension == 3 ? 10 : 300;
        good = good && proof.holds && proof.share >= 0.8 && proof.seconds <= allowed &&
               proof.boxes >= 0.5 && proof.boxes <= 2;
    }
    return good;
}

}  // namespace ricochet::bench
