#include "ricochet/sensitivity/detail/history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>

#include "base/require.hpp"

namespace ricochet::detail {

namespace {

[[nodiscard]] double dot(std::span<const double> a, std::span<const double> b) noexcept
{
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
}

void add(std::span<double> to, double factor, std::span<const double> of) noexcept
{
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += factor * of[i];
}

/// Derivatives by the start of a step, by its time and by its length.
struct StepSlopes {
    std::vector<double> x;
    double t = 0;
    double h = 0;
};

/// The weights of the rates on the dense output and their derivatives by the fraction, which are
/// polynomials of degree 5: the central difference of seven points is exact.
[[nodiscard]] std::array<double, 7> dense_slopes(const TableauView& tableau, double u)
{
    constexpr double distance = 0.25;
    constexpr std::array<double, 3> weights{45.0 / 60, -9.0 / 60, 1.0 / 60};
    std::array<double, 7> sum{};
    for (std::size_t k = 0; k < 3; ++k) {
        const double offset = static_cast<double>(k + 1) * distance;
        const auto above = tableau.dense(u + offset);
        const auto below = tableau.dense(u - offset);
        for (std::size_t i = 0; i < 7; ++i) {
            sum[i] += weights[k] * (above[i] - below[i]) / distance;
        }
    }
    return sum;
}

/// One step of an explicit method, computed again, and its sweeps.
class StepAgain {
public:
    StepAgain(const TableauView& tableau, const Pullback& system)
        : tableau_(tableau), system_(system)
    {
    }

    /// Takes the step of `length` from a piece; `with_end` evaluates the rate at its end, too.
    void take(const History& history, const Piece& piece, double length, bool with_end)
    {
        piece_ = &piece;
        held_ = history.held(piece);
        h_ = length;
        n_ = piece.size;
        stages_ = tableau_.stages + (with_end ? 1 : 0);
        x_.assign((stages_ + 1) * n_, 0);
        k_.resize(stages_ * n_);
        const std::span<const double> start = history.state(piece);
        for (std::size_t i = 0; i < stages_; ++i) {
            std::ranges::copy(start, x(i).begin());
            for (std::size_t j = 0; j < std::min(i, tableau_.stages); ++j) {
                if (const double c = coefficient(i, j); c != 0) add(x(i), h_ * c, k(j));
            }
            system_.flow(piece.mode, time(i), x(i), k(i));
            still(k(i));
        }
    }

    /// The state at the end.
    void end(std::span<double> to)
    {
        std::ranges::copy(x(0), to.begin());
        for (std::size_t j = 0; j < tableau_.stages; ++j) add(to, h_ * tableau_.b[j], k(j));
    }
    /// The state on the dense output, at an offset.
    void dense(double s, std::span<double> to)
    {
        const auto weights = tableau_.dense(s / h_);
        std::ranges::copy(x(0), to.begin());
        double first = s;
        for (std::size_t j = 1; j < stages_; ++j) {
            add(to, h_ * weights[j], k(j));
            first -= h_ * weights[j];
        }
        add(to, first, k(0));
    }

    /// Starts a sweep.
    void start_sweep()
    {
        k_back_.assign(stages_ * n_, 0);
        slopes_ = {std::vector<double>(n_, 0.0), 0, 0};
    }
    /// Adds weights of the state at the end.
    void weigh_end(std::span<const double> w)
    {
        add(slopes_.x, 1, w);
        for (std::size_t j = 0; j < tableau_.stages; ++j) {
            if (tableau_.b[j] == 0) continue;
            add(k_back(j), h_ * tableau_.b[j], w);
            slopes_.h += tableau_.b[j] * dot(w, k(j));
        }
    }
    /// Adds weights of the state on the dense output at an offset; returns the derivative by that
    /// offset.
    double weigh_dense(double s, std::span<const double> w)
    {
        const double u = s / h_;
        const auto weights = tableau_.dense(u);
        const auto by_u = dense_slopes(tableau_, u);
        add(slopes_.x, 1, w);
        double first = s;
        double by_s = dot(w, k(0));
        for (std::size_t j = 1; j < stages_; ++j) {
            add(k_back(j), h_ * weights[j], w);
            first -= h_ * weights[j];
            const double along = dot(w, k(j)) - dot(w, k(0));
            slopes_.h += (weights[j] - u * by_u[j]) * along;
            by_s += by_u[j] * along;
        }
        add(k_back(0), first, w);
        return by_s;
    }
    /// Goes back through the stages; derivatives by parameters are added to p.
    [[nodiscard]] const StepSlopes& sweep(std::span<double> p)
    {
        std::vector<double>& by_x = by_x_;
        for (std::size_t i = stages_; i-- > 0;) {
            still(k_back(i));
            if (std::ranges::all_of(k_back(i), [](double w) { return w == 0; })) continue;
            by_x.assign(n_, 0);
            double by_t = 0;
            system_.flow_back(piece_->mode, time(i), x(i), k_back(i), {by_x, by_t, p});
            add(slopes_.x, 1, by_x);
            slopes_.t += by_t;
            slopes_.h += node(i) * by_t;
            for (std::size_t j = 0; j < std::min(i, tableau_.stages); ++j) {
                const double c = coefficient(i, j);
                if (c == 0) continue;
                slopes_.h += c * dot(by_x, k(j));
                add(k_back(j), h_ * c, by_x);
            }
        }
        return slopes_;
    }

private:
    // Behind the stages of the method there may be the rate at the end of the step.
    [[nodiscard]] double coefficient(std::size_t i, std::size_t j) const noexcept
    {
        return i < tableau_.stages ? tableau_.a[i * tableau_.stages + j] : tableau_.b[j];
    }
    [[nodiscard]] double node(std::size_t i) const noexcept
    {
        return i < tableau_.stages ? tableau_.c[i] : 1;
    }
    [[nodiscard]] double time(std::size_t i) const noexcept { return piece_->t + node(i) * h_; }
    [[nodiscard]] std::span<double> x(std::size_t i) { return {x_.data() + i * n_, n_}; }
    [[nodiscard]] std::span<double> k(std::size_t i) { return {k_.data() + i * n_, n_}; }
    [[nodiscard]] std::span<double> k_back(std::size_t i) { return {k_back_.data() + i * n_, n_}; }
    void still(std::span<double> rate) const
    {
        if (!held_) return;
        for (std::size_t i = 0; i < n_; ++i) {
            if ((*held_)[i]) rate[i] = 0;
        }
    }

    const TableauView& tableau_;
    const Pullback& system_;
    const Piece* piece_ = nullptr;
    const std::vector<bool>* held_ = nullptr;
    double h_ = 0;
    std::size_t n_ = 0;
    std::size_t stages_ = 0;
    std::vector<double> x_, k_, k_back_, by_x_;
    StepSlopes slopes_;
};

class Sweep {
public:
    Sweep(const History& history, const Pullback& system, LossWeights&& weights)
        : history_(history),
          system_(system),
          weights_(std::move(weights)),
          step_(history.tableau(), system),
          part_(history.tableau(), system),
          gradient_{{}, std::vector<double>(system.parameters(), 0.0), 0}
    {
    }

    [[nodiscard]] FlatGradient take(std::span<const double> end_state, double end_time)
    {
        start(end_state, end_time);
        add_before(history_.size());
        for (std::size_t i = history_.size(); i-- > 0;) {
            add_after(i + 1);
            const Piece& piece = history_[i];
            if (piece.kind == Piece::Kind::step) {
                back_through_step(i, piece);
            } else {
                back_through_jump(piece);
            }
            add_before(i);
        }
        add_after(0);
        gradient_.start = std::move(x_);
        gradient_.t_start = t_;
        return std::move(gradient_);
    }

private:
    [[nodiscard]] std::span<double> parameters() { return gradient_.parameters; }

    /// The end of the run is a state at a fixed time: as if a step of no length led there.
    void start(std::span<const double> state, double time)
    {
        x_ = weights_.end;
        x_.resize(state.size(), 0.0);
        const bool any = std::ranges::any_of(x_, [](double w) { return w != 0; });
        const bool at_event =
            history_.size() > 0 && (history_[history_.size() - 1].kind != Piece::Kind::step ||
                                    history_[history_.size() - 1].end == Piece::End::guard);
        if (!any || !at_event) return;
        std::vector<double> rate(state.size());
        system_.flow(weights_.end_mode, time, state, rate);
        t_ = -dot(x_, rate);
    }

    void add_after(std::size_t piece)
    {
        for (const EventWeights& event : weights_.events) {
            if (event.end == piece && !event.after.empty()) add(x_, 1, event.after);
        }
    }
    void add_before(std::size_t piece)
    {
        for (const EventWeights& event : weights_.events) {
            if (event.first != piece) continue;
            t_ += event.t;
            if (!event.before.empty()) add(x_, 1, event.before);
        }
    }

    void back_through_jump(const Piece& piece)
    {
        std::vector<double> by_x(piece.size, 0.0);
        double by_t = 0;
        const Cotangent to{by_x, by_t, parameters()};
        if (piece.kind == Piece::Kind::reset) {
            system_.reset_back(piece.guard, piece.mode, piece.t, history_.state(piece), x_, to);
        } else {
            system_.rest_back(piece.guard, piece.mode, piece.t, history_.state(piece), x_, to);
        }
        x_ = std::move(by_x);
        t_ += by_t;
    }

    void back_through_step(std::size_t i, const Piece& piece)
    {
        const auto [first, last] = std::ranges::equal_range(
            weights_.places, i, {}, [](const PlaceWeights& w) { return w.place.piece; });
        const bool dense = history_.tableau().dense != nullptr && piece.h != 0;
        step_.take(history_, piece, piece.h, dense && first != last);
        double by_places = 0;  // by the time of the start, of what is at fixed times
        std::vector<double> more(piece.size, 0.0);
        double more_t = 0;
        step_.start_sweep();
        for (auto w = first; w != last; ++w) {
            add_recorded_event(piece, *w);
            if (dense) {
                by_places -= step_.weigh_dense(w->place.s, w->x);
            } else {
                part_.take(history_, piece, w->place.s, false);
                part_.start_sweep();
                part_.weigh_end(w->x);
                const StepSlopes& slopes = part_.sweep(parameters());
                add(more, 1, slopes.x);
                more_t += slopes.t - slopes.h;
            }
        }
        step_.weigh_end(x_);
        if (piece.end == Piece::End::guard) {
            back_to_guard(piece);
        } else {
            const StepSlopes& slopes = step_.sweep(parameters());
            t_ = piece.end == Piece::End::time ? slopes.t - slopes.h : slopes.t + t_;
            x_ = slopes.x;
        }
        add(x_, 1, more);
        t_ += by_places + more_t;
    }

    void back_to_guard(const Piece& piece)
    {
        const StepSlopes of_loss = step_.sweep(parameters());
        std::vector<double> end(piece.size);
        step_.end(end);
        by_guard_.assign(parameters().size(), 0);
        std::vector<double> g_x(piece.size, 0.0);
        double g_t = 0;
        system_.guard_back(piece.guard, piece.mode, piece.t + piece.h, end, 1,
                           {g_x, g_t, by_guard_});
        step_.start_sweep();
        step_.weigh_end(g_x);
        const StepSlopes& of_guard = step_.sweep(by_guard_);
        const double m = -(of_loss.h + t_) / (of_guard.h + g_t);
        x_ = of_loss.x;
        add(x_, m, of_guard.x);
        t_ += of_loss.t + m * (of_guard.t + g_t);
        add(parameters(), m, by_guard_);
    }

    /// Turns a weight of the time of a recorded event into weights of the state at that time.
    void add_recorded_event(const Piece& piece, PlaceWeights& w)
    {
        if (w.guard == no_guard) return;
        std::vector<double> at(piece.size), rate(piece.size), g_x(piece.size, 0.0);
        history_.evaluate(system_, w.place, at);
        const double t = piece.t + w.place.s;
        system_.flow(piece.mode, t, at, rate);
        by_guard_.assign(parameters().size(), 0);
        double g_t = 0;
        system_.guard_back(w.guard, piece.mode, t, at, 1, {g_x, g_t, by_guard_});
        // The states before and after it move with the event.
        const double m = -(w.t + dot(w.x, rate)) / (dot(g_x, rate) + g_t);
        add(w.x, m, g_x);
        add(parameters(), m, by_guard_);
        w.guard = no_guard;
    }

    const History& history_;
    const Pullback& system_;
    LossWeights weights_;
    StepAgain step_, part_;
    std::vector<double> x_;  // by the state where the sweep is, and by its time
    double t_ = 0;
    std::vector<double> by_guard_;
    FlatGradient gradient_;
};

}  // namespace

void History::add(Piece piece, std::span<const double> x)
{
    piece.at = states_.size();
    piece.size = x.size();
    if (piece.kind == Piece::Kind::step) piece.held = held_;
    states_.insert(states_.end(), x.begin(), x.end());
    pieces_.push_back(piece);
}

void History::hold(std::vector<bool> components)
{
    if (std::ranges::find(components, true) == components.end()) return release();
    holds_.push_back(std::move(components));
    held_ = holds_.size();
}

void History::review_held(std::span<const double> end)
{
    if (held_ == 0) return;
    Piece& last = pieces_.back();
    const std::span<const double> start = state(last);
    const std::vector<bool>& held = holds_[held_ - 1];
    for (std::size_t i = 0; i < end.size() && i < held.size(); ++i) {
        if (!held[i] || end[i] == start[i]) continue;
        release();
        last.held = 0;
        return;
    }
}

void History::evaluate(const Pullback& system, const Place& place, std::span<double> x) const
{
    const Piece& piece = pieces_[place.piece];
    StepAgain step(tableau_, system);
    if (tableau_.dense && piece.h != 0) {
        step.take(*this, piece, piece.h, true);
        step.dense(place.s, x);
    } else {
        step.take(*this, piece, place.s, false);
        step.end(x);
    }
}

void throw_wrong_slopes(std::string_view what, std::size_t expected, std::size_t given)
{
    Refuse{"Adjoint"}(fmt::format(
        "found slopes of {} {}, expected those of the {} that the run has", given, what, expected));
}

void throw_slope_of_wrong_size(std::size_t expected, std::size_t given)
{
    Refuse{"Adjoint"}(
        fmt::format("found a slope of {} components, expected one of {}", given, expected));
}

FlatGradient sweep_back(const History& history, const Pullback& system, LossWeights weights,
                        std::span<const double> end_state, double end_time)
{
    return Sweep(history, system, std::move(weights)).take(end_state, end_time);
}

}  // namespace ricochet::detail
