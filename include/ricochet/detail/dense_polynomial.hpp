// Internal: the declarations of this header may change without notice.
//
// The solution inside a step as a polynomial, one component at a time.
//
// A step is given by its departure w from the tangent at its start (see
// detail/kernels.hpp), which is zero with zero slope there, by the departure
// and its slope at the end, and for methods of higher order by further nodes
// inside. With u = s / h,
//
//     x(s) = x0 + s f0 + sum_k ( H_k(u) w_k + h K_k(u) w'_k )
//
// where H_k and K_k are the Hermite basis of those nodes (Hairer, Norsett and Wanner I,
// section II.6). The basis depends on the time alone, so evaluating one component
// of a large state costs a few multiplications.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "ricochet/detail/small_state.hpp"

namespace ricochet::detail {

/// Nodes of a step's polynomial besides its start.
enum class DenseNodes {
    end,         ///< cubic: the end with its slope
    middle_end,  ///< quartic: the middle without its slope, the end with it
    half_end,    ///< quintic: the middle and the end, with slopes
    thirds_end,  ///< degree 7: both thirds and the end, with slopes
    series,      ///< none: the coefficients of a power series
};

[[nodiscard]] constexpr int degree_of(DenseNodes nodes) noexcept
{
    switch (nodes) {
        case DenseNodes::end: return 3;
        case DenseNodes::middle_end: return 4;
        case DenseNodes::half_end: return 5;
        case DenseNodes::thirds_end: return 7;
        case DenseNodes::series: break;
    }
    return 0;
}

/// Weights of up to three departures and three slopes, for the value at u or its
/// derivative with respect to u. Slopes are per unit of u.
struct DenseWeights {
    std::array<double, 3> value{};
    std::array<double, 3> slope{};
};

/// Hermite basis over double nodes: 0 (where value and slope vanish) and `nodes`.
template <std::size_t n>
[[nodiscard]] constexpr DenseWeights hermite_weights(const std::array<double, n>& nodes, double u,
                                                     bool derivative) noexcept
{
    DenseWeights weights;
    for (std::size_t k = 0; k < n; ++k) {
        // L(u) = product of (u - node) / (node_k - node) over the other nodes and 0
        double at = u / nodes[k];
        double slope = 1 / nodes[k];    // L'(u)
        double at_node = 1 / nodes[k];  // L'(node_k)
        for (std::size_t j = 0; j < n; ++j) {
            if (j == k) continue;
            const double gap = nodes[k] - nodes[j];
            slope = (slope * (u - nodes[j]) + at) / gap;
            at *= (u - nodes[j]) / gap;
            at_node += 1 / gap;
        }
        const double d = u - nodes[k];
        const double bend = 1 - 2 * d * at_node;
        if (derivative) {
            weights.value[k] = -2 * at_node * at * at + 2 * bend * at * slope;
            weights.slope[k] = at * at + 2 * d * at * slope;
        } else {
            weights.value[k] = bend * at * at;
            weights.slope[k] = d * at * at;
        }
    }
    return weights;
}

/// The quartic through the middle (no slope) and the end (with slope); index 0 is the
/// middle.
[[nodiscard]] constexpr DenseWeights quartic_weights(double u, bool derivative) noexcept
{
    DenseWeights weights;
    if (derivative) {
        weights.value = {32 * u * (1 - u) * (1 - 2 * u), u * (-10 + u * (42 - 32 * u)), 0};
        weights.slope = {0, u * (2 + u * (-9 + 8 * u)), 0};
    } else {
        weights.value = {16 * u * u * (1 - u) * (1 - u), u * u * (2 * u - 1) * (5 - 4 * u), 0};
        weights.slope = {0, u * u * (2 * u - 1) * (u - 1), 0};
    }
    return weights;
}

[[nodiscard]] constexpr DenseWeights dense_weights(DenseNodes nodes, double u,
                                                   bool derivative) noexcept
{
    switch (nodes) {
        case DenseNodes::end: return hermite_weights<1>({1}, u, derivative);
        case DenseNodes::middle_end: return quartic_weights(u, derivative);
        case DenseNodes::half_end: return hermite_weights<2>({0.5, 1}, u, derivative);
        case DenseNodes::thirds_end:
            return hermite_weights<3>({1.0 / 3, 2.0 / 3, 1}, u, derivative);
        case DenseNodes::series: break;
    }
    return {};
}

/// Coefficients of power series in the offset s from the start of a step: the coefficient of s^k in
/// component i is `coefficients[k stride + i]`.
struct SeriesTerms {
    const double* coefficients = nullptr;
    int order = 0;
    std::size_t stride = 0;

    /// The departure from the tangent, or its derivative, at offset s.
    [[nodiscard, gnu::noinline]] double departure(std::size_t i, double s,
                                                  bool derivative) const noexcept
    {
        double sum = 0;
        for (int k = order; k > 1; --k) {
            const double c = coefficients[static_cast<std::size_t>(k) * stride + i];
            sum = sum * s + (derivative ? k * c : c);
        }
        return derivative ? sum * s : sum * s * s;
    }
};

/// The parts of a step's polynomial. Nodes are in ascending order, the end last.
template <class X>
struct DenseParts {
    DenseNodes nodes = DenseNodes::end;
    double h = 0;
    const X* x0 = nullptr;
    const X* remainder = nullptr;  ///< rounding error of x0, not contained in it
    const X* rate0 = nullptr;
    std::array<const X*, 3> w{};      ///< departures at the nodes
    std::array<const X*, 3> slope{};  ///< their slopes per second; null where not used
    SeriesTerms series{};             ///< in place of nodes

    [[nodiscard]] int degree() const noexcept
    {
        return nodes == DenseNodes::series ? series.order : degree_of(nodes);
    }
};

/// x(s), or x'(s) if `derivative`, a component at a time. Valid while the step is.
template <class X, bool derivative>
class DenseView {
public:
    DenseView(const DenseParts<X>& parts, double s) noexcept
        : parts_(parts), s_(s), weights_(dense_weights(parts.nodes, s / parts.h, derivative))
    {
        const double unit = derivative ? 1 / parts.h : 1;
        for (std::size_t k = 0; k < 3; ++k) {
            weights_.value[k] *= unit;
            weights_.slope[k] *= unit * parts.h;
        }
    }

    template <class Index>
    [[nodiscard]] double operator[](Index index) const noexcept
    {
        const auto i = static_cast<decltype(parts_.x0->size())>(index);
        double bent = 0;
        if (parts_.series.order > 0 && has_terms(static_cast<std::size_t>(i))) {
            bent = parts_.series.departure(static_cast<std::size_t>(i), s_, derivative);
        }
        for (std::size_t k = 0; k < 3 && parts_.w[k]; ++k) {
            bent += weights_.value[k] * (*parts_.w[k])[i];
            if (parts_.slope[k]) bent += weights_.slope[k] * (*parts_.slope[k])[i];
        }
        if constexpr (derivative) {
            return (*parts_.rate0)[i] + bent;
        } else {
            return (*parts_.x0)[i] + (s_ * (*parts_.rate0)[i] + (bent + (*parts_.remainder)[i]));
        }
    }

    [[nodiscard]] auto size() const noexcept { return parts_.x0->size(); }

private:
    /// Series have terms of the components alone, not of the zeros behind them.
    [[nodiscard]] bool has_terms([[maybe_unused]] std::size_t i) const noexcept
    {
        if constexpr (std::is_same_v<X, SmallState>) return i < parts_.series.stride;
        return true;
    }

    DenseParts<X> parts_;
    double s_;
    DenseWeights weights_;
};

}  // namespace ricochet::detail
