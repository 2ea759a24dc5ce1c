// The matrices A and A + G' D G of a contact law, assembled and factored.
#include <array>

#include "scene/contact_law.hpp"

namespace ricochet::detail {

namespace {

/// The rows of G of a contact, in the three coordinates of one of its bodies.
struct RowsOfContact {
    RowsOfContact(const LawContact& c, std::size_t side)
    {
        const double sign = side == 0 ? 1 : -1;
        normal = {sign * c.normal[0], sign * c.normal[1], 0};
        across = {-sign * c.normal[1], sign * c.normal[0], c.edges[side] < 0 ? 0.0 : -1.0};
    }
    std::array<double, 3> normal{}, across{};
};

/// D of a contact: of the normal impulse by u_n, of the tangential one by u_n and by u_t.
struct Slopes {
    double normal = 0, mixed = 0, across = 0;
};

/// a' D b
BlockLu<3>::Block product(const RowsOfContact& a, const Slopes& d, const RowsOfContact& b)
{
    BlockLu<3>::Block block{};
    for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 3; ++column) {
            block[3 * row + column] =
                a.normal[row] * d.normal * b.normal[column] +
                a.across[row] * (d.mixed * b.normal[column] + d.across * b.across[column]);
        }
    }
    return block;
}

}  // namespace

/// Adds to a list of entries the coupling of `a` with `b`, or a term of `a` alone.
void ContactLaw::add_entries(int a, int b, const BlockLu<2>::Block& block)
{
    const auto add = [&](int row, int column, double sign) {
        for (int k = 0; k < 4; ++k) {
            triplets_.emplace_back(2 * row + k / 2, 2 * column + k % 2,
                                   sign * block[static_cast<std::size_t>(k)]);
        }
    };
    add(a, a, 1);
    if (b < 0) return;
    add(b, b, 1);
    add(a, b, -1);
    add(b, a, -1);
}

/// [kg] I / r^2; the mass of a disc that does not turn, whose edge nothing moves.
double ContactLaw::inertia_of_edge(std::size_t body) const
{
    const double inverse = problem_->turning[body];
    return inverse > 0 ? 1 / inverse : problem_->inertia[body];
}

/// Assembles A without edges by blocks: add(a, b, pair, block) for a coupling of a and b, with the
/// place of their pair in the pattern; b is -1 for a term of a alone.
template <class Add>
std::size_t ContactLaw::assemble_inertia(const Add& add) const
{
    for (std::size_t b = 0; b < problem_->inertia.size(); ++b) {
        const double m = problem_->inertia[b];
        add(static_cast<int>(b), -1, 0, {m, 0, 0, m});
    }
    std::size_t pair = 0;
    for (const LawCoupling& k : problem_->couplings) {
        add(k.first, k.second, pair++, {k.xx, k.xy, k.xy, k.yy});
    }
    return pair;
}

/// Assembles A + G' D G where no disc turns, with D = -dp/du of the active contacts.
template <class Add>
void ContactLaw::assemble(const Add& add) const
{
    std::size_t pair = assemble_inertia(add);
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const LawContact& c = problem_->contacts[k];
        const std::size_t own = c.second >= 0 ? pair++ : 0;
        if (active_[k] == Active::open) continue;
        const double stiff = rho(k).normal;
        if (active_[k] == Active::sticks) {
            add(c.first, c.second, own, {stiff, 0, 0, stiff});
            continue;
        }
        const double slope = active_[k] == Active::slips_forward ? c.friction : -c.friction;
        const auto [nx, ny] = c.normal;
        const double x = stiff * (nx - slope * ny);
        const double y = stiff * (ny + slope * nx);
        add(c.first, c.second, own, {x * nx, x * ny, y * nx, y * ny});
    }
}

/// The same where discs turn: add(a, b, pair, block) adds to the block of row a and column b.
template <class Add>
void ContactLaw::assemble_turning(const Add& add) const
{
    using Block = BlockLu<3>::Block;
    std::size_t pair =
        assemble_inertia([&](int a, int b, std::size_t own, const BlockLu<2>::Block& m) {
            const double edge = b < 0 ? inertia_of_edge(static_cast<std::size_t>(a)) : 0;
            add(a, a, own, Block{m[0], m[1], 0, m[2], m[3], 0, 0, 0, edge});
            if (b < 0) return;
            add(b, b, own, Block{m[0], m[1], 0, m[2], m[3], 0, 0, 0, 0});
            const Block other{-m[0], -m[1], 0, -m[2], -m[3], 0, 0, 0, 0};
            add(a, b, own, other);
            add(b, a, own, other);
        });
    for (std::size_t k = 0; k < problem_->contacts.size(); ++k) {
        const LawContact& c = problem_->contacts[k];
        const std::size_t own = c.second >= 0 ? pair++ : 0;
        if (active_[k] == Active::open) continue;
        const bool sticks = active_[k] == Active::sticks;
        const double slope = active_[k] == Active::slips_forward ? c.friction : -c.friction;
        const auto [stiff_n, stiff_t] = rho(k);
        const Slopes slopes{stiff_n, sticks ? 0 : slope * stiff_n, sticks ? stiff_t : 0};
        const RowsOfContact first(c, 0);
        add(c.first, c.first, own, product(first, slopes, first));
        if (c.second < 0) continue;
        const RowsOfContact second(c, 1);
        add(c.second, c.second, own, product(second, slopes, second));
        add(c.first, c.second, own, product(first, slopes, second));
        add(c.second, c.first, own, product(second, slopes, first));
    }
}

void ContactLaw::factor_inertia()
{
    if (problem_->couplings.empty()) return;
    triplets_.clear();
    assemble_inertia([this](int a, int b, std::size_t /*pair*/, const BlockLu<2>::Block& block) {
        add_entries(a, b, block);
    });
    const Eigen::Index n = problem_->momentum.size();
    for (std::size_t b = 0; b < problem_->turning.size(); ++b) {
        const auto k = static_cast<int>(2 * problem_->turning.size() + b);
        triplets_.emplace_back(k, k, inertia_of_edge(b));
    }
    sparse_.resize(n, n);
    sparse_.setFromTriplets(triplets_.begin(), triplets_.end());
    inertia_factor_.compute(sparse_);
}

/// The order of elimination belongs to the pairs in contact, and is kept while they stay.
void ContactLaw::compare_pattern()
{
    std::vector<std::array<int, 2>> pattern;
    pattern.reserve(problem_->contacts.size() + problem_->couplings.size());
    for (const LawCoupling& k : problem_->couplings) pattern.push_back({k.first, k.second});
    for (const LawContact& c : problem_->contacts) {
        if (c.second >= 0) pattern.push_back({c.first, c.second});
    }
    const auto count = static_cast<int>(problem_->inertia.size());
    const bool same_kind = pattern_turns_ == turns();
    if (same_kind && count == pattern_count_ && pattern == pattern_) return;
    pattern_count_ = count;
    pattern_turns_ = turns();
    pattern_.swap(pattern);
    if (turns()) {
        turning_lu_.analyze(count, pattern_);
    } else {
        block_lu_.analyze(count, pattern_);
    }
}

/// Factors A + G' D G by blocks; false where pivots between blocks are needed.
bool ContactLaw::factor_blocks()
{
    if (turns()) {
        turning_lu_.clear();
        assemble_turning([this](int a, int b, std::size_t pair, const BlockLu<3>::Block& block) {
            if (a == b) {
                turning_lu_.add(a, block);
            } else {
                turning_lu_.add(pair, pattern_[pair][0] != a, block);
            }
        });
        return turning_lu_.factor();
    }
    block_lu_.clear();
    assemble([this](int a, int b, std::size_t pair, const BlockLu<2>::Block& block) {
        block_lu_.add(a, block);
        if (b < 0) return;
        block_lu_.add(b, block);
        block_lu_.subtract(pair, block);
    });
    return block_lu_.factor();
}

/// Lists the entries of A + G' D G.
void ContactLaw::collect_entries()
{
    triplets_.clear();
    if (!turns()) {
        assemble([this](int a, int b, std::size_t /*pair*/, const BlockLu<2>::Block& block) {
            add_entries(a, b, block);
        });
        return;
    }
    const auto edges = static_cast<int>(2 * problem_->inertia.size());
    assemble_turning([&](int a, int b, std::size_t /*pair*/, const BlockLu<3>::Block& block) {
        const std::array<int, 3> rows{2 * a, 2 * a + 1, edges + a};
        const std::array<int, 3> columns{2 * b, 2 * b + 1, edges + b};
        for (std::size_t k = 0; k < block.size(); ++k) {
            triplets_.emplace_back(rows[k / 3], columns[k % 3], block[k]);
        }
    });
}

/// Factors A + G' D G by blocks or, where pivots between blocks are needed, with such pivots.
bool ContactLaw::factor()
{
    blocked_ = factor_blocks();
    if (blocked_) return true;
    collect_entries();
    const Eigen::Index n = problem_->momentum.size();
    sparse_.resize(n, n);
    sparse_.setFromTriplets(triplets_.begin(), triplets_.end());
    sparse_lu_.compute(sparse_);
    return sparse_lu_.info() == Eigen::Success;
}

Eigen::VectorXd ContactLaw::solve_factored(const Eigen::VectorXd& right) const
{
    if (!blocked_) return sparse_lu_.solve(right);
    return turns() ? turning_lu_.solve(right) : block_lu_.solve(right);
}

}  // namespace ricochet::detail
