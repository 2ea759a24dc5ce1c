// Many contacts between bodies in the plane, at one instant or over one step.
//
//     A v = b + G' p,    u = G v + offset,    for every contact:
//     0 <= p_n,  u_n >= 0,  p_n u_n = 0,      |p_t| <= friction p_n, and against u_t at the bound
//
// with two coordinates a body. A is diagonal, but for what springs and dampers couple; it is never
// inverted as a matrix, and W = G A^-1 G' is not formed: the equations are solved for velocities,
// of which there are fewer than impulses where contacts are redundant. A contact with one row more
// for a spin would change `LawContact` and the products with G alone.
#pragma once

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>

#include <array>
#include <vector>

namespace ricochet::detail {

struct LawContact {
    int first = 0;                   ///< place of the body that the normal pushes
    int second = -1;                 ///< the other one, -1 for a wall
    std::array<double, 2> normal{};  ///< of length 1, towards `first`
    std::array<double, 2> offset{};  ///< of the relative velocity, normal and tangential [m/s]
    double friction = 0;
};

/// A symmetric, positive semidefinite block of A that resists the relative velocity of two bodies.
struct LawCoupling {
    int first = 0;
    int second = 0;
    double xx = 0, xy = 0, yy = 0;  ///< [kg]
};

struct LawProblem {
    std::vector<double> inertia;  ///< [kg] of each body, positive
    std::vector<LawCoupling> couplings;
    std::vector<LawContact> contacts;
    Eigen::VectorXd momentum;  ///< b [kg m/s], two for each body
};

struct LawReport {
    bool converged = false;
    /// As in `ContactReport`: the largest defect of velocity or impulse in units in which a
    /// contact's two bodies have mass 1, as a fraction of the largest relative velocity before.
    double residual = 0;
    int iterations = 0;  ///< of Newton's method
    int factors = 0;     ///< matrices factored
    int sweeps = 0;      ///< over the contacts
    bool dense = false;  ///< whether `ContactSolver` had to help
};

/// Newton's method on the law with multipliers: in each contact p = P(p - rho u), P onto the cone
/// of friction, with a large rho. What is active enters the matrix A + G' D G, which is regular
/// however redundant the contacts are, and is factored once for a set of active contacts; then p is
/// improved with the same factor. Without friction the matrix is symmetric, and the active set ends
/// the iteration: its solution is exact to rounding. Where sets run in circles, sweeps over the
/// contacts find another start, and after them the dense `ContactSolver`, for no more than 100
/// contacts.
class ContactLaw {
public:
    explicit ContactLaw(double tolerance = 1e-10) : tolerance_(tolerance) {}

    /// `p`, two for each contact, normal first, is the start and the result, as is `v`, which
    /// satisfies the first equation to rounding whatever the outcome.
    LawReport solve(const LawProblem& problem, Eigen::VectorXd& p, Eigen::VectorXd& v);

private:
    enum class Active : unsigned char { open, sticks, slips_forward, slips_backward };
    using Sparse = Eigen::SparseMatrix<double>;

    struct Pair {
        double normal = 0, tangential = 0;
    };
    [[nodiscard]] Pair relative(const LawContact& c, const Eigen::VectorXd& v) const;
    static void push(const LawContact& c, double normal, double tangential, Eigen::VectorXd& b);
    [[nodiscard]] double unit(const LawContact& c) const;

    void factor_inertia();
    void compare_pattern();
    void follow(const Eigen::VectorXd& p, Eigen::VectorXd& v);
    void set_scale(const Eigen::VectorXd& free);
    [[nodiscard]] double residual(const Eigen::VectorXd& p, const Eigen::VectorXd& v) const;

    bool iterate(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report);
    bool newton(Eigen::VectorXd& p, Eigen::VectorXd& v, int most, LawReport& report);
    void relax(Eigen::VectorXd& p, Eigen::VectorXd& v, int times);
    bool choose(const Eigen::VectorXd& p, const Eigen::VectorXd& v);
    [[nodiscard]] bool factor();
    void improve(Eigen::VectorXd& p);
    void confine(Eigen::VectorXd& p) const;
    void sweep(Eigen::VectorXd& p, Eigen::VectorXd& v);
    void solve_densely(Eigen::VectorXd& p, Eigen::VectorXd& v, LawReport& report);
    void add_block(int row, int column, const Eigen::Matrix2d& block);

    double tolerance_;
    const LawProblem* problem_ = nullptr;
    double scale_ = 0;
    double stiffness_ = 1e5;
    Eigen::SimplicialLDLT<Sparse> inertia_factor_;
    std::vector<Active> active_, chosen_;
    std::vector<Eigen::Triplet<double>> triplets_;
    bool small_ = true, symmetric_ = true;
    std::vector<std::array<int, 2>> pattern_;
    bool ldlt_analyzed_ = false, lu_analyzed_ = false;
    Eigen::MatrixXd dense_;
    Eigen::PartialPivLU<Eigen::MatrixXd> dense_lu_;
    Sparse sparse_;
    Eigen::SimplicialLDLT<Sparse> sparse_ldlt_;
    Eigen::SparseLU<Sparse> sparse_lu_;
    Eigen::VectorXd right_, linear_, trial_p_, trial_v_;
};

}  // namespace ricochet::detail
