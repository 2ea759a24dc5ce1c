// References for `DiodeCircuit`: matrix exponentials between bisected changes of mode.
#pragma once

#include <Eigen/Dense>
#include <unsupported/Eigen/MatrixFunctions>

#include <cmath>
#include <limits>
#include <vector>

#include "ricochet/systems/diode_circuit.hpp"

namespace ricochet::testing_support {

/// The circuit with V1 of a fixed sign, or stuck at zero (sign 0).
class ExactCircuit {
public:
    explicit ExactCircuit(const DiodeCircuit::Parameters& p = {}) : p_(p) {}

    struct Change {
        double t;
        int sign;  ///< of V1 afterwards; 0: stuck
    };

    /// Runs from `w` at 0 to t_end and stores the changes of mode.
    void run(Eigen::Vector3d w, double t_end)
    {
        changes.clear();
        nodes_.clear();
        double t = 0;
        int sign = w[0] > 0 ? 1 : w[0] < 0 ? -1 : mode_at_zero(w);
        while (true) {
            nodes_.push_back({t, sign, w});
            const double stay = first_change(sign, w, t_end - t);
            if (!(t + stay < t_end)) break;
            w = flow(sign, w, stay);
            t += stay;
            w[0] = 0;
            sign = mode_at_zero(w, sign);
            changes.push_back({t, sign});
        }
        final = state(t_end);
    }

    /// The state at t in [0, t_end] of the last run.
    [[nodiscard]] Eigen::Vector3d state(double t) const
    {
        std::size_t i = nodes_.size() - 1;
        while (i > 0 && nodes_[i].t > t) --i;
        return flow(nodes_[i].sign, nodes_[i].w, t - nodes_[i].t);
    }

    std::vector<Change> changes;
    Eigen::Vector3d final;

private:
    struct Node {
        double t;
        int sign;
        Eigen::Vector3d w;
    };

    [[nodiscard]] Eigen::Vector3d flow(int sign, const Eigen::Vector3d& w, double t) const
    {
        // (w, 1)' = B (w, 1)
        const double g = 1 / p_.resistance;
        Eigen::Matrix4d b = Eigen::Matrix4d::Zero();
        if (sign != 0) {
            b.row(0) << -g / p_.capacitance_1, g / p_.capacitance_1, 0,
                -sign * p_.current / p_.capacitance_1;
        }
        b.row(1) << g / p_.capacitance_2, -g / p_.capacitance_2, 1 / p_.capacitance_2, 0;
        b.row(2) << 0, -1 / p_.inductance, 0, 0;
        const Eigen::Matrix4d map = (b * t).exp();
        return (map * w.homogeneous()).head<3>();
    }

    /// The mode after V1 has reached 0 from `before`, or has been stuck if that is 0.
    [[nodiscard]] int mode_at_zero(const Eigen::Vector3d& w, int before = 0) const
    {
        const double drive = w[1] / p_.resistance;
        if (before != 0 && std::abs(drive) <= p_.current) return 0;
        if (before == 0 && std::abs(drive) < p_.current * (1 - 1e-9)) return 0;
        return drive > 0 ? 1 : -1;
    }

    /// Time at which the mode ends, or infinity: the first sign change on a grid of 1e-3, far below
    /// the periods of the circuit, bisected.
    [[nodiscard]] double first_change(int sign, const Eigen::Vector3d& w, double limit) const
    {
        const auto inside = [&](double t) {
            const Eigen::Vector3d at = flow(sign, w, t);
            return sign == 0 ? p_.current - std::abs(at[1]) / p_.resistance : sign * at[0];
        };
        const double grid = 1e-3;
        for (double t = grid; t < limit + grid; t += grid) {
            if (inside(t) > 0) continue;
            double low = t - grid;
            double high = t;
            if (t == grid) low = 1e-9;  // starts on the surface
            while (true) {
                const double middle = low + (high - low) / 2;
                if (middle <= low || middle >= high) return high;
                (inside(middle) > 0 ? low : high) = middle;
            }
        }
        return std::numeric_limits<double>::infinity();
    }

    DiodeCircuit::Parameters p_;
    std::vector<Node> nodes_;
};

}  // namespace ricochet::testing_support
