// The stiffness K of a fault of n x n elements: products, bounds of its spectrum, solutions.
//
// Elements are numbered along x first, then along depth. K is symmetric and positive definite.
// Where its entries depend on distances only it is not stored, except for the smallest meshes: a
// product is computed by transforms of twice the fault's size, in O(N log N) for N = n^2 elements.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

namespace ricochet {

namespace detail {
struct StiffnessData;
class StiffnessTransforms;

/// An interval that holds the eigenvalues of a matrix.
struct Spectrum {
    double lower = 0;
    double upper = 0;
};
}  // namespace detail

/// A stiffness matrix. A value: copies share their entries, which never change.
class FaultStiffness {
public:
    /// Entries by distance in elements, along x and along depth.
    using ByDistance = std::function<double(int dx, int dz)>;
    /// Entries by distance along x and by the rows of both elements, in either order of them.
    using ByRows = std::function<double(int dx, int row, int other_row)>;

    /// K_ij = entry(|dx|, |dz|). Memory: 16 n^2 doubles.
    [[nodiscard]] static FaultStiffness toeplitz(int elements, const ByDistance& entry);
    /// K_ij = entry(|dx|, row of i, row of j). Memory: n^3 doubles, and as much time.
    [[nodiscard]] static FaultStiffness layered(int elements, const ByRows& entry);
    /// Any matrix of n^2 rows. Memory: n^4 doubles.
    /// @throws std::invalid_argument unless it is of that size, finite, symmetric to 1e-9 of
    /// its largest entry, and positive definite.
    [[nodiscard]] static FaultStiffness dense(int elements, Eigen::MatrixXd matrix);

    [[nodiscard]] int elements() const noexcept;  ///< per side
    [[nodiscard]] std::size_t size() const noexcept
    {
        return static_cast<std::size_t>(elements()) * static_cast<std::size_t>(elements());
    }
    /// K times `factor`, positive.
    [[nodiscard]] FaultStiffness scaled(double factor) const;

    /// Bounds of the eigenvalues. The upper one is that of a larger matrix of which K is a part, or
    /// of all its parts; the lower one is 0.97 times the result of 80 steps of Lanczos, which
    /// converge from above.
    /// @throws std::invalid_argument where the lower bound is not positive.
    [[nodiscard]] detail::Spectrum spectrum() const;

    /// The solution of K x = b by conjugate gradients, to 1e-13 of |b|.
    /// @throws std::invalid_argument if K is not positive definite.
    [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

private:
    friend class StiffnessProduct;
    std::shared_ptr<const detail::StiffnessData> data_;
    double factor_ = 1;
};

/// Products with K, with scratch memory of their own. Each thread needs one.
class StiffnessProduct {
public:
    /// Keeps a copy of `stiffness`, and allocates scratch memory where products take transforms.
    explicit StiffnessProduct(const FaultStiffness& stiffness);
    ~StiffnessProduct();
    /// Takes the scratch memory over; the other object must not be used again.
    StiffnessProduct(StiffnessProduct&&) noexcept;
    StiffnessProduct& operator=(StiffnessProduct&&) noexcept;

    /// y = K x. Both have `size()` components and do not overlap.
    void operator()(const double* x, double* y);
    void operator()(const Eigen::VectorXd& x, Eigen::VectorXd& y) { (*this)(x.data(), y.data()); }

    [[nodiscard]] const FaultStiffness& stiffness() const noexcept { return stiffness_; }
    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

private:
    FaultStiffness stiffness_;
    std::unique_ptr<detail::StiffnessTransforms> transforms_;
    std::uint64_t count_ = 0;
};

/// Memory [bytes] of a mesh of `elements` per side together with a run on it.
[[nodiscard]] double toeplitz_memory(double elements) noexcept;
[[nodiscard]] double layered_memory(double elements) noexcept;
[[nodiscard]] double dense_memory(double elements) noexcept;

}  // namespace ricochet
