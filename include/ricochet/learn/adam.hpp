// Adam: stochastic gradient descent with a step per parameter.
//
// D. P. Kingma and J. Ba, "Adam: A method for stochastic optimization", ICLR
// 2015, algorithm 1.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ricochet::learn {

/// The method Adam: m := b1 m + (1 - b1) g,  v := b2 v + (1 - b2) g^2,
/// p := p - rate m^ / (sqrt(v^) + epsilon),
/// with m^ = m / (1 - b1^k) and v^ = v / (1 - b2^k) in step k = 1, 2, ...
class Adam {
public:
    /// Constants of the method.
    struct Options {
        double beta1 = 0.9;     ///< in [0, 1)
        double beta2 = 0.999;   ///< in [0, 1)
        double epsilon = 1e-8;  ///< positive
    };

    /// State that a checkpoint must hold to continue.
    struct State {
        std::uint64_t steps = 0;
        std::vector<double> first;   ///< m
        std::vector<double> second;  ///< v
    };

    /// @throws std::invalid_argument if an option is outside its range.
    Adam(std::size_t parameters, const Options& options);

    /// Moves `parameters` one step against `gradient`.
    /// @param rate  learning rate, positive
    void step(std::span<double> parameters, std::span<const double> gradient, double rate) noexcept;

    [[nodiscard]] const State& state() const noexcept { return state_; }

    /// Continues from a stored state.
    /// @throws std::invalid_argument if it holds another number of parameters.
    void restore(State state);

private:
    Options options_;
    State state_;
};

}  // namespace ricochet::learn
