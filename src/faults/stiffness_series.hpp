// Functions of a stiffness matrix, as Chebyshev polynomials in it.
#pragma once

#include <functional>
#include <vector>

#include "ricochet/faults/fault_stiffness.hpp"

namespace ricochet {

/// A polynomial on an interval, sum of c_k T_k(x), with x from -1 to 1 across it. Applied to the
/// matrix, it deviates from the function as much as it does on the eigenvalues.
class StiffnessSeries {
public:
    using Function = std::function<double(double)>;

    StiffnessSeries() = default;
    /// The first `degree` + 1 terms of the series of f on `interval`.
    StiffnessSeries(const Function& f, detail::Spectrum interval, int degree);
    /// The least degree for which a polynomial is found within `bound` of f, relative to f,
    /// which is positive on the interval: the best one, by Remez's exchange, or the series.
    /// @throws std::invalid_argument where none up to `most_terms` is found.
    [[nodiscard]] static StiffnessSeries within(const Function& f, detail::Spectrum interval,
                                                double bound);
    static constexpr int most_terms = 400;

    /// Becomes constant + slope x + factor p(x), in the memory that it has.
    void combine(const StiffnessSeries& p, double constant, double slope, double factor);

    [[nodiscard]] int degree() const noexcept { return static_cast<int>(c_.size()) - 1; }
    [[nodiscard]] double operator()(double eigenvalue) const noexcept;
    /// The largest |p / f - 1| on the interval, from 64 samples for each of its terms.
    [[nodiscard]] double relative_error(const Function& f) const;

    /// y = p(K) x, by `degree()` products. x and y do not overlap.
    struct Scratch {
        Eigen::VectorXd before, now, next;
    };
    void apply(StiffnessProduct& product, const Eigen::VectorXd& x, Eigen::VectorXd& y,
               Scratch& scratch) const;

private:
    detail::Spectrum interval_;
    std::vector<double> c_;
};

}  // namespace ricochet
