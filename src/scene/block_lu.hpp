// Elimination of sparse matrices of small blocks whose symmetric pattern is known in advance.
//
// Factors A = L U in an order of least degree, with pivots within the diagonal blocks alone.
// Matrices of contacts are small and are factored again and again with other numbers in the same
// places; a general sparse elimination would spend most of its time on finding those places.
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cstdint>
#include <vector>

namespace ricochet::detail {

/// Blocks of N x N, N = 2 or 3. Vectors have two coordinates for each block, and for N = 3 a third
/// one for each block after all these.
template <std::size_t N>
class BlockLu {
public:
    /// Row-major.
    using Block = std::array<double, N * N>;

    /// Prepares for `count` diagonal blocks, and blocks at (i, j) and (j, i) of each pair.
    void analyze(int count, const std::vector<std::array<int, 2>>& pairs);

    void clear();
    /// Adds to the diagonal block i; subtracts from the blocks (i, j) and (j, i) of a pair.
    void add(int i, const Block& block)
    {
        add_to(static_cast<std::size_t>(place_[static_cast<std::size_t>(i)]), 1, block);
    }
    void subtract(std::size_t pair, const Block& block)
    {
        for (const std::size_t at : pairs_[pair]) add_to(at, -1, block);
    }
    /// Adds to the block (i, j) of a pair, or with `transposed` to (j, i).
    void add(std::size_t pair, bool transposed, const Block& block)
    {
        add_to(pairs_[pair][transposed], 1, block);
    }

    /// False where a diagonal block is singular, or so small compared with its first value that
    /// digits are lost.
    [[nodiscard]] bool factor();
    [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& right) const;

private:
    void add_to(std::size_t at, double sign, const Block& block)
    {
        for (std::size_t k = 0; k < N * N; ++k) blocks_[at][k] += sign * block[k];
    }
    void order(int count, const std::vector<std::array<int, 2>>& pairs);
    /// The coordinates of block i in a vector.
    [[nodiscard]] std::array<Eigen::Index, N> coordinates(std::size_t i) const;

    std::vector<int> place_;               ///< of a block's row in the elimination
    std::vector<std::vector<int>> later_;  ///< rows with which a row is coupled when it is
                                           ///< eliminated
    std::vector<std::size_t> upper_;       ///< start of a row's blocks to the right
    std::vector<std::size_t> lower_;       ///< start of its blocks below the diagonal
    std::vector<std::uint32_t> targets_;   ///< of the products, in the order of their use
    std::vector<std::array<std::size_t, 2>> pairs_;
    std::vector<Block> blocks_;  ///< diagonal ones first; inverted by `factor`
};

}  // namespace ricochet::detail
