// Networks attached to scenes with expensive guards: the events are the same for any weights, and
// with the meter on the time is the same.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "measure.hpp"
#include "measure_networks.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

/// inputs - hidden - hidden - outputs, with weights from `next`; it accepts any state.
template <class Next>
Model model_of(std::string_view system, std::size_t inputs, std::size_t hidden, std::size_t outputs,
               Next next)
{
    Model model;
    model.system = system;
    model.recipe = "state";
    model.offset.assign(inputs, 0);
    model.scale.assign(inputs, 1);
    model.domain.assign(inputs, {-1e6, 1e6});
    model.step_min = 0;
    model.step_max = std::numeric_limits<double>::max();
    const std::array<std::size_t, 4> widths{inputs, hidden, hidden, outputs};
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
        DenseLayer layer{.inputs = widths[k], .outputs = widths[k + 1], .weight = {}, .bias = {}};
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(next());
        }
        for (std::size_t i = 0; i < layer.outputs; ++i) layer.bias.push_back(next());
        model.layers.push_back(std::move(layer));
    }
    return model;
}

/// Horizons of 2 to 64 steps, the more likely to be cleared the higher the threshold.
gates::Gate gate_of(Model model, double step, double threshold)
{
    model.kind = "gate-horizon";
    for (double tau = 2 * step; model.levels.size() < 6; tau *= 2) {
        model.levels.push_back({.value = tau, .threshold = threshold});
    }
    return gates::Gate(std::move(model));
}

}  // namespace

std::vector<AnyGate> odd_gates(std::string_view system, std::size_t inputs, double step)
{
    const auto constant = [](double weight) { return [weight] { return weight; }; };
    std::vector<AnyGate> gates{
        {"bold", gate_of(model_of(system, inputs, 16, 6, constant(0)), step, 1)},
        {"shy", gate_of(model_of(system, inputs, 16, 6, constant(0)), step, -1)},
        {"NaN", gate_of(model_of(system, inputs, 16, 6, constant(nan)), step, 0)},
        {"infinite", gate_of(model_of(system, inputs, 16, 6, constant(infinite)), step, 0)}};
    std::mt19937_64 random(5);
    for (std::size_t i = 0; i < 4; ++i) {
        const double size = std::pow(10.0, static_cast<double>(i) - 2);
        const auto next = [&] {
            return size * (static_cast<double>(random() >> 11U) * 0x1p-52 - 1);
        };
        gates.push_back({fmt::format("random, to {}", size),
                         gate_of(model_of(system, inputs, 16, 6, next), step, 0)});
    }
    return gates;
}

std::vector<AnyGate> expensive_gates(std::string_view system, std::size_t inputs, double step)
{
    std::mt19937_64 random(6);
    const auto next = [&] { return 0.3 * (static_cast<double>(random() >> 11U) * 0x1p-52 - 1); };
    return {
        {"random, 2 x 64", gate_of(model_of(system, inputs, 64, 6, next), step, 0)},
        {"bold, 2 x 64", gate_of(model_of(system, inputs, 64, 6, [] { return 0.0; }), step, 1)}};
}

std::vector<AnyNetwork> odd_networks(std::string_view system, std::size_t inputs)
{
    std::vector<AnyNetwork> networks;
    for (const auto& [name, weight, threshold] :
         {std::tuple{"always clear", 0.0, 1.0}, std::tuple{"never clear", 0.0, -1.0},
          std::tuple{"NaN", nan, 0.0}}) {
        Model model = model_of(system, inputs, 8, 1, [w = weight] { return w; });
        model.threshold = threshold;
        networks.push_back({name, Network(std::move(model))});
    }
    std::mt19937_64 random(7);
    const auto next = [&] { return static_cast<double>(random() >> 11U) * 0x1p-52 - 1; };
    networks.push_back({"random", Network(model_of(system, inputs, 8, 1, next))});
    return networks;
}

Measured same_events_whatever_the_weights()
{
    std::vector<SameEvents> scenes;
    add_cavern_events(scenes);
    add_cave_body_events(scenes);
    add_arm_events(scenes);
    add_other_events(scenes);
    Measured out{.pass = true, .text = {}, .details = {}};
    std::uint64_t events = 0;
    std::size_t runs = 0;
    for (const SameEvents& scene : scenes) {
        out.pass = out.pass && scene.events > 0 && scene.different.empty();
        events += scene.events * scene.runs;
        runs += scene.runs;
        out.details.push_back(fmt::format(
            "{:<44}{:>6} events, {:>3} networks, {:>8} answers{}", scene.name, scene.events,
            scene.runs, scene.answers,
            scene.different.empty() ? ": the same bits" : ": OTHER EVENTS, " + scene.different));
    }
    out.text = fmt::format("{} scenes, {} runs with {} events: {}", scenes.size(), runs, events,
                           out.pass ? "the same, bit for bit" : "NOT the same");
    return out;
}

Measured time_metered_networks()
{
    std::vector<MeteredRow> rows;
    add_cavern_times(rows);
    add_cave_body_times(rows);
    add_arm_times(rows);
    add_other_times(rows);
    Measured out{.pass = true, .text = {}, .details = {}};
    double worst = 0;
    out.details.push_back(fmt::format("{:<44}{:>10}{:>10}{:>10}{:>8}   {}", "us a step", "every",
                                      "planned", "metered", "ratio", "network"));
    for (const MeteredRow& row : rows) {
        worst = std::max(worst, row.ratio());
        out.pass = out.pass && row.same && row.ratio() <= 1.05;
        const double us = 1e6 / static_cast<double>(row.steps);
        out.details.push_back(
            fmt::format("{:<44}{:>10.4f}{:>10.4f}{:>10.4f}{:>8.3f}   {}, asked {} "
                        "times{}",
                        row.name, us * row.every, us * row.planned, us * row.metered, row.ratio(),
                        row.network, row.asked, row.same ? "" : "  OTHER EVENTS"));
    }
    out.text = fmt::format("{:.3f}x of the better of planned and every step, at worst of {} rows",
                           worst, rows.size());
    return out;
}

}  // namespace ricochet::bench
