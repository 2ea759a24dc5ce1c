#include "scene/gauss.hpp"

#include <cmath>
#include <vector>

namespace ricochet::detail {

namespace {

using Index = Eigen::Index;

class ActiveSet {
public:
    ActiveSet(const Eigen::MatrixXd& w, const Eigen::VectorXd& q) : w_(w), q_(q) {}

    void add(Index i) { active_.push_back(i); }
    void remove_zeros(Eigen::VectorXd& p)
    {
        std::erase_if(active_, [&](Index i) {
            if (p[i] > 0) return false;
            p[i] = 0;
            return true;
        });
    }
    [[nodiscard]] bool empty() const { return active_.empty(); }
    void clear() { active_.clear(); }
    void drop_last() { active_.pop_back(); }
    [[nodiscard]] const std::vector<Index>& indices() const { return active_; }

    /// The impulses under which the active contacts do not move; false where the contacts depend on
    /// each other.
    [[nodiscard]] bool solve(Eigen::VectorXd& z) const
    {
        const auto n = static_cast<Index>(active_.size());
        Eigen::MatrixXd part(n, n);
        Eigen::VectorXd right(n);
        for (Index i = 0; i < n; ++i) {
            right[i] = -q_[active_[static_cast<std::size_t>(i)]];
            for (Index j = 0; j < n; ++j) {
                part(i, j) =
                    w_(active_[static_cast<std::size_t>(i)], active_[static_cast<std::size_t>(j)]);
            }
        }
        const Eigen::LLT<Eigen::MatrixXd> factors(part);
        if (factors.info() != Eigen::Success) return false;
        for (Index i = 0; i < n; ++i) {
            const double pivot = factors.matrixLLT()(i, i);
            if (!(pivot * pivot > 1e-12 * part(i, i))) return false;
        }
        const Eigen::VectorXd solved = factors.solve(right);
        z = Eigen::VectorXd::Zero(q_.size());
        for (Index i = 0; i < n; ++i) z[active_[static_cast<std::size_t>(i)]] = solved[i];
        return true;
    }

private:
    const Eigen::MatrixXd& w_;
    const Eigen::VectorXd& q_;
    std::vector<Index> active_;
};

/// Goes from p towards z until an impulse vanishes, and on without it; false where the remaining
/// set cannot be solved.
bool approach(ActiveSet& set, Eigen::VectorXd& p, Eigen::VectorXd& z)
{
    for (;;) {
        double part = 1;
        for (const Index i : set.indices()) {
            if (z[i] <= 0) part = std::min(part, p[i] / (p[i] - z[i]));
        }
        if (part >= 1) break;
        for (const Index i : set.indices()) {
            p[i] += part * (z[i] - p[i]);
            if (z[i] <= 0 && p[i] <= 1e-15 * std::fabs(z[i])) p[i] = 0;
        }
        set.remove_zeros(p);
        if (set.empty()) return true;
        if (!set.solve(z)) return false;
    }
    for (const Index i : set.indices()) p[i] = z[i];
    return true;
}

}  // namespace

bool solve_together(const Eigen::MatrixXd& w, const Eigen::VectorXd& q, Eigen::VectorXd& p)
{
    const Index n = q.size();
    const double smallest = 4e-15 * q.cwiseAbs().maxCoeff();
    ActiveSet set(w, q);
    for (Index i = 0; i < n; ++i) {
        if (p[i] > 0) set.add(i);
    }
    Eigen::VectorXd z;
    if (!set.empty()) {
        if (!set.solve(z)) {
            p.setZero();
            set.clear();
        } else if (!approach(set, p, z)) {
            return false;
        }
    }
    std::vector<char> out(static_cast<std::size_t>(n), 0);
    for (Index round = 0; round < 4 * n + 10; ++round) {
        const Eigen::VectorXd u = w * p + q;
        Index worst = -1;
        for (Index i = 0; i < n; ++i) {
            if (p[i] > 0 || out[static_cast<std::size_t>(i)]) continue;
            if (u[i] < -smallest && (worst < 0 || u[i] < u[worst])) worst = i;
        }
        if (worst < 0) return true;
        set.add(worst);
        if (!set.solve(z) || z[worst] <= 0) {
            set.drop_last();
            out[static_cast<std::size_t>(worst)] = 1;
            continue;
        }
        std::fill(out.begin(), out.end(), char{0});
        if (!approach(set, p, z)) return false;
    }
    return false;
}

}  // namespace ricochet::detail
