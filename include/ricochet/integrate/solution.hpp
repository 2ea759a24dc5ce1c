// The whole solution, for evaluation at any time after the run.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/hybrid/guard.hpp"

namespace ricochet {

/// Steps as polynomials, of the order that the method attains over many steps. Where
/// the state jumps there is one value on each side.
template <class State>
class Solution {
public:
    [[nodiscard]] bool empty() const noexcept { return pieces_.empty(); }
    [[nodiscard]] std::size_t size() const noexcept { return pieces_.size(); }

    /// x at time t [s], after an event at t. Before the first and after the last
    /// recorded step, the nearest computed state. Needs at least one step.
    [[nodiscard]] State operator()(double t) const { return evaluate(pieces_[after(t)], t); }

    /// x at time t [s], before an event at t.
    [[nodiscard]] State before(double t) const
    {
        std::size_t k = after(t);
        while (k > 0 && offset(pieces_[k], t) <= 0) --k;
        return evaluate(pieces_[k], t);
    }

    /// The mode at time t [s], after an event at t.
    [[nodiscard]] Mode mode(double t) const { return pieces_[after(t)].mode; }

    /// Time [s] at which step k starts; for k = size(), at which the last one ends. Needs a step.
    [[nodiscard]] double time(std::size_t k) const
    {
        if (k < pieces_.size()) return pieces_[k].t;
        const Piece& last = pieces_.back();
        return last.backward ? last.t - last.length : last.t + last.length;
    }

    /// Passes every number to `visit`, which writes it or replaces it by the number that it reads
    /// (`detail::SnapshotWriter`, `detail::SnapshotReader`).
    template <class Visitor>
    void visit(Visitor&& visit)
    {
        std::size_t size = pieces_.size();
        visit(size);
        pieces_.resize(size);
        for (Piece& piece : pieces_) {
            for (double* number : {&piece.t, &piece.length, &piece.h}) visit(*number);
            auto nodes = static_cast<std::uint8_t>(piece.nodes);
            std::size_t departures = piece.w.size(), slopes = piece.slope.size();
            visit(piece.backward);
            visit(piece.mode);
            visit(nodes);
            visit(departures);
            visit(slopes);
            piece.nodes = static_cast<DenseNodes>(nodes);
            piece.w.resize(std::min<std::size_t>(departures, 3));
            piece.slope.resize(std::min<std::size_t>(slopes, piece.w.size()));
            for (State* x : {&piece.x0, &piece.remainder, &piece.rate0}) visit.state(*x);
            for (State& x : piece.w) visit.state(x);
            for (State& x : piece.slope) visit.state(x);
            if (piece.nodes == DenseNodes::series) {
                std::size_t numbers = piece.series.size();
                visit(numbers);
                piece.series.resize(numbers);
                for (double& number : piece.series) visit(number);
            }
        }
    }

    /// Adds a step, of which only the first `length` [s] were used.
    void add(double t0, bool backward, Mode mode, const DenseParts<State>& parts, double length)
    {
        Piece piece{.t = t0,
                    .length = length,
                    .h = parts.h,
                    .backward = backward,
                    .mode = mode,
                    .nodes = parts.nodes,
                    .x0 = *parts.x0,
                    .remainder = *parts.remainder,
                    .rate0 = *parts.rate0};
        for (std::size_t k = 0; k < 3; ++k) {
            if (parts.w[k]) piece.w.push_back(*parts.w[k]);
            if (parts.w[k] && parts.slope[k]) piece.slope.push_back(*parts.slope[k]);
        }
        if (parts.nodes == DenseNodes::series) {
            const double* const first = parts.series.coefficients;
            const auto orders = static_cast<std::size_t>(parts.series.order) + 1;
            piece.series.assign(first, first + orders * parts.series.stride);
        }
        pieces_.push_back(std::move(piece));
    }

    /// Adds the steps of `from`, with states of another type, that are not yet in this solution.
    template <class Other, class Convert>
    void add_from(const Solution<Other>& from, const Convert& convert)
    {
        const auto all = [&](const std::vector<Other>& states) {
            std::vector<State> out;
            out.reserve(states.size());
            for (const Other& state : states) out.push_back(convert(state));
            return out;
        };
        for (std::size_t i = pieces_.size(); i < from.pieces_.size(); ++i) {
            const auto& piece = from.pieces_[i];
            pieces_.push_back({.t = piece.t,
                               .length = piece.length,
                               .h = piece.h,
                               .backward = piece.backward,
                               .mode = piece.mode,
                               .nodes = piece.nodes,
                               .x0 = convert(piece.x0),
                               .remainder = convert(piece.remainder),
                               .rate0 = convert(piece.rate0),
                               .w = all(piece.w),
                               .slope = all(piece.slope),
                               .series = piece.series});
        }
    }

    /// Keeps only the first `size` steps.
    void shrink(std::size_t size)
    {
        pieces_.erase(pieces_.begin() + static_cast<std::ptrdiff_t>(size), pieces_.end());
    }

private:
    template <class>
    friend class Solution;

    struct Piece {
        double t, length, h;
        bool backward;
        Mode mode;
        DenseNodes nodes;
        State x0, remainder, rate0;
        std::vector<State> w{}, slope{};
        std::vector<double> series{};
    };

    [[nodiscard]] static double offset(const Piece& piece, double t) noexcept
    {
        return piece.backward ? piece.t - t : t - piece.t;
    }

    /// The last piece that starts at or before t.
    [[nodiscard]] std::size_t after(double t) const noexcept
    {
        const auto later = [](double time, const Piece& piece) { return offset(piece, time) < 0; };
        const auto it = std::upper_bound(pieces_.begin(), pieces_.end(), t, later);
        return it == pieces_.begin() ? 0 : static_cast<std::size_t>(it - pieces_.begin()) - 1;
    }

    [[nodiscard]] static State evaluate(const Piece& piece, double t)
    {
        DenseParts<State> parts{.nodes = piece.nodes,
                                .h = piece.h,
                                .x0 = &piece.x0,
                                .remainder = &piece.remainder,
                                .rate0 = &piece.rate0};
        const std::size_t without_slope = piece.w.size() - piece.slope.size();
        for (std::size_t k = 0; k < piece.w.size(); ++k) {
            parts.w[k] = &piece.w[k];
            if (k >= without_slope) parts.slope[k] = &piece.slope[k - without_slope];
        }
        State x = piece.x0;
        if (const auto n = static_cast<std::size_t>(x.size()); piece.series.size() >= 2 * n) {
            parts.series = {piece.series.data(), static_cast<int>(piece.series.size() / n) - 1, n};
        }
        const double s = std::clamp(offset(piece, t), 0.0, piece.length);
        if (s > 0) {
            const DenseView<State, false> view(parts, s);
            detail::for_each_component(x, [&](auto i) { x[i] = view[i]; });
        }
        return x;
    }

    std::vector<Piece> pieces_;
};

}  // namespace ricochet
