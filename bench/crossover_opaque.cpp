#include <fmt/format.h>

#include "crossover.hpp"
#include "problems/cavern.hpp"
#include "problems/opaque.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/learn/train.hpp"

namespace ricochet::bench {

namespace {

using learn::GateTraining;
using learn::Random;
using learn::RunStart;

template <class System>
Regime regime_of(std::string name, std::size_t dimension, const System& inner,
                 std::string_view recipe, double step)
{
    using Box = BlackBox<System>;
    using X = typename System::State;
    const Box system(inner, 0);
    const X start = system.start();
    const learn::Starts<X> starts = [start](Random& random) {
        return RunStart<X>{.t = random.uniform(0, 1e4), .x = start};
    };
    GateTraining training;
    training.recipe = gate_recipe(recipe);
    training.levels = learn::horizons(step, {2, 4, 8, 16, 32, 64});
    training.step_min = training.step_max = step;
    training.run_length = 1e5 * step;
    training.hidden = {64, 64};
    training.events = 5000;
    training.validation_events = 2500;
    training.iterations = 3000;
    training.fresh_events = 0;
    const learn::TrainedGate trained =
        learn::train_gate(system, starts, FixedStep<Rk4>{}, {}, training);

    const Options options{.t_end = 200'000 * step, .step = step};
    std::uint64_t hash = 0;
    Regime regime = plain_regime(std::move(name), dimension, system, options, hash);
    regime.opaque = true;
    regime.ways.insert(regime.ways.begin() + 1,
                       measure_way("network", system, start, options,
                                   Calibrated<>(gates::Gate(trained.model)), hash));
    return regime;
}

}  // namespace

std::vector<Regime> opaque_regimes()
{
    std::vector<Regime> out;
    for (const double step : {1e-3, 5e-3}) {
        out.push_back(regime_of(fmt::format("cavern, {} ms", 1e3 * step), 2,
                                Cavern({.segments = 1000}), "state", step));
        out.push_back(regime_of(fmt::format("arm, 8 obstacles, {} ms", 1e3 * step), 4,
                                PlanarArm<4>({.obstacles = 8}), "chain", step));
    }
    out.push_back(
        regime_of("arm, 40 obstacles, 1 ms", 6, PlanarArm<6>({.obstacles = 40}), "chain", 1e-3));
    return out;
}

}  // namespace ricochet::bench
