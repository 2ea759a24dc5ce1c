// A block of 1 kg that is pulled by a load and rubs with friction 1 N,
//
//     v' = load(t) + r,   r in [-1, 1] against v.
#pragma once

#include <Eigen/Core>
#include <functional>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet::test {

struct Block {
    using Vector = Eigen::Matrix<double, 1, 1>;
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    std::function<double(double)> load = [](double) { return 0.0; };

    void smooth(double t, const Vector& /*w*/, Vector& f) const { f[0] = load(t); }
    [[nodiscard]] static sets::IntervalSet reaction_set(double /*t*/, const Vector& /*w*/)
    {
        return sets::IntervalSet::symmetric(1);
    }
};

inline Block pulled_by(double load)
{
    return {[=](double) { return load; }};
}

}  // namespace ricochet::test
