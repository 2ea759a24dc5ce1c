// A connected group of bodies and walls in lasting contact, in the plane.
//
// The scene's loop hands a group over where impacts accumulate or a contact is pressed together,
// and takes it back where no contact remains. Bodies are discs (points are discs of radius 0) of
// two coordinates each. Where one has an inertia, each has a third one, the speed r w of its edge:
// friction then acts on edges and turns discs, and the angular momentum of a pair is kept. On discs
// without an inertia it acts at the centre: such a disc slides down an incline like a block.
//
// A step of length h is implicit in velocities, contacts, springs, dampers and drag, and explicit
// in gravity (Moreau's rule over Signorini's and Coulomb's laws; with the gap in the law as in M.
// Anitescu and F. A. Potra, Formulating dynamic multi-rigid-body contact problems with friction as
// solvable linear complementarity problems, Nonlinear Dynamics 14, 1997):
//
//     M (v+ - v) = h F + G' p,    q+ = q + h v+
//     0 <= p_n,  n.(v+ - w) + g(q)/h >= 0, complementary;  friction on t.(v+ - w)
//
// with w the velocity of a wall; where discs turn, friction is on the slip of edges at the end of
// the step, and an angle advances by h times the spin there. The law has restitution 0. Three
// properties follow:
//
//  - distances of discs from discs, lines and segments are convex, and their linear model is below
//    them: no gap of a step's end is negative beyond rounding, whatever the step;
//  - with walls at rest the energy never grows beyond rounding: a step loses |v+ - v|^2 M / 2, the
//    work of friction and p_n g/h. The price is that the rule is of order 1;
//  - a step is a straight line q + s v+, with the velocity v + s (v+ - v)/h, which may be cut at
//    any s in [0, h], since the energy is convex along it. The scene therefore finds impacts of
//    other bodies on the group in closed form.
//
// In a *crowd*, impacts that would rebound do not end a step. The step is the same, so that gaps
// and the bound of the energy are; at its end those contacts that have closed in it rebound
// together, by Newton's law with the approach before the step, as far as the step has lost energy:
//
//     M (v - v+) = G' r,    0 <= r_n,  n.(v - w) - e a >= 0, complementary;  friction
//
// with a the speed of approach at the start of the step and e a = 0 for contacts that were closed.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <unordered_map>
#include <vector>

#include "scene/contact_law.hpp"
#include "scene/contact_setup.hpp"

namespace ricochet::detail {

struct IslandStatistics {
    std::uint64_t steps = 0;
    std::uint64_t problems = 0;    ///< contact laws solved, including those of repeated steps
    std::uint64_t iterations = 0;  ///< of Newton's method in them
    std::uint64_t factors = 0;
    std::uint64_t sweeps = 0;
    std::uint64_t dense = 0;     ///< problems that only the dense solver could solve
    std::uint64_t wedged = 0;    ///< problems solved with overlaps by rounding left in place
    std::uint64_t halvings = 0;  ///< steps tried again at half the length
    std::uint64_t spent = 0;     ///< impacts without rebound, as it would be shorter than a step
    std::uint64_t slept = 0;
    std::uint64_t slept_by_speed = 0;  ///< of these below `sleep_speed`, not at exact rest
    double largest_residual = 0;
    double largest_error = 0;  ///< [m] of a step, where errors are estimated
    double sum_of_errors = 0;  ///< [m]
    double projected = 0;      ///< [m] largest displacement of a body onto its surface
};

/// Result of `ContactIsland::strike`.
struct StrikeReport {
    bool refused = false;  ///< nothing was changed
    std::string message;
    LawReport law;
    double energy_before = 0, energy_after = 0;  ///< [J] kinetic
};

class ContactIsland {
public:
    /// Bodies and walls are ordered by position, not by id. A body that lies behind a surface by no
    /// more than `largest_overlap` is put onto it by the least displacement, weighted by mass.
    ///
    /// @throws std::invalid_argument for an overlap beyond that (which, and by how much), a mass or
    /// step that is not positive, an unknown body of a spring, or a number that is not finite.
    ContactIsland(IslandSetup setup, const IslandOptions& options, double t);

    /// Steps until `until`, or until another outcome ends it at an earlier time.
    IslandOutcome advance(double until);

    /// Plans the same for the scene: a step no farther than `until`, which has not changed anything
    /// yet. `length` is 0 where it was not `reached`; where the island sleeps it is the time until
    /// it wakes or `until`; with `impact` it is the time until the arrival.
    struct Plan {
        IslandOutcome outcome = IslandOutcome::reached;
        double length = 0;  ///< [s]
    };
    Plan plan(double until);
    /// [s] Length of the current step, which an arrival may shorten.
    [[nodiscard]] double planned_step() const noexcept { return planned_; }
    /// The planned motion: at + s chord.
    [[nodiscard]] std::array<double, 2> chord(std::uint32_t id) const;
    /// [rad/s] Rate of the angle of a body in it.
    [[nodiscard]] double chord_spin(std::uint32_t id) const;
    /// Advances to s, at most the length of the plan.
    void commit(double s);

    [[nodiscard]] double t() const noexcept { return t_; }
    [[nodiscard]] bool asleep() const noexcept { return asleep_; }
    /// Time at which a wall begins to move; infinite if none does.
    [[nodiscard]] double wake_time() const;
    void wake();

    [[nodiscard]] std::size_t size() const noexcept { return bodies_.size(); }
    [[nodiscard]] IslandBody body(std::uint32_t id) const;
    /// Sets a velocity after an impact, and wakes the island.
    void set_velocity(std::uint32_t id, const std::array<double, 2>& velocity);
    /// The same for a spin [rad/s] of a disc that turns.
    void set_spin(std::uint32_t id, double spin);

    /// Applies Newton's law of impact and Coulomb's law of friction at all contacts that touch and
    /// approach, together. Refused where the two would raise the energy, or are not solved.
    StrikeReport strike();

    /// Contacts that ended `advance` with the outcome `impact`.
    [[nodiscard]] const std::vector<IslandContact>& arrivals() const noexcept { return arrivals_; }
    /// Contacts that pushed in the last step; kept during sleep.
    [[nodiscard]] std::vector<IslandContact> contacts() const;
    /// [s] length of the step whose impulses these are.
    [[nodiscard]] double contact_step() const noexcept { return warm_step_; }
    /// Ids of bodies grouped by springs and by contacts that push: several groups are islands of
    /// their own.
    [[nodiscard]] std::vector<std::vector<std::uint32_t>> groups() const;

    /// Kinetic energy and potential energy of gravity and of springs [J].
    [[nodiscard]] double energy() const;
    [[nodiscard]] const IslandStatistics& statistics() const noexcept { return statistics_; }
    void set_crowded(bool crowded) noexcept { options_.crowded = crowded; }
    /// Contacts that rebound at the end of the planned step of a crowd.
    [[nodiscard]] std::uint32_t rebounds() const noexcept { return rebounds_; }
    [[nodiscard]] const LawReport& failure() const noexcept { return failure_; }

private:
    using Point = std::array<double, 2>;
    struct Touch {
        int body = 0, other = 0;  ///< places; of a body or of a wall
        bool wall = false;
        bool at_end = false;  ///< of a segment or an arc: at one of its ends
        Point normal{}, end{};
        double gap = 0;
        ContactCoefficients law{};
        friend bool same(const Touch& a, const Touch& b)
        {
            return a.body == b.body && a.other == b.other && a.wall == b.wall;
        }
    };

    void check(const IslandSetup& setup) const;
    void sort_members(IslandSetup setup);
    void project(double most);
    [[nodiscard]] std::string name_of(const Touch& touch) const;
    [[nodiscard]] double size_of(int body) const;
    [[nodiscard]] int place_of(std::uint32_t id) const;
    [[nodiscard]] int edge_of(int body) const;
    void set_turning();
    void set_momentum(const Eigen::VectorXd& v, LawProblem& problem) const;
    void set_edges_momentum(const Eigen::VectorXd& v, LawProblem& problem) const;

    void find_touches(const std::vector<double>& reach);
    void pair_touches(const std::vector<double>& reach);
    void wall_touches(int body, double reach);
    bool wall_touch(const Point& at, const Point& moved, Touch& touch) const;
    bool arc_touch(const IslandWall& arc, const Point& at, Touch& touch) const;
    [[nodiscard]] std::array<double, 2> wall_displacement(int wall, double from, double to) const;

    bool attempt(double h);
    void assemble(double h, const Eigen::VectorXd& v);
    void couple_springs(double h);
    [[nodiscard]] LawContact law_contact(const Touch& touch, double h) const;
    bool solve_touches(double h);
    bool solve_law(double h, bool last_resorts);
    [[nodiscard]] bool stays_within(const std::vector<double>& reach, double h) const;
    [[nodiscard]] Eigen::VectorXd warm_impulses(double h) const;
    [[nodiscard]] double relative_normal(const Touch& touch, const Eigen::VectorXd& v) const;
    [[nodiscard]] double rebound_speed(std::size_t k, double h, const Eigen::VectorXd& kick);
    [[nodiscard]] Eigen::VectorXd kick() const;
    bool exclude_arrivals(double h);
    void rebound(double h);
    [[nodiscard]] bool set_rebounds(double h);
    [[nodiscard]] LawContact closed_contact(const Touch& touch, double h) const;
    [[nodiscard]] double energy_between(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
    [[nodiscard]] double work_of(const Eigen::VectorXd& p, double h) const;
    [[nodiscard]] double lost(double h) const;
    [[nodiscard]] double allowed_part(const Eigen::VectorXd& p, const Eigen::VectorXd& v,
                                      double h) const;
    bool attempt_in_crowd(double h);
    [[nodiscard]] double first_arrival(double h);
    [[nodiscard]] Touch on_chord(const Touch& touch, double s) const;
    [[nodiscard]] double closing_time(const Touch& touch, double h) const;
    [[nodiscard]] bool is_released() const;
    [[nodiscard]] IslandContact public_contact(const Touch& touch, double normal,
                                               double tangential) const;
    void try_to_sleep(double free_speed);
    [[nodiscard]] bool rests(double h);
    IslandOutcome advance_once(double until);
    IslandOutcome advance_by_halves(double until);
    [[nodiscard]] double free_speed() const;
    bool fit_step(double h);

    IslandOptions options_;
    std::array<double, 2> gravity_{};
    std::function<ContactCoefficients(std::uint32_t, std::uint32_t)> coefficients_;
    std::unordered_map<std::uint32_t, int> places_;  ///< of ids
    std::vector<IslandBody> bodies_;  ///< in order of place; their state is in q_ and v_
    std::vector<IslandWall> walls_;
    struct Link {
        int first = 0, second = 0;
        double rest = 0, stiffness = 0, damping = 0;
    };
    std::vector<Link> links_;
    double t_ = 0;
    Eigen::VectorXd q_;
    Eigen::VectorXd v_;  ///< and, where discs turn, the speeds of all edges after these
    bool asleep_ = false;
    std::uint32_t open_steps_ = 0;
    double slow_since_ = std::numeric_limits<double>::infinity();

    ContactLaw law_, impact_law_;
    LawProblem problem_;
    std::vector<Touch> touches_, excluded_;
    Eigen::VectorXd impulses_, v_next_;
    Eigen::VectorXd v_end_;     ///< velocities after the impacts at the end of a step of a crowd
    LawProblem impacts_;        ///< these impacts
    double planned_ = 0;        ///< [s] length of the current step
    double planned_until_ = 0;  ///< where it ends, or what ends it before
    std::vector<Touch> warm_;
    Eigen::VectorXd warm_impulses_;
    double warm_step_ = 0;
    std::uint32_t rebounds_ = 0;
    double enough_ = 0;  ///< residual that a step of a crowd may leave, 0 in other steps
    std::uint32_t awake_steps_ = 0;  ///< of a crowd, since rest was looked for

    std::vector<IslandContact> arrivals_;
    IslandStatistics statistics_;
    LawReport failure_;
};

}  // namespace ricochet::detail
