// Systems as islands: their events, which the core finds, their discs, and pushes of these.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scene/islands.hpp"

namespace ricochet::detail {

/// The current step as seen by a monitor.
class Islands::Step final : public SceneStep {
public:
    Step(const Islands& islands, const Island& island) : islands_(islands), island_(island) {}

    Instant t0() const override { return island_.start; }
    double h() const override { return island_.h; }
    std::span<const double> x0() const override { return island_.x; }
    std::span<const double> x1() const override { return island_.x_end; }
    std::span<const double> rate0() const override { return island_.rate; }
    std::span<const double> rate1() const override { return island_.rate_end; }
    void interpolate(double s, std::span<double> x) const override
    {
        const double u = s / island_.h;
        const double bent = u * u * (3 - 2 * u);
        const double turn = s * u * (u - 1);
        for (std::size_t i = 0; i < x.size(); ++i) {
            const double departs = (x1()[i] - x0()[i]) - island_.h * rate0()[i];
            x[i] = x0()[i] + (s * rate0()[i] + (bent * departs + turn * (rate1()[i] - rate0()[i])));
        }
    }
    void restep(double s, std::span<double> x) const override { islands_.restep(island_, s, x); }

private:
    const Islands& islands_;
    const Island& island_;
};

void Islands::add_systems()
{
    for (const Scene::System& from : world_.scene.systems()) {
        Island island;
        island.system = from.motion;
        island.events = from.motion->events();
        island.mode = island.mode_after = from.motion->start_mode();
        island.x = from.motion->start();
        island.remainder.assign(island.x.size(), 0);
        island.rate.resize(island.x.size());
        island.x_end = island.remainder_end = island.rate_end = island.rate;
        island.start = island.end = {world_.options.t_start, 0};
        for (std::uint32_t k = 0; k < from.count; ++k) {
            const std::uint32_t i = from.first + k;
            const SystemDisc at = from.motion->shape(k, island.mode, island.start.value, island.x);
            Body& body = world_.bodies[i];
            body.p = at.at;
            body.v = at.velocity;
            body.a = {};
            body.island = static_cast<std::uint32_t>(islands_.size());
            body.mapped = body.quartic = true;
            place_[i] = k;
            island.members.push_back(i);
        }
        islands_.push_back(std::move(island));
    }
    if (!world_.scene.systems().empty()) world_.accelerations.resize(world_.bodies.size());
}

void Islands::restep(const Island& island, double s, std::span<double> x) const
{
    const auto swap = [this] {
        std::swap(stages_, spare_stages_);
        std::swap(w_, spare_w_);
        std::swap(end_rate_, spare_end_rate_);
    };
    spare_stages_.resize(stages_.size());
    for (State& stage : spare_stages_) stage.resize(island.x.size());
    spare_w_.resize(island.x.size());
    spare_end_rate_.resize(island.x.size());
    swap();
    depart(island, s, false);
    for (std::size_t i = 0; i < x.size(); ++i) {
        x[i] = island.x[i] + (s * island.rate[i] + (w_[i] + island.remainder[i]));
    }
    swap();
}

/// Ends the current step at the first events in it.
bool Islands::find_events(Island& island)
{
    island.cut = false;
    if (!island.events || island.h == 0) return true;  // at the end of the run
    return follow(island, island.events->examine(Step(*this, island)));
}

bool Islands::follow(Island& island, StepVerdict verdict)
{
    for (int k = 0; verdict == StepVerdict::cut; ++k) {
        island.cut = true;
        island.end = island.events->cut_at();
        island.x_end.assign(island.events->after().begin(), island.events->after().end());
        island.mode_after = island.events->mode_after();
        verdict = island.events->resume(island.next);
        if (k < 100) continue;
        trouble_ = {Outcome::endless_cascade, "has resets that trigger each other at one instant"};
        return false;
    }
    if (verdict == StepVerdict::stands) return true;
    trouble_ = {verdict == StepVerdict::rests ? Outcome::zeno : Outcome::stopped_by_event,
                verdict == StepVerdict::rests
                    ? "has come to rest at events of its own, which a scene does not follow"
                    : "has been ended by events of its own"};
    return false;
}

void Islands::record_system(Island& island)
{
    for (std::uint32_t k = 0; k < island.members.size(); ++k) {
        const std::uint32_t i = island.members[k];
        const double t = island.start.plus(0);
        const SystemDisc at = island.system->shape(k, island.mode, t, island.x);
        const double most = island.system->acceleration(k, island.mode, t, island.x);
        Body& body = world_.bodies[i];
        body.p = at.at;
        body.v = at.velocity;
        body.t = island.start;
        ++body.version;
        world_.accelerations[i] = most;
        if (!is_finite(at.at) || !is_finite(at.velocity)) {
            trouble_ = {Outcome::non_finite, "has a disc that is not finite"};
        } else if (!(most >= 0) || !std::isfinite(most)) {
            trouble_ = {Outcome::wrong_bound,
                        fmt::format("declares {} m/s^2 as bound of an acceleration", most)};
        }
    }
}

const std::vector<double>& Islands::state(std::uint32_t which, const Instant& t) const
{
    const Island& island = islands_[which];
    if (!island.started) return island.x;
    look_at(island, t);
    return at_;
}

SystemDisc Islands::disc(std::uint32_t body, const Instant& t) const
{
    const std::uint32_t which = world_.bodies[body].island;
    const Island& island = islands_[which];
    return island.system->shape(place_[body], island.mode, t.plus(0), state(which, t));
}

std::array<Vector2, 2> Islands::mobility(std::uint32_t of, std::uint32_t by, const Instant& t) const
{
    const std::uint32_t which = world_.bodies[by].island;
    const Island& island = islands_[which];
    const State x = state(which, t);
    const double at = t.plus(0);
    const Vector2 before = island.system->shape(place_[of], island.mode, at, x).velocity;
    std::array<Vector2, 2> changes;
    for (std::size_t c = 0; c < 2; ++c) {
        State after = x;
        Vector2 unit{};
        unit[c] = 1;
        island.system->push(place_[by], island.mode, at, after, unit);
        changes[c] = island.system->shape(place_[of], island.mode, at, after).velocity - before;
    }
    return changes;
}

bool Islands::push(std::uint32_t which, const Instant& t,
                   const std::vector<std::pair<std::uint32_t, Vector2>>& impulses)
{
    Island& island = islands_[which];
    State x = state(which, t);
    for (const auto& [body, impulse] : impulses) {
        island.system->push(place_[body], island.mode, t.plus(0), x, impulse);
    }
    seen_ = nullptr;
    island.x = std::move(x);
    std::ranges::fill(island.remainder, 0.0);
    island.start = island.end = t;
    island.cut = false;
    flow(island, island.x, island.rate, 0);
    if (island.events) {
        const StepVerdict verdict = island.events->start(t, island.x, island.next, island.mode);
        if (!follow(island, verdict)) return false;
        if (island.cut) return advance(which);
    }
    return attempt(which) && record(island);
}

}  // namespace ricochet::detail
