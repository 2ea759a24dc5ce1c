// The motion of an FMU between two event modes, as a system of this library.
//
// There an FMU is a function of time, state and continuous inputs: steps may be repeated, and
// indicators evaluated anywhere in them, beyond the event, too. It stays where it was placed last.
// An indicator is on one of two sides, z > 0 or z <= 0, so that z = 0 counts as below: as a guard
// it is the least negative normal number there, and has no zeros.
#pragma once

#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "fmi/inputs.hpp"
#include "fmi/instance.hpp"
#include "ricochet/system.hpp"

namespace ricochet::fmi {

class Phase {
public:
    using State = std::vector<double>;
    static constexpr bool resets = false;
    std::size_t guard_count;

    Phase(Instance& instance, const Inputs& inputs)
        : guard_count(instance.indicators()), instance_(&instance), inputs_(&inputs)
    {
    }

    /// A phase from `begin` to at most `end` [s].
    void start(double begin, double end)
    {
        begin_ = begin;
        end_ = end;
        placed_ = false;
    }

    void flow(double t, const State& x, State& dxdt) const
    {
        if (instance_->states() == 0) {
            dxdt[0] = 0;  // one component that stays, where the FMU has none
        } else if (!at(t, x) || !instance_->derivatives(dxdt)) {
            lose(dxdt);
        }
    }

    void guards(double t, const State& x, std::span<double> g) const
    {
        // The standard forbids times before the last event mode.
        if (t < begin_ || !at(t, x) || !instance_->indicator_values(g)) return lose(g);
        for (double& z : g) {
            if (z == 0) z = -std::numeric_limits<double>::min();
        }
    }

    [[nodiscard]] GuardInfo guard_info(std::size_t /*which*/) const
    {
        return {.crossing = Crossing::either};
    }

    void jacobian(double t, const State& x, std::span<double> rows) const
    {
        if (instance_->states() == 0) {
            rows[0] = 0;
        } else if (by_differences || !by_derivatives(t, x, rows)) {
            differences(t, x, rows);
        }
    }

    /// The Jacobian from directional derivatives. False: the FMU has discarded the point.
    [[nodiscard]] bool by_derivatives(double t, const State& x, std::span<double> rows) const
    {
        const std::size_t n = x.size();
        column_.resize(n);
        if (!at(t, x)) return false;
        for (std::size_t j = 0; j < n; ++j) {
            if (!instance_->directional(j, column_)) return false;
            for (std::size_t i = 0; i < n; ++i) rows[i * n + j] = column_[i];
        }
        return true;
    }

    /// The Jacobian from forward differences over the root of the rounding error, as a fraction of
    /// the state or of its nominal value.
    void differences(double t, const State& x, std::span<double> rows) const
    {
        const std::size_t n = x.size();
        State here(n), there(n), moved = x;
        flow(t, x, here);
        for (std::size_t j = 0; j < n; ++j) {
            moved[j] = x[j] + 0x1p-26 * std::fmax(std::fabs(x[j]), nominals[j]);
            flow(t, moved, there);
            for (std::size_t i = 0; i < n; ++i) {
                rows[i * n + j] = (there[i] - here[i]) / (moved[j] - x[j]);
            }
            moved[j] = x[j];
        }
    }

    /// Places the FMU at (t, x), unless it is there. False: it has discarded the point.
    bool at(double t, const State& x) const
    {
        const std::size_t n = instance_->states();
        if (placed_ && t == t_ && std::memcmp(x.data(), x_.data(), n * sizeof(double)) == 0) {
            return true;
        }
        placed_ = instance_->place(t, {x.data(), n});
        if (placed_ && !inputs_->empty()) inputs_->set_continuous(*instance_, t, t < end_);
        t_ = t;
        x_ = x;
        return placed_;
    }

    std::vector<double> nominals;  ///< positive, one for each component
    bool by_differences = true;    ///< not by directional derivatives

private:
    template <class Values>
    static void lose(Values& values)
    {
        for (double& value : values) value = std::numeric_limits<double>::quiet_NaN();
    }

    Instance* instance_;
    const Inputs* inputs_;
    double begin_ = 0, end_ = 0;
    mutable double t_ = 0;
    mutable State x_, column_;
    mutable bool placed_ = false;
};

}  // namespace ricochet::fmi
