// Internal: the declarations of this header may change without notice.
//
// What a run leaves behind for a sweep in reverse: the state at the start of each step, and the
// jumps between them. Stages are computed again.
//
// A step is a function of its start and its length, x1 = x0 + h sum_i b_i k_i, and so is the time
// of its end. Its length is the one of the run where nothing else determines it; a step that ends
// at a given time (t_end, a time event) has the length that is left to it; one that ends at a guard
// has the length at which the guard vanishes. Derivatives of these numbers are those of the
// formulas, to rounding. With
//
//     w, v      the derivatives of the loss by the state and the time at the end of a step
//     W_x, W_t, W_h   those of w . x1 by the start, its time, and the length
//     G_x, G_t, G_h   those of g(t1, x1), where a guard ends the step
//
// they are, at its start,
//
//     a length of the run    W_x,                 W_t + v
//     a given end            W_x,                 W_t - W_h
//     a guard                W_x + m G_x,         W_t + v + m G_t,       m = -(W_h + v) / G_h
//
// and those by parameters likewise. The last row, with the reset between two steps, is the
// transposed saltation matrix (saltation.hpp): W_h is w . f⁻ and G_h the rate of the guard.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "ricochet/detail/runge_kutta.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/sensitivity/pullback.hpp"

namespace ricochet::detail {

/// An explicit method as numbers.
struct TableauView {
    std::size_t stages = 0;
    const double* c = nullptr;
    const double* a = nullptr;  ///< row by row, `stages` wide
    const double* b = nullptr;
    /// Weights of the rates in the departure at a fraction of a step; null: none.
    std::array<double, 7> (*dense)(double) = nullptr;
};

template <class Tableau>
[[nodiscard]] TableauView tableau_view() noexcept
{
    TableauView view{
        .stages = Tableau::stages, .c = Tableau::c.data(), .a = nullptr, .b = Tableau::b.data()};
    if constexpr (Tableau::stages > 1) view.a = Tableau::a[0].data();
    if constexpr (requires { Tableau::dense(0.5); }) view.dense = &Tableau::dense;
    return view;
}

/// A piece of a run, in its order.
struct Piece {
    enum class Kind : std::uint8_t { step, reset, rest };
    enum class End : std::uint8_t { length, time, guard };

    Kind kind = Kind::step;
    End end = End::length;  ///< what determines the length of a step
    Mode mode = 0;          ///< of a step, or before a reset
    std::size_t guard = no_guard;
    std::size_t at = 0;  ///< where the state at its start is
    std::size_t size = 0;
    double t = 0;          ///< [s]
    double h = 0;          ///< [s] length of a step
    std::size_t held = 0;  ///< 1 + the place of the components that a rest holds; 0: none
};

/// A place at which the loss depends on the state: a sample, or a recorded event.
struct Place {
    std::size_t piece = 0;  ///< a step
    double s = 0;           ///< [s] from its start
};

/// The pieces of a run.
class History {
public:
    explicit History(const TableauView& tableau) : tableau_(tableau) {}

    void add(Piece piece, std::span<const double> x);
    void set_end(Piece::End end, std::size_t guard)
    {
        pieces_.back().end = end;
        pieces_.back().guard = guard;
    }
    /// Declares components held by the last rest, until `release`.
    void hold(std::vector<bool> components);
    void release() noexcept { held_ = 0; }
    [[nodiscard]] bool holds() const noexcept { return held_ != 0; }
    /// Lets go the components that the last step has moved nevertheless.
    void review_held(std::span<const double> end);

    [[nodiscard]] std::size_t size() const noexcept { return pieces_.size(); }
    [[nodiscard]] const Piece& operator[](std::size_t i) const noexcept { return pieces_[i]; }
    [[nodiscard]] std::span<const double> state(const Piece& piece) const noexcept
    {
        return {states_.data() + piece.at, piece.size};
    }
    [[nodiscard]] const TableauView& tableau() const noexcept { return tableau_; }
    [[nodiscard]] const std::vector<bool>* held(const Piece& piece) const noexcept
    {
        return piece.held == 0 ? nullptr : &holds_[piece.held - 1];
    }

    /// Bytes that it occupies.
    [[nodiscard]] std::size_t bytes() const noexcept
    {
        return pieces_.size() * sizeof(Piece) + states_.size() * sizeof(double);
    }

    /// The state at a place, on the dense output of the method where it has one, else by a step of
    /// that length.
    void evaluate(const Pullback& system, const Place& place, std::span<double> x) const;

private:
    TableauView tableau_;
    std::vector<Piece> pieces_;
    std::vector<double> states_;
    std::vector<std::vector<bool>> holds_;
    std::size_t held_ = 0;
};

/// Weights of the loss at a place.
struct PlaceWeights {
    Place place;
    std::vector<double> x;         ///< by the state at its fixed time
    std::size_t guard = no_guard;  ///< of a recorded event
    double t = 0;                  ///< by the time of that event
};

/// Weights at an event that ends a step: by its time and by the states there.
struct EventWeights {
    std::size_t first = 0;  ///< the piece of its reset
    std::size_t end = 0;    ///< the piece after its resets
    double t = 0;
    std::vector<double> before, after;  ///< empty: none
};

/// All weights of a loss, in the order of their places.
struct LossWeights {
    std::vector<PlaceWeights> places;
    std::vector<EventWeights> events;
    std::vector<double> end;  ///< by the state at the end of the run, at its fixed time
    Mode end_mode = 0;
};

/// The derivatives of a loss.
struct FlatGradient {
    std::vector<double> start, parameters;
    double t_start = 0;
};

[[noreturn]] void throw_wrong_slopes(std::string_view what, std::size_t expected,
                                     std::size_t given);
[[noreturn]] void throw_slope_of_wrong_size(std::size_t expected, std::size_t given);

/// From the weights back to the start.
[[nodiscard]] FlatGradient sweep_back(const History& history, const Pullback& system,
                                      LossWeights weights, std::span<const double> end_state,
                                      double end_time);

}  // namespace ricochet::detail
