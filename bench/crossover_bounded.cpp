#include <fmt/format.h>

#include "crossover.hpp"
#include "problems/cavern.hpp"
#include "problems/planar_arm.hpp"

namespace ricochet::bench {

namespace {

template <class System>
Regime regime_of(std::string name, std::size_t dimension, const System& system, double steps,
                 double step)
{
    const Options options{.t_end = steps * step, .step = step};
    std::uint64_t hash = 0;
    Regime regime = plain_regime(std::move(name), dimension, system, options, hash);
    regime.ways.insert(regime.ways.begin() + 1,
                       measure_way("planned", system, system.start(), options, planner(), hash));
    return regime;
}

Regime cavern(double kick, double step)
{
    return regime_of(fmt::format("cavern, kick {} m/s, {} ms", kick, 1e3 * step), 2,
                     Cavern({.segments = 1000, .kick = kick}), 100'000, step);
}

template <std::size_t N>
Regime arm(std::size_t obstacles, double step)
{
    return regime_of(fmt::format("arm, {} obstacles, {} ms", obstacles, 1e3 * step), N,
                     PlanarArm<N>({.obstacles = obstacles}), 200'000, step);
}

}  // namespace

std::vector<Regime> bounded_regimes()
{
    // Flying, skimming, and both with steps so long that hardly one lies between two events.
    std::vector<Regime> out{cavern(6, 1e-3), cavern(0.5, 1e-3), cavern(6, 1e-2), cavern(0.5, 1e-2),
                            cavern(0.5, 5e-2)};
    for (const auto& [obstacles, step] :
         {std::pair{std::size_t{8}, 1e-3}, {std::size_t{40}, 1e-3}, {std::size_t{40}, 1e-2}}) {
        out.push_back(arm<4>(obstacles, step));
        out.push_back(arm<6>(obstacles, step));
    }
    return out;
}

}  // namespace ricochet::bench
