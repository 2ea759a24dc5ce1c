// Random contact problems, the same from the same seed.
#pragma once

#include <Eigen/Dense>

#include <cmath>
#include <random>
#include <vector>

namespace ricochet::testing_support {

/// 1 to `most` contacts of 2 or 3 components between bodies of three degrees of freedom,
/// whose masses differ by up to 1e8, or between one and the ground. Bodies are few, so that
/// there are often more contacts than degrees of freedom, and some contacts occur
/// twice. Friction is in [0, 2]. q holds the contact velocities of free bodies in
/// random motion, so that impulses that stop the bodies exist.
class RandomContacts {
public:
    explicit RandomContacts(unsigned seed) : random_(seed) {}

    void draw(int most)
    {
        components = integer(0, 1) ? 2 : 3;
        // Small ones are as frequent as large ones.
        const int contacts =
            static_cast<int>(std::floor(std::exp(uniform(0, std::log(most + 1.0)))));
        const int bodies = integer(1, std::max(1, contacts / (integer(0, 2) ? 1 : 3)));
        const double spread = integer(0, 1) ? uniform(0, 8) : 0;
        Eigen::VectorXd inverse_mass(3 * bodies);
        for (int b = 0; b < bodies; ++b) {
            inverse_mass.segment(3 * b, 3).setConstant(
                std::pow(10, uniform(-spread / 2, spread / 2)));
        }
        const int n = contacts * components;
        Eigen::MatrixXd h = Eigen::MatrixXd::Zero(n, 3 * bodies);
        for (int c = 0; c < contacts; ++c) {
            const bool again = c > 0 && integer(0, 9) == 0;
            if (again) {
                h.middleRows(c * components, components) =
                    h.middleRows((c - 1) * components, components);
                continue;
            }
            const int a = integer(0, bodies - 1);
            const int b = integer(0, bodies - 1);
            for (int i = 0; i < components; ++i) {
                for (int j = 0; j < 3; ++j) {
                    h(c * components + i, 3 * a + j) += normal();
                    if (b != a) h(c * components + i, 3 * b + j) += normal();
                }
            }
        }
        w = h * inverse_mass.asDiagonal() * h.transpose();
        w = (0.5 * (w + w.transpose())).eval();
        Eigen::VectorXd velocity =
            Eigen::VectorXd::NullaryExpr(3 * bodies, [&] { return normal(); });
        q = h * velocity;
        friction.resize(static_cast<std::size_t>(contacts));
        const bool none = integer(0, 9) == 0;
        for (double& coefficient : friction) {
            coefficient = none ? 0 : uniform(0, 2);
        }
    }

    int components = 2;
    Eigen::MatrixXd w;
    Eigen::VectorXd q;
    std::vector<double> friction;

private:
    int integer(int low, int high)
    {
        return std::uniform_int_distribution<int>(low, high)(random_);
    }
    double uniform(double low, double high)
    {
        return std::uniform_real_distribution<double>(low, high)(random_);
    }
    double normal() { return std::normal_distribution<double>()(random_); }

    std::mt19937 random_;
};

}  // namespace ricochet::testing_support
