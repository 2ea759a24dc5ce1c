#include "trainable_mlp.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "base/wide.hpp"

namespace ricochet::learn {

namespace {

// States are processed in blocks of 8 lanes, which never mix except in `sum_of`. Several rows are
// computed together, so that what is loaded serves all of them; the order of every sum is that of
// one row alone, and products are rounded before they are added, in both versions of a kernel.
constexpr std::size_t block = 8;
constexpr std::size_t together = 4;
typedef double Half __attribute__((vector_size(32), may_alias, aligned(8)));

[[gnu::always_inline]] inline const Half& half_at(const double* from)
{
    return *reinterpret_cast<const Half*>(from);
}

[[gnu::always_inline]] inline Half& half_at(double* to)
{
    return *reinterpret_cast<Half*>(to);
}

/// A matrix by which rows of lanes are multiplied: element (row, column) is at
/// row * row_stride + column * column_stride.
struct Matrix {
    const double* elements;
    std::size_t row_stride;
    std::size_t column_stride;
    std::size_t columns;

    [[nodiscard]] double at(std::size_t row, std::size_t column) const
    {
        return elements[row * row_stride + column * column_stride];
    }
};

/// `Rows` rows of start + matrix * in, from `row` on, for the block of lanes at `s`.
template <std::size_t Rows>
[[gnu::always_inline]] inline void multiply_rows(const Matrix& matrix, const double* start,
                                                 std::size_t row, const double* in,
                                                 std::size_t lanes, double* out)
{
    for (std::size_t s = 0; s < lanes; s += block) {
        Half low[Rows]{};
        Half high[Rows]{};
        for (std::size_t r = 0; start != nullptr && r < Rows; ++r) {
            const double first = start[row + r];
            low[r] = Half{first, first, first, first};
            high[r] = low[r];
        }
        for (std::size_t c = 0; c < matrix.columns; ++c) {
            const Half& in_low = half_at(in + c * lanes + s);
            const Half& in_high = half_at(in + c * lanes + s + 4);
            for (std::size_t r = 0; r < Rows; ++r) {
                const double w = matrix.at(row + r, c);
                low[r] += w * in_low;
                high[r] += w * in_high;
            }
        }
        for (std::size_t r = 0; r < Rows; ++r) {
            half_at(out + (row + r) * lanes + s) = low[r];
            half_at(out + (row + r) * lanes + s + 4) = high[r];
        }
    }
}

/// out = start + matrix * in, for `rows` rows of `lanes` lanes; `start` may be null.
RICOCHET_WIDE void multiply(const Matrix& matrix, const double* start, std::size_t rows,
                            const double* in, std::size_t lanes, double* out)
{
    std::size_t row = 0;
    for (; row + together <= rows; row += together) {
        multiply_rows<together>(matrix, start, row, in, lanes, out);
    }
    for (; row < rows; ++row) multiply_rows<1>(matrix, start, row, in, lanes, out);
}

[[gnu::always_inline]] inline double sum_of(const Half& low, const Half& high)
{
    return ((low[0] + high[0]) + (low[2] + high[2])) + ((low[1] + high[1]) + (low[3] + high[3]));
}

/// Dot products of one row of slopes with `Rows` rows of values.
template <std::size_t Rows>
[[gnu::always_inline]] inline void dot_rows(const double* slope, const double* values,
                                            std::size_t lanes, double* out)
{
    Half low[Rows]{};
    Half high[Rows]{};
    for (std::size_t s = 0; s < lanes; s += block) {
        const Half& slope_low = half_at(slope + s);
        const Half& slope_high = half_at(slope + s + 4);
        for (std::size_t r = 0; r < Rows; ++r) {
            low[r] += slope_low * half_at(values + r * lanes + s);
            high[r] += slope_high * half_at(values + r * lanes + s + 4);
        }
    }
    for (std::size_t r = 0; r < Rows; ++r) out[r] = sum_of(low[r], high[r]);
}

/// out = slopes * values^T, `rows` x `columns`, sums over the lanes.
RICOCHET_WIDE void outer(const double* slopes, std::size_t rows, const double* values,
                         std::size_t columns, std::size_t lanes, double* out)
{
    for (std::size_t row = 0; row < rows; ++row) {
        std::size_t c = 0;
        double* const to = out + row * columns;
        for (; c + together <= columns; c += together) {
            dot_rows<together>(slopes + row * lanes, values + c * lanes, lanes, to + c);
        }
        for (; c < columns; ++c) {
            dot_rows<1>(slopes + row * lanes, values + c * lanes, lanes, to + c);
        }
    }
}

/// out = slopes * 1, sums over the lanes.
void sum_rows(const double* slopes, std::size_t rows, std::size_t lanes, double* out)
{
    for (std::size_t row = 0; row < rows; ++row) {
        Half low{};
        Half high{};
        for (std::size_t s = 0; s < lanes; s += block) {
            low += half_at(slopes + row * lanes + s);
            high += half_at(slopes + row * lanes + s + 4);
        }
        out[row] = sum_of(low, high);
    }
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
        std::vector<double>& out = activations_[k + 1];
        multiply({parameters_.data() + shape.weight, shape.inputs, 1, shape.inputs},
                 parameters_.data() + shape.bias, shape.outputs, activations_[k].data(), lanes_,
                 out.data());
        if (k + 1 == shapes_.size()) return;
        for (double& value : out) {
            value = activation_ == Activation::relu ? (value > 0 ? value : 0) : std::tanh(value);
        }
    }
}

void TrainableMlp::backward(std::span<double> gradient)
{
    for (std::size_t k = shapes_.size(); k-- > 0;) {
        const Shape& shape = shapes_[k];
        const std::vector<double>& in = activations_[k];
        const double* const slope = slopes_[k + 1].data();
        sum_rows(slope, shape.outputs, lanes_, gradient.data() + shape.bias);
        outer(slope, shape.outputs, in.data(), shape.inputs, lanes_,
              gradient.data() + shape.weight);
        if (k == 0) return;
        std::vector<double>& out = slopes_[k];
        multiply({parameters_.data() + shape.weight, 1, shape.inputs, shape.outputs}, nullptr,
                 shape.inputs, slope, lanes_, out.data());
        for (std::size_t j = 0; j < out.size(); ++j) {
            const double y = in[j];
            out[j] *= activation_ == Activation::tanh ? 1 - y * y : (y > 0 ? 1.0 : 0.0);
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
