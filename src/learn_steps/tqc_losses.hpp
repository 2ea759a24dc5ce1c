// The losses of TQC and their gradients, for a part of a batch.
//
// A. Kuznetsov, P. Shvechikov, A. Grishin and D. Vetrov, "Controlling overestimation bias with
// truncated mixture of continuous distributional quantile critics", ICML 2020, section 3. With
// C critics of M quantiles each, of which d C are dropped, on a batch of B transitions
// (s, a, r, s'):
//
//     a' ~ policy(s'),  z_1 <= ... <= z_CM: the quantiles of all target critics at (s', a')
//     y_j = r + discount (z_j - temperature log p(a')),  j <= CM - dC; y = r after a terminal step
//     critics: mean over batch, critics, quantiles and targets of the quantile Huber loss
//     actor:   mean of temperature log p(a) - mean of all quantiles at (s, a), a ~ policy(s)
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "gaussian_actor.hpp"
#include "transitions.hpp"

namespace ricochet::learn {

struct TqcShape {
    std::size_t observations;
    std::size_t actions;
    std::vector<std::size_t> actor;   ///< hidden layers
    std::vector<std::size_t> critic;  ///< hidden layers
    std::size_t critics;
    std::size_t quantiles;  ///< of each critic
    std::size_t dropped;    ///< of each critic
};

/// Contributions of a part to the sums over the batch.
struct ActorSums {
    double loss = 0;         ///< divided by the size of the batch
    double log_density = 0;  ///< not divided
};

template <class T>
class TqcLosses {
public:
    /// Memory for one part.
    struct Work {
        Transitions<T> batch;
        typename GaussianActor<T>::Work actor;
        std::vector<typename BatchMlp<T>::Work> critics;
        Buffer<T> pairs;    ///< state and the policy's action
        Buffer<T> pool;     ///< rows x all quantiles
        Buffer<T> by_pair;  ///< rows x (state, action)
        Buffer<T> by_action;
    };

    explicit TqcLosses(const TqcShape& shape);

    [[nodiscard]] const TqcShape& shape() const noexcept { return shape_; }
    [[nodiscard]] const GaussianActor<T>& actor() const noexcept { return actor_; }
    [[nodiscard]] const BatchMlp<T>& critic() const noexcept { return critic_; }
    /// Number of the parameters of all critics, one after the other.
    [[nodiscard]] std::size_t critics_size() const noexcept
    {
        return shape_.critics * critic_.size();
    }
    [[nodiscard]] std::size_t critics_transposed_size() const noexcept
    {
        return shape_.critics * critic_.transposed_size();
    }

    [[nodiscard]] Work work(std::size_t most_rows) const;

    struct Parameters {
        const T* actor;
        const T* critics;
        const T* critics_transposed;
        const T* targets;  ///< of the target critics
        const typename GaussianActor<T>::Noise* noise;
        T temperature;
        T discount;
        std::size_t batch;  ///< B, of which this is a part
    };

    /// Gradient by the critics' parameters; the loss only if requested.
    double critic_part(const Parameters& p, Work& work, bool loss, T* gradient) const;

    /// Gradient by the actor's parameters; the actor's loss and log densities.
    ActorSums actor_part(const Parameters& p, Work& work, T* gradient) const;

private:
    void make_targets(const Parameters& p, Work& work) const;
    double huber(Work& work, const Parameters& p, bool loss) const;

    TqcShape shape_;
    GaussianActor<T> actor_;
    BatchMlp<T> critic_;
    Buffer<T> above_, below_;  ///< weights of the quantiles, padded
    const DenseKernels<T>* kernels_;
};

extern template class TqcLosses<float>;
extern template class TqcLosses<double>;

}  // namespace ricochet::learn
