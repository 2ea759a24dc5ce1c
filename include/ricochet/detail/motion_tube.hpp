// Internal: the declarations of this header may change without notice.
//
// A tube around an interval of a motion, one step or several, as enclosures of its components.
//
// The motion is what the rest of the library takes for it: in every step the polynomial of the
// step. With u in [0, 1], the chord from x0 to x1 = x0 + D, and the rates f0 and f1 at its ends,
// the cubic through both is
//
//     x0 + u D + u (1 - u)^2 (h f0 - D) + u^2 (1 - u) (D - h f1)
//
// and both weights lie in [0, 4/27]. A polynomial p of a higher degree differs from its cubic by at
// most max |p''''| h^4 / 384, `beyond`. In an interval of several steps the chord is that from the
// first state to the last, and the distance of a chord of a step from it is largest at a node. So
// the tube holds for the polynomials themselves, whatever their error.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/enclosure.hpp"

namespace ricochet::detail {

/// Start of a step of an interval, or the end of the last one.
template <class X>
struct TubeNode {
    double s = 0;  ///< [s] offset from the start of the interval
    const X* x = nullptr;
    const X* rate = nullptr;    ///< dx/ds
    const X* beyond = nullptr;  ///< of the step that begins here; null: it is a cubic
    double part = 1;            ///< factor of `beyond`
};

template <class X>
class MotionTube {
public:
    /// @param nodes  at least two, with ascending offsets; the tube keeps a reference
    /// @param t0,t1  [s] times of the first and the last
    MotionTube(double t0, double t1, std::span<const TubeNode<X>> nodes) noexcept
        : t0_(t0), t1_(t1), nodes_(nodes)
    {
    }

    [[nodiscard]] std::size_t size() const noexcept { return nodes_.front().x->size(); }

    [[nodiscard]] Enclosure time() const noexcept
    {
        const double rounding = 0x1p-51 * (std::fabs(t0_) + std::fabs(t1_));
        return {0.5 * (t0_ + t1_), 0.5 * (t1_ - t0_), rounding};
    }

    [[nodiscard]] Enclosure component(std::size_t i) const noexcept
    {
        Block<1> block;
        return enclose(block, i), block.of(0);
    }

    /// The first n components.
    template <std::size_t n>
    [[nodiscard]] std::array<Enclosure, n> components() const noexcept
    {
        std::array<Enclosure, n> all;
        std::size_t first = 0;
        for (; first + lanes <= n; first += lanes) {
            Block<lanes> block;
            enclose(block, first);
            for (std::size_t k = 0; k < lanes; ++k) all[first + k] = block.of(k);
        }
        for (; first < n; ++first) all[first] = component(first);
        return all;
    }

private:
    static constexpr double weight = 4.0 / 27;
    static constexpr std::size_t lanes = 4;  ///< components that are enclosed together

    /// Some components, next to each other.
    template <std::size_t m>
    struct Block {
        std::array<double, m> x0, x1, lowest, highest, largest;

        [[nodiscard]] Enclosure of(std::size_t k) const noexcept
        {
            // The polynomial and the tube are sums of a few such terms, each rounded a few times.
            const double width = highest[k] - lowest[k];
            const double terms = std::fabs(x0[k]) + std::fabs(x1[k]) + largest[k] + width;
            return {0.5 * (x0[k] + x1[k]) + 0.5 * (lowest[k] + highest[k]), 0.5 * (x1[k] - x0[k]),
                    0.5 * width + 0x1p-49 * terms};
        }
    };

    /// Encloses components `first`, ... The loops over them are vectorised.
    template <std::size_t m>
    void enclose(Block<m>& block, std::size_t first) const noexcept
    {
        const TubeNode<X>* const nodes = nodes_.data();
        const std::size_t steps = nodes_.size() - 1;
        const double* x = at(*nodes->x, first);
        const double* slope = at(*nodes->rate, first);
        const double* const last = at(*nodes[steps].x, first);
        std::array<double, m> rate, before{};
        for (std::size_t k = 0; k < m; ++k) {
            block.x0[k] = x[k];
            block.x1[k] = last[k];
            block.lowest[k] = block.highest[k] = block.largest[k] = 0;
            rate[k] = (last[k] - x[k]) / nodes[steps].s;
        }
        for (std::size_t n = 0; n < steps; ++n) {
            const TubeNode<X>& from = nodes[n];
            const TubeNode<X>& to = nodes[n + 1];
            const double h = to.s - from.s;
            const double* const next_x = at(*to.x, first);
            const double* const next_slope = at(*to.rate, first);
            const double* const beyond = from.beyond ? at(*from.beyond, first) : nullptr;
            // The chords meet at the end.
            const double inside = n + 1 < steps ? 1 : 0;
            for (std::size_t k = 0; k < m; ++k) {
                const double chord = next_x[k] - x[k];
                const double a = h * slope[k] - chord;
                const double b = chord - h * next_slope[k];
                const double after = inside * ((next_x[k] - block.x0[k]) - rate[k] * to.s);
                const double more = beyond ? from.part * beyond[k] : 0;
                const double below = least_of(a, 0.0) + least_of(b, 0.0);
                const double above = greatest_of(a, 0.0) + greatest_of(b, 0.0);
                block.lowest[k] =
                    least_of(block.lowest[k], least_of(before[k], after) + weight * below - more);
                block.highest[k] = greatest_of(
                    block.highest[k], greatest_of(before[k], after) + weight * above + more);
                block.largest[k] =
                    greatest_of(block.largest[k], std::fabs(a) + std::fabs(b) + more);
                before[k] = after;
            }
            x = next_x;
            slope = next_slope;
        }
    }

    [[nodiscard]] static const double* at(const X& x, std::size_t i) noexcept
    {
        return x.data() + i;
    }

    double t0_, t1_;
    std::span<const TubeNode<X>> nodes_;
};

/// The components of a tube, as a state that can only be read.
template <class X>
class TubeView {
public:
    explicit TubeView(const MotionTube<X>& tube) noexcept : tube_(&tube) {}
    template <class Index>
    [[nodiscard]] Enclosure operator[](Index i) const noexcept
    {
        return tube_->component(static_cast<std::size_t>(i));
    }
    [[nodiscard]] std::size_t size() const noexcept { return tube_->size(); }

private:
    const MotionTube<X>* tube_;
};

}  // namespace ricochet::detail
