// Internal: the declarations of this header may change without notice.
//
// The operations of a flow that were recorded at run time, and their power series, computed
// operation by operation, for flows whose operations the compiler cannot know.
#pragma once

#include <cstddef>
#include <vector>

#include "ricochet/detail/taylor_recording.hpp"
#include "ricochet/detail/taylor_step.hpp"
#include "ricochet/detail/taylor_tape.hpp"

namespace ricochet::detail {

/// The operations of a flow and of its guards in one mode, with the constants of one object.
///
/// Recurrences are those of `TaylorSeries`, with which the results agree to rounding.
class LazyTape {
public:
    LazyTape() = default;

    /// Reads a recording whose inputs are `states` components and the time.
    /// @param outputs  the rates of the state, then the guards, as operations of the recording
    LazyTape(std::size_t states, const Recording& as_called, std::vector<int> outputs);

    [[nodiscard]] std::size_t states() const noexcept { return tape_.states; }
    [[nodiscard]] std::size_t guards() const noexcept { return tape_.guards; }
    /// Number of different operations.
    [[nodiscard]] std::size_t operations() const noexcept { return tape_.ops_count - states() - 1; }
    /// Whether all constants are finite.
    [[nodiscard]] bool is_finite() const noexcept { return finite_; }
    /// Whether the motion is a polynomial in time, of degree `least_taylor_order` at most.
    [[nodiscard]] bool is_polynomial() const noexcept { return degree_ <= least_taylor_order; }

    /// The coefficients as by `TaylorSeries::compute`, up to an order, or all of them where the
    /// motion is a polynomial. Returns their number.
    int compute(double t, const double* x, const TaylorCoefficients<double>& to);

private:
    static constexpr std::size_t width = most_taylor_order + 1;

    /// As in `TaylorTape`.
    struct Tape {
        std::size_t states = 0;
        std::size_t guards = 0;
        std::size_t ops_count = 0;
        std::vector<TapeOp> ops;
        std::vector<int> outputs;
        std::vector<bool> for_guards;
        std::vector<int> degree;
    };

    void simplify(const Recording& recording);
    [[nodiscard]] int repeated(TapeOp& op, double& constant) const;
    void add_partners();
    void find_slopes();
    void start();
    void compute_at(std::size_t i, int k);
    void advance(int k, double* out, double* guards);
    void keep_guards(int k, double* guards) const;
    [[nodiscard]] double begin(std::size_t i);
    [[nodiscard]] double coefficient(std::size_t i, int k) const;
    [[nodiscard]] double coefficient_of_function(std::size_t i, int k) const;
    [[nodiscard]] double coefficient_of_inverse(std::size_t i, int k) const;

    [[nodiscard]] double* series(int i) noexcept
    {
        return coefficients_.data() + static_cast<std::size_t>(i) * width;
    }
    [[nodiscard]] const double* series(int i) const noexcept
    {
        return coefficients_.data() + static_cast<std::size_t>(i) * width;
    }
    /// j times coefficient j
    [[nodiscard]] const double* slope(int i) const noexcept
    {
        return slopes_.data() + static_cast<std::size_t>(i) * width;
    }
    [[nodiscard]] int degree(int i) const noexcept
    {
        return i < 0 ? 0 : tape_.degree[static_cast<std::size_t>(i)];
    }

    Tape tape_;
    std::vector<double> constants_;
    std::vector<double> coefficients_, slopes_, inverses_;
    std::vector<bool> has_slope_;
    int degree_ = no_degree;
    bool finite_ = true;
};

}  // namespace ricochet::detail
