#include "gaussian_actor.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ricochet::learn {

namespace {

/// log(1 - tanh(u)^2), without cancellation.
template <class T>
T log_slope_of_tanh(T u)
{
    const T x = -2 * u;
    const T softplus = std::max(x, T(0)) + std::log1p(std::exp(-std::abs(x)));
    return 2 * (std::numbers::ln2_v<T> - u - softplus);
}

template <class T>
const T half_log_two_pi = static_cast<T>(0.5 * std::log(2 * std::numbers::pi));

}  // namespace

template <class T>
GaussianActor<T>::GaussianActor(std::size_t observations, std::span<const std::size_t> hidden,
                                std::size_t actions)
    : trunk_(observations, hidden, 0, true),
      mean_(trunk_.outputs(), {}, actions),
      deviation_(trunk_.size() + mean_.size()),
      kernels_(&dense_kernels<T>())
{
}

template <class T>
void GaussianActor<T>::initialise(T* parameters, Random& random) const
{
    trunk_.initialise(parameters, random);
    mean_.initialise(parameters + trunk_.size(), random);
    for (std::size_t j = 0; j < latent(); ++j) {
        for (std::size_t a = 0; a < stride(); ++a) {
            parameters[deviation_ + j * stride() + a] = a < actions() ? first_log_deviation : T(0);
        }
    }
}

template <class T>
typename GaussianActor<T>::Noise GaussianActor<T>::noise() const
{
    const Buffer<T> square(latent() * stride());
    const Buffer<T> transposed(actions() * padded<T>(latent()));
    return {.normal = square,
            .deviation = square,
            .product = square,
            .variance = square,
            .product_transposed = transposed,
            .variance_transposed = transposed,
            .trunk_transposed = Buffer<T>(trunk_.transposed_size()),
            .mean_transposed = Buffer<T>(mean_.transposed_size())};
}

template <class T>
void GaussianActor<T>::draw(Noise& noise, Random& random) const
{
    for (std::size_t j = 0; j < latent(); ++j) {
        for (std::size_t a = 0; a < actions(); ++a) {
            noise.normal[j * stride() + a] = static_cast<T>(random.normal());
        }
    }
}

template <class T>
void GaussianActor<T>::prepare_forward(const T* parameters, Noise& noise) const
{
    for (std::size_t j = 0; j < latent(); ++j) {
        for (std::size_t a = 0; a < actions(); ++a) {
            const std::size_t i = j * stride() + a;
            noise.deviation[i] = std::exp(parameters[deviation_ + i]);
            noise.product[i] = noise.deviation[i] * noise.normal[i];
            noise.variance[i] = noise.deviation[i] * noise.deviation[i];
        }
    }
}

template <class T>
void GaussianActor<T>::prepare(const T* parameters, Noise& noise) const
{
    prepare_forward(parameters, noise);
    const std::size_t out = padded<T>(latent());
    learn::transpose(noise.product.data(), stride(), latent(), actions(),
                     noise.product_transposed.data(), out);
    learn::transpose(noise.variance.data(), stride(), latent(), actions(),
                     noise.variance_transposed.data(), out);
    trunk_.transpose(parameters, noise.trunk_transposed.data());
    mean_.transpose(parameters + trunk_.size(), noise.mean_transposed.data());
}

template <class T>
typename GaussianActor<T>::Work GaussianActor<T>::work(std::size_t rows) const
{
    const Buffer<T> narrow(rows * stride());
    const Buffer<T> wide(rows * padded<T>(latent()));
    const Buffer<T> parameters(latent() * stride());
    return {.trunk = trunk_.work(rows),
            .mean = mean_.work(rows),
            .squares = wide,
            .noise = narrow,
            .variance = narrow,
            .actions = narrow,
            .log_density = Buffer<T>(rows),
            .noise_slopes = narrow,
            .variance_slopes = narrow,
            .from_noise = wide,
            .from_variance = wide,
            .by_noise = parameters,
            .by_variance = parameters};
}

template <class T>
void GaussianActor<T>::forward(const T* parameters, const Noise& noise, Rows<const T> states,
                               std::size_t rows, Work& work) const
{
    const Rows<T> h = trunk_.forward(parameters, states, rows, work.trunk);
    mean_.forward(parameters + trunk_.size(), {h.data, h.stride}, rows, work.mean);
    for (std::size_t i = 0; i < rows * h.stride; ++i) work.squares[i] = h.data[i] * h.data[i];
    const auto times = [&](const T* left, const Buffer<T>& right, Buffer<T>& out) {
        kernels_->product({.a = left,
                           .a_stride = h.stride,
                           .b = right.data(),
                           .b_stride = stride(),
                           .c = out.data(),
                           .c_stride = stride(),
                           .rows = rows,
                           .inner = latent(),
                           .columns = stride()},
                          After::nothing);
    };
    times(h.data, noise.product, work.noise);
    times(work.squares.data(), noise.variance, work.variance);
    for (std::size_t row = 0; row < rows; ++row) squash(row, work);
}

/// log p(a) = sum_a -n^2 / (2 v) - log(v) / 2 - log(2 pi) / 2 - log(1 - tanh(u)^2)
template <class T>
void GaussianActor<T>::squash(std::size_t row, Work& work) const
{
    T log_density = 0;
    for (std::size_t a = 0; a < actions(); ++a) {
        const std::size_t i = row * stride() + a;
        T& v = work.variance[i];
        v += least_variance;
        const T n = work.noise[i];
        const T u = std::clamp(work.mean.values.back()[i], -mean_bound, mean_bound) + n;
        work.actions[i] = std::tanh(u);
        log_density -=
            n * n / (2 * v) + std::log(v) / 2 + half_log_two_pi<T> + log_slope_of_tanh(u);
    }
    work.log_density[row] = log_density;
}

/// Writes the derivatives by m, n and v from those by a and by log p(a).
template <class T>
void GaussianActor<T>::unsquash(std::size_t row, const T* by_actions, T by_density, T* by_mean,
                                Work& work) const
{
    for (std::size_t j = 0; j < actions(); ++j) {
        const std::size_t i = row * stride() + j;
        const T a = work.actions[i];
        const T n = work.noise[i];
        const T v = work.variance[i];
        // -log(1 - tanh(u)^2) has the derivative 2 tanh(u).
        const T by_u = by_actions[j] * (1 - a * a) + by_density * 2 * a;
        const bool inside = std::abs(work.mean.values.back()[i]) < mean_bound;
        by_mean[j] = inside ? by_u : T(0);
        work.noise_slopes[i] = by_u - by_density * n / v;
        work.variance_slopes[i] = by_density * (n * n / v - 1) / (2 * v);
    }
}

template <class T>
void GaussianActor<T>::backward(const Noise& noise, Rows<const T> states, std::size_t rows,
                                Rows<const T> by_actions, T by_density, Work& work,
                                T* gradient) const
{
    const Rows<T> by_mean = mean_.slopes_out(work.mean);
    for (std::size_t row = 0; row < rows; ++row) {
        unsquash(row, by_actions.row(row), by_density, by_mean.row(row), work);
    }

    const Rows<const T> h{work.trunk.values.back().data(), padded<T>(latent())};
    const Rows<T> by_h = trunk_.slopes_out(work.trunk);
    mean_.backward(noise.mean_transposed.data(), h, rows, work.mean, gradient + trunk_.size(),
                   by_h.data);
    const auto back = [&](const Buffer<T>& slopes, const Buffer<T>& transposed, Buffer<T>& out) {
        kernels_->product({.a = slopes.data(),
                           .a_stride = stride(),
                           .b = transposed.data(),
                           .b_stride = h.stride,
                           .c = out.data(),
                           .c_stride = h.stride,
                           .rows = rows,
                           .inner = actions(),
                           .columns = h.stride},
                          After::nothing);
    };
    back(work.noise_slopes, noise.product_transposed, work.from_noise);
    back(work.variance_slopes, noise.variance_transposed, work.from_variance);
    for (std::size_t i = 0; i < rows * h.stride; ++i) {
        const T sum = by_h.data[i] + work.from_noise[i] + 2 * h.data[i] * work.from_variance[i];
        by_h.data[i] = h.data[i] > 0 ? sum : T(0);  // the ReLU at the trunk's end
    }
    trunk_.backward(noise.trunk_transposed.data(), states, rows, work.trunk, gradient, nullptr);

    const auto outer = [&](const T* left, const Buffer<T>& slopes, Buffer<T>& out) {
        kernels_->outer_product({.a = left,
                                 .a_stride = h.stride,
                                 .b = slopes.data(),
                                 .b_stride = stride(),
                                 .c = out.data(),
                                 .c_stride = stride(),
                                 .rows = rows,
                                 .left = latent(),
                                 .columns = stride()});
    };
    outer(h.data, work.noise_slopes, work.by_noise);
    outer(work.squares.data(), work.variance_slopes, work.by_variance);
    for (std::size_t i = 0; i < latent() * stride(); ++i) {
        gradient[deviation_ + i] =
            noise.product[i] * work.by_noise[i] + 2 * noise.variance[i] * work.by_variance[i];
    }
}

template <class T>
std::vector<DenseLayer> GaussianActor<T>::layers(const T* parameters) const
{
    std::vector<DenseLayer> out = trunk_.layers(parameters);
    const DenseLayer mean = mean_.layers(parameters + trunk_.size()).front();
    // clamp(y, -2, 2) = max(0, y + 2) - max(0, y - 2) - 2
    const auto bound = static_cast<double>(mean_bound);
    DenseLayer hinges{.inputs = mean.inputs, .outputs = 2 * mean.outputs, .weight = {}, .bias = {}};
    for (const double sign : {1.0, -1.0}) {
        hinges.weight.insert(hinges.weight.end(), mean.weight.begin(), mean.weight.end());
        for (const double bias : mean.bias) hinges.bias.push_back(bias + sign * bound);
    }
    DenseLayer sum{.inputs = hinges.outputs, .outputs = mean.outputs, .weight = {}, .bias = {}};
    for (std::size_t a = 0; a < sum.outputs; ++a) {
        for (std::size_t i = 0; i < sum.inputs; ++i) {
            sum.weight.push_back(i == a ? 1 : i == a + sum.outputs ? -1 : 0);
        }
        sum.bias.push_back(-bound);
    }
    out.push_back(std::move(hinges));
    out.push_back(std::move(sum));
    return out;
}

template class GaussianActor<float>;
template class GaussianActor<double>;

}  // namespace ricochet::learn
