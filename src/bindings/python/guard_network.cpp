// Networks as guards: functions of compiled code, which the loop calls without the interpreter.
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "ricochet/nn/guard_network.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::python {

namespace {

using RowsOfInputs = py::array_t<double, py::array::c_style | py::array::forcecast>;
using NetworkInputs = std::array<double, GuardNetwork::max_width>;

/// A network and the components of the state that it reads, in this order.
class PyGuardNetwork {
public:
    PyGuardNetwork(Model model, std::vector<std::size_t> components)
        : model_(std::move(model)), network_(model_), components_(std::move(components))
    {
        const std::size_t n = network_.inputs();
        if (components_.empty()) {
            for (std::size_t i = 0; i < n; ++i) components_.push_back(i);
        }
        if (components_.size() != n) {
            throw py::value_error("components: found " + std::to_string(components_.size()) +
                                  ", expected " + std::to_string(n) +
                                  ", one for each input of the network");
        }
        least_ = 1 + *std::max_element(components_.begin(), components_.end());
    }

    [[nodiscard]] const GuardNetwork& network() const noexcept { return network_; }
    [[nodiscard]] const Model& model() const noexcept { return model_; }
    [[nodiscard]] const std::vector<std::size_t>& components() const noexcept
    {
        return components_;
    }
    /// The smallest state that has all components.
    [[nodiscard]] std::size_t least() const noexcept { return least_; }

    /// A guard as `C_GUARD` declares it; NaN for a state that lacks a component.
    static double value(std::uint32_t /*mode*/, double /*t*/, const double* x, std::size_t n,
                        void* self)
    {
        const auto& me = *static_cast<const PyGuardNetwork*>(self);
        NetworkInputs in;
        return me.gather(x, n, in) ? me.network_.value(in.data()) : nan;
    }
    /// Its rate along the flow, as `C_RATE` declares it.
    static double rate(std::uint32_t /*mode*/, double /*t*/, const double* x, const double* dxdt,
                       std::size_t n, void* self)
    {
        const auto& me = *static_cast<const PyGuardNetwork*>(self);
        NetworkInputs in, along;
        if (!me.gather(x, n, in) || !me.gather(dxdt, n, along)) return nan;
        double rate = 0;
        static_cast<void>(me.network_.value_and_rate(in.data(), along.data(), rate));
        return rate;
    }

private:
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

    [[nodiscard]] bool gather(const double* x, std::size_t n, NetworkInputs& in) const noexcept
    {
        if (n < least_) return false;
        for (std::size_t i = 0; i < components_.size(); ++i) in[i] = x[components_[i]];
        return true;
    }

    Model model_;
    GuardNetwork network_;
    std::vector<std::size_t> components_;
    std::size_t least_ = 0;
};

/// Applies `each(inputs, to)` to rows of inputs, or to a single one, where it writes `width`
/// numbers; 0: one number, in an array without that dimension.
template <class Each>
[[nodiscard]] py::array for_rows(const PyGuardNetwork& self, const RowsOfInputs& x,
                                 std::size_t width, const Each& each)
{
    const std::size_t n = self.network().inputs();
    const py::ssize_t last = x.ndim() > 0 ? x.shape(x.ndim() - 1) : 0;
    if (x.ndim() < 1 || x.ndim() > 2 || static_cast<std::size_t>(last) != n) {
        throw py::value_error("x: found shape " + py::cast<std::string>(py::str(x.attr("shape"))) +
                              ", expected (" + std::to_string(n) + ",) or (rows, " +
                              std::to_string(n) + ")");
    }
    const py::ssize_t rows = x.ndim() == 1 ? 1 : x.shape(0);
    std::vector<py::ssize_t> shape;
    if (x.ndim() == 2) shape.push_back(rows);
    if (width > 0) shape.push_back(static_cast<py::ssize_t>(width));
    py::array out = new_array<double>(std::move(shape));
    auto* to = static_cast<double*>(out.mutable_data());
    const double* from = x.data();
    const py::gil_scoped_release others;
    for (py::ssize_t i = 0; i < rows; ++i, from += n, to += std::max<std::size_t>(width, 1)) {
        each(from, to);
    }
    return out;
}

[[nodiscard]] py::array value_of_guard(const PyGuardNetwork& self, const RowsOfInputs& x)
{
    return for_rows(self, x, 0,
                    [&](const double* in, double* to) { *to = self.network().value(in); });
}

[[nodiscard]] py::array gradient_of_guard(const PyGuardNetwork& self, const RowsOfInputs& x,
                                          bool unit)
{
    const std::size_t n = self.network().inputs();
    return for_rows(self, x, n, [&](const double* in, double* to) {
        static_cast<void>(self.network().value_and_gradient(in, to));
        if (!unit) return;
        double square = 0;
        for (std::size_t i = 0; i < n; ++i) square += to[i] * to[i];
        const double factor = square > 0 ? 1 / std::sqrt(square) : 0;
        for (std::size_t i = 0; i < n; ++i) to[i] *= factor;
    });
}

[[nodiscard]] Activation activation_named(const std::string& given)
{
    for (const Activation each : {Activation::tanh, Activation::relu, Activation::softplus,
                                  Activation::silu, Activation::sine}) {
        if (name(each) == given) return each;
    }
    throw py::value_error("activation: found '" + given +
                          "', expected 'tanh', 'relu', 'softplus', 'silu' or 'sin'");
}

/// A layer from its weights, outputs x inputs, and biases.
[[nodiscard]] DenseLayer layer_of_guard(std::size_t k, const RowsOfInputs& weight,
                                        const RowsOfInputs& bias)
{
    if (weight.ndim() != 2 || bias.ndim() != 1 || bias.shape(0) != weight.shape(0)) {
        throw py::value_error("layers[" + std::to_string(k) + "]: found weights of shape " +
                              py::cast<std::string>(py::str(weight.attr("shape"))) +
                              " and biases of shape " +
                              py::cast<std::string>(py::str(bias.attr("shape"))) +
                              ", expected (outputs, inputs) and (outputs,)");
    }
    DenseLayer out;
    out.outputs = static_cast<std::size_t>(weight.shape(0));
    out.inputs = static_cast<std::size_t>(weight.shape(1));
    out.weight.assign(weight.data(), weight.data() + weight.size());
    out.bias.assign(bias.data(), bias.data() + bias.size());
    return out;
}

/// @param offset, scale  of the inputs; empty: 0 and 1
[[nodiscard]] Model model_of_layers(
    const std::vector<std::pair<RowsOfInputs, RowsOfInputs>>& layers, const std::string& activation,
    std::vector<double> offset, std::vector<double> scale, std::vector<std::size_t> residual)
{
    Model model;
    model.kind = "guard";
    model.recipe = "state";
    model.precision = Precision::f64;
    model.activation = activation_named(activation);
    for (std::size_t k = 0; k < layers.size(); ++k) {
        model.layers.push_back(layer_of_guard(k, layers[k].first, layers[k].second));
    }
    const std::size_t n = layers.empty() ? 0 : model.layers.front().inputs;
    model.offset = offset.empty() ? std::vector<double>(n, 0.0) : std::move(offset);
    model.scale = scale.empty() ? std::vector<double>(n, 1.0) : std::move(scale);
    constexpr double infinity = std::numeric_limits<double>::infinity();
    model.domain.assign(n, ValueRange{-infinity, infinity});
    model.residual = std::move(residual);
    return model;
}

[[nodiscard]] PyGuardNetwork guard_network_from(const py::bytes& content, const std::string& name,
                                                std::vector<std::size_t> components)
{
    const std::string_view text = content;
    Model model = parse_model(std::as_bytes(std::span(text.data(), text.size())), name);
    return {std::move(model), std::move(components)};
}

[[nodiscard]] py::bytes bytes_of_guard(const PyGuardNetwork& self)
{
    const std::vector<std::byte> bytes = to_safetensors(self.model());
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

void bind_guard_network(py::module_& module)
{
    py::class_<PyGuardNetwork>(module, "GuardNetwork")
        .def_static("from_file", &guard_network_from)
        .def_static(
            "from_layers",
            [](const std::vector<std::pair<RowsOfInputs, RowsOfInputs>>& layers,
               const std::string& activation, std::vector<double> offset, std::vector<double> scale,
               std::vector<std::size_t> residual, std::vector<std::size_t> components) {
                return PyGuardNetwork(model_of_layers(layers, activation, std::move(offset),
                                                      std::move(scale), std::move(residual)),
                                      std::move(components));
            })
        .def("to_bytes", &bytes_of_guard)
        .def_property_readonly("components",
                               [](const PyGuardNetwork& self) { return self.components(); })
        .def_property_readonly("least", &PyGuardNetwork::least)
        .def_property_readonly("inputs",
                               [](const PyGuardNetwork& self) { return self.network().inputs(); })
        .def_property_readonly("value_address",
                               [](const PyGuardNetwork&) {
                                   return reinterpret_cast<std::uintptr_t>(&PyGuardNetwork::value);
                               })
        .def_property_readonly("rate_address",
                               [](const PyGuardNetwork&) {
                                   return reinterpret_cast<std::uintptr_t>(&PyGuardNetwork::rate);
                               })
        .def_property_readonly(
            "address",
            [](const PyGuardNetwork& self) { return reinterpret_cast<std::uintptr_t>(&self); })
        .def("value", &value_of_guard)
        .def("gradient", &gradient_of_guard);
}

}  // namespace ricochet::python
