#include "scene/contact_island.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace ricochet::detail {

namespace {

constexpr double epsilon = 2.220446049250313e-16;

/// Defect of the contact law in a crowd, as a fraction of the velocities, and the smaller one where
/// with the first the energy would rise.
constexpr double crowded_defect = 1e-4;
constexpr double crowded_small_defect = 1e-6;
/// Overlap, as a fraction of the coordinates, that a crowd does not push apart.
constexpr double crowded_overlap = 1e-8;
/// Residual of the impacts at the end of its steps.
constexpr double impact_defect = 1e-2;
/// Velocity, as a fraction of that of a step of free fall, below which rest of a crowd is looked
/// for, and the number of steps from one look to the next.
constexpr double crowded_slow = 1e-2;
constexpr std::uint32_t steps_to_look = 16;

/// [m/s] Relative velocity at which a contact has no part in impacts.
constexpr double apart = 1e6;

}  // namespace

// --- the law of one step ---

/// Springs resist the velocity at the end of the step: with h c + h^2 k along the spring, and with
/// its tension across, where it pulls.
void ContactIsland::couple_springs(double h)
{
    problem_.couplings.clear();
    for (const Link& k : links_) {
        const Eigen::Vector2d d = q_.segment<2>(2 * k.first) - q_.segment<2>(2 * k.second);
        const double length = std::hypot(d[0], d[1]);
        if (!(length > 0)) continue;
        const Eigen::Vector2d along = d / length;
        const double pull = k.stiffness * (length - k.rest);
        problem_.momentum.segment<2>(2 * k.first) -= h * pull * along;
        problem_.momentum.segment<2>(2 * k.second) += h * pull * along;
        const double stiff = h * k.damping + h * h * k.stiffness;
        const double across = h * h * std::max(0.0, pull) / length;
        if (stiff == 0) continue;
        problem_.couplings.push_back({k.first, k.second,
                                      stiff * along[0] * along[0] + across * along[1] * along[1],
                                      (stiff - across) * along[0] * along[1],
                                      stiff * along[1] * along[1] + across * along[0] * along[0]});
    }
}

/// Assembles the terms that do not depend on contacts.
void ContactIsland::assemble(double h, const Eigen::VectorXd& v)
{
    const auto n = bodies_.size();
    problem_.inertia.resize(n);
    problem_.momentum.resize(v.size());
    for (std::size_t i = 0; i < n; ++i) {
        const IslandBody& b = bodies_[i];
        problem_.inertia[i] = b.mass + h * b.drag;
        const auto k = 2 * static_cast<Eigen::Index>(i);
        problem_.momentum[k] = b.mass * (v[k] + h * gravity_[0]);
        problem_.momentum[k + 1] = b.mass * (v[k + 1] + h * gravity_[1]);
    }
    set_edges_momentum(v, problem_);
    couple_springs(h);
}

LawContact ContactIsland::law_contact(const Touch& touch, double h) const
{
    LawContact c{.first = touch.body,
                 .second = touch.wall ? -1 : touch.other,
                 .normal = touch.normal,
                 .offset = {},
                 .friction = touch.law.friction};
    c.edges = {edge_of(touch.body), touch.wall ? -1 : edge_of(touch.other)};
    // An overlap by rounding is removed in one step; a deeper one is not pushed out at a speed.
    c.offset[0] = std::max(touch.gap, -closed_gap * size_of(touch.body)) / h;
    if (options_.crowded && touch.gap < 0) {
        c.offset[0] = std::min(0.0, touch.gap + crowded_overlap * size_of(touch.body)) / h;
    }
    if (!touch.wall) return c;
    const auto way = wall_displacement(touch.other, t_, t_ + h);
    const auto [nx, ny] = touch.normal;
    c.offset[0] -= (nx * way[0] + ny * way[1]) / h;
    c.offset[1] -= (nx * way[1] - ny * way[0]) / h;
    return c;
}

/// Impulses of the last step, for contacts that pushed then.
Eigen::VectorXd ContactIsland::warm_impulses(double h) const
{
    Eigen::VectorXd p = Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(touches_.size()));
    if (!(warm_step_ > 0)) return p;
    // Both lists are in the order of their members.
    std::size_t k = 0;
    const auto before = [](const Touch& a, const Touch& b) {
        return std::tuple(a.wall, a.body, a.other) < std::tuple(b.wall, b.body, b.other);
    };
    for (std::size_t i = 0; i < touches_.size(); ++i) {
        while (k < warm_.size() && before(warm_[k], touches_[i])) ++k;
        if (k == warm_.size()) break;
        if (!same(warm_[k], touches_[i])) continue;
        p.segment<2>(2 * static_cast<Eigen::Index>(i)) =
            h / warm_step_ * warm_impulses_.segment<2>(2 * static_cast<Eigen::Index>(k));
    }
    return p;
}

bool ContactIsland::solve_touches(double h)
{
    std::erase_if(touches_, [this](const Touch& c) {
        return std::ranges::any_of(excluded_, [&](const Touch& e) { return same(c, e); });
    });
    problem_.contacts.clear();
    for (const Touch& c : touches_) problem_.contacts.push_back(law_contact(c, h));
    const bool overlaps = std::ranges::any_of(touches_, [](const Touch& c) { return c.gap < 0; });
    if (solve_law(h, !overlaps)) return true;
    if (!overlaps) return false;
    // Discs that friction has wedged cannot part by an overlap of rounding: it is left in place.
    for (std::size_t k = 0; k < touches_.size(); ++k) {
        Touch closed = touches_[k];
        closed.gap = std::max(0.0, closed.gap);
        problem_.contacts[k] = law_contact(closed, h);
    }
    ++statistics_.wedged;
    return solve_law(h, true);
}

/// Solves the present contacts, from the impulses of the last step. Without last resorts only
/// a converged solution is accepted.
bool ContactIsland::solve_law(double h, bool last_resorts)
{
    if (enough_ == 0 || enough_ == crowded_defect) impulses_ = warm_impulses(h);
    if (enough_ > 0) {
        const bool polish = enough_ < crowded_defect;
        failure_ = law_.settle(problem_, impulses_, v_next_, enough_, polish);
    }
    if (enough_ == 0 || failure_.residual > crowded_defect) {
        failure_ = law_.solve(problem_, impulses_, v_next_, last_resorts);
    }
    ++statistics_.problems;
    statistics_.iterations += static_cast<std::uint64_t>(failure_.iterations);
    statistics_.factors += static_cast<std::uint64_t>(failure_.factors);
    statistics_.sweeps += static_cast<std::uint64_t>(failure_.sweeps);
    statistics_.dense += failure_.dense;
    const double most = enough_ > 0 ? crowded_defect : last_resorts ? options_.largest_defect : 0;
    const bool solved = failure_.converged || failure_.residual <= most;
    return solved && v_next_.allFinite();
}

bool ContactIsland::stays_within(const std::vector<double>& reach, double h) const
{
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const auto k = 2 * static_cast<Eigen::Index>(i);
        if (!(h * std::hypot(v_next_[k], v_next_[k + 1]) <= reach[i])) return false;
    }
    return true;
}

/// Computes the velocities after a step of length h, in `v_next_`.
bool ContactIsland::attempt(double h)
{
    assemble(h, v_);
    std::vector<double> reach(bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const auto k = 2 * static_cast<Eigen::Index>(i);
        const double free =
            std::hypot(problem_.momentum[k], problem_.momentum[k + 1]) / problem_.inertia[i];
        reach[i] = 2 * h * std::max(free, std::hypot(v_[k], v_[k + 1])) + 1e-3 * bodies_[i].radius +
                   closed_gap * size_of(static_cast<int>(i));
    }
    for (int round = 0; round < 30; ++round) {
        find_touches(reach);
        if (!solve_touches(h)) return false;
        if (stays_within(reach, h)) return true;
        for (std::size_t i = 0; i < bodies_.size(); ++i) {
            const auto k = 2 * static_cast<Eigen::Index>(i);
            reach[i] = std::max(reach[i], 2 * h * std::hypot(v_next_[k], v_next_[k + 1]));
        }
    }
    return false;
}

// --- arrivals ---

double ContactIsland::relative_normal(const Touch& touch, const Eigen::VectorXd& v) const
{
    const auto [nx, ny] = touch.normal;
    double x = v[2 * touch.body];
    double y = v[2 * touch.body + 1];
    if (!touch.wall) {
        x -= v[2 * touch.other];
        y -= v[2 * touch.other + 1];
    }
    return nx * x + ny * y;
}

/// Change of velocities by forces alone in the current step.
Eigen::VectorXd ContactIsland::kick() const
{
    Eigen::VectorXd kick = problem_.momentum.head(q_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        kick.segment<2>(2 * static_cast<Eigen::Index>(i)) /= problem_.inertia[i];
    }
    kick -= v_.head(q_.size());
    return kick;
}

/// [m/s] Speed at which a contact that closes in a step rebounds, 0 where it does not. A rebound
/// shorter than the step is dissipated: impacts that a step does not resolve accumulate within it.
double ContactIsland::rebound_speed(std::size_t k, double h, const Eigen::VectorXd& kick)
{
    const Touch& c = touches_[k];
    if (!(impulses_[2 * static_cast<Eigen::Index>(k)] > 0) || c.law.restitution == 0) return 0;
    if (c.gap <= closed_gap * size_of(c.body)) return 0;
    double approach = -relative_normal(c, v_);
    if (c.wall) {
        const auto way = wall_displacement(c.other, t_, t_ + h);
        approach += (c.normal[0] * way[0] + c.normal[1] * way[1]) / h;
    }
    const bool lasts = std::ranges::any_of(warm_, [&](const Touch& w) {
        return same(c, w) && warm_impulses_[2 * static_cast<Eigen::Index>(&w - warm_.data())] > 0;
    });
    if (lasts || !(approach > 0)) return 0;
    // Under gravity any approach as slow as a step of free fall is soon pressed together.
    const double press =
        std::max(-relative_normal(c, kick) / h, std::hypot(gravity_[0], gravity_[1]));
    if (2 * c.law.restitution * approach < press * h) {
        ++statistics_.spent;
        return 0;
    }
    return c.law.restitution * approach;
}

/// Excludes contacts that would rebound, so that the motion goes on up to them.
bool ContactIsland::exclude_arrivals(double h)
{
    const Eigen::VectorXd change = kick();
    const std::size_t before = excluded_.size();
    for (std::size_t k = 0; k < touches_.size(); ++k) {
        if (rebound_speed(k, h, change) > 0) excluded_.push_back(touches_[k]);
    }
    return excluded_.size() > before;
}

LawContact ContactIsland::closed_contact(const Touch& touch, double h) const
{
    Touch closed = touch;
    closed.gap = 0;
    return law_contact(closed, h);
}

/// Sets the impacts at the end of a step of length h of a crowd; false where there are none.
bool ContactIsland::set_rebounds(double h)
{
    const Eigen::VectorXd change = kick();
    impacts_.contacts.clear();
    rebounds_ = 0;
    for (std::size_t k = 0; k < touches_.size(); ++k) {
        LawContact c = closed_contact(touches_[k], h);
        const double speed = rebound_speed(k, h, change);
        rebounds_ += speed > 0;
        c.offset[0] -= speed;
        // The others stay apart.
        if (!(impulses_[2 * static_cast<Eigen::Index>(k)] > 0)) c.offset[0] = apart;
        impacts_.contacts.push_back(c);
    }
    if (rebounds_ == 0) return false;
    impacts_.inertia.clear();
    for (const IslandBody& b : bodies_) impacts_.inertia.push_back(b.mass);
    set_momentum(v_next_, impacts_);
    return true;
}

/// [J] Kinetic energy of the difference of two velocities of all bodies.
double ContactIsland::energy_between(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const
{
    double sum = 0;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const auto k = 2 * static_cast<Eigen::Index>(i);
        sum += 0.5 * bodies_[i].mass * (a.segment<2>(k) - b.segment<2>(k)).squaredNorm();
    }
    for (std::size_t i = 0; i < problem_.turning.size(); ++i) {
        if (problem_.turning[i] == 0) continue;
        const auto k = static_cast<Eigen::Index>(2 * bodies_.size() + i);
        sum += 0.5 / problem_.turning[i] * (a[k] - b[k]) * (a[k] - b[k]);
    }
    return sum;
}

/// [J] Work of the impulses p of pressed contacts at the velocities of the end of a step of length
/// h.
double ContactIsland::work_of(const Eigen::VectorXd& p, double h) const
{
    double sum = 0;
    for (std::size_t k = 0; k < touches_.size(); ++k) {
        const auto i = 2 * static_cast<Eigen::Index>(k);
        if (!(p[i] > 0)) continue;
        const auto u = ContactLaw::relative(closed_contact(touches_[k], h), v_next_);
        sum += p[i] * u.normal + p[i + 1] * u.tangential;
    }
    return sum;
}

/// [J] Energy lost in a step of length h, seen from walls that move; that lost by drag and springs
/// is not counted.
double ContactIsland::lost(double h) const
{
    return energy_between(v_next_, v_) - work_of(impulses_, h);
}

/// The largest part of impulses p, which lead from the velocities of the step's end to v, with
/// which the energy is not above that at the start of the step.
double ContactIsland::allowed_part(const Eigen::VectorXd& p, const Eigen::VectorXd& v,
                                   double h) const
{
    // Gained with the part theta: theta linear + theta^2 square.
    const double linear = work_of(p, h);
    const double square = energy_between(v, v_next_);
    const double most = lost(h);
    if (linear + square <= most) return 1;
    if (!(most > 0)) return 0;
    return (std::sqrt(linear * linear + 4 * most * square) - linear) / (2 * square);
}

/// Lets the contacts that close in a step of length h of a crowd rebound at its end.
void ContactIsland::rebound(double h)
{
    v_end_ = v_next_;
    if (!set_rebounds(h)) return;
    Eigen::VectorXd p;
    Eigen::VectorXd v;
    impact_law_.settle(impacts_, p, v, impact_defect, false);
    if (!v.allFinite()) return;
    v_end_ += allowed_part(p, v, h) * (v - v_next_);
}

/// A step of a crowd, whose contacts are solved again where the energy would rise by their defect.
bool ContactIsland::attempt_in_crowd(double h)
{
    bool solved = false;
    for (const double enough : {crowded_defect, crowded_small_defect, 0.0}) {
        enough_ = enough;
        solved = attempt(h);
        if (!solved || failure_.converged || lost(h) >= 0) break;
    }
    enough_ = 0;
    if (solved) rebound(h);
    return solved;
}

/// A contact s after the start of the current step.
ContactIsland::Touch ContactIsland::on_chord(const Touch& touch, double s) const
{
    const auto at = [&](int body) {
        return Point{q_[2 * body] + s * v_next_[2 * body],
                     q_[2 * body + 1] + s * v_next_[2 * body + 1]};
    };
    Touch then = touch;
    const Point x = at(touch.body);
    if (touch.wall) {
        const IslandWall& wall = walls_[static_cast<std::size_t>(touch.other)];
        Point moved{};
        if (wall.motion) {
            moved = wall.motion->displacement(t_);
            const Point way = wall_displacement(touch.other, t_, t_ + planned_);
            moved = {moved[0] + s / planned_ * way[0], moved[1] + s / planned_ * way[1]};
        }
        wall_touch(x, moved, then);
        return then;
    }
    const Point y = at(touch.other);
    const double distance = std::hypot(x[0] - y[0], x[1] - y[1]);
    then.normal = {(x[0] - y[0]) / distance, (x[1] - y[1]) / distance};
    then.gap = distance - bodies_[static_cast<std::size_t>(touch.body)].radius -
               bodies_[static_cast<std::size_t>(touch.other)].radius;
    return then;
}

/// Time at which a contact closes on the straight lines of the step; infinite where the gap stays
/// open. Gaps are convex along them, so Newton's method comes from the left and does not pass the
/// first root.
double ContactIsland::closing_time(const Touch& touch, double h) const
{
    double s = 0;
    for (int iteration = 0; iteration < 100 && s <= h; ++iteration) {
        const Touch then = on_chord(touch, s);
        if (then.gap <= 4 * epsilon * size_of(touch.body)) return s;
        double rate = relative_normal(then, v_next_);
        if (touch.wall) {
            const Point way = wall_displacement(touch.other, t_, t_ + h);
            rate -= (then.normal[0] * way[0] + then.normal[1] * way[1]) / h;
        }
        if (!(rate < 0)) break;
        const double next = s - then.gap / rate;
        if (next <= s) return s;
        s = next;
    }
    return std::numeric_limits<double>::infinity();
}

/// Time of the first of the excluded contacts to close; those that close together are `arrivals_`.
double ContactIsland::first_arrival(double h)
{
    double first = std::numeric_limits<double>::infinity();
    std::vector<double> times;
    for (const Touch& c : excluded_) {
        times.push_back(closing_time(c, h));
        first = std::min(first, times.back());
    }
    arrivals_.clear();
    if (!(first <= h)) return first;
    for (std::size_t k = 0; k < times.size(); ++k) {
        if (times[k] - first <= 8 * epsilon * (std::abs(t_) + first)) {
            arrivals_.push_back(public_contact(on_chord(excluded_[k], first), 0, 0));
        }
    }
    return first;
}

IslandContact ContactIsland::public_contact(const Touch& c, double normal, double tangential) const
{
    const auto other = static_cast<std::size_t>(c.other);
    return {.first = bodies_[static_cast<std::size_t>(c.body)].id,
            .with_wall = c.wall,
            .second = c.wall ? walls_[other].id : bodies_[other].id,
            .normal = c.normal,
            .gap = c.gap,
            .impulse = {normal, tangential}};
}

// --- steps ---

/// Takes a step of length h or, where its contacts are not solved, of a fraction of it.
bool ContactIsland::fit_step(double h)
{
    for (int halving = 0; halving <= 10; ++halving) {
        excluded_.clear();
        planned_ = h;
        bool solved = options_.crowded ? attempt_in_crowd(h) : attempt(h);
        while (solved && !options_.crowded && exclude_arrivals(h)) solved = attempt(h);
        if (solved) return true;
        if (!problem_.momentum.allFinite()) return false;
        ++statistics_.halvings;
        h /= 2;
        planned_until_ = t_ + h;
    }
    return false;
}

ContactIsland::Plan ContactIsland::plan(double until)
{
    planned_ = 0;
    const double wakes = wake_time();
    if (asleep_ && wakes > t_) {
        planned_until_ = std::min(until, wakes);
        return {IslandOutcome::asleep, planned_ = std::max(0.0, planned_until_ - t_)};
    }
    asleep_ = false;
    if (!(until > t_)) return {};
    planned_until_ = until;
    // A wall begins to move where a step ends.
    if (wakes > t_) planned_until_ = std::min(planned_until_, wakes);
    for (const IslandWall& wall : walls_) {
        if (!wall.motion || !wall.motion->next_break) continue;
        const double jump = wall.motion->next_break(t_);
        if (jump > t_) planned_until_ = std::min(planned_until_, jump);
    }
    if (planned_until_ - t_ > options_.step * (1 + 1e-9)) planned_until_ = t_ + options_.step;
    if (!fit_step(planned_until_ - t_)) {
        const bool finite = problem_.momentum.allFinite() && v_next_.allFinite();
        return {finite ? IslandOutcome::not_converged : IslandOutcome::non_finite, planned_ = 0};
    }
    const double arrival = first_arrival(planned_);
    if (arrival <= planned_) return {IslandOutcome::impact, arrival};
    if (is_released()) return {IslandOutcome::released, planned_ = 0};
    return {IslandOutcome::reached, planned_};
}

/// Whether this step is the last of the steps without contact that the patience requires. It is not
/// taken: the scene continues from the time at which contact, or patience, has ended.
bool ContactIsland::is_released() const
{
    if (!impulses_.isZero(0)) return false;
    std::uint32_t patience = 1;
    for (const IslandBody& b : bodies_) patience = std::max(patience, b.patience);
    return open_steps_ + 1 >= patience;
}

std::array<double, 2> ContactIsland::chord(std::uint32_t id) const
{
    const int i = place_of(id);
    if (asleep_) return {0, 0};
    return {v_next_[2 * i], v_next_[2 * i + 1]};
}

void ContactIsland::commit(double s)
{
    if (!(s > 0)) return;
    const bool whole = s >= planned_;
    if (asleep_) {
        const double wakes = wake_time();
        t_ = s >= wakes - t_ ? wakes : s == planned_ ? planned_until_ : t_ + s;
        return;
    }
    const double free = free_speed();
    q_ += s * v_next_.head(q_.size());
    if (whole) {
        v_ = options_.crowded ? v_end_ : v_next_;
    } else {
        v_ += s / planned_ * (v_next_ - v_);
    }
    t_ = whole ? planned_until_ : t_ + s;
    warm_ = touches_;
    warm_impulses_ = impulses_;
    warm_step_ = planned_;
    open_steps_ = impulses_.isZero(0) ? open_steps_ + 1 : 0;
    ++statistics_.steps;
    statistics_.largest_residual = std::max(statistics_.largest_residual, failure_.residual);
    if (whole) try_to_sleep(free);
    planned_ = 0;
    // A moving wall is not on the straight line of a step when the step is cut.
    const auto moving = [](const IslandWall& wall) { return wall.motion != nullptr; };
    if (!whole && std::ranges::any_of(walls_, moving)) project(options_.largest_overlap);
    // The straight line of a step leads behind an arc that is met from inside.
    const auto curved = [](const IslandWall& wall) { return wall.radius > 0; };
    if (std::ranges::any_of(walls_, curved)) project(std::numeric_limits<double>::infinity());
}

/// The largest change of velocity by forces alone in the current step.
double ContactIsland::free_speed() const
{
    double largest = 0;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const auto k = 2 * static_cast<Eigen::Index>(i);
        for (Eigen::Index j = k; j < k + 2; ++j) {
            const double change = problem_.momentum[j] / problem_.inertia[i] - v_[j];
            largest = std::max(largest, std::abs(change));
        }
    }
    return largest;
}

IslandOutcome ContactIsland::advance(double until)
{
    while (t_ < until) {
        const IslandOutcome outcome =
            options_.estimate_error && !asleep_ ? advance_by_halves(until) : advance_once(until);
        if (outcome != IslandOutcome::reached && outcome != IslandOutcome::asleep) return outcome;
    }
    return asleep_ ? IslandOutcome::asleep : IslandOutcome::reached;
}

IslandOutcome ContactIsland::advance_once(double until)
{
    const Plan next = plan(until);
    commit(next.length);
    return next.outcome;
}

/// Takes the same step whole and in two halves. The halves are kept; the difference is the error of
/// the whole step, and approximately that of the halves.
IslandOutcome ContactIsland::advance_by_halves(double until)
{
    const Plan whole = plan(until);
    if (whole.outcome != IslandOutcome::reached) {
        commit(whole.length);
        return whole.outcome;
    }
    const double end = planned_until_;
    const Eigen::VectorXd at = q_ + whole.length * v_next_.head(q_.size());
    for (const double target : {t_ + whole.length / 2, end}) {
        const IslandOutcome outcome = advance_once(target);
        if (outcome != IslandOutcome::reached) return outcome;
        if (asleep_) break;
    }
    if (t_ == end) {
        const double error = (q_ - at).lpNorm<Eigen::Infinity>();
        statistics_.largest_error = std::max(statistics_.largest_error, error);
        statistics_.sum_of_errors += error;
    }
    return IslandOutcome::reached;
}

// --- rest ---

/// Whether a step of length h from rest leaves all velocities zero.
bool ContactIsland::rests(double h)
{
    excluded_.clear();
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(v_.size());
    assemble(h, zero);
    std::vector<double> reach;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        reach.push_back(closed_gap * size_of(static_cast<int>(i)));
    }
    find_touches(reach);
    problem_.contacts.clear();
    for (const Touch& c : touches_) {
        problem_.contacts.push_back(law_contact(c, h));
        problem_.contacts.back().offset = {};
    }
    double largest = 0;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const auto k = 2 * static_cast<Eigen::Index>(i);
        largest = std::max(largest, problem_.momentum.segment<2>(k).norm() / problem_.inertia[i]);
    }
    impulses_ = warm_impulses(h);
    const LawReport report = law_.solve(problem_, impulses_, v_next_);
    return report.converged && v_next_.allFinite() &&
           v_next_.lpNorm<Eigen::Infinity>() <= options_.tolerance * largest;
}

/// Puts the island to sleep where velocities are zero, up to the errors of the solver and of the
/// rounding of gaps, and remain zero.
void ContactIsland::try_to_sleep(double free_speed)
{
    if (!(wake_time() > t_)) return;
    double size = 0;
    for (int i = 0; i < static_cast<int>(bodies_.size()); ++i) size = std::max(size, size_of(i));
    const double fastest = v_.lpNorm<Eigen::Infinity>();
    double zero = 10 * options_.tolerance * free_speed + 16 * epsilon * size / planned_;
    if (options_.crowded) {
        if (++awake_steps_ < steps_to_look) return;
        awake_steps_ = 0;
        zero = std::max(zero, crowded_slow * free_speed);
    }
    const bool at_rest = fastest <= zero && rests(planned_);
    if (!(fastest <= options_.sleep_speed)) slow_since_ = t_;
    slow_since_ = std::min(slow_since_, t_);
    const bool slow = options_.sleep_speed > 0 && t_ - slow_since_ >= options_.sleep_after;
    if (!at_rest && !slow) return;
    if (at_rest) {
        warm_ = touches_;
        warm_impulses_ = impulses_;
    } else {
        ++statistics_.slept_by_speed;
    }
    v_.setZero();
    v_next_.setZero();
    asleep_ = true;
    ++statistics_.slept;
}

void ContactIsland::wake()
{
    asleep_ = false;
    slow_since_ = t_;
}

}  // namespace ricochet::detail
