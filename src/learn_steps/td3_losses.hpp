// The losses of TD3 and their gradients, for a part of a batch.
//
// S. Fujimoto, H. van Hoof and D. Meger, "Addressing function approximation error in actor-critic
// methods", ICML 2018, algorithm 1. On a batch of B transitions (s, a, r, s'), with target networks
// marked by ':
//
//     a' = clamp(policy'(s') + e, -1, 1),  e clamped noise
//     y = r + discount min_c Q'_c(s', a'); y = r after a terminal step
//     critics: sum over them of the mean of (Q_c(s, a) - y)^2
//     actor:   mean of -Q_1(s, policy(s)),  policy = tanh(network)
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "batch_mlp.hpp"
#include "transitions.hpp"

namespace ricochet::learn {

struct Td3Shape {
    std::size_t observations;
    std::size_t actions;
    std::vector<std::size_t> actor;   ///< hidden layers
    std::vector<std::size_t> critic;  ///< hidden layers
    std::size_t critics = 2;
};

template <class T>
class Td3Losses {
public:
    /// Memory for one part.
    struct Work {
        Transitions<T> batch;
        Buffer<T> smoothing;  ///< e, rows x actions; set by the caller
        typename BatchMlp<T>::Work actor;
        std::vector<typename BatchMlp<T>::Work> critics;
        Buffer<T> pairs;    ///< state and the policy's action
        Buffer<T> targets;  ///< y
        Buffer<T> by_pair;
    };

    explicit Td3Losses(const Td3Shape& shape);

    [[nodiscard]] const Td3Shape& shape() const noexcept { return shape_; }
    [[nodiscard]] const BatchMlp<T>& actor() const noexcept { return actor_; }
    [[nodiscard]] const BatchMlp<T>& critic() const noexcept { return critic_; }

    [[nodiscard]] Work work(std::size_t most_rows) const;

    struct Parameters {
        const T* actor;
        const T* actor_transposed;
        const T* critics;  ///< one after the other
        const T* critics_transposed;
        const T* target_actor;
        const T* target_critics;
        T discount;
        std::size_t batch;  ///< B, of which this is a part
    };

    /// The part's contribution to the loss, and its gradient by the critics' parameters.
    double critic_part(const Parameters& p, Work& work, T* gradient) const;

    /// The same for the actor.
    double actor_part(const Parameters& p, Work& work, T* gradient) const;

private:
    void act(const T* actor, Rows<const T> states, Work& work) const;

    Td3Shape shape_;
    BatchMlp<T> actor_;
    BatchMlp<T> critic_;
};

extern template class Td3Losses<float>;
extern template class Td3Losses<double>;

}  // namespace ricochet::learn
