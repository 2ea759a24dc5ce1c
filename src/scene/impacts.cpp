#include "scene/impacts.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "scene/gauss.hpp"
#include "scene/thermal.hpp"

namespace ricochet::detail {

namespace {

/// Approach velocities that differ by less are treated as equal.
constexpr double tie = 1e-12;

/// Waves per contact after which a cluster is treated as collapsing.
constexpr std::size_t patience = 100;

/// The same in lasting contact, whose next step takes the remaining impacts without restitution.
constexpr std::size_t lasting_patience = 4;

/// Limits: contacts for which sweeps suffice if they end; contacts of an exact solution; sweeps
/// before it; sweeps where there is none.
constexpr std::size_t few = 4;
constexpr std::size_t most_exact = 600;
constexpr int few_sweeps = 30;
constexpr int most_sweeps = 10'000;
/// Sweeps after which changes by less than the rounding of the velocities are left out: a fast body
/// that slides past slow ones would push them forever, since it does not become slower itself.
constexpr int exact_sweeps = 100;

}  // namespace

double Impacts::approach(const Cluster& cluster, const Contact& contact) const
{
    return -dot(relative_velocity(cluster.after, contact), contact.normal);
}

double Impacts::noise(const Cluster& cluster, const Contact& contact) const
{
    const double other = !contact.surface ? norm(cluster.after[contact.slot_b])
                         : contact.moving ? norm(contact.surface_velocity)
                                          : 0;
    return 8 * epsilon * (norm(cluster.after[contact.slot_a]) + other);
}

/// [m/s] Change of the velocity at a contact that is rounding of what the fastest body of a cluster
/// has handed on, since normals are a rounding off their directions. It acts, and is no impact.
double Impacts::unrecorded(const Cluster& cluster, const Contact& contact)
{
    if (cluster.contacts.size() == 1) return 0;
    return (8 * epsilon + contact.blur) * cluster.fastest;
}

void Impacts::push(Cluster& cluster, const Contact& contact, const Vector2& impulse) const
{
    if (!cluster.couplings.empty()) return push_coupled(cluster, contact, impulse);
    Vector2& a = cluster.after[contact.slot_a];
    a = a + world_.bodies[contact.a].inverse_mass * impulse;
    if (contact.surface) return;
    Vector2& b = cluster.after[contact.slot_b];
    b = b - world_.bodies[contact.b].inverse_mass * impulse;
}

/// The same where a body may be a plate, or belong to a system, whose other bodies it moves too.
void Impacts::push_coupled(Cluster& cluster, const Contact& contact, const Vector2& impulse) const
{
    const auto apply = [&](std::uint32_t body, std::uint32_t slot, const Vector2& p) {
        cluster.impulses[slot] = cluster.impulses[slot] + p;
        if (!world_.is_guided(body)) {
            cluster.after[slot] = cluster.after[slot] + world_.bodies[body].inverse_mass * p;
            return;
        }
        for (const Coupling& coupling : cluster.couplings) {
            if (coupling.by != slot) continue;
            Vector2& v = cluster.after[coupling.of];
            v = v + coupling.times(p);
        }
    };
    apply(contact.a, contact.slot_a, impulse);
    if (!contact.surface) apply(contact.b, contact.slot_b, -1.0 * impulse);
}

/// Effective masses of contacts along the normal and across, where there are systems or plates.
void Impacts::set_masses(Cluster& cluster) const
{
    const auto inverse_of = [&](std::uint32_t body, std::uint32_t slot, const Vector2& direction) {
        if (!world_.is_guided(body)) return world_.bodies[body].inverse_mass;
        for (const Coupling& coupling : cluster.couplings) {
            if (coupling.of == slot && coupling.by == slot) {
                return dot(direction, coupling.times(direction));
            }
        }
        return 0.0;
    };
    const auto mass_along = [&](const Contact& contact, const Vector2& direction) {
        double inverse = inverse_of(contact.a, contact.slot_a, direction);
        if (!contact.surface) inverse += inverse_of(contact.b, contact.slot_b, direction);
        return inverse > 0 ? 1 / inverse : 0;  // neither can be moved
    };
    for (Contact& contact : cluster.contacts) {
        contact.mass = mass_along(contact, contact.normal);
        contact.tangential_mass = mass_along(contact, turned(contact.normal));
    }
}

/// Effective masses across, where edges move with the spin: an impulse J across turns the disc a by
/// -r J / I, and moves its edge by r^2 J / I more than its centre.
void Impacts::set_masses_of_edges(Cluster& cluster)
{
    const auto edge = [&](std::uint32_t slot) {
        const TurningBody& body = cluster.turning[slot];
        return body.radius * body.radius * body.inverse_inertia;
    };
    for (Contact& contact : cluster.contacts) {
        const double more = edge(contact.slot_a) + (contact.surface ? 0 : edge(contact.slot_b));
        if (more == 0) continue;
        const double inverse = contact.tangential_mass > 0 ? 1 / contact.tangential_mass : 0;
        contact.tangential_mass = 1 / (inverse + more);
    }
}

/// [m/s] Relative velocity across of the two edges that touch, or of two centres that do not turn.
double Impacts::slip(const Cluster& cluster, const Contact& contact)
{
    const double centres = dot(relative_velocity(cluster.after, contact), turned(contact.normal));
    if (cluster.turning.empty()) return centres;
    const auto edge = [&](std::uint32_t slot) {
        const TurningBody& body = cluster.turning[slot];
        return body.inverse_inertia > 0 ? body.radius * body.spin : 0;
    };
    return centres - (edge(contact.slot_a) + (contact.surface ? 0 : edge(contact.slot_b)));
}

/// Turns the discs of a contact by an impulse across.
void Impacts::turn(Cluster& cluster, const Contact& contact, double tangential)
{
    if (cluster.turning.empty()) return;
    const auto apply = [&](std::uint32_t slot) {
        TurningBody& body = cluster.turning[slot];
        body.spin -= body.radius * tangential * body.inverse_inertia;
    };
    apply(contact.slot_a);
    if (!contact.surface) apply(contact.slot_b);
}

/// Resolves one contact alone, in closed form. The normal has the length 1 up to rounding, always
/// on the same side for the same normal: uncorrected, an elastic impact would change the energy by
/// |n|^2 - 1 of the work, and many of them would make it drift.
void Impacts::strike(Cluster& cluster, Contact& contact)
{
    const double u = approach(cluster, contact);
    const double size = (1 + contact.restitution) * u * contact.mass;
    contact.impulse = size - size * excess_of_square(contact.normal);
    contact.tangential = 0;
    if (contact.friction > 0) {
        const Vector2 tangent = turned(contact.normal);
        const double slips = slip(cluster, contact);
        const double most = contact.friction * contact.impulse;
        contact.tangential = std::clamp(-slips * contact.tangential_mass, -most, most);
        push(cluster, contact, contact.impulse * contact.normal + contact.tangential * tangent);
        turn(cluster, contact, contact.tangential);
    } else {
        push(cluster, contact, contact.impulse * contact.normal);
        if (rounds_alike(cluster, contact)) undo_gain(cluster, contact, u);
    }
}

/// Whether rounding changes the energy in the same way at each such elastic impact: masses and
/// directions of plates and normals of slanted walls are the same each time, and what |n|^2 differs
/// from 1 by is mostly below the last place of an impulse.
bool Impacts::rounds_alike(const Cluster& cluster, const Contact& contact)
{
    if (contact.restitution != 1) return false;
    return (contact.surface && is_slanted(contact.normal)) || !cluster.couplings.empty();
}

/// Corrects the impulse of an elastic impact, at the approach u, by what rounding has changed the
/// energy, here and in earlier impacts that round alike: uncorrected, the energy would drift in
/// proportion to their number.
void Impacts::undo_gain(Cluster& cluster, Contact& contact, double u)
{
    if (contact.moving || !world_.accelerations.empty()) return;
    const auto change = [&](std::uint32_t body, std::uint32_t slot) {
        return 0.5 * world_.scene.bodies()[body].mass *
               difference_of_squares(cluster.after[slot], before_wave_[slot]);
    };
    const auto gain = [&] {
        const double first = change(contact.a, contact.slot_a);
        return contact.surface ? first : first + change(contact.b, contact.slot_b);
    };
    const double most = 8 * epsilon * contact.impulse;
    contact.impulse -= std::clamp((gained_ + gain()) / u, -most, most);
    cluster.after[contact.slot_a] = before_wave_[contact.slot_a];
    if (!contact.surface) cluster.after[contact.slot_b] = before_wave_[contact.slot_b];
    push(cluster, contact, contact.impulse * contact.normal);
    gained_ += gain();
}

/// Sends a body away from a thermal surface, with a velocity at random relative to it.
void Impacts::strike_thermal(Cluster& cluster, Contact& contact) const
{
    Vector2& v = cluster.after[contact.slot_a];
    MixedRandom random(world_.options.seed);
    random.mix(t_);
    for (const double number : {contact.at[0], contact.at[1], v[0], v[1]}) random.mix(number);
    const double temperature = world_.scene.surfaces()[world_.faces[contact.b].surface].temperature;
    const double inverse = world_.bodies[contact.a].inverse_mass;
    const Vector2 leaves = leaving_velocity(random, temperature * inverse);
    const Vector2 tangent = turned(contact.normal);
    const Vector2 after =
        contact.surface_velocity + leaves[0] * contact.normal + leaves[1] * tangent;
    contact.impulse = dot(after - v, contact.normal) / inverse;
    contact.tangential = dot(after - v, tangent) / inverse;
    v = after;
}

/// Where laws are not constant: finds restitutions at the present speeds of approach, and strikes a
/// thermal contact alone, before the others of its wave. Returns whether there was one.
bool Impacts::apply_laws(Cluster& cluster)
{
    for (const std::uint32_t k : struck_) {
        Contact& contact = cluster.contacts[k];
        if (contact.thermal) {
            struck_ = {k};
            strike_thermal(cluster, contact);
            return true;
        }
        if (!contact.by_speed) continue;
        const std::uint32_t other =
            contact.surface ? world_.faces[contact.b].material : world_.bodies[contact.b].material;
        contact.restitution = world_.restitution(world_.bodies[contact.a].material, other,
                                                 approach(cluster, contact));
    }
    return false;
}

/// Effect of an impulse at one contact on another one along its normal.
static double coupling(const World& world, const Contact& a, const Contact& b)
{
    double sum = 0;
    const auto add = [&](std::uint32_t body, const Vector2& direction) {
        if (b.a == body) sum += world.bodies[body].inverse_mass * dot(direction, b.normal);
        if (!b.surface && b.b == body) {
            sum -= world.bodies[body].inverse_mass * dot(direction, b.normal);
        }
    };
    add(a.a, a.normal);
    if (!a.surface) add(a.b, -1.0 * a.normal);
    return sum;
}

/// Solves without friction, by an active set; false where that does not terminate.
bool Impacts::solve_exactly(Cluster& cluster) const
{
    const auto n = static_cast<Eigen::Index>(struck_.size());
    Eigen::MatrixXd w(n, n);
    Eigen::VectorXd q(n);
    Eigen::VectorXd p(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const Contact& a = cluster.contacts[struck_[static_cast<std::size_t>(i)]];
        p[i] = a.impulse;
        q[i] = -approach(cluster, a) - a.target;
        for (Eigen::Index j = 0; j < n; ++j) {
            w(i, j) = coupling(world_, a, cluster.contacts[struck_[static_cast<std::size_t>(j)]]);
        }
    }
    if (!solve_together(w, q, p)) return false;
    for (Eigen::Index i = 0; i < n; ++i) {
        Contact& contact = cluster.contacts[struck_[static_cast<std::size_t>(i)]];
        contact.impulse = p[i];
        push(cluster, contact, p[i] * contact.normal);
    }
    return true;
}

/// Solves all of `struck_` together: separation >= target, impulse >= 0, with equality in one.
void Impacts::solve(Cluster& cluster) const
{
    double fastest = 0;
    bool friction = false;
    for (const std::uint32_t k : struck_) {
        Contact& contact = cluster.contacts[k];
        contact.impulse = contact.tangential = 0;
        const double u = approach(cluster, contact);
        fastest = std::max(fastest, std::fabs(u));
        contact.target = contact.restitution * std::max(u, 0.0);
        friction = friction || contact.friction > 0;
    }
    const double smallest = 0.5 * epsilon * fastest;
    const std::vector<Vector2> start = cluster.after;
    const std::vector<TurningBody> turning = cluster.turning;
    const bool exact = cluster.couplings.empty() && struck_.size() <= most_exact;
    if (exact && !friction) {
        if (sweep(cluster, smallest, few_sweeps) && struck_.size() <= few) return;
        cluster.after = start;
        if (solve_exactly(cluster)) return;
        cluster.after = start;
        for (const std::uint32_t k : struck_) cluster.contacts[k].impulse = 0;
    }
    if (sweep(cluster, smallest, most_sweeps) || !exact || !friction) return;
    // Where a heavy body presses a light one on others, the number of sweeps grows with the ratio
    // of their masses: these begin with the normal impulses without friction.
    cluster.after = start;
    cluster.turning = turning;
    for (const std::uint32_t k : struck_) cluster.contacts[k].tangential = 0;
    if (!solve_exactly(cluster)) {
        cluster.after = start;
        for (const std::uint32_t k : struck_) cluster.contacts[k].impulse = 0;
    }
    sweep(cluster, smallest, most_sweeps);
}

double Impacts::kinetic_energy(const Cluster& cluster) const
{
    double twice = 0;
    for (std::size_t i = 0; i < cluster.bodies.size(); ++i) {
        if (world_.bodies[cluster.bodies[i]].mapped) {
            // For a body of a system: the work of its impulses in this wave.
            twice +=
                dot(cluster.impulses[i] - impulses_before_[i], before_wave_[i] + cluster.after[i]);
            continue;
        }
        twice +=
            dot(cluster.after[i], cluster.after[i]) / world_.bodies[cluster.bodies[i]].inverse_mass;
    }
    for (const TurningBody& body : cluster.turning) {
        if (body.inverse_inertia > 0) twice += body.spin * body.spin / body.inverse_inertia;
    }
    return 0.5 * twice;
}

/// [J] Work of moving surfaces in the current solve.
double Impacts::work_of_surfaces(const Cluster& cluster) const
{
    double work = 0;
    for (const std::uint32_t k : struck_) {
        const Contact& contact = cluster.contacts[k];
        if (!contact.moving) continue;
        work += contact.impulse * dot(contact.normal, contact.surface_velocity) +
                contact.tangential * dot(turned(contact.normal), contact.surface_velocity);
    }
    return work;
}

/// [J] Size of the works on systems and of surfaces in the current solve, by which their rounding
/// is measured: the energy of the bodies that are counted may be zero before it.
double Impacts::size_of_works(const Cluster& cluster) const
{
    double size = 0;
    for (std::size_t i = 0; i < cluster.bodies.size(); ++i) {
        if (!world_.bodies[cluster.bodies[i]].mapped) continue;
        size += norm(cluster.impulses[i] - impulses_before_[i]) *
                (norm(before_wave_[i]) + norm(cluster.after[i]));
    }
    for (const std::uint32_t k : struck_) {
        const Contact& contact = cluster.contacts[k];
        if (!contact.moving) continue;
        size += (contact.impulse + std::fabs(contact.tangential)) * norm(contact.surface_velocity);
    }
    return size;
}

/// Newton's restitution and Coulomb's friction at several contacts may gain energy together. In
/// that case restitution is set to 0, and where the sweeps still gain energy, friction is left out.
void Impacts::solve_without_gain(Cluster& cluster)
{
    const std::vector<Vector2> start = cluster.after;
    const std::vector<TurningBody> turning = cluster.turning;
    impulses_before_ = cluster.impulses;
    const double most = kinetic_energy(cluster) * (1 + 1e-12);
    solve(cluster);
    std::vector<std::pair<double, double>> laws;
    for (const bool with_friction : {true, false}) {
        const double gained = kinetic_energy(cluster) - work_of_surfaces(cluster) - most;
        if (gained <= 1e-12 * size_of_works(cluster)) break;
        cluster.after = start;
        cluster.turning = turning;
        cluster.impulses = impulses_before_;
        for (const std::uint32_t k : struck_) {
            Contact& contact = cluster.contacts[k];
            if (with_friction) laws.emplace_back(contact.restitution, contact.friction);
            contact.restitution = 0;
            if (!with_friction) contact.friction = 0;
        }
        solve(cluster);
    }
    for (std::size_t i = 0; i < laws.size(); ++i) {
        Contact& contact = cluster.contacts[struck_[i]];
        std::tie(contact.restitution, contact.friction) = laws[i];
    }
}

/// Solves one contact after another, until no velocity changes by more than `smallest`; false where
/// `most` sweeps do not suffice.
bool Impacts::sweep(Cluster& cluster, double smallest, int most) const
{
    for (int k = 0; k < most; ++k) {
        double largest = 0;
        for (const std::uint32_t c : struck_) {
            Contact& contact = cluster.contacts[c];
            const double wanted = approach(cluster, contact) + contact.target;
            if (k >= exact_sweeps && std::fabs(wanted) <= noise(cluster, contact)) continue;
            const double next = std::max(0.0, contact.impulse + wanted * contact.mass);
            const double change = next - contact.impulse;
            contact.impulse = next;
            largest = std::max(largest, std::fabs(change) / contact.mass);
            Vector2 impulse = change * contact.normal;
            if (contact.friction > 0) {
                const Vector2 tangent = turned(contact.normal);
                const double slips = slip(cluster, contact);
                const double most = contact.friction * contact.impulse;
                const double held =
                    std::clamp(contact.tangential - slips * contact.tangential_mass, -most, most);
                impulse = impulse + (held - contact.tangential) * tangent;
                turn(cluster, contact, held - contact.tangential);
                contact.tangential = held;
            }
            push(cluster, contact, impulse);
        }
        if (largest <= smallest) return true;
    }
    return false;
}

/// Stops bodies that are slower than the rounding of the fastest: `sweep` is not more accurate, and
/// between others they would be struck again and again.
void Impacts::stop_slow(Cluster& cluster) const
{
    if (!cluster.couplings.empty()) return;
    double fastest = 0;
    for (const Vector2& v : cluster.after) fastest = std::max(fastest, norm(v));
    for (Vector2& v : cluster.after) {
        if (norm(v) <= 8 * epsilon * fastest) v = {};
    }
}

/// Strikes the contacts that approach fastest; false where none approaches.
bool Impacts::wave(Cluster& cluster)
{
    struck_.clear();
    double fastest = 0;
    for (const Contact& contact : cluster.contacts) {
        const double u = approach(cluster, contact);
        if (u > noise(cluster, contact)) fastest = std::max(fastest, u);
    }
    if (fastest == 0) return false;
    const bool together = world_.options.impacts == ImpactLaw::together;
    for (std::uint32_t k = 0; k < cluster.contacts.size(); ++k) {
        const Contact& contact = cluster.contacts[k];
        const double u = approach(cluster, contact);
        const double rounding = noise(cluster, contact);
        const bool fast = u >= fastest * (1 - tie - contact.blur) && u > rounding;
        if (together || fast) struck_.push_back(k);
    }
    ++world_.statistics.waves;
    before_wave_ = cluster.after;
    if (!world_.plain_laws && apply_laws(cluster)) return true;
    const auto rubs = [&] { return cluster.contacts[struck_[0]].friction > 0; };
    if (struck_.size() == 1 && (cluster.couplings.empty() || !rubs())) {
        strike(cluster, cluster.contacts[struck_[0]]);
    } else {
        solve_without_gain(cluster);
    }
    return true;
}

void Impacts::emit(const Cluster& cluster, double t, std::vector<SceneEvent>* events)
{
    for (const std::uint32_t k : struck_) {
        const Contact& contact = cluster.contacts[k];
        if (contact.impulse <= unrecorded(cluster, contact) * contact.mass) continue;
        ++world_.statistics.impacts;
        if (!events) continue;
        Vector2 impulse = contact.impulse * contact.normal;
        if (contact.tangential != 0) {
            impulse = impulse + contact.tangential * turned(contact.normal);
        }
        SceneEvent event{.t = t, .body = contact.a, .impulse = impulse};
        event.at = contact.at;
        event.normal = contact.normal;
        if (!contact.surface && !world_.plate(contact.b)) {
            // From the middle between the centres to where the edges meet.
            const double beside =
                0.5 * (world_.bodies[contact.b].radius - world_.bodies[contact.a].radius);
            event.at = event.at + beside * event.normal;
        }
        event.before[0] = before_wave_[contact.slot_a];
        event.after[0] = cluster.after[contact.slot_a];
        if (contact.surface) {
            event.other = {true, world_.faces[contact.b].surface};
            event.before[1] = event.after[1] = contact.surface_velocity;
        } else {
            event.other = {false, contact.b};
            event.before[1] = before_wave_[contact.slot_b];
            event.after[1] = cluster.after[contact.slot_b];
            if (contact.b < contact.a) {
                std::swap(event.body, event.other.index);
                std::swap(event.before[0], event.before[1]);
                std::swap(event.after[0], event.after[1]);
                event.impulse = -1.0 * event.impulse;
                event.normal = -1.0 * event.normal;
            }
        }
        events->push_back(event);
    }
}

bool Impacts::resolve(Cluster& cluster, double t, bool spend, std::vector<SceneEvent>* events)
{
    if (cluster.contacts.size() > 1) {
        std::ranges::sort(cluster.contacts, {}, &Contact::at);
    }
    for (Contact& contact : cluster.contacts) {
        double inverse = world_.bodies[contact.a].inverse_mass;
        if (!contact.surface) inverse += world_.bodies[contact.b].inverse_mass;
        contact.mass = contact.tangential_mass = 1 / inverse;
    }
    if (!cluster.couplings.empty()) set_masses(cluster);
    if (!cluster.turning.empty()) set_masses_of_edges(cluster);
    t_ = t;
    const std::size_t each = cluster.lasting ? lasting_patience : patience;
    const std::size_t most = each * cluster.contacts.size();
    cluster.fastest = 0;
    for (const Vector2& v : cluster.before) cluster.fastest = std::max(cluster.fastest, norm(v));
    for (std::size_t waves = 0; !spend; ++waves) {
        if (waves == most) spend = true;
        if (!wave(cluster)) return false;
        emit(cluster, t, events);
        if (cluster.contacts.size() == 1) return false;
    }
    if (cluster.lasting) return true;
    ++world_.statistics.collapses;
    struck_.clear();
    for (std::uint32_t k = 0; k < cluster.contacts.size(); ++k) {
        cluster.contacts[k].restitution = 0;
        struck_.push_back(k);
    }
    before_wave_ = cluster.after;
    solve(cluster);
    stop_slow(cluster);
    emit(cluster, t, events);
    return false;
}

}  // namespace ricochet::detail
