// Internal: the declarations of this header may change without notice.
//
// The operations of a flow that were recorded at run time, and their power series, computed
// operation by operation, for flows whose operations the compiler cannot know.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ricochet/taylor/detail/taylor_recording.hpp"
#include "ricochet/taylor/detail/taylor_step.hpp"
#include "ricochet/taylor/detail/taylor_tape.hpp"

namespace ricochet::detail {

/// The operations of a flow and of its guards in one mode, with the constants of one object.
///
/// Recurrences are those of `TaylorSeries`, with which the results agree to rounding. Operations of
/// one kind that do not depend on each other are computed side by side.
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

    // What is computed, for code that does the same.

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
    /// A term of a combination: an operation, or its place, and its factor.
    struct Term {
        std::size_t of;
        double factor;
    };
    [[nodiscard]] const Tape& tape() const noexcept { return tape_; }
    /// Constants by operation.
    [[nodiscard]] const std::vector<double>& constants() const noexcept { return constants_; }
    /// Terms, by operation, of those that are combinations.
    [[nodiscard]] const std::vector<std::vector<Term>>& terms() const noexcept { return terms_; }
    /// Whether an operation is only a part of combinations.
    [[nodiscard]] bool is_absorbed(std::size_t i) const noexcept { return absorbed_[i]; }
    /// The largest degree in time of states and guards.
    [[nodiscard]] int degree() const noexcept { return degree_; }

private:
    /// What is computed side by side: coefficient k of operations of one kind.
    enum class Pass {
        operation,
        combination,  ///< a sum of more than two operands, with factors
        copy,         ///< of operands that do not stand side by side
        slope,        ///< k times a coefficient
    };
    /// Places of the operands.
    struct Lane {
        std::uint32_t a, b;
    };
    struct Batch {
        Pass pass = Pass::operation;
        TaylorOp op{};
        double exponent = 0;
        int degree_a = 0, degree_b = 0, degree_c = 0;  ///< of the operands
        int degree = 0;
        bool for_guards = false;
        std::size_t first = 0;           ///< place of the first lane
        std::vector<std::size_t> ops{};  ///< their numbers on the tape
        std::vector<Lane> lanes{};
        std::vector<Term> terms{};  ///< of combinations, lane by lane
        /// Places of the first operands where those of all lanes stand side by side, and of the
        /// slopes of the operands and of the results.
        std::size_t a = 0, b = 0, c = 0, slope_a = 0, slope_b = 0, slope = 0;
    };
    /// The terms j = lo, ..., hi of coefficient k.
    struct Terms {
        int k, lo, hi;
    };

    // Of a short tape operations are computed one by one, each with its coefficients in a row.

    enum class Step : std::uint8_t {
        sum,
        difference,
        negative,
        copy,
        times,
        combination,
        slope,
        product,
        square,
        quotient,
        constant_over,
        square_root,
        function,  ///< exp, sin, sinh, cosh
        cosine,    ///< the same with the opposite sign
        tangent,   ///< with a_k before it
        hyperbolic_tangent,
    };
    struct Instruction {
        Step step{};
        bool for_guards = false;
        bool endless = false;                 ///< its operands are no polynomials
        int degree = 0;                       ///< of the result
        int degree_a = 0, degree_b = 0;       ///< of the operands
        std::uint32_t out = 0, a = 0, b = 0;  ///< where their columns begin
        /// Of a combination the first term, of a function the column of the operand's slopes, else
        /// the place of the result.
        std::uint32_t first = 0;
        std::uint32_t count = 0;  ///< of the terms of a combination
        double factor = 0;
    };

    void simplify(const Recording& recording);
    [[nodiscard]] int repeated(TapeOp& op, double& constant) const;
    void add_partners();

    void combine_sums();
    [[nodiscard]] Term term(int i, const std::vector<int>& uses);
    void arrange();
    [[nodiscard]] static Lane lane(std::size_t a, std::size_t b) noexcept;
    [[nodiscard]] std::vector<Batch> batches() const;
    void place(Batch& batch);
    void side_by_side(Batch& batch);
    [[nodiscard]] std::size_t in_a_row(const std::vector<std::size_t>& places, bool late);
    [[nodiscard]] std::size_t slopes_of(std::size_t first, std::size_t count, bool late);

    void write_program();
    [[nodiscard]] bool append(const Batch& batch, std::vector<std::uint32_t>& sources);
    int run_program(double t, const double* x, const TaylorCoefficients<double>& to, int order);
    template <int k>
    bool run_row(int order, const TaylorCoefficients<double>& to);
    template <int k>
    void compute_instruction(const Instruction& of);
    void advance_columns(int k, const TaylorCoefficients<double>& to);
    void keep_guard_columns(int k, double* guards) const;
    [[nodiscard]] double combined(const Instruction& of, int k) const noexcept;

    void start(double t, const double* x);
    [[nodiscard]] double begin(std::size_t i);
    void compute_row(int k, bool guards_alone);
    void compute_batch(const Batch& batch, int k);
    void combine(const Batch& batch, int k);
    void add_up(const Batch& batch, int k);
    void add_up_function(const Batch& batch, int k);
    void add_up_inverse(const Batch& batch, int k);
    void convolve(std::size_t a, std::size_t b, Terms terms, std::size_t count, double* sums);
    void square(std::size_t a, int k, int lo, std::size_t count);
    void power(const Batch& batch, int k, int hi);
    void advance(int k, double* out, double* guards);
    void keep_guards(int k, double* guards) const;

    [[nodiscard]] double* row(int k) noexcept
    {
        return rows_.data() + static_cast<std::size_t>(k) * width_;
    }
    [[nodiscard]] const double* row(int k) const noexcept
    {
        return rows_.data() + static_cast<std::size_t>(k) * width_;
    }
    [[nodiscard]] int degree(int i) const noexcept
    {
        return i < 0 ? 0 : tape_.degree[static_cast<std::size_t>(i)];
    }

    Tape tape_;
    std::vector<double> constants_;
    /// Operands, with their factors, of every linear combination that is more than a sum or
    /// difference of two operations; empty for all others.
    std::vector<std::vector<Term>> terms_;
    std::vector<bool> absorbed_;        ///< operations that are parts of combinations
    std::vector<std::size_t> places_;   ///< of operations in a row
    std::vector<std::size_t> outputs_;  ///< places of the outputs
    std::vector<Batch> batches_;        ///< in their order
    std::vector<Batch> late_;           ///< of what a row is read from in the next ones alone
    std::size_t width_ = 0;
    /// Where the terms of a sum of `last` + 1 are, in the order in which they are added.
    std::array<std::array<std::ptrdiff_t, most_taylor_order + 1>, most_taylor_order + 1> outward_{};
    std::vector<double> rows_;      ///< a row of coefficients for each order
    std::vector<double> factors_;   ///< constants by place
    std::vector<double> inverses_;  ///< by place
    std::vector<double> sums_, other_sums_;
    std::vector<Instruction> program_;  ///< empty: operations are computed side by side
    std::vector<Term> program_terms_;   ///< places of operands, and factors
    std::vector<double> columns_;       ///< coefficients of each place, one after the other
    int degree_ = no_degree;
    bool finite_ = true;
};

}  // namespace ricochet::detail
