#include "friction_study.hpp"

#include <cmath>
#include <stdexcept>

#include "ricochet/base/random.hpp"
#include "ricochet/faults/variational_step.hpp"

namespace ricochet::learn {

namespace {

constexpr double run_time = 2;  // [s]
constexpr int per_second = 64;

bool is(const std::atomic<bool>* cancelled)
{
    return cancelled && cancelled->load(std::memory_order_relaxed);
}

SliderCase stepped_load(Random& random)
{
    SliderCase c;
    const RateStateParameters& p = c.slider.friction;
    SpringBlock& block = c.slider.block;
    c.stiffness_ratio = random.uniform(1.5, 4);
    block.stiffness =
        c.stiffness_ratio * critical_stiffness(p, block.mass, block.normal_force, 2 * p.v_star);
    const auto velocity = [&] { return p.v_star * random.log_uniform(0.5, 2); };
    const double first = velocity();
    const double second = velocity();
    const double third = velocity();
    const double t1 = random.uniform(0.4, 0.8);
    const double t2 = random.uniform(1.2, 1.6);
    c.slider.load = SliderLoad(block.normal_force * p.f_star / block.stiffness,
                               {{0, first}, {t1, second}, {t2, third}});
    return c;
}

struct SliderPath {
    std::vector<double> x{}, v{}, f{};
};

constexpr int samples_per_second = 1024;

/// Takes steps of order 4 and 2^-13 s, which end at the corners of the load.
template <class Law>
SliderPath follow(const Law& law, const SliderCase& c)
{
    constexpr int parts = 8;
    constexpr double h = 1.0 / (parts * samples_per_second);
    const VariationalStep<Law> step(law, c.slider.block, 4);
    SliderState s = slider_case_start();
    SliderPath out;
    for (int n = 1; n <= static_cast<int>(run_time) * parts * samples_per_second; ++n) {
        const double end = n * h;
        const double corner = c.slider.load.next_corner(s.t);
        if (corner < end) {
            (void)step.take(s, corner - s.t, c.slider.load);
            s.t = corner;
        }
        if (end > s.t) (void)step.take(s, end - s.t, c.slider.load);
        s.t = end;
        if (n % parts != 0) continue;
        out.x.push_back(s.x);
        out.v.push_back(s.v);
        out.f.push_back(law.gradient(s.v, s.xi).friction);
    }
    return out;
}

/// The slip rate of a slider as a history, with the friction that belongs to it.
FrictionHistory as_history(const SliderPath& path, const RateStateParameters& p)
{
    constexpr std::size_t stride = 20;
    FrictionHistory h{.between = FrictionHistory::Between::linear};
    for (std::size_t i = 0; i < path.v.size(); i += stride) {
        h.t.push_back(static_cast<double>(i) / samples_per_second);
        h.v.push_back(path.v[i]);
    }
    h.friction = ageing_friction(p, h);
    return h;
}

SliderErrors compare(const AdditivePair& pair, const std::vector<SliderCase>& cases,
                     const std::vector<SliderPath>& exact, const std::atomic<bool>* cancelled)
{
    SliderErrors out;
    const auto count = static_cast<double>(cases.size());
    for (std::size_t i = 0; i < cases.size() && !is(cancelled); ++i) {
        const SliderPath path = follow(pair, cases[i]);
        out.x += relative_error(path.x, exact[i].x) / count;
        out.v += relative_error(path.v, exact[i].v) / count;
        out.friction += relative_error(path.f, exact[i].f) / count;
        out.beyond +=
            relative_error_beyond(path.f, exact[i].f, cases[i].slider.friction.f_star) / count;
    }
    return out;
}

}  // namespace

InternalVariables try_internal_variables(const FrictionData& data, int internal,
                                         std::size_t histories, double seconds,
                                         const std::atomic<bool>* cancelled)
{
    const std::vector<FrictionHistory> some(
        data.training.begin(),
        data.training.begin() + static_cast<long>(std::min(histories, data.training.size())));
    const LearnedFriction fit = train_friction(
        some,
        {.internal = internal, .iterations = 200, .seconds = seconds, .cancelled = cancelled});
    const double f_star = RateStateParameters{}.f_star;
    return {.internal = internal,
            .parameters = fit.parameters(),
            .seconds = fit.seconds,
            .training = assess(fit, some, f_star),
            .test = assess(fit, data.test, f_star)};
}

Transfer transfer_to_sliders(const LearnedFriction& fit, std::uint64_t seed, double seconds,
                             const std::atomic<bool>* cancelled)
{
    if (!fit.pair()) {
        throw std::invalid_argument(
            "transfer_to_sliders: expected an additive pair with one internal variable");
    }
    const AgeingLaw<DirectEffect::log> law;
    Random random(seed);
    std::vector<SliderCase> cases;
    std::vector<SliderPath> exact;
    for (int i = 0; i < 10; ++i) {
        if (is(cancelled)) return {};
        cases.push_back(stepped_load(random));
        exact.push_back(follow(law, cases.back()));
    }
    std::vector<FrictionHistory> others;
    for (int i = 0; i < 24; ++i) {
        if (is(cancelled)) return {};
        others.push_back(as_history(follow(law, stepped_load(random)), law.parameters()));
    }
    const LearnedFriction further = train_further(
        fit, others,
        {.iterations = 40, .seconds = seconds, .target = 1e-9, .cancelled = cancelled});
    return {.as_trained = compare(*fit.pair(), cases, exact, cancelled),
            .further_trained = compare(*further.pair(), cases, exact, cancelled)};
}

SliderVelocities slider_velocities(const SliderCase& slider, int order, int steps_in_64th)
{
    const VariationalStep<AgeingLaw<>> step(AgeingLaw<>(slider.slider.friction),
                                            slider.slider.block, order);
    const double h = 1.0 / (per_second * steps_in_64th);
    SliderState s = slider_case_start();
    SliderVelocities out;
    const int steps = static_cast<int>(run_time) * per_second * steps_in_64th;
    for (int n = 1; n <= steps; ++n) {
        const StepReport r = step.take(s, h, slider.slider.load);
        out.unsolved += static_cast<std::size_t>(r.unsolved);
        if (!std::isfinite(s.v) || std::abs(s.v) > 1e6 * slider.slider.friction.v_star) {
            out.stable = false;
            return out;
        }
        if (n % steps_in_64th == 0) out.velocity.push_back(s.v);
    }
    return out;
}

SliderVelocities slider_velocities(const SliderCase& slider, BaselineOptions options,
                                   int steps_in_64th)
{
    options.step = 1.0 / (per_second * steps_in_64th);
    options.t_end = run_time;
    const BaselineRun run = run_baseline(slider.slider, slider_case_start(), options);
    SliderVelocities out{.stable = run.stable};
    const auto stride = static_cast<std::size_t>(steps_in_64th);
    for (std::size_t i = stride - 1; i < run.velocity.size(); i += stride) {
        out.velocity.push_back(run.velocity[i]);
    }
    return out;
}

}  // namespace ricochet::learn
