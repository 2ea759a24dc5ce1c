#include "ricochet/scene/measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/require.hpp"
#include "scene/vector2.hpp"

namespace ricochet {

using namespace detail;

namespace {

constexpr std::string_view of_measure = "SceneMeasure";
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

Measured mean_of(std::span<const double> values)
{
    const auto count = static_cast<double>(values.size());
    if (values.empty()) return {unknown, unknown};
    double sum = 0;
    for (const double value : values) sum += value;
    const double mean = sum / count;
    double squares = 0;
    for (const double value : values) squares += (value - mean) * (value - mean);
    return {mean, values.size() > 1 ? std::sqrt(squares / (count * (count - 1))) : unknown};
}

SceneMeasure::SceneMeasure(const Scene& scene, const MeasureOptions& options)
    : scene_(&scene), options_(options)
{
    require_finite(of_measure, "t_start", options.t_start);
    require_above(of_measure, "t_end", options.t_end, "t_start", options.t_start);
    require(options.blocks >= 2, of_measure, "blocks", "be two at least",
            static_cast<double>(options.blocks));
    require_not_negative(of_measure, "area", options.area);
    const Vector2& period = scene.settings().period;
    if (options.area == 0) options_.area = period[0] * period[1];
    if (!(options_.area > 0)) {
        Refuse{of_measure}("the scene has no period along both axes; expected the area of the gas");
    }
    length_ = (options.t_end - options.t_start) / static_cast<double>(options.blocks);
    blocks_.resize(options.blocks);
    for (Block& block : blocks_) block.push.resize(scene.surfaces().size());
    lengths_.assign(scene.surfaces().size(), unknown);
    t_ = -std::numeric_limits<double>::infinity();
    for (const Disc& body : scene.bodies()) {
        velocities_.push_back(body.velocity);
        if (scene.plate_of(static_cast<std::uint32_t>(velocities_.size() - 1))) continue;
        momentum_ = momentum_ + body.mass * body.velocity;
        mass_ += body.mass;
        twice_energy_ += body.mass * dot(body.velocity, body.velocity);
        speeds_ += norm(body.velocity);
    }
    if (!is_zero(scene.settings().gravity)) {
        Refuse{of_measure}(
            "the scene has gravity; speeds are followed from impact to impact alone");
    }
}

void SceneMeasure::length_of(SurfaceId surface, double length)
{
    require_positive(of_measure, "length of a surface", length);
    if (surface.index >= lengths_.size()) {
        Refuse{of_measure}(fmt::format("surface {} is not in the scene, which has {}",
                                       surface.index, lengths_.size()));
    }
    lengths_[surface.index] = length;
}

/// Adds what lasts, up to t, to the blocks.
void SceneMeasure::advance(double t)
{
    double from = std::max(t_, options_.t_start);
    const double to = std::min(t, options_.t_end);
    t_ = t;
    if (!(to > from)) return;
    const double thermal = twice_energy_ - dot(momentum_, momentum_) / mass_;
    auto block = static_cast<std::size_t>((from - options_.t_start) / length_);
    for (; from < to && block < blocks_.size(); ++block) {
        const double end = options_.t_start + static_cast<double>(block + 1) * length_;
        const double s = std::max(std::min(to, end) - from, 0.0);
        blocks_[block].energy += s * thermal;
        blocks_[block].speed += s * speeds_;
        from += s;
    }
}

void SceneMeasure::change(std::uint32_t body, const Vector2& velocity)
{
    if (scene_->plate_of(body)) return;
    const double mass = scene_->bodies()[body].mass;
    Vector2& old = velocities_[body];
    momentum_ = momentum_ + mass * (velocity - old);
    twice_energy_ += mass * (dot(velocity, velocity) - dot(old, old));
    speeds_ += norm(velocity) - norm(old);
    old = velocity;
}

void SceneMeasure::add(const SceneEvent& event)
{
    advance(event.t);
    change(event.body, event.after[0]);
    if (!event.other.is_surface && event.other.index != event.body) {
        change(event.other.index, event.after[1]);
    }
    const double since = event.t - options_.t_start;
    if (event.kind != SceneEvent::Kind::impact || since < 0 || event.t >= options_.t_end) return;
    const auto number = static_cast<std::size_t>(since / length_);
    Block& block = blocks_[std::min(number, blocks_.size() - 1)];
    const double push = dot(event.impulse, event.normal);
    const bool first = scene_->plate_of(event.body) != nullptr;
    const bool second = !event.other.is_surface && scene_->plate_of(event.other.index);
    if (first && (event.other.is_surface || second)) return;  // of no body of the gas
    if (first || second) {
        block.wall_hits += 1;
        return;
    }
    if (event.other.is_surface) {
        block.wall_hits += 1;
        block.push[event.other.index] += push;
        return;
    }
    block.collisions += 1;
    const auto bodies = scene_->bodies();
    block.virial += push * (bodies[event.body].radius + bodies[event.other.index].radius);
}

void SceneMeasure::add(const SceneRun& run)
{
    for (const SceneEvent& event : run.events) add(event);
}

SceneMeasures SceneMeasure::result() const
{
    SceneMeasure whole = *this;  // with the time after the last event
    whole.advance(std::max(t_, options_.t_end));
    const auto count = static_cast<double>(velocities_.size() - scene_->plates().size());
    const auto each = [&](const auto& of) {
        std::vector<double> values;
        for (const Block& block : whole.blocks_) values.push_back(of(block));
        return mean_of(values);
    };
    SceneMeasures out;
    out.collision_rate = each([&](const Block& b) { return b.collisions / length_; });
    out.wall_rate = each([&](const Block& b) { return b.wall_hits / length_; });
    // Of N bodies with a common momentum 2 (N - 1) velocities are free.
    out.temperature = each([&](const Block& b) { return b.energy / length_ / (2 * count - 2); });
    out.virial_pressure = each([&](const Block& b) {
        return (0.5 * b.energy + 0.5 * b.virial) / (length_ * options_.area);
    });
    out.mean_free_path = each([&](const Block& b) { return b.speed / (2 * b.collisions); });
    for (std::size_t s = 0; s < lengths_.size(); ++s) {
        out.surface_pressure.push_back(
            each([&](const Block& b) { return b.push[s] / (length_ * lengths_[s]); }));
    }
    return out;
}

PairDistribution pair_distribution(const Scene& scene, const SceneRun& run, double distance,
                                   std::size_t bins)
{
    constexpr std::string_view who_asks = "pair_distribution";
    const Vector2& period = scene.settings().period;
    if (!(period[0] > 0) || !(period[1] > 0)) {
        Refuse{who_asks}("the scene has no period along both axes");
    }
    require(distance > 0 && distance <= 0.5 * std::min(period[0], period[1]), who_asks, "distance",
            "be positive, and half the period at most", distance);
    require(bins > 0, who_asks, "bins", "be one at least", 0);
    if (run.samples.empty()) Refuse{who_asks}("the run has no samples; expected sample_times");
    const double width = distance / static_cast<double>(bins);
    std::vector<std::vector<double>> found(bins);
    for (const std::vector<BodyState>& states : run.samples) {
        std::vector<double> pairs(bins, 0.0);
        for (std::size_t i = 0; i < states.size(); ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                Vector2 apart = states[i].at - states[j].at;
                for (std::size_t c = 0; c < 2; ++c) {
                    apart[c] -= period[c] * std::nearbyint(apart[c] / period[c]);
                }
                const double r = norm(apart);
                if (r < distance) pairs[static_cast<std::size_t>(r / width)] += 1;
            }
        }
        const auto count = static_cast<double>(states.size());
        for (std::size_t k = 0; k < bins; ++k) {
            const double inner = static_cast<double>(k) * width;
            const double ring = std::numbers::pi * width * (2 * inner + width);
            const double expected = 0.5 * count * (count - 1) * ring / (period[0] * period[1]);
            found[k].push_back(pairs[k] / expected);
        }
    }
    PairDistribution out;
    for (std::size_t k = 0; k < bins; ++k) {
        out.distances.push_back((static_cast<double>(k) + 0.5) * width);
        out.values.push_back(mean_of(found[k]));
    }
    return out;
}

TemperatureProfile temperature_profile(const Scene& scene, const SceneRun& run, std::size_t axis,
                                       double low, double high, std::size_t slices)
{
    constexpr std::string_view who_asks = "temperature_profile";
    require(axis < 2, who_asks, "axis", "be 0 or 1", static_cast<double>(axis));
    require_finite(who_asks, "low", low);
    require_above(who_asks, "high", high, "low", low);
    require(slices > 0, who_asks, "slices", "be one at least", 0);
    if (run.samples.empty()) Refuse{who_asks}("the run has no samples; expected sample_times");
    struct Slice {
        double count = 0, mass = 0, squares = 0;
        Vector2 momentum{};
    };
    const double width = (high - low) / static_cast<double>(slices);
    std::vector<std::vector<double>> found(slices);
    for (const std::vector<BodyState>& states : run.samples) {
        std::vector<Slice> sums(slices);
        for (std::size_t i = 0; i < states.size(); ++i) {
            const double place = states[i].at[axis];
            if (scene.plate_of(static_cast<std::uint32_t>(i))) continue;
            if (!(place >= low && place < high)) continue;
            const auto k = static_cast<std::size_t>((place - low) / width);
            Slice& slice = sums[std::min(k, slices - 1)];
            const double mass = scene.bodies()[i].mass;
            const Vector2& v = states[i].velocity;
            slice.count += 1;
            slice.mass += mass;
            slice.squares += mass * dot(v, v);
            slice.momentum = slice.momentum + mass * v;
        }
        for (std::size_t k = 0; k < slices; ++k) {
            const Slice& slice = sums[k];
            if (slice.count < 2) continue;
            const double thermal = slice.squares - dot(slice.momentum, slice.momentum) / slice.mass;
            found[k].push_back(thermal / (2 * slice.count - 2));
        }
    }
    TemperatureProfile out;
    for (std::size_t k = 0; k < slices; ++k) {
        out.places.push_back(low + (static_cast<double>(k) + 0.5) * width);
        out.values.push_back(mean_of(found[k]));
    }
    return out;
}

}  // namespace ricochet
