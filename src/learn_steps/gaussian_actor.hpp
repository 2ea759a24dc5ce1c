// The stochastic policy of TQC: a normal distribution squashed into (-1, 1).
//
//     h = trunk(s),  u = m(h) + n,  a = tanh(u)
//     m(h) = clamp(W h + b, -2, 2),  n = h (exp(l) * e),  e standard normal
//
// with `*` by components: the noise depends on the state, and e is the same for a while
// (generalised state-dependent exploration). Given s, u_a is normal with mean m_a and variance
//
//     v_a = sum_j h_j^2 exp(2 l_ja) + 1e-6
//
// A. Raffin, J. Kober and F. Stulp, "Smooth exploration for robotic reinforcement learning",
// CoRL 2021; the numbers 2 and 1e-6, and l = -3 at the start, are those of Stable-Baselines3.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "batch_mlp.hpp"

namespace ricochet::learn {

/// Parameters: trunk, layer of the mean, then l, latent x actions.
template <class T>
class GaussianActor {
public:
    /// Values that depend on the parameters and e only, for a batch to share.
    struct Noise {
        Buffer<T> normal;     ///< e, latent x actions; drawn by the caller
        Buffer<T> deviation;  ///< exp(l)
        Buffer<T> product;    ///< exp(l) * e
        Buffer<T> variance;   ///< exp(2 l)
        Buffer<T> product_transposed, variance_transposed;
        Buffer<T> trunk_transposed, mean_transposed;  ///< weights
    };

    struct Work {
        typename BatchMlp<T>::Work trunk, mean;
        Buffer<T> squares;          ///< h^2
        Buffer<T> noise, variance;  ///< n and v, rows x actions
        Buffer<T> actions;          ///< a
        Buffer<T> log_density;      ///< of a, one per row
        Buffer<T> noise_slopes, variance_slopes;
        Buffer<T> from_noise, from_variance;  ///< rows x latent
        Buffer<T> by_noise, by_variance;      ///< latent x actions
    };

    GaussianActor(std::size_t observations, std::span<const std::size_t> hidden,
                  std::size_t actions);

    [[nodiscard]] std::size_t actions() const noexcept { return mean_.outputs(); }
    [[nodiscard]] std::size_t size() const noexcept { return deviation_ + latent() * stride(); }

    void initialise(T* parameters, Random& random) const;

    [[nodiscard]] Noise noise() const;
    /// New values of `noise.normal`.
    void draw(Noise& noise, Random& random) const;
    /// All except the transposed weights, from these and the parameters: enough for `forward`.
    void prepare_forward(const T* parameters, Noise& noise) const;
    /// All values, as `backward` needs them.
    void prepare(const T* parameters, Noise& noise) const;

    [[nodiscard]] Work work(std::size_t rows) const;

    /// Writes `work.actions` and `work.log_density`.
    void forward(const T* parameters, const Noise& noise, Rows<const T> states, std::size_t rows,
                 Work& work) const;

    /// The gradient of a loss with these derivatives by the actions, and the derivative
    /// `by_density` by each of the log densities.
    void backward(const Noise& noise, Rows<const T> states, std::size_t rows,
                  Rows<const T> by_actions, T by_density, Work& work, T* gradient) const;

    /// tanh of these layers' output is tanh(m(h)).
    [[nodiscard]] std::vector<DenseLayer> layers(const T* parameters) const;

    [[nodiscard]] const BatchMlp<T>& trunk() const noexcept { return trunk_; }
    [[nodiscard]] const BatchMlp<T>& mean() const noexcept { return mean_; }
    /// Offset of l.
    [[nodiscard]] std::size_t deviation_offset() const noexcept { return deviation_; }

    static constexpr T mean_bound = T(2);
    static constexpr T least_variance = T(1e-6);
    static constexpr T first_log_deviation = T(-3);

private:
    [[nodiscard]] std::size_t latent() const noexcept { return trunk_.outputs(); }
    [[nodiscard]] std::size_t stride() const noexcept { return padded<T>(actions()); }
    void squash(std::size_t row, Work& work) const;
    void unsquash(std::size_t row, const T* by_actions, T by_density, T* by_mean, Work& work) const;

    BatchMlp<T> trunk_;
    BatchMlp<T> mean_;
    std::size_t deviation_;
    const DenseKernels<T>* kernels_;
};

extern template class GaussianActor<float>;
extern template class GaussianActor<double>;

}  // namespace ricochet::learn
