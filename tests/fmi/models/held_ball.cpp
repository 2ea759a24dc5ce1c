// A set-valued system as an FMU, for co-simulation alone: a ball bounces, lies on the floor, and is
// lifted by a load that grows from 1 s on and reaches its weight at 1.5 s.
#include <array>
#include <cmath>
#include <optional>
#include <ricochet/fmi/export.hpp>
#include <ricochet/nonsmooth/hand_over.hpp>

namespace {

using ricochet::Mode;

struct HeldBall {
    using State = std::array<double, 2>;  // height, speed
    enum : Mode { flying, resting };
    static constexpr std::size_t mode_count = 2;

    static double pull(double t) { return t < 1 ? -10 : -10 + 20 * (t - 1); }
    static void flow(Mode, double t, const State& x, State& dxdt) { dxdt = {x[1], pull(t)}; }
    static double guard(Mode, double, const State& x) { return x[0]; }
    static ricochet::GuardInfo guard_info() { return {.unilateral = true, .reaction = 0}; }
    static Mode reset(Mode mode, double, State& x)
    {
        x = {0, -0.5 * x[1]};
        return mode;
    }
    static Mode rest(Mode, double, State& x)
    {
        x = {0, 0};
        return resting;
    }
    static double next_time_event(double t) { return t < 1 ? 1 : INFINITY; }

    /// v' = pull + r with r >= 0, and v = 0 while it rests.
    struct Floor {
        static constexpr int state_size = 2, reaction_size = 1;
        static void smooth(double t, const Eigen::Vector2d& w, Eigen::Vector2d& f)
        {
            f << w[1], pull(t);
        }
        static void observe(Eigen::Matrix<double, 1, 2>& E) { E << 0, 1; }
        static ricochet::sets::IntervalSet reaction_set(double, const Eigen::Vector2d&)
        {
            return ricochet::sets::IntervalSet::half_line();
        }
    };
    static std::optional<Floor> set_valued(Mode mode)
    {
        return mode == resting ? std::optional<Floor>(Floor{}) : std::nullopt;
    }
    static Mode change(std::size_t, ricochet::EventKind kind, Mode mode, double, State&)
    {
        return kind == ricochet::EventKind::slip ? Mode{flying} : mode;
    }
};

struct Held {
    static constexpr double t_end = 2;
    static constexpr ricochet::fmi::Exported states[] = {{"height", 0.2, "m"}, {"speed", 0, "m/s"}};
    static HeldBall make(std::span<const double>) { return {}; }
};

}  // namespace
RICOCHET_FMU(Held)
