#include "scene/islands.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "ricochet/detail/runge_kutta.hpp"
#include "ricochet/step_control.hpp"

namespace ricochet::detail {

namespace {

/// A run counts as hopeless after this many consecutive steps, each shorter than this fraction of
/// the run: 10^8 such steps take half a minute or more.
constexpr std::uint32_t most_short_steps = 1000;
constexpr double short_part = 1e-8;

using Dopri5 = RungeKutta<Dopri5Tableau, std::vector<double>>;

std::uint32_t root_of(std::vector<std::uint32_t>& parent, std::uint32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

}  // namespace

Islands::Islands(World& world)
    : world_(world), place_(world.bodies.size(), 0), stages_(Dopri5::kept_stages)
{
    join(world);
    add_systems();
    for (std::uint32_t k = 0; k < islands_.size(); ++k) {
        Island& island = islands_[k];
        if (island.system) continue;
        const std::size_t n = 4 * island.members.size();
        island.x.resize(n);
        island.remainder.assign(n, 0);
        island.rate.resize(n);
        island.x_end = island.remainder_end = island.rate_end = island.rate;
        island.start = island.end = {world.options.t_start, 0};
        for (std::size_t m = 0; m < island.members.size(); ++m) {
            Body& body = world.bodies[island.members[m]];
            body.island = k;
            place_[island.members[m]] = static_cast<std::uint32_t>(m);
            island.x[4 * m] = body.p[0];
            island.x[4 * m + 1] = body.p[1];
            island.x[4 * m + 2] = body.v[0];
            island.x[4 * m + 3] = body.v[1];
        }
    }
}

void Islands::join(World& world)
{
    if (!world.any_drag && world.scene.springs().empty()) return;
    const auto count = static_cast<std::uint32_t>(world.bodies.size());
    std::vector<std::uint32_t> parent(count);
    std::iota(parent.begin(), parent.end(), 0U);
    std::vector<char> driven(count, 0);
    for (std::uint32_t i = 0; i < count; ++i) {
        driven[i] = world.scene.bodies()[i].drag > 0 ? 1 : 0;
    }
    for (const Spring& spring : world.scene.springs()) {
        const auto [a, b] = spring.between;
        driven[a.index] = driven[b.index] = 1;
        const std::uint32_t first = root_of(parent, a.index);
        const std::uint32_t second = root_of(parent, b.index);
        parent[std::max(first, second)] = std::min(first, second);
    }
    std::vector<std::uint32_t> island_of(count, none);
    for (std::uint32_t i = 0; i < count; ++i) {
        if (!driven[i]) continue;
        std::uint32_t& island = island_of[root_of(parent, i)];
        if (island == none) {
            island = static_cast<std::uint32_t>(islands_.size());
            islands_.emplace_back();
        }
        Island& of = islands_[island];
        place_[i] = static_cast<std::uint32_t>(of.members.size());
        of.members.push_back(i);
        of.drag.push_back(world.scene.bodies()[i].drag);
        of.inverse_mass.push_back(world.bodies[i].inverse_mass);
    }
    for (const Spring& spring : world.scene.springs()) {
        const auto [a, b] = spring.between;
        islands_[island_of[root_of(parent, a.index)]].links.push_back(
            {place_[a.index], place_[b.index], spring.rest, spring.stiffness, spring.damping});
    }
}

template <class AnyState>
void Islands::flow(const Island& island, const AnyState& x, AnyState& rate, double s) const
{
    ++world_.statistics.flow_calls;
    if constexpr (std::is_same_v<AnyState, State>) {
        if (island.system) return island.system->flow(island.mode, island.start.plus(s), x, rate);
    }
    const std::size_t n = island.members.size();
    for (std::size_t m = 0; m < n; ++m) {
        const double damping = island.drag[m] * island.inverse_mass[m];
        rate[4 * m] = x[4 * m + 2];
        rate[4 * m + 1] = x[4 * m + 3];
        rate[4 * m + 2] = world_.gravity[0] - damping * x[4 * m + 2];
        rate[4 * m + 3] = world_.gravity[1] - damping * x[4 * m + 3];
    }
    for (const Link& link : island.links) {
        const std::size_t a = std::size_t{4} * link.a;
        const std::size_t b = std::size_t{4} * link.b;
        const Vector2 apart{x[b] - x[a], x[b + 1] - x[a + 1]};
        const double length = norm(apart);
        if (length == 0) continue;  // no direction, no force
        const Vector2 along = (1 / length) * apart;
        const double stretching = dot(along, {x[b + 2] - x[a + 2], x[b + 3] - x[a + 3]});
        const double pull = link.stiffness * (length - link.rest) + link.damping * stretching;
        for (std::size_t c = 0; c < 2; ++c) {
            rate[a + 2 + c] += pull * island.inverse_mass[link.a] * along[c];
            rate[b + 2 + c] -= pull * island.inverse_mass[link.b] * along[c];
        }
    }
}

// Systems need it as well (island_systems.cpp).
template void Islands::flow(const Island&, const State&, State&, double) const;

/// Departs from a state of few numbers, in registers; the bits are those of `depart`.
template <std::size_t n, class Flow>
void Islands::depart_few(const Island& island, double h, bool with_error, const Flow& flow) const
{
    using Few = std::array<double, n>;
    using Method = RungeKutta<Dopri5Tableau, Few>;
    const auto few = [](const State& state) {
        Few out;
        std::copy_n(state.begin(), n, out.begin());
        return out;
    };
    const Few x = few(island.x);
    const Few remainder = few(island.remainder);
    const Few start = few(island.rate);
    const auto departure = [&](const auto& w, Few& rate, double s) {
        Few point;
        for (std::size_t i = 0; i < n; ++i) {
            point[i] = x[i] + (s * start[i] + (w[i] + remainder[i]));
        }
        flow(point, rate);
        for (std::size_t i = 0; i < n; ++i) rate[i] -= start[i];
    };
    std::array<Few, Method::kept_stages> stages;
    Few w;
    Few end_rate;
    Few error{};
    Method::depart(departure, x, h, stages.data(), {w, end_rate, error}, with_error,
                   Method::inner_stages);
    seen_ = nullptr;
    std::ranges::copy(w, w_.begin());
    if (!with_error) return;  // a place in the current step, which has its record already
    std::ranges::copy(end_rate, end_rate_.begin());
    std::ranges::copy(error, error_.begin());
    for (std::size_t k = 0; k < stages.size() && !island.unseen; ++k) {
        std::ranges::copy(stages[k], stages_[k].begin());
    }
}

void Islands::depart(const Island& island, double h, bool with_error) const
{
    const std::size_t n = island.x.size();
    if (w_.size() != n) {
        for (State* state : {&w_, &end_rate_, &error_, &middle_, &at_, &point_}) state->resize(n);
        for (State& stage : stages_) stage.resize(n);
    }
    if (n == 4 && !island.system) {
        // A single body has no springs.
        const double damping = island.drag[0] * island.inverse_mass[0];
        const Vector2 pull = world_.gravity;
        return depart_few<4>(island, h, with_error, [&](const auto& x, auto& rate) {
            ++world_.statistics.flow_calls;
            rate = {x[2], x[3], pull[0] - damping * x[2], pull[1] - damping * x[3]};
        });
    }
    if (n == 8 && !island.system) {
        return depart_few<8>(island, h, with_error,
                             [&](const auto& x, auto& rate) { flow(island, x, rate, 0); });
    }
    const auto departure = [&](const auto& w, State& rate, double s) {
        for (std::size_t i = 0; i < n; ++i) {
            point_[i] = island.x[i] + (s * island.rate[i] + (w[i] + island.remainder[i]));
        }
        flow(island, point_, rate, s);
        for (std::size_t i = 0; i < n; ++i) rate[i] -= island.rate[i];
    };
    Dopri5::depart(departure, island.x, h, stages_.data(), {w_, end_rate_, error_}, with_error,
                   Dopri5::inner_stages);
    seen_ = nullptr;
}

double Islands::error_of(const Island& island, double h) const
{
    double largest = 0;
    for (std::size_t i = 0; i < island.x.size(); ++i) {
        const double end = island.x[i] + (h * island.rate[i] + w_[i]);
        const double scale = world_.options.atol +
                             world_.options.rtol * std::max(std::fabs(island.x[i]), std::fabs(end));
        largest = std::max(largest, std::fabs(error_[i]) / scale);
        if (!std::isfinite(end + error_[i] + end_rate_[i])) return std::nan("");
    }
    return largest;
}

double Islands::first_step(const Island& island) const
{
    double size = 0;
    double speed = 0;
    for (std::size_t i = 0; i < island.x.size(); ++i) {
        const double scale = world_.options.atol + world_.options.rtol * std::fabs(island.x[i]);
        size = std::max(size, std::fabs(island.x[i]) / scale);
        speed = std::max(speed, std::fabs(island.rate[i]) / scale);
    }
    const double euler = size > 1e-5 && speed > 1e-5 ? 0.01 * size / speed : 1e-6;
    State moved(island.x);
    for (std::size_t i = 0; i < moved.size(); ++i) moved[i] += euler * island.rate[i];
    State rate(moved.size());
    flow(island, moved, rate, euler);
    double bend = 0;
    for (std::size_t i = 0; i < moved.size(); ++i) {
        const double scale = world_.options.atol + world_.options.rtol * std::fabs(island.x[i]);
        bend = std::max(bend, std::fabs(rate[i] - island.rate[i]) / scale);
    }
    const double fastest = std::max(speed, bend / euler);
    const double h = fastest <= 1e-15 ? 1e-6 : std::pow(0.01 / fastest, 0.2);
    const double first = std::min(100 * euler, h);
    return std::isfinite(first) && first > 0 ? first : 1e-6;
}

bool Islands::attempt(std::uint32_t which)
{
    Island& island = islands_[which];
    Instant t_end{world_.options.t_end, 0};
    if (island.events) t_end.value = std::min(t_end.value, island.events->must_stop_at());
    for (;;) {
        const double left = seconds(island.start, t_end);
        const double least = 4 * epsilon * std::max(std::fabs(island.start.value), 1e-300);
        island.h = island.next < left ? island.next : left;
        if (island.h <= least && left > least) return false;
        depart(island, island.h, true);
        const double error = error_of(island, island.h);
        const double factor = std::isfinite(error) ? ErrorRule{}.factor(error, 5) : 0.2;
        if (ErrorRule::accepts(error)) {
            // A step shortened by the end of the run says little about the next one.
            if (island.h < left || factor < 1) island.next = island.h * factor;
            island.end = island.h == left ? t_end : island.start.after(island.h);
            ++world_.statistics.steps;
            const double run = world_.options.t_end - world_.options.t_start;
            const bool is_short = island.h < left && island.h < short_part * run;
            island.short_steps = is_short ? island.short_steps + 1 : 0;
            return true;
        }
        ++world_.statistics.rejected;
        island.next = island.h * std::min(factor, 1.0);
    }
}

/// Records quartics through the middle and the end of the current step. False where a system cannot
/// continue.
bool Islands::record(Island& island)
{
    const double h = island.h;
    for (std::size_t i = 0; i < island.x.size(); ++i) {
        const TwoSum sum = two_sum(island.x[i], h * island.rate[i] + (w_[i] + island.remainder[i]));
        island.x_end[i] = sum.value;
        island.remainder_end[i] = sum.remainder;
        island.rate_end[i] = island.rate[i] + end_rate_[i];
    }
    if (island.system) {
        if (!find_events(island)) return false;
        record_system(island);
        return !trouble_;
    }
    if (island.unseen) {
        Body& body = world_.bodies[island.members[0]];
        ++body.version;
        body.t = island.start;
        body.quartic = true;
        return true;
    }
    Dopri5::dense(0.5 * h, h, stages_.data(), end_rate_, middle_);
    for (std::size_t m = 0; m < island.members.size(); ++m) {
        const std::uint32_t i = island.members[m];
        Body& body = world_.bodies[i];
        ++body.version;
        body.t = island.start;
        body.quartic = true;
        for (std::size_t c = 0; c < 2; ++c) {
            const std::size_t k = 4 * m + c;
            const double middle = middle_[k];
            const double end = w_[k];
            const double slope = h * end_rate_[k];
            body.p[c] = island.x[k];
            body.v[c] = island.rate[k];
            body.a[c] = 2 * (16 * middle - 5 * end + slope) / (h * h);
            const double c3 = (-32 * middle + 14 * end - 3 * slope) / (h * h * h);
            const double c4 = (16 * middle - 8 * end + 2 * slope) / (h * h * h * h);
            const double curved =
                0.5 * std::fabs(body.a[c]) + h * (std::fabs(c3) + h * std::fabs(c4));
            world_.bends[i].c3[c] = c3;
            world_.bends[i].c4[c] = c4;
            world_.bends[i].sweep[c] = h * (std::fabs(body.v[c]) + h * curved);
        }
    }
    return true;
}

bool Islands::advance(std::uint32_t which)
{
    Island& island = islands_[which];
    if (!island.started) {
        flow(island, island.x, island.rate, 0);
        island.next = first_step(island);
        island.started = true;
        if (island.events) {
            const StepVerdict verdict =
                island.events->start(island.start, island.x, island.next, island.mode);
            if (!follow(island, verdict)) return false;
        }
    }
    if (island.cut) {
        island.cut = false;
        island.x = island.x_end;
        std::ranges::fill(island.remainder, 0.0);
        island.mode = island.mode_after;
        island.start = island.end;
        flow(island, island.x, island.rate, 0);
    } else if (before(island.start, island.end)) {
        std::swap(island.x, island.x_end);
        std::swap(island.remainder, island.remainder_end);
        std::swap(island.rate, island.rate_end);
        island.start = island.end;
    }
    return attempt(which) && record(island);
}

bool Islands::stalls(std::uint32_t which) const
{
    return islands_[which].short_steps > most_short_steps;
}

void Islands::look_at(const Island& island, const Instant& t) const
{
    if (seen_ == &island && seen_at_.value == t.value && seen_at_.remainder == t.remainder &&
        seen_from_.value == island.start.value && seen_from_.remainder == island.start.remainder) {
        return;
    }
    const double s = seconds(island.start, t);
    depart(island, s, false);
    for (std::size_t i = 0; i < island.x.size(); ++i) {
        at_[i] = island.x[i] + (s * island.rate[i] + (w_[i] + island.remainder[i]));
    }
    seen_ = &island;
    seen_at_ = t;
    seen_from_ = island.start;
}

Vector2 Islands::position(std::uint32_t body, const Instant& t) const
{
    if (world_.bodies[body].mapped) return disc(body, t).at;
    look_at(islands_[world_.bodies[body].island], t);
    const std::size_t k = std::size_t{4} * place_[body];
    return {at_[k], at_[k + 1]};
}

Vector2 Islands::velocity(std::uint32_t body, const Instant& t) const
{
    if (world_.bodies[body].mapped) return disc(body, t).velocity;
    look_at(islands_[world_.bodies[body].island], t);
    const std::size_t k = std::size_t{4} * place_[body];
    return {at_[k + 2], at_[k + 3]};
}

bool Islands::restart(std::uint32_t which, const Instant& t,
                      const std::vector<std::pair<std::uint32_t, Vector2>>& velocities)
{
    Island& island = islands_[which];
    look_at(island, t);
    seen_ = nullptr;
    island.x = at_;
    std::ranges::fill(island.remainder, 0.0);
    for (const auto& [body, velocity] : velocities) {
        const std::size_t k = std::size_t{4} * place_[body];
        island.x[k + 2] = velocity[0];
        island.x[k + 3] = velocity[1];
        const Body& point = world_.bodies[body];
        if (point.radius > 0) continue;
        island.x[k] = point.p[0];  // on its side of the segments that it has struck
        island.x[k + 1] = point.p[1];
    }
    island.start = t;
    flow(island, island.x, island.rate, 0);
    return attempt(which) && record(island);
}

void Islands::suspend(std::uint32_t which)
{
    for (const std::uint32_t i : islands_[which].members) world_.bodies[i].quartic = false;
    seen_ = nullptr;
}

bool Islands::resume(std::uint32_t which, const Instant& t,
                     const std::vector<std::array<Vector2, 2>>& states)
{
    Island& island = islands_[which];
    for (std::size_t m = 0; m < states.size(); ++m) {
        const auto& [p, v] = states[m];
        const std::array<double, 4> x{p[0], p[1], v[0], v[1]};
        std::ranges::copy(x, island.x.begin() + static_cast<std::ptrdiff_t>(4 * m));
    }
    std::ranges::fill(island.remainder, 0.0);
    island.start = t;
    seen_ = nullptr;
    flow(island, island.x, island.rate, 0);
    if (!island.started) island.next = first_step(island);
    island.started = true;
    return attempt(which) && record(island);
}

std::vector<Islands::Join> Islands::springs(std::uint32_t which) const
{
    const Island& island = islands_[which];
    std::vector<Join> springs;
    for (const Link& link : island.links) {
        springs.push_back({island.members[link.a], island.members[link.b], link.rest,
                           link.stiffness, link.damping});
    }
    return springs;
}

}  // namespace ricochet::detail
