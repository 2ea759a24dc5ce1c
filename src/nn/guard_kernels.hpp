// The kernels of `GuardNetwork` for one instruction set.
//
// Included by one file per instruction set, as kernels.hpp. Those files are compiled without
// contraction of products and sums, so that all have the same bits.
#pragma once

#include "guard_kernel_table.hpp"
#include "ricochet/nn/detail/activation.hpp"
#include "ricochet/nn/detail/simd.hpp"

#include <cstddef>
#include <cstdint>

namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE {

using V = Vector<double>;
inline constexpr std::size_t guard_width = GuardNetwork::max_width;
inline constexpr std::size_t lane_count = lanes<double>;

[[nodiscard]] RICOCHET_INLINE V size_of(V x) noexcept
{
    using Bits = Simd<double>::Bits;
    constexpr std::uint64_t all_but_sign = ~std::uint64_t{0} >> 1U;
    return reinterpret_cast<V>(reinterpret_cast<Bits>(x) & (all_but_sign - Bits{}));
}
[[nodiscard]] RICOCHET_INLINE V larger_of(V a, V b) noexcept
{
    return a > b ? a : b;
}

// --- activations: f and its first two derivatives, and a bound of the third ---

/// Ranges of ReLU are those of its chord, not of an expansion.
struct GuardRelu {
    static constexpr bool is_smooth = false;
    RICOCHET_INLINE static V value(V x) noexcept { return Relu::of<double>(x); }
    RICOCHET_INLINE static void point(V x, V& f, V& first) noexcept
    {
        f = value(x);
        first = x > constant(0.0) ? constant(1.0) : constant(0.0);
    }
};

struct GuardTanh {
    static constexpr bool is_smooth = true;
    static constexpr double third = 2;
    RICOCHET_INLINE static V value(V x) noexcept { return Tanh::of<double>(x); }
    RICOCHET_INLINE static void point(V x, V& f, V& first) noexcept
    {
        f = value(x);
        first = constant(1.0) - f * f;
    }
    RICOCHET_INLINE static void expand(V x, V& f, V& first, V& second) noexcept
    {
        point(x, f, first);
        second = constant(-2.0) * f * first;
    }
    /// The derivative lies in this range.
    static constexpr double least_rate = 0, largest_rate = 1;
};

/// 1 / (1 + exp(-x))
[[nodiscard]] RICOCHET_INLINE V logistic(V x) noexcept
{
    return constant(0.5) + constant(0.5) * Tanh::of<double>(constant(0.5) * x);
}

/// x logistic(x)
struct GuardSilu {
    static constexpr bool is_smooth = true;
    /// |f'''| is largest at +-1.0435: 0.3078.
    static constexpr double third = 0.31;
    RICOCHET_INLINE static V value(V x) noexcept { return x * logistic(x); }
    RICOCHET_INLINE static void point(V x, V& f, V& first) noexcept
    {
        const V s = logistic(x);
        f = x * s;
        first = s + x * (s * (constant(1.0) - s));
    }
    RICOCHET_INLINE static void expand(V x, V& f, V& first, V& second) noexcept
    {
        const V s = logistic(x);
        const V rate = s * (constant(1.0) - s);
        f = x * s;
        first = s + x * rate;
        second = rate * (constant(2.0) + x * (constant(1.0) - constant(2.0) * s));
    }
    static constexpr double least_rate = -0.1, largest_rate = 1.1;
};

/// log(1 + exp(x))
struct GuardSoftplus {
    static constexpr bool is_smooth = true;
    static constexpr double third = 0.0963;  // 1 / (6 sqrt 3), at logistic = 1/2 +- 1 / sqrt 12
    RICOCHET_INLINE static V value(V x) noexcept
    {
        V f;
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < lane_count; ++k) {
            const double at = x[k];
            const double rest = __builtin_log1p(__builtin_exp(at > 0 ? -at : at));
            f[k] = (at < 0 ? 0 : at) + rest;
        }
        return f;
    }
    RICOCHET_INLINE static void point(V x, V& f, V& first) noexcept
    {
        f = value(x);
        first = logistic(x);
    }
    RICOCHET_INLINE static void expand(V x, V& f, V& first, V& second) noexcept
    {
        point(x, f, first);
        second = first * (constant(1.0) - first);
    }
    static constexpr double least_rate = 0, largest_rate = 1;
};

struct GuardSine {
    static constexpr bool is_smooth = true;
    static constexpr double third = 1;
    RICOCHET_INLINE static V value(V x) noexcept
    {
        V f;
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < lane_count; ++k) f[k] = __builtin_sin(x[k]);
        return f;
    }
    RICOCHET_INLINE static void point(V x, V& f, V& first) noexcept
    {
        f = value(x);
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < lane_count; ++k) first[k] = __builtin_cos(x[k]);
    }
    RICOCHET_INLINE static void expand(V x, V& f, V& first, V& second) noexcept
    {
        point(x, f, first);
        second = -f;
    }
    static constexpr double least_rate = -1, largest_rate = 1;
};

// --- affine layers ---

/// Inputs of a layer that are not zero.
struct UsedInputs {
    const std::uint16_t* list;  ///< null: all are used
    std::size_t count;
};

/// W x + b of `Sums` inputs together, of which the first alone has the bias, and of which the last,
/// if `sized`, is multiplied by |W|.
template <std::size_t Sums, bool sized, std::size_t Registers, bool listed>
RICOCHET_INLINE void affine_together(const GuardLayer& layer, std::size_t first,
                                     const double* const (&x)[Sums], const UsedInputs& used,
                                     double* const (&y)[Sums]) noexcept
{
    V sums[Sums][Registers];
    RICOCHET_UNROLL
    for (std::size_t k = 0; k < Registers; ++k) {
        sums[0][k] = load(layer.parameters + first + k * lane_count);
        RICOCHET_UNROLL
        for (std::size_t m = 1; m < Sums; ++m) sums[m][k] = V{};
    }
    RICOCHET_KEEP_LOOP
    for (std::size_t n = 0; n < used.count; ++n) {
        const std::size_t i = listed ? used.list[n] : n;
        const double* const weights = layer.parameters + (i + 1) * layer.row + first;
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < Registers; ++k) {
            const V w = load(weights + k * lane_count);
            RICOCHET_UNROLL
            for (std::size_t m = 0; m < Sums; ++m) {
                const V factor = sized && m + 1 == Sums ? size_of(w) : w;
                accumulate(sums[m][k], factor * x[m][i]);
            }
        }
    }
    RICOCHET_UNROLL
    for (std::size_t m = 0; m < Sums; ++m) {
        RICOCHET_UNROLL
        for (std::size_t k = 0; k < Registers; ++k) {
            store(y[m] + first + k * lane_count, sums[m][k]);
        }
    }
}

/// The same for a range, in two registers each: arrays of these sums would be kept in memory.
template <bool listed>
RICOCHET_INLINE void range_together(const GuardLayer& layer, std::size_t first,
                                    const double* const (&x)[3], const UsedInputs& used,
                                    double* const (&y)[3]) noexcept
{
    const double* const c = x[0];
    const double* const b = x[1];
    const double* const r = x[2];
    V c0 = load(layer.parameters + first), c1 = load(layer.parameters + first + lane_count);
    V b0 = V{}, b1 = V{}, r0 = V{}, r1 = V{};
    RICOCHET_KEEP_LOOP
    for (std::size_t n = 0; n < used.count; ++n) {
        const std::size_t i = listed ? used.list[n] : n;
        const double* const weights = layer.parameters + (i + 1) * layer.row + first;
        const V w0 = load(weights), w1 = load(weights + lane_count);
        accumulate(c0, w0 * c[i]);
        accumulate(c1, w1 * c[i]);
        accumulate(b0, w0 * b[i]);
        accumulate(b1, w1 * b[i]);
        accumulate(r0, size_of(w0) * r[i]);
        accumulate(r1, size_of(w1) * r[i]);
    }
    store(y[0] + first, c0);
    store(y[0] + first + lane_count, c1);
    store(y[1] + first, b0);
    store(y[1] + first + lane_count, b1);
    store(y[2] + first, r0);
    store(y[2] + first + lane_count, r1);
}

template <std::size_t Sums, bool sized, std::size_t Registers, bool listed>
RICOCHET_INLINE void affine_by(const GuardLayer& layer, const double* const (&x)[Sums],
                               const UsedInputs& used, double* const (&y)[Sums]) noexcept
{
    std::size_t first = 0;
    for (; first + Registers * lane_count <= layer.row; first += Registers * lane_count) {
        if constexpr (sized) {
            static_assert(Sums == 3 && Registers == 2);
            range_together<listed>(layer, first, x, used, y);
        } else {
            affine_together<Sums, sized, Registers, listed>(layer, first, x, used, y);
        }
    }
    for (; first < layer.row; first += lane_count) {
        affine_together<Sums, sized, 1, listed>(layer, first, x, used, y);
    }
}

/// The same for the last layer: its one row of weights follows the bias, and ends with zeros.
template <std::size_t Sums, bool sized>
RICOCHET_INLINE void dot_products(const GuardLayer& layer, const double* const (&x)[Sums],
                                  double* const (&y)[Sums]) noexcept
{
    constexpr std::size_t parts = block<double> / lane_count;
    V sums[Sums][parts] = {};
    const double* const weights = layer.parameters + 1;
    for (std::size_t i = 0; i < layer.inputs; i += block<double>) {
        RICOCHET_UNROLL
        for (std::size_t p = 0; p < parts; ++p) {
            const std::size_t at = i + p * lane_count;
            const V w = load(weights + at);
            RICOCHET_UNROLL
            for (std::size_t m = 0; m < Sums; ++m) {
                const V factor = sized && m + 1 == Sums ? size_of(w) : w;
                accumulate(sums[m][p], factor * load(x[m] + at));
            }
        }
    }
    RICOCHET_UNROLL
    for (std::size_t m = 0; m < Sums; ++m) {
        y[m][0] = sum_of_lanes<double>(sums[m]) + (m == 0 ? layer.parameters[0] : 0);
    }
}

/// The indices of inputs that are not zero in any of the arrays.
template <std::size_t Sums>
RICOCHET_INLINE std::size_t list_used(const double* const (&x)[Sums], std::size_t n,
                                      std::uint16_t* used) noexcept
{
    std::size_t count = 0;
    for (std::size_t i = 0; i < n; ++i) {
        std::uint64_t bits = 0;
        RICOCHET_UNROLL
        for (std::size_t m = 0; m < Sums; ++m) bits |= __builtin_bit_cast(std::uint64_t, x[m][i]);
        used[count] = static_cast<std::uint16_t>(i);
        count += bits << 1U != 0 ? 1 : 0;  // zeros of either sign
    }
    return count;
}

/// Layer k of a network. Inputs that a ReLU has made zero are left out of wide layers, where the
/// list costs less than the products.
template <class Activation, std::size_t Sums, bool sized, std::size_t Registers>
RICOCHET_INLINE void affine(const GuardLayers& net, std::size_t k, const double* const (&x)[Sums],
                            double* const (&y)[Sums]) noexcept
{
    const GuardLayer& layer = net.layers[k];
    if (k + 1 == net.count) return dot_products<Sums, sized>(layer, x, y);
    if constexpr (!Activation::is_smooth) {
        constexpr std::size_t wide = 32;
        if (k > 0 && layer.row >= wide && layer.inputs >= wide) {
            std::uint16_t list[guard_width];
            const std::size_t count = list_used<Sums>(x, layer.inputs, list);
            return affine_by<Sums, sized, Registers, true>(layer, x, {list, count}, y);
        }
    }
    affine_by<Sums, sized, Registers, false>(layer, x, {nullptr, layer.inputs}, y);
}

/// A row more than the widest layer has, so that the same places of two buffers are not a multiple
/// of 4096 bytes apart: processors take a store to one for a store to the other.
struct GuardBuffer {
    alignas(64) double values[guard_width + 8];
};

/// Zeros behind the inputs, up to a whole block.
RICOCHET_INLINE void end_inputs(double* x, std::size_t inputs) noexcept
{
    for (std::size_t i = inputs; i % block<double> != 0; ++i) x[i] = 0;
}

/// The inputs of the first layer.
RICOCHET_INLINE void scale_inputs(const GuardLayers& net, const double* in, double* x) noexcept
{
    for (std::size_t i = 0; i < net.layers[0].inputs; ++i) {
        x[i] = (in[i] - net.offset[i]) * net.scale[i];
    }
    end_inputs(x, net.layers[0].inputs);
}

// --- values and derivatives ---

template <class Activation>
double guard_value(const GuardLayers& net, const double* in) noexcept
{
    GuardBuffer a, b;
    double* x = a.values;
    double* y = b.values;
    scale_inputs(net, in, x);
    for (std::size_t k = 0; k < net.count; ++k) {
        const GuardLayer& layer = net.layers[k];
        affine<Activation, 1, false, 8>(net, k, {x}, {y});
        if (k + 1 == net.count) break;
        for (std::size_t j = 0; j < layer.row; j += lane_count) {
            V f = Activation::value(load(y + j));
            if (layer.is_residual) f = f + load(x + j);
            store(y + j, f);
        }
        double* const next = x;
        x = y;
        y = next;
    }
    return y[0];
}

template <class Activation>
double guard_rate(const GuardLayers& net, const double* in, const double* along,
                  double* rate) noexcept
{
    GuardBuffer buffers[4];
    double *x = buffers[0].values, *dx = buffers[1].values;
    double *y = buffers[2].values, *dy = buffers[3].values;
    scale_inputs(net, in, x);
    for (std::size_t i = 0; i < net.layers[0].inputs; ++i) dx[i] = along[i] * net.scale[i];
    end_inputs(dx, net.layers[0].inputs);
    for (std::size_t k = 0; k < net.count; ++k) {
        const GuardLayer& layer = net.layers[k];
        affine<Activation, 2, false, 4>(net, k, {x, dx}, {y, dy});
        if (k + 1 == net.count) break;
        for (std::size_t j = 0; j < layer.row; j += lane_count) {
            V f, first;
            Activation::point(load(y + j), f, first);
            V d = first * load(dy + j);
            if (layer.is_residual) {
                f = f + load(x + j);
                d = d + load(dx + j);
            }
            store(y + j, f);
            store(dy + j, d);
        }
        double* const next[2] = {x, dx};
        x = y;
        dx = dy;
        y = next[0];
        dy = next[1];
    }
    *rate = dy[0];
    return y[0];
}

template <class Activation>
double guard_gradient(const GuardLayers& net, const double* in, double* gradient) noexcept
{
    GuardBuffer a{}, b{};
    GuardBuffer rates[GuardNetwork::max_layers];
    double* x = a.values;
    double* y = b.values;
    scale_inputs(net, in, x);
    for (std::size_t k = 0; k < net.count; ++k) {
        const GuardLayer& layer = net.layers[k];
        affine<Activation, 1, false, 8>(net, k, {x}, {y});
        if (k + 1 == net.count) break;
        for (std::size_t j = 0; j < layer.row; j += lane_count) {
            V f, first;
            Activation::point(load(y + j), f, first);
            store(rates[k].values + j, first);
            if (layer.is_residual) f = f + load(x + j);
            store(y + j, f);
        }
        double* const next = x;
        x = y;
        y = next;
    }
    const double value = y[0];
    // Backward: d holds the derivatives by the outputs of a layer, e those by its inputs.
    double* d = a.values;
    double* e = b.values;
    for (std::size_t k = net.count; k-- > 0;) {
        const GuardLayer& layer = net.layers[k];
        const bool is_last = k + 1 == net.count;
        for (std::size_t i = 0; i < layer.inputs; ++i) {
            const double* const weights = layer.parameters + (i + 1) * layer.row;
            double sum = 0;
            if (is_last) {
                sum = weights[0];
            } else {
                V part[block<double> / lane_count] = {};
                for (std::size_t j = 0; j < layer.row; j += block<double>) {
                    RICOCHET_UNROLL
                    for (std::size_t p = 0; p < block<double> / lane_count; ++p) {
                        const std::size_t at = j + p * lane_count;
                        const V of_sum = load(d + at) * load(rates[k].values + at);
                        accumulate(part[p], load(weights + at) * opaque(of_sum));
                    }
                }
                sum = sum_of_lanes<double>(part);
            }
            e[i] = layer.is_residual ? sum + d[i] : sum;
        }
        const std::size_t before = k > 0 ? net.layers[k - 1].row : 0;
        for (std::size_t i = layer.inputs; i < before; ++i) e[i] = 0;
        double* const next = d;
        d = e;
        e = next;
    }
    for (std::size_t i = 0; i < net.layers[0].inputs; ++i) gradient[i] = d[i] * net.scale[i];
    return value;
}

// --- ranges ---

/// Roundings of an activation, in parts of its terms: those of a few operations, and 16 units in
/// the last place of the function itself, once for the range and once for the guard.
inline constexpr double rounding_of_activation = 0x1p-47;

/// ReLU between its chord and the line parallel to it.
RICOCHET_INLINE void range_of_relu(V& c, V& b, V& r) noexcept
{
    const V zero = opaque(V{});
    const V reach = size_of(b) + r;
    const V lo = c - reach;
    const V hi = c + reach;
    const V slope = hi <= zero ? zero : lo >= zero ? constant(1.0) : hi / (hi - lo);
    const V shift = (lo < zero) & (hi > zero) ? constant(-0.5) * slope * lo : zero;
    const V rounding = constant(rounding_of_activation) * (size_of(c) + reach);
    c = slope * c + shift;
    b = slope * b;
    // What is surely zero has no rounding, so that the next layer can leave it out.
    r = hi < -rounding ? zero : slope * r + (shift + rounding);
}

/// A smooth activation by its expansion at the centre, or by the range of its derivative where that
/// is closer.
template <class Activation>
RICOCHET_INLINE void range_of_smooth(V& c, V& b, V& r) noexcept
{
    V f, first, second;
    Activation::expand(c, f, first, second);
    const V reach = size_of(b) + r;
    const V square = reach * reach;
    const V bend = constant(0.25) * second * square;
    const V rest = size_of(bend) + constant(Activation::third / 6) * square * reach;
    const V by_expansion = size_of(first) * r + rest;
    constexpr double rate = 0.5 * (Activation::least_rate + Activation::largest_rate);
    constexpr double spread = 0.5 * (Activation::largest_rate - Activation::least_rate);
    const V by_rates = constant(rate) * r + constant(spread) * reach;
    const V rounding = constant(rounding_of_activation) * (size_of(f) + size_of(c) + reach + rest);
    const auto expands = by_expansion <= by_rates;
    c = expands ? f + bend : f;
    b = (expands ? first : constant(rate)) * b;
    r = (expands ? by_expansion : by_rates) + rounding;
}

/// Registers of each of the three sums: with six there are enough independent additions to hide the
/// latency of one, and they fit in 16 registers.
inline constexpr std::size_t range_registers = 2;

// Long: one pass through the layers, whose buffers and registers its parts have in common.
template <class Activation>
GuardRange guard_along(const GuardLayers& net, const double* centre, const double* slope,
                       const double* radius) noexcept
{
    GuardBuffer buffers[6];
    double *c = buffers[0].values, *b = buffers[1].values, *r = buffers[2].values;
    double *yc = buffers[3].values, *yb = buffers[4].values, *yr = buffers[5].values;
    const auto size = [](double x) { return x < 0 ? -x : x; };
    double largest = 0;
    for (std::size_t i = 0; i < net.layers[0].inputs; ++i) {
        const double scale = net.scale[i];
        c[i] = (centre[i] - net.offset[i]) * scale;
        b[i] = slope[i] * scale;
        const double terms = size(centre[i]) + size(net.offset[i]) + size(slope[i]) + radius[i];
        r[i] = radius[i] * size(scale) + 0x1p-50 * terms * size(scale);
        const double reach = size(c[i]) + size(b[i]) + r[i];
        largest = reach > largest ? reach : largest;
    }
    end_inputs(c, net.layers[0].inputs);
    end_inputs(b, net.layers[0].inputs);
    end_inputs(r, net.layers[0].inputs);
    for (std::size_t k = 0; k < net.count; ++k) {
        const GuardLayer& layer = net.layers[k];
        affine<Activation, 3, true, range_registers>(net, k, {c, b, r}, {yc, yb, yr});
        const V of_inputs = constant(largest);
        V most = V{};
        if (k + 1 == net.count) {
            const double rounding = layer.rounding[0] * largest + layer.rounding[layer.row];
            return {yc[0], yb[0], yr[0] + rounding};
        }
        for (std::size_t j = 0; j < layer.row; j += lane_count) {
            V fc = load(yc + j), fb = load(yb + j);
            V fr = load(yr + j) +
                   (load(layer.rounding + j) * of_inputs + load(layer.rounding + layer.row + j));
            if constexpr (Activation::is_smooth) {
                range_of_smooth<Activation>(fc, fb, fr);
            } else {
                range_of_relu(fc, fb, fr);
            }
            if (layer.is_residual) {
                fc = fc + load(c + j);
                fb = fb + load(b + j);
                fr = fr + load(r + j) +
                     constant(0x1p-51) * (size_of(fc) + size_of(fb) + load(r + j));
            }
            most = larger_of(most, size_of(fc) + size_of(fb) + fr);
            store(yc + j, fc);
            store(yb + j, fb);
            store(yr + j, fr);
        }
        largest = most[0];
        for (std::size_t n = 1; n < lane_count; ++n)
            largest = most[n] > largest ? most[n] : largest;
        double* const next[3] = {c, b, r};
        c = yc;
        b = yb;
        r = yr;
        yc = next[0];
        yb = next[1];
        yr = next[2];
    }
    return {0, 0, 0};  // there is a last layer
}

template <class Activation>
constexpr GuardKernels guard_kernels_of() noexcept
{
    return {guard_value<Activation>, guard_rate<Activation>, guard_gradient<Activation>,
            guard_along<Activation>};
}

inline GuardKernels choose_guard_kernels(Activation activation) noexcept
{
    switch (activation) {
        case Activation::relu: return guard_kernels_of<GuardRelu>();
        case Activation::tanh: return guard_kernels_of<GuardTanh>();
        case Activation::softplus: return guard_kernels_of<GuardSoftplus>();
        case Activation::silu: return guard_kernels_of<GuardSilu>();
        case Activation::sine: return guard_kernels_of<GuardSine>();
    }
    return {};
}

}  // namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE
