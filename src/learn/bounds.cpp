#include "bounds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/require.hpp"
#include "ricochet/nn/detail/pack.hpp"

namespace ricochet {
namespace {

constexpr double unit = 0x1p-53;
constexpr double underflow = 1e-250;
constexpr std::size_t lanes = 4;

/// Twice the bound of the relative error of a sum of n products.
double gamma(std::size_t n, double u = unit) noexcept
{
    const double nu = static_cast<double>(n) * u;
    return 2 * nu / (1 - nu);
}

constexpr detail::Refuse refuse_bounds{"NetworkBounds"};

/// A vector of two doubles, which fits a register of every x86-64 processor.
using Pair = double __attribute__((vector_size(2 * sizeof(double))));

Pair load_pair(const double* from) noexcept
{
    return Pair{from[0], from[1]};
}

Pair magnitude(Pair x) noexcept
{
    return x < 0.0 ? -x : x;
}

/// The affine forms of four neurons: c, G_1 ... G_D, e, each by lane.
template <std::size_t D>
using FourForms = double[D + 2][lanes];

/// Adds up the forms of the neurons before, times the weights of a block of four.
template <std::size_t D>
[[gnu::always_inline]] inline void add_up(const double* bias, const double* weights,
                                          const double* forms, const std::size_t* active,
                                          std::size_t count, FourForms<D>& sum) noexcept
{
    constexpr std::size_t stride = D + 2;
    Pair sums[stride][2] = {};
    sums[0][0] = load_pair(bias);
    sums[0][1] = load_pair(bias + 2);
    for (std::size_t a = 0; a < count; ++a) {
        const double* const row = weights + active[a] * lanes;
        const double* const form = forms + a * stride;
        for (std::size_t p = 0; p < 2; ++p) {
            const Pair w = load_pair(row + 2 * p);
            for (std::size_t q = 0; q <= D; ++q) sums[q][p] += w * form[q];
            sums[D + 1][p] += magnitude(w) * form[D + 1];
        }
    }
    for (std::size_t q = 0; q < stride; ++q) {
        for (std::size_t l = 0; l < lanes; ++l) sum[q][l] = sums[q][l / 2][l % 2];
    }
}

/// One neuron before its activation: its form c + G t +- e without G, and what follows from it.
struct Neuron {
    double c, e;
    double size;  ///< |c| + |G| 1 + e
    double low, high;
};

/// @param own  twice the relative error of a sum over the layer before
template <std::size_t D>
[[gnu::always_inline]] inline Neuron neuron(const FourForms<D>& sum, std::size_t l, double bias,
                                            double own) noexcept
{
    const double c = sum[0][l];
    double reach = 0;
    for (std::size_t q = 1; q <= D; ++q) reach += std::fabs(sum[q][l]);
    const double e = sum[D + 1][l] * (1 + own) + own * std::fabs(bias) + underflow;
    const double size = std::fabs(c) + reach + e;
    const double pad = reach + e + own * size;
    return {.c = c, .e = e, .size = size, .low = c - pad, .high = c + pad};
}

/// Writes the form of a neuron behind its ReLU, which is not always zero.
/// @param next  twice the relative error of a sum over this layer
template <std::size_t D>
[[gnu::always_inline]] inline void activate(const Neuron& z, const FourForms<D>& sum, std::size_t l,
                                            double own, double next, double* form) noexcept
{
    if (z.low >= 0) {
        for (std::size_t q = 0; q <= D; ++q) form[q] = sum[q][l];
        form[D + 1] = z.e + next * z.size;
        return;
    }
    // slope z <= relu(z) <= slope z + 2 mu on [low, high], for any slope in [0, 1]
    const double slope = z.high / (z.high - z.low);
    const double mu = std::max(-slope * z.low, (1 - slope) * z.high) / 2 * (1 + own);
    form[0] = slope * z.c + mu;
    for (std::size_t q = 1; q <= D; ++q) form[q] = slope * sum[q][l];
    form[D + 1] = slope * z.e + mu + (next + own) * (z.size + mu);
}

}  // namespace

/// The normalised features of a box: |x - centre| <= radius.
struct NetworkBounds::Place {
    std::array<double, max_inputs> centre;
    std::array<double, max_inputs> radius;
};

void NetworkBounds::check(const Model& model) const
{
    detail::check_layers(model, "NetworkBounds");
    if (model.activation != Activation::relu)
        refuse_bounds("expected ReLU activations, found tanh");
    const std::size_t n = model.layers.front().inputs;
    if (model.layers.back().outputs != 1) {
        refuse_bounds("expected one output, found " + std::to_string(model.layers.back().outputs));
    }
    if (n > max_inputs) {
        refuse_bounds("expected at most " + std::to_string(max_inputs) + " features, found " +
                      std::to_string(n));
    }
    if (model.offset.size() != n || model.scale.size() != n || model.domain.size() != n) {
        refuse_bounds("expected an offset, a scale and a range of the domain for each of " +
                      std::to_string(n) + " features");
    }
    for (std::size_t i = 0; i < n; ++i) {
        const ValueRange& range = model.domain[i];
        const std::string feature = "feature " + std::to_string(i);
        if (!std::isfinite(range.lower) || !std::isfinite(range.upper) ||
            !(range.lower <= range.upper)) {
            refuse_bounds(feature + ": expected a finite range as its domain");
        }
        if (!std::isfinite(model.offset[i]) || !std::isfinite(model.scale[i])) {
            refuse_bounds(feature + ": expected a finite offset and scale");
        }
    }
    for (std::size_t k = 0; k < model.layers.size(); ++k) {
        const auto finite = [&](double x) {
            return std::isfinite(
                model.precision == Precision::f32 ? static_cast<double>(static_cast<float>(x)) : x);
        };
        const DenseLayer& layer = model.layers[k];
        if (!std::all_of(layer.weight.begin(), layer.weight.end(), finite) ||
            !std::all_of(layer.bias.begin(), layer.bias.end(), finite)) {
            refuse_bounds("layer " + std::to_string(k) + ": expected finite weights and biases");
        }
    }
}

void NetworkBounds::load(const Model& model)
{
    const auto evaluated = [&](double x) {
        return model.precision == Precision::f32 ? static_cast<double>(static_cast<float>(x)) : x;
    };
    inputs_ = model.layers.front().inputs;
    offset_ = model.offset;
    scale_ = model.scale;
    std::size_t operations = 64;
    for (const DenseLayer& from : model.layers) {
        Layer layer;
        layer.inputs = from.inputs;
        layer.outputs = from.outputs;
        layer.blocks = (from.outputs + lanes - 1) / lanes;
        layer.blocked.resize(layer.blocks * lanes * layer.inputs);
        layer.bias.resize(layer.blocks * lanes);
        for (const double w : from.weight) layer.rows.push_back(evaluated(w));
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            layer.bias[j] = evaluated(from.bias[j]);
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                layer.blocked[(j / lanes * layer.inputs + i) * lanes + j % lanes] =
                    layer.rows[j * layer.inputs + i];
            }
        }
        operations += 4 * (layer.inputs + layer.outputs);
        layers_.push_back(std::move(layer));
    }
    backward_gamma_ = gamma(operations);
    for (std::size_t i = 0; i < inputs_; ++i) {
        if (depends_on(i)) live_.push_back(i);
    }
}

NetworkBounds::NetworkBounds(const Model& model)
{
    check(model);
    load(model);
    bound_evaluation(model);
}

bool NetworkBounds::depends_on(std::size_t i) const noexcept
{
    const Layer& first = layers_.front();
    for (std::size_t j = 0; j < first.outputs; ++j) {
        if (first.rows[j * inputs_ + i] != 0) return true;
    }
    return false;
}

NetworkBounds::Scratch::Scratch(const NetworkBounds& network)
{
    std::size_t widest = network.inputs_;
    for (const Layer& layer : network.layers_) {
        widest = std::max(widest, layer.blocks * lanes);
        low.emplace_back(layer.blocks * lanes);
        high.emplace_back(layer.blocks * lanes);
    }
    forms.resize(widest * (max_inputs + 2));
    previous.resize(forms.size());
    active.resize(widest);
    next_active.resize(widest);
    back.resize(widest);
    front.resize(widest);
}

NetworkBounds::Place NetworkBounds::place(const double* lower, const double* upper) const noexcept
{
    Place at;
    for (std::size_t i = 0; i < inputs_; ++i) {
        const double middle = lower[i] + (upper[i] - lower[i]) / 2;
        const double half = std::max(middle - lower[i], upper[i] - middle);
        const double scale = std::fabs(scale_[i]);
        at.centre[i] = (middle - offset_[i]) * scale_[i];
        // Covers two roundings of the centre, one of `half`, and those of this line.
        at.radius[i] =
            scale * half * (1 + 8 * unit) + 8 * unit * std::fabs(at.centre[i]) + underflow;
    }
    return at;
}

/// Writes the forms of the inputs.
template <std::size_t D>
void NetworkBounds::start(const Place& at, Scratch& s) const noexcept
{
    constexpr std::size_t stride = D + 2;  // c, G_1 ... G_D, e
    for (std::size_t a = 0; a < live_.size(); ++a) {
        double* const form = s.previous.data() + a * stride;
        std::fill_n(form, stride, 0.0);
        const std::size_t i = live_[a];
        form[0] = at.centre[i];
        form[1 + a] = at.radius[i];
        form[D + 1] = gamma(layers_[0].inputs + D + 8) * (std::fabs(at.centre[i]) + at.radius[i]);
        s.active[a] = i;
    }
}

/// Fills `low` and `high` of every hidden layer, and gives the range of the logit.
template <std::size_t D>
ValueRange NetworkBounds::forward(const Place& at, Scratch& s, double* influence) const noexcept
{
    start<D>(at, s);
    std::size_t count = live_.size();
    for (std::size_t k = 0; k < layers_.size(); ++k) {
        const Layer& layer = layers_[k];
        const bool last = k + 1 == layers_.size();
        const double own = gamma(layer.inputs + D + 8);
        const double next = last ? 0 : gamma(layers_[k + 1].inputs + D + 8);
        double* to = s.forms.data();
        std::size_t kept = 0;
        for (std::size_t b = 0; b < layer.blocks; ++b) {
            FourForms<D> sum;
            add_up<D>(layer.bias.data() + b * lanes,
                      layer.blocked.data() + b * layer.inputs * lanes, s.previous.data(),
                      s.active.data(), count, sum);
            for (std::size_t l = 0; l < lanes && b * lanes + l < layer.outputs; ++l) {
                const std::size_t j = b * lanes + l;
                const Neuron z = neuron<D>(sum, l, layer.bias[j], own);
                if (last) {
                    for (std::size_t i = 0; i < inputs_; ++i) influence[i] = 0;
                    for (std::size_t a = 0; a < live_.size(); ++a) {
                        influence[live_[a]] = std::fabs(sum[1 + a][l]);
                    }
                    return {z.low, z.high};
                }
                s.low[k][j] = z.low;
                s.high[k][j] = z.high;
                if (z.high <= 0) continue;
                s.next_active[kept] = j;
                activate<D>(z, sum, l, own, next, to + kept * (D + 2));
                ++kept;
            }
        }
        count = kept;
        std::swap(s.forms, s.previous);
        std::swap(s.active, s.next_active);
    }
    return {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
}

ValueRange NetworkBounds::forward(const Place& at, Scratch& s, double* influence) const noexcept
{
    switch (live_.size()) {
        case 0:
        case 1: return forward<1>(at, s, influence);
        case 2: return forward<2>(at, s, influence);
        case 3: return forward<3>(at, s, influence);
        case 4: return forward<4>(at, s, influence);
        case 5: return forward<5>(at, s, influence);
        case 6: return forward<6>(at, s, influence);
        case 7:
        case 8: return forward<8>(at, s, influence);
        default: return forward<max_inputs>(at, s, influence);
    }
}

/// A lower bound of the logit, from the ranges that `forward` has left.
double NetworkBounds::backward(const Place& at, Scratch& s) const noexcept
{
    const Layer& last = layers_.back();
    double constant = last.bias[0];
    double size = last.most[0];  // sum of the magnitudes of everything added
    std::copy_n(last.rows.begin(), last.inputs, s.back.begin());
    for (std::size_t k = layers_.size() - 1; k-- > 0;) {
        const Layer& layer = layers_[k];
        std::fill_n(s.front.begin(), layer.inputs, 0.0);
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            const double low = s.low[k][j];
            const double high = s.high[k][j];
            double factor = s.back[j];
            if (high <= 0 || factor == 0) continue;
            if (!(low >= 0)) {
                if (factor > 0) {  // relu(z) >= z or 0: the one with the smaller gap
                    if (!(high > -low)) continue;
                } else {  // relu(z) <= slope z + offset
                    const double slope = high / (high - low);
                    const double offset = std::max(-slope * low, (1 - slope) * high);
                    constant += factor * offset;
                    size += std::fabs(factor * offset);
                    factor *= slope;
                }
            }
            constant += factor * layer.bias[j];
            size += std::fabs(factor) * layer.most[j];
            const double* const row = layer.rows.data() + j * layer.inputs;
            for (std::size_t i = 0; i < layer.inputs; ++i) s.front[i] += factor * row[i];
        }
        std::swap(s.front, s.back);
    }
    double lower = constant;
    double reach = 0;
    for (std::size_t i = 0; i < inputs_; ++i) {
        lower += s.back[i] * at.centre[i];
        reach += std::fabs(s.back[i]) * at.radius[i];
        size += std::fabs(s.back[i]) * (std::fabs(at.centre[i]) + at.radius[i]);
    }
    return lower - reach - backward_gamma_ * size - underflow;
}

ValueRange NetworkBounds::over(const double* lower, const double* upper, double enough,
                               Scratch& scratch, double* influence) const noexcept
{
    const Place at = place(lower, upper);
    ValueRange range = forward(at, scratch, influence);
    if (!(range.lower - evaluation_error_ >= enough) && layers_.size() > 1) {
        const double other = backward(at, scratch);
        if (other > range.lower) range.lower = other;
    }
    const double pad = evaluation_error_ * (1 + 4 * unit);
    range.lower -= pad + 2 * unit * (std::fabs(range.lower) + pad);
    range.upper += pad + 2 * unit * (std::fabs(range.upper) + pad);
    return range;
}

/// Bounds the values over the domain, and the effect of rounding on them.
void NetworkBounds::bound_evaluation(const Model& model)
{
    const bool single = model.precision == Precision::f32;
    const double u = single ? 0x1p-24 : unit;
    const double tiny = single ? 0x1p-149 : 0x1p-1074;
    const double largest = single ? 1e37 : 1e300;

    std::vector<double> low(inputs_), high(inputs_), influence(inputs_);
    for (std::size_t i = 0; i < inputs_; ++i) {
        low[i] = model.domain[i].lower;
        high[i] = model.domain[i].upper;
    }
    const Place at = place(low.data(), high.data());
    Scratch scratch(*this);
    static_cast<void>(forward(at, scratch, influence.data()));

    std::vector<double> x(inputs_), error(inputs_);
    for (std::size_t i = 0; i < inputs_; ++i) {
        x[i] = std::fabs(at.centre[i]) + at.radius[i];
        error[i] = x[i] * (u + 4 * unit) * 1.01 + tiny;  // centred, scaled, rounded to T
    }
    for (std::size_t i = 0; i < inputs_; ++i) {
        if (!(x[i] < largest)) {
            refuse_bounds("feature " + std::to_string(i) +
                          ": normalised, it could overflow in the domain");
        }
    }
    for (std::size_t k = 0; k < layers_.size(); ++k) {
        Layer& layer = layers_[k];
        std::vector<double> next_x, next_error;
        // A term passes its product and at most inputs + 4 additions; see kernel.hpp.
        const double g = gamma(layer.inputs + 8, u);
        for (std::size_t j = 0; j < layer.outputs; ++j) {
            double sum = std::fabs(layer.bias[j]);
            double carried = 0;
            double magnitude = sum;
            for (std::size_t i = 0; i < layer.inputs; ++i) {
                const double w = std::fabs(layer.rows[j * layer.inputs + i]);
                sum += w * x[i];
                carried += w * error[i];
                magnitude += w * (x[i] + error[i]);
            }
            if (!(magnitude < largest)) {
                refuse_bounds("layer " + std::to_string(k) +
                              ": the weights are so large that an evaluation could overflow");
            }
            layer.most.push_back(sum * 1.01);
            const double pads = static_cast<double>(layer.inputs + 8) * tiny;
            next_error.push_back((carried + g * magnitude + pads) * 1.01);
            const double high_here = scratch.high[k][j];
            const bool ranged = k + 1 < layers_.size() && high_here < sum;
            next_x.push_back(ranged ? std::max(high_here, 0.0) : sum * 1.01);
        }
        x = std::move(next_x);
        error = std::move(next_error);
    }
    evaluation_error_ = error[0];
}

}  // namespace ricochet
