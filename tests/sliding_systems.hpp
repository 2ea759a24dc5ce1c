// Systems with set_valued() beside guards, resets and time events of their own, written as data.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <string_view>
#include <vector>

#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet {

/// Times of the events of one kind.
template <class Events>
[[nodiscard]] std::vector<double> times_of(const Events& events, EventKind kind)
{
    std::vector<double> times;
    for (const auto& event : events) {
        if (event.kind == kind) times.push_back(event.t);
    }
    return times;
}

template <std::size_t N>
struct OwnGuard {
    GuardInfo info;
    std::function<double(double t, const std::array<double, N>& x)> value;
    std::function<void(double t, std::array<double, N>& x)> reset{};
};

/// x_0' = f_0(t, x) - friction Sgn(x_0 - belt), and x_i' = f_i(t, x) beside it. Guard 0, recorded,
/// is x_0 - belt; the others follow.
template <std::size_t N>
struct Slider {
    using State = std::array<double, N>;
    static constexpr std::string_view name = "slider";

    std::function<void(double t, const State& x, State& dxdt)> f;
    double friction = 1, belt = 0;
    std::vector<OwnGuard<N>> own{};
    std::function<double(double t)> next{};          ///< the next time event
    std::function<void(double t, State& x)> kick{};  ///< its reset

    void flow(double t, const State& x, State& dxdt) const
    {
        f(t, x, dxdt);
        dxdt[0] -= x[0] >= belt ? friction : -friction;
    }
    [[nodiscard]] std::size_t guard_count() const { return own.size() + 1; }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const
    {
        if (i > 0) return own[i - 1].info;
        GuardInfo info;
        info.name = "sliding speed";
        info.crossing = Crossing::either;
        info.resets = false;
        return info;
    }
    [[nodiscard]] double guard(std::size_t i, double t, const State& x) const
    {
        return i == 0 ? x[0] - belt : own[i - 1].value(t, x);
    }
    void reset(std::size_t i, double t, State& x) const
    {
        if (i > 0 && own[i - 1].reset) own[i - 1].reset(t, x);
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return next ? next(t) : std::numeric_limits<double>::infinity();
    }
    void time_reset(double t, State& x) const
    {
        if (kick) kick(t, x);
    }

    struct Motion {
        static constexpr int state_size = static_cast<int>(N);
        static constexpr int reaction_size = 1;
        using Vector = Eigen::Matrix<double, state_size, 1>;
        using Reaction = Eigen::Matrix<double, 1, 1>;
        const Slider* slider;

        void smooth(double t, const Vector& w, Vector& out) const
        {
            State x, dxdt;
            Eigen::Map<Vector>(x.data()) = w;
            slider->f(t, x, dxdt);
            out = Eigen::Map<const Vector>(dxdt.data());
        }
        void offset(double, Reaction& s) const { s[0] = slider->belt; }
        static void offset_rate(double, Reaction& s) { s[0] = 0; }
        [[nodiscard]] sets::Box<1> reaction_set(double, const Vector&) const
        {
            return sets::Box<1>({-slider->friction}, {slider->friction});
        }
    };
    [[nodiscard]] Motion set_valued() const { return {this}; }
};

}  // namespace ricochet
