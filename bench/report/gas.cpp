#include "gas.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "cells.hpp"

namespace ricochet::report {

namespace {

using Long = long double;
constexpr Long never = std::numeric_limits<Long>::infinity();

/// The free flight of a disc since its last collision.
struct Flight {
    Long t, x, y, u, v, r, m;
    [[nodiscard]] Long x_at(Long s) const { return x + (s - t) * u; }
    [[nodiscard]] Long y_at(Long s) const { return y + (s - t) * v; }
};

/// A predicted collision.
struct Meeting {
    Long t = never;
    std::size_t guard = 0;
    std::size_t i = 0, j = 0;  ///< discs; the same one where it is a wall
    int wall = -1;
};

class BruteForceGas {
public:
    explicit BruteForceGas(const Scene& scene)
    {
        for (const Disc& d : scene.bodies()) {
            flights_.push_back(
                {0, d.at[0], d.at[1], d.velocity[0], d.velocity[1], d.radius, d.mass});
        }
        first_.resize(flights_.size());
        for (std::size_t i = 0; i < flights_.size(); ++i) predict(i);
    }

    /// Performs the next collision and returns it.
    Meeting next()
    {
        const Meeting meeting =
            *std::min_element(first_.begin(), first_.end(),
                              [](const Meeting& a, const Meeting& b) { return a.t < b.t; });
        move(meeting.i, meeting.t);
        if (meeting.wall >= 0) {
            Flight& d = flights_[meeting.i];
            (meeting.wall % 2 == 0 ? d.v : d.u) *= -1;
        } else {
            move(meeting.j, meeting.t);
            strike(flights_[meeting.i], flights_[meeting.j]);
        }
        now_ = meeting.t;
        // A disc whose first collision was with one of these needs another prediction.
        for (std::size_t k = 0; k < flights_.size(); ++k) {
            const Meeting& m = first_[k];
            if (m.i == meeting.i || m.i == meeting.j || m.j == meeting.i || m.j == meeting.j) {
                predict(k);
            }
        }
        // Other discs may now collide with these earlier.
        for (const std::size_t struck : {meeting.i, meeting.j}) {
            for (std::size_t k = 0; k < flights_.size(); ++k) consider(k, struck);
        }
        return meeting;
    }

private:
    void move(std::size_t i, Long t)
    {
        Flight& d = flights_[i];
        d.x = d.x_at(t);
        d.y = d.y_at(t);
        d.t = t;
    }

    void predict(std::size_t i)
    {
        first_[i] = {};
        const Flight& d = flights_[i];
        const std::array<Long, 4> times{
            d.v < 0 ? (d.r - d.y) / d.v : never, d.u < 0 ? (d.r - d.x) / d.u : never,
            d.v > 0 ? (1 - d.r - d.y) / d.v : never, d.u > 0 ? (1 - d.r - d.x) / d.u : never};
        for (std::size_t wall = 0; wall < 4; ++wall) {
            const Long t = d.t + times[wall];
            if (t < first_[i].t) {
                first_[i] = {t, wall_guard(flights_.size(), i, wall), i, i, static_cast<int>(wall)};
            }
        }
        for (std::size_t j = 0; j < flights_.size(); ++j) consider(i, j);
    }

    /// Records the collision of disc i with disc j if it is the first of disc i.
    void consider(std::size_t i, std::size_t j)
    {
        if (i == j) return;
        const Long t = meeting_time(flights_[i], flights_[j]);
        if (t < first_[i].t) {
            first_[i] = {t, pair_guard(std::min(i, j), std::max(i, j)), i, j, -1};
        }
    }

    [[nodiscard]] Long meeting_time(const Flight& a, const Flight& b) const
    {
        const Long x = a.x_at(now_) - b.x_at(now_);
        const Long y = a.y_at(now_) - b.y_at(now_);
        const Long u = a.u - b.u;
        const Long v = a.v - b.v;
        const Long rate = x * u + y * v;
        if (rate >= 0) return never;
        const Long reach = a.r + b.r;
        const Long gap = x * x + y * y - reach * reach;
        const Long square = rate * rate - (u * u + v * v) * gap;
        return square < 0 ? never : now_ + gap / (std::sqrt(square) - rate);
    }

    static void strike(Flight& a, Flight& b)
    {
        const Long x = a.x - b.x;
        const Long y = a.y - b.y;
        const Long p =
            2 * ((a.u - b.u) * x + (a.v - b.v) * y) / (x * x + y * y) / (1 / a.m + 1 / b.m);
        a.u -= p * x / a.m;
        a.v -= p * y / a.m;
        b.u += p * x / b.m;
        b.v += p * y / b.m;
    }

    std::vector<Flight> flights_;
    std::vector<Meeting> first_;  ///< of each disc
    Long now_ = 0;
};

[[nodiscard]] Answer solve(const Scene& scene, double t_end)
{
    const SceneRun run = simulate(scene, {.t_end = t_end});
    Answer answer{
        .finished = run.outcome == Outcome::reached_end,
        .energy_change = energy(scene, run.bodies) / energy(scene, test::start_of(scene)) - 1,
        .note = run.message};
    const std::size_t discs = scene.bodies().size();
    for (const SceneEvent& event : run.events) {
        if (event.kind != SceneEvent::Kind::impact) continue;
        const std::size_t other = event.other.index;
        answer.add(event.t, event.other.is_surface ? wall_guard(discs, event.body, other)
                                                   : pair_guard(event.body, other));
    }
    return answer;
}

}  // namespace

FirstCollisions first_collisions(const Scene& scene, std::size_t count)
{
    BruteForceGas gas(scene);
    FirstCollisions out;
    Long last = 0;
    for (std::size_t k = 0; k < count; ++k) {
        const Meeting meeting = gas.next();
        last = meeting.t;
        out.events.push_back({static_cast<double>(last), meeting.guard});
    }
    out.until = static_cast<double>((last + gas.next().t) / 2);
    return out;
}

Task<DiscGas> gas(std::size_t discs)
{
    const Scene scene = gas_scene(discs);
    FirstCollisions first = first_collisions(scene, scored_collisions);
    Task<DiscGas> task{.system = DiscGas(scene),
                       .t_end = gas_end(discs),
                       .events = std::move(first.events),
                       .scored_until = first.until,
                       .first_step = 1e-2 * gas_end(discs)};
    for (const Disc& disc : scene.bodies()) {
        task.x0.insert(task.x0.end(), {disc.at[0], disc.at[1], disc.velocity[0], disc.velocity[1]});
    }
    return task;
}

void add_gas(Cells& cells)
{
    for (const std::size_t discs : gas_sizes) {
        const std::string name = "gas-" + std::to_string(discs);
        if (discs != gas_in_one_state) {  // whose reference is that of its task
            cells.add_reference(
                [=] { return reference_of(name, gas_title(discs), std::vector{gas(discs)}); });
        }
        cells.add({name, "ricochet", "scene", 0, [discs] {
                       return [scene = gas_scene(discs), t_end = gas_end(discs)] {
                           return solve(scene, t_end);
                       };
                   }});
    }
}

}  // namespace ricochet::report
