#include "trainable_mlp.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

namespace ricochet::learn {

namespace {

// States are processed in blocks: a block of one row stays in registers while
// the other index runs, and its lanes never mix except in `sum`.
constexpr std::size_t block = 8;
using Block = std::array<double, block>;

Block load_block(const double* from)
{
    Block values;
    std::copy_n(from, block, values.begin());
    return values;
}

void add_product(Block& sum, double factor, const double* values)
{
    for (std::size_t lane = 0; lane < block; ++lane) sum[lane] += factor * values[lane];
}

double sum(const Block& b)
{
    return ((b[0] + b[4]) + (b[2] + b[6])) + ((b[1] + b[5]) + (b[3] + b[7]));
}

// Evaluations of many states are done in pieces that stay in the cache.
constexpr std::size_t piece = 256;

}  // namespace

TrainableMlp::TrainableMlp(std::size_t inputs, std::span<const std::size_t> hidden,
                           Activation activation, Random& random, std::size_t outputs)
    : activation_(activation)
{
    std::vector<std::size_t> widths{inputs};
    widths.insert(widths.end(), hidden.begin(), hidden.end());
    widths.push_back(outputs);
    if (std::find(widths.begin(), widths.end(), 0U) != widths.end()) {
        throw std::invalid_argument("TrainableMlp: a layer of width 0");
    }
    std::size_t next = 0;
    for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
        const std::size_t weights = widths[k] * widths[k + 1];
        shapes_.push_back({.inputs = widths[k],
                           .outputs = widths[k + 1],
                           .weight = next,
                           .bias = next + weights});
        next += weights + widths[k + 1];
    }
    parameters_.assign(next, 0.0);
    activations_.resize(widths.size());
    slopes_.resize(widths.size());

    for (const Shape& shape : shapes_) {
        const bool he = activation == Activation::relu && &shape != &shapes_.back();
        const std::size_t fan = he ? shape.inputs : shape.inputs + shape.outputs;
        const double limit = std::sqrt(6 / static_cast<double>(fan));
        for (std::size_t i = shape.weight; i < shape.bias; ++i) {
            parameters_[i] = random.uniform(-limit, limit);
        }
    }
}

void TrainableMlp::load(std::span<const double> states, std::size_t n)
{
    const std::size_t lanes = (n + block - 1) / block * block;
    if (lanes != lanes_) {
        lanes_ = lanes;
        activations_[0].assign(inputs() * lanes, 0.0);
        for (std::size_t k = 0; k < shapes_.size(); ++k) {
            activations_[k + 1].assign(shapes_[k].outputs * lanes, 0.0);
            slopes_[k + 1].assign(shapes_[k].outputs * lanes, 0.0);
        }
    }
    for (std::size_t i = 0; i < inputs(); ++i) {
        double* const row = activations_[0].data() + i * lanes;
        for (std::size_t s = 0; s < n; ++s) row[s] = states[s * inputs() + i];
        std::fill(row + n, row + lanes, 0.0);
    }
}

void TrainableMlp::forward()
{
    for (std::size_t k = 0; k < shapes_.size(); ++k) {
        const Shape& shape = shapes_[k];
        const bool last = k + 1 == shapes_.size();
        const double* const in = activations_[k].data();
        for (std::size_t o = 0; o < shape.outputs; ++o) {
            const double* const weight = parameters_.data() + shape.weight + o * shape.inputs;
            double* const out = activations_[k + 1].data() + o * lanes_;
            for (std::size_t s = 0; s < lanes_; s += block) {
                Block z;
                z.fill(parameters_[shape.bias + o]);
                for (std::size_t i = 0; i < shape.inputs; ++i) {
                    add_product(z, weight[i], in + i * lanes_ + s);
                }
                if (!last && activation_ == Activation::relu) {
                    for (double& value : z) value = value > 0 ? value : 0;
                } else if (!last) {
                    for (double& value : z) value = std::tanh(value);
                }
                std::copy(z.begin(), z.end(), out + s);
            }
        }
    }
}

void TrainableMlp::backward(std::span<double> gradient)
{
    for (std::size_t k = shapes_.size(); k-- > 0;) {
        const Shape& shape = shapes_[k];
        const double* const in = activations_[k].data();
        const double* const slope = slopes_[k + 1].data();
        for (std::size_t o = 0; o < shape.outputs; ++o) {
            const double* const row = slope + o * lanes_;
            Block bias{};
            for (std::size_t s = 0; s < lanes_; s += block) add_product(bias, 1, row + s);
            gradient[shape.bias + o] = sum(bias);
            for (std::size_t i = 0; i < shape.inputs; ++i) {
                Block weight{};
                for (std::size_t s = 0; s < lanes_; s += block) {
                    const Block slopes = load_block(row + s);
                    const double* const values = in + i * lanes_ + s;
                    for (std::size_t lane = 0; lane < block; ++lane) {
                        weight[lane] += slopes[lane] * values[lane];
                    }
                }
                gradient[shape.weight + o * shape.inputs + i] = sum(weight);
            }
        }
        if (k == 0) return;
        for (std::size_t i = 0; i < shape.inputs; ++i) {
            const double* const values = in + i * lanes_;
            double* const out = slopes_[k].data() + i * lanes_;
            for (std::size_t s = 0; s < lanes_; s += block) {
                Block back{};
                for (std::size_t o = 0; o < shape.outputs; ++o) {
                    const double weight = parameters_[shape.weight + o * shape.inputs + i];
                    add_product(back, weight, slope + o * lanes_ + s);
                }
                for (std::size_t lane = 0; lane < block; ++lane) {
                    const double y = values[s + lane];
                    const double rate =
                        activation_ == Activation::tanh ? 1 - y * y : (y > 0 ? 1.0 : 0.0);
                    out[s + lane] = back[lane] * rate;
                }
            }
        }
    }
}

void TrainableMlp::evaluate(std::span<const double> states, std::span<double> logits)
{
    const std::size_t all = logits.size() / outputs();
    for (std::size_t done = 0; done < all; done += piece) {
        const std::size_t n = std::min(piece, all - done);
        load(states.subspan(done * inputs(), n * inputs()), n);
        forward();
        for (std::size_t o = 0; o < outputs(); ++o) {
            const double* const row = activations_.back().data() + o * lanes_;
            for (std::size_t s = 0; s < n; ++s) logits[(done + s) * outputs() + o] = row[s];
        }
    }
}

double TrainableMlp::loss_and_gradient(std::span<const double> states,
                                       std::span<const std::uint8_t> labels,
                                       std::span<double> gradient)
{
    const std::size_t n = labels.size();
    load(states, n);
    forward();
    double loss = 0;
    std::vector<double>& slope = slopes_.back();
    std::fill(slope.begin(), slope.end(), 0.0);
    for (std::size_t s = 0; s < n; ++s) {
        const double logit = activations_.back()[s];
        loss += cross_entropy(logit, labels[s] != 0);
        slope[s] = (1 / (1 + std::exp(-logit)) - labels[s]) / static_cast<double>(n);
    }
    backward(gradient);
    return loss / static_cast<double>(n);
}

double TrainableMlp::loss_and_gradient(std::span<const double> states, std::size_t n,
                                       const Loss& loss, std::span<double> gradient)
{
    load(states, n);
    forward();
    const std::size_t width = outputs();
    const std::vector<double>& logits = activations_.back();
    std::vector<double>& slopes = slopes_.back();
    std::fill(slopes.begin(), slopes.end(), 0.0);
    logits_.resize(width);
    logit_slopes_.resize(width);
    double sum = 0;
    for (std::size_t s = 0; s < n; ++s) {
        for (std::size_t o = 0; o < width; ++o) logits_[o] = logits[o * lanes_ + s];
        sum += loss(s, logits_.data(), logit_slopes_.data());
        for (std::size_t o = 0; o < width; ++o) {
            slopes[o * lanes_ + s] = logit_slopes_[o] / static_cast<double>(n);
        }
    }
    backward(gradient);
    return sum / static_cast<double>(n);
}

std::vector<DenseLayer> TrainableMlp::layers() const
{
    std::vector<DenseLayer> layers;
    for (const Shape& shape : shapes_) {
        const auto at = [this](std::size_t i) {
            return parameters_.begin() + static_cast<std::ptrdiff_t>(i);
        };
        layers.push_back({.inputs = shape.inputs,
                          .outputs = shape.outputs,
                          .weight = {at(shape.weight), at(shape.bias)},
                          .bias = {at(shape.bias), at(shape.bias + shape.outputs)}});
    }
    return layers;
}

double cross_entropy(double logit, bool event) noexcept
{
    const double softplus = std::max(logit, 0.0) + std::log1p(std::exp(-std::abs(logit)));
    return event ? softplus - logit : softplus;
}

}  // namespace ricochet::learn
