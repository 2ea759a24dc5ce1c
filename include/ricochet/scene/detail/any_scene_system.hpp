// Internal: the declarations of this header may change without notice.
//
// Interface through which a scene uses systems of any type.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/instant.hpp"
#include "ricochet/scene/scene.hpp"
#include "ricochet/scene/system_disc.hpp"

namespace ricochet::detail {

/// A monitor's verdict on a step; see `Verdict`.
enum class StepVerdict { stands, cut, rests, ended };

/// A step of the scene, shown to a monitor.
class SceneStep {
public:
    SceneStep() = default;
    SceneStep(const SceneStep&) = delete;
    SceneStep& operator=(const SceneStep&) = delete;
    virtual ~SceneStep() = default;

    [[nodiscard]] virtual Instant t0() const = 0;
    [[nodiscard]] virtual double h() const = 0;
    [[nodiscard]] virtual std::span<const double> x0() const = 0;
    [[nodiscard]] virtual std::span<const double> x1() const = 0;
    [[nodiscard]] virtual std::span<const double> rate0() const = 0;
    [[nodiscard]] virtual std::span<const double> rate1() const = 0;
    virtual void interpolate(double s, std::span<double> x) const = 0;
    virtual void restep(double s, std::span<double> x) const = 0;
};

/// The events of a system in a run of a scene.
class SystemEvents {
public:
    SystemEvents() = default;
    SystemEvents(const SystemEvents&) = delete;
    SystemEvents& operator=(const SystemEvents&) = delete;
    virtual ~SystemEvents() = default;

    virtual StepVerdict start(const Instant& t, std::span<const double> x, double scale,
                              Mode mode) = 0;
    virtual StepVerdict examine(const SceneStep& step) = 0;
    virtual StepVerdict resume(double scale) = 0;
    [[nodiscard]] virtual Instant cut_at() const = 0;
    [[nodiscard]] virtual std::span<const double> after() const = 0;
    [[nodiscard]] virtual Mode mode_after() const = 0;
    [[nodiscard]] virtual double must_stop_at() const = 0;
};

/// A system with its start, whatever its types.
class SceneSystem {
public:
    SceneSystem() = default;
    SceneSystem(const SceneSystem&) = delete;
    SceneSystem& operator=(const SceneSystem&) = delete;
    virtual ~SceneSystem() = default;

    using State = std::vector<double>;
    [[nodiscard]] virtual State start() const = 0;
    [[nodiscard]] virtual Mode start_mode() const = 0;
    [[nodiscard]] virtual std::size_t shape_count() const = 0;
    [[nodiscard]] virtual double radius(std::size_t k) const = 0;
    virtual void flow(Mode mode, double t, const State& x, State& dxdt) const = 0;
    [[nodiscard]] virtual SystemDisc shape(std::size_t k, Mode mode, double t,
                                           const State& x) const = 0;
    [[nodiscard]] virtual double acceleration(std::size_t k, Mode mode, double t,
                                              const State& x) const = 0;
    virtual void push(std::size_t k, Mode mode, double t, State& x,
                      const Vector2& impulse) const = 0;
    /// Null if the system has none.
    [[nodiscard]] virtual std::unique_ptr<SystemEvents> events() const = 0;
};

}  // namespace ricochet::detail
