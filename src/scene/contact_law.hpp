// Many contacts between bodies in the plane, at one instant or over one step.
//
//     A v = b + G' p,    u = G v + offset,    for every contact:
//     0 <= p_n,  u_n >= 0,  p_n u_n = 0,      |p_t| <= friction p_n, and against u_t at the bound
//
// with two coordinates per body. A is diagonal, except for couplings by springs and dampers; it is
// never inverted as a matrix, and W = G A^-1 G' is not formed: the equations are solved for
// velocities, which are fewer than impulses where contacts are redundant.
//
// Where discs turn, v has one more coordinate for each body after all these: the speed r w [m/s] of
// its edge, counterclockwise, with the inertia I / r^2 [kg]. It is subtracted from u_t in each
// contact of the disc, so that u_t is the slip of edges.
#pragma once

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>

#include <array>
#include <vector>

#include "scene/block_lu.hpp"

namespace ricochet::detail {

struct LawContact {
    int first = 0;                   ///< place of the body that the normal pushes
    int second = -1;                 ///< the other one, -1 for a wall
    std::array<double, 2> normal{};  ///< of length 1, towards `first`
    std::array<double, 2> offset{};  ///< of the relative velocity, normal and tangential [m/s]
    double friction = 0;
    std::array<int, 2> edges{-1, -1};  ///< places in v of the speeds of edges that turn
};

/// A symmetric, positive semidefinite block of A that resists the relative velocity of two bodies.
struct LawCoupling {
    int first = 0;
    int second = 0;
    double xx = 0, xy = 0, yy = 0;  ///< [kg]
};

struct LawProblem {
    std::vector<double> inertia;  ///< [kg] of each body, positive
    /// [1/kg] r^2 / I of each body, 0 where it does not turn; empty where no body does.
    std::vector<double> turning{};
    std::vector<LawCoupling> couplings;
    std::vector<LawContact> contacts;
    Eigen::VectorXd momentum;  ///< b [kg m/s], of the size of v
};

struct LawReport {
    bool converged = false;
    /// As in `ContactReport`: the largest defect of velocity or impulse in units in which a
    /// contact's two bodies have mass 1, as a fraction of the largest relative velocity before.
    double residual = 0;
    int iterations = 0;  ///< of Newton's method
    int factors = 0;     ///< matrices factored
    int sweeps = 0;      ///< over the contacts
    int switches = 0;    ///< of contacts along paths
    bool dense = false;  ///< whether `ContactSolver` had to help
};

/// Newton's method on the law with multipliers: in each contact p = P(p - rho u), with P the
/// projection onto the cone of friction and a large rho. Active contacts enter the matrix
/// A + G' D G, which is regular however redundant the contacts are, and is factored once for a set
/// of active contacts; then p is improved with the same factor. Without friction the matrix is
/// symmetric, and the active set ends the iteration: its solution is exact to rounding. Where
/// active sets cycle, paths lead to a solution: p = P(p - rho u + s c) with a shift c for which the
/// start solves the law at s = 1, and s going to 0. The path is a polygon, at whose corners one
/// contact changes; it is that of Lemke's method, in which s may grow for a while (R. W. Cottle,
/// J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, section 4.4), from a start
/// nearby. After them come sweeps over the contacts, and the dense `ContactSolver`, for no more
/// than 100 contacts.
class ContactLaw {
public:
    explicit ContactLaw(double tolerance = 1e-10) : tolerance_(tolerance) {}

    /// `p`, two for each contact, normal first, is the start and the result, as is `v`, which
    /// satisfies the first equation to rounding for any outcome. `last_resorts`: whether
    /// sweeps and the dense solver are tried where paths do not lead to a solution.
    LawReport solve(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v,
                    bool last_resorts = true);

    /// The same by sweeps over the contacts until the residual is `enough`: for many contacts,
    /// where paths are long. `polish`: whether Newton's method goes on from there. The
    /// residual is the caller's to judge.
    LawReport settle(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v,
                     double enough, bool polish);

    struct Pair {
        double normal = 0, tangential = 0;
    };
    /// Relative velocity of a contact.
    [[nodiscard]] static Pair relative(const LawContact& c, const Eigen::VectorXd& v);

private:
    enum class Active : unsigned char { open, sticks, slips_forward, slips_backward };
    using Sparse = Eigen::SparseMatrix<double>;

    static void push(const LawContact& c, double normal, double tangential, Eigen::VectorXd& b);
    void set_units();
    [[nodiscard]] Pair rho(std::size_t k) const;

    bool begin(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v,
               LawReport& report);
    void factor_inertia();
    void compare_pattern();
    void follow(const Eigen::VectorXd& p, Eigen::VectorXd& v);
    void set_scale(const Eigen::VectorXd& free);
    [[nodiscard]] double residual(const Eigen::VectorXd& p, const Eigen::VectorXd& v) const;

    bool iterate(Eigen::VectorXd& p, Eigen::VectorXd& v, bool last_resorts, LawReport& report);
    bool newton(Eigen::VectorXd& p, Eigen::VectorXd& v, int most, LawReport& report,
                bool active_given = false);
    void relax(Eigen::VectorXd& p, Eigen::VectorXd& v, int times);
    bool choose(const Eigen::VectorXd& p, const Eigen::VectorXd& u);
    [[nodiscard]] bool factor();
    [[nodiscard]] Eigen::VectorXd solve_factored(const Eigen::VectorXd& right) const;
    void improve(Eigen::VectorXd& p, Eigen::VectorXd& u);
    void confine(Eigen::VectorXd& p) const;
    void sweep(Eigen::VectorXd& p, Eigen::VectorXd& v);
    void lay_rows();
    template <bool turns>
    void sweep_rows(Eigen::VectorXd& p, Eigen::VectorXd& v) const;
    bool along_paths(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report);
    void begin_path(const Eigen::VectorXd& p, const Eigen::VectorXd& v);
    void begin_path_afar();
    bool follow_path(LawReport& report);
    struct Switch {
        double after = 0;
        std::size_t contact = 0;
        Active to = Active::open;
    };
    void turn_path();
    [[nodiscard]] Switch next_switch() const;
    void pass(const Switch& next);
    void impulses_of_path(Eigen::VectorXd& p) const;
    void solve_densely(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report);
    [[nodiscard]] bool turns() const noexcept { return !problem_->turning.empty(); }
    void add_entries(int a, int b, const BlockLu<2>::Block& block);
    void collect_entries();
    [[nodiscard]] bool factor_blocks();
    template <class Add>
    std::size_t assemble_inertia(const Add& add) const;
    template <class Add>
    void assemble(const Add& add) const;
    template <class Add>
    void assemble_turning(const Add& add) const;
    [[nodiscard]] double inertia_of_edge(std::size_t body) const;

    double tolerance_;
    const LawProblem* problem_ = nullptr;
    double scale_ = 0;
    double stiffness_ = 1e5;
    /// [kg] Effective inertia of the bodies at each contact, along the normal and across, without
    /// springs.
    std::vector<Pair> units_;
    Eigen::SimplicialLDLT<Sparse> inertia_factor_;
    std::vector<Active> active_, chosen_;
    std::vector<Eigen::Triplet<double>> triplets_;
    std::vector<std::array<int, 2>> pattern_;
    int pattern_count_ = 0;
    bool pattern_turns_ = false;
    BlockLu<2> block_lu_;
    BlockLu<3> turning_lu_;
    bool blocked_ = true;
    Sparse sparse_;
    Eigen::SparseLU<Sparse> sparse_lu_;
    Eigen::VectorXd right_, linear_, trial_p_, trial_v_;
    /// A contact, with what many sweeps need: `mass` is its unit of inertia.
    struct Row {
        Eigen::Index first = 0, second = 0;
        double nx = 0, ny = 0, offset_n = 0, offset_t = 0, friction = 0;
        double mass = 0, by_first = 0, by_second = 0;
        /// Of the edges, where a disc turns.
        std::array<Eigen::Index, 2> edges{};
        std::array<double, 2> by_edges{};
        double mass_across = 0;
    };
    std::vector<Row> rows_;
    struct Path {
        Eigen::VectorXd w, w_rate;  ///< p - rho u + left shift, whose projection is p
        Eigen::VectorXd shift;
        double left = 1, left_rate = -1;
    } path_;
};

}  // namespace ricochet::detail
