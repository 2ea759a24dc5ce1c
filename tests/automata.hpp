// Hybrid automata whose modes have inclusions of their own, written as data.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet {

/// w' = f(t, w) + E' r, y = E w - s, lower <= r <= upper.
template <int N, int M>
struct BoxMotion {
    static constexpr int state_size = N, reaction_size = M;
    using State = std::array<double, static_cast<std::size_t>(N)>;
    using Vector = Eigen::Matrix<double, N, 1>;
    using Reaction = Eigen::Matrix<double, M, 1>;
    using Bounds = std::array<double, static_cast<std::size_t>(M)>;

    std::function<void(double t, const State& x, State& dxdt)> f;
    std::array<std::array<double, static_cast<std::size_t>(N)>, static_cast<std::size_t>(M)> e;
    Bounds lower, upper, s{};

    void smooth(double t, const Vector& w, Vector& out) const
    {
        State x, dxdt{};
        Eigen::Map<Vector>(x.data()) = w;
        f(t, x, dxdt);
        out = Eigen::Map<const Vector>(dxdt.data());
    }
    template <class Matrix>
    void observe(Matrix& out) const
    {
        for (int i = 0; i < M; ++i) {
            for (int c = 0; c < N; ++c) {
                out(i, c) = e[static_cast<std::size_t>(i)][static_cast<std::size_t>(c)];
            }
        }
    }
    void offset(double, Reaction& out) const { out = Eigen::Map<const Reaction>(s.data()); }
    static void offset_rate(double, Reaction& out) { out.setZero(); }
    [[nodiscard]] sets::Box<static_cast<std::size_t>(M)> reaction_set(double, const Vector&) const
    {
        return {lower, upper};
    }
};

template <std::size_t N, int M = 1>
struct Automaton {
    using State = std::array<double, N>;
    using Motion = BoxMotion<static_cast<int>(N), M>;
    static constexpr std::string_view name = "automaton";
    struct Transition {
        GuardInfo info;
        std::function<double(Mode mode, double t, const State& x)> value;
        std::function<Mode(Mode mode, double t, State& x)> reset{};
        std::vector<Mode> disabled_in{};
    };

    std::size_t mode_count = 2;
    std::function<void(Mode mode, double t, const State& x, State& dxdt)> own;
    std::function<std::optional<Motion>(Mode mode)> motion;
    std::vector<Transition> transitions{};
    std::function<double(double t)> next{};  ///< the next time event
    std::function<Mode(Mode mode, double t, State& x)> tick{};

    void flow(Mode mode, double t, const State& x, State& dxdt) const { own(mode, t, x, dxdt); }
    [[nodiscard]] std::size_t guard_count() const { return transitions.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return transitions[i].info; }
    [[nodiscard]] double guard(std::size_t i, Mode mode, double t, const State& x) const
    {
        return transitions[i].value(mode, t, x);
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const
    {
        for (const Mode off : transitions[i].disabled_in) {
            if (off == mode) return false;
        }
        return true;
    }
    Mode reset(std::size_t i, Mode mode, double t, State& x) const
    {
        return transitions[i].reset ? transitions[i].reset(mode, t, x) : mode;
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return next ? next(t) : std::numeric_limits<double>::infinity();
    }
    Mode time_reset(Mode mode, double t, State& x) const { return tick ? tick(mode, t, x) : mode; }
    [[nodiscard]] std::optional<Motion> set_valued(Mode mode) const { return motion(mode); }
};

}  // namespace ricochet
