// The diode circuit by power series, apart from the library: the motion between changes is linear.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/systems/diode_circuit.hpp"

namespace playground {

/// Times at which the diode's current begins or ceases to hold its voltage at zero, or changes its
/// sign, each to the rounding of T.
template <class T>
class DiodeReferenceOf {
public:
    using State = std::array<T, 3>;
    explicit DiodeReferenceOf(const ricochet::DiodeCircuit::Parameters& p)
        : c1_(p.capacitance_1),
          c2_(p.capacitance_2),
          r_(p.resistance),
          l_(p.inductance),
          i_(p.current)
    {
    }

    /// The times [s] up to `t_end`, from a start whose first voltage is not zero.
    [[nodiscard]] std::vector<double> changes(State x, double t_end)
    {
        std::vector<double> times;
        sign_ = x[0] > 0 ? 1 : -1;
        T from = 0;  // of the last change: times are counted from there, so that they do not drift
        int steps = 0;
        // Far below the time constants of the circuit: c1 r = 0.16 s, and 0.38 s of c2 and l.
        const T step = T(1) / 64;
        constexpr std::size_t most = 2000;
        while (from + steps * step < t_end && times.size() < most) {
            const Series series(*this, x);
            if (distance(series.at(step)) > 0) {
                x = series.at(step);
                ++steps;
                continue;
            }
            const T within = zero_of(series, step);
            from += steps * step + within;
            steps = 0;
            x = series.at(within);
            if (from <= t_end) times.push_back(static_cast<double>(from));
            change(x);
        }
        return times;
    }

private:
    static constexpr int terms = 14;  // 2.6^14 / 64^14 / 14! is 1e-30

    /// The derivative, affine in x.
    [[nodiscard]] State rate(const State& x, bool affine) const
    {
        const T through = (x[1] - x[0]) / r_;
        const T load = affine ? -sign_ * i_ : T(0);
        return {sign_ == 0 ? T(0) : (through + load) / c1_, (x[2] - through) / c2_, -x[1] / l_};
    }

    struct Series {
        std::array<State, terms + 1> c;
        Series(const DiodeReferenceOf& of, const State& x)
        {
            c[0] = x;
            for (int k = 0; k < terms; ++k) {
                c[k + 1] = of.rate(c[k], k == 0);
                for (T& component : c[k + 1]) component /= k + 1;
            }
        }
        [[nodiscard]] State at(T h) const
        {
            State sum = c[terms];
            for (int k = terms - 1; k >= 0; --k) {
                for (std::size_t i = 0; i < 3; ++i) sum[i] = c[k][i] + h * sum[i];
            }
            return sum;
        }
    };

    /// Positive until the next change: |V1|, or what the diode could carry besides its load.
    [[nodiscard]] T distance(const State& x) const
    {
        return sign_ != 0 ? sign_ * x[0] : i_ - std::abs(x[1]) / r_;
    }

    [[nodiscard]] T zero_of(const Series& series, T h) const
    {
        T low = 0;
        T high = h;
        for (int k = 0; k < 70; ++k) {
            const T middle = (low + high) / 2;
            (distance(series.at(middle)) > 0 ? low : high) = middle;
        }
        return high;
    }

    void change(State& x)
    {
        const bool arrives = sign_ != 0;
        if (arrives) x[0] = 0;
        const T load = x[1] / r_;
        if (arrives && std::abs(load) < i_) {
            sign_ = 0;
        } else {
            sign_ = load > 0 ? 1 : -1;
        }
    }

    T c1_, c2_, r_, l_, i_;
    int sign_ = 0;  ///< of V1
};
using DiodeReference = DiodeReferenceOf<double>;

}  // namespace playground
