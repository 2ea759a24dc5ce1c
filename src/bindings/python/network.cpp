#include "network.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "results.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::python {

PyNetwork::PyNetwork(Model model)
    : model_(std::make_shared<const Model>(std::move(model))), classifier_(*model_)
{
    if (model_->kind == "gate-horizon" || model_->kind == "gate-level") gate_.emplace(*model_);
    if (!model_->certificate.empty() && why_void(*model_).empty()) certified_.emplace(*model_);
}

namespace {

using Features = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Rows of features; a single state is one row.
class Rows {
public:
    Rows(const Features& features, std::size_t width)
        : data_(features.data()), width_(width), single_(features.ndim() == 1)
    {
        const py::ssize_t last = features.ndim() > 0 ? features.shape(features.ndim() - 1) : 0;
        if (features.ndim() < 1 || features.ndim() > 2 || static_cast<std::size_t>(last) != width) {
            throw py::value_error("features: found shape " +
                                  py::cast<std::string>(py::str(features.attr("shape"))) +
                                  ", expected (" + std::to_string(width) + ",) or (n, " +
                                  std::to_string(width) + ")");
        }
        count_ = single_ ? 1 : features.shape(0);
    }

    /// Returns an array with one T for each row, or a NumPy scalar for a single state.
    template <class T, class Answer>
    [[nodiscard]] py::object answers(const Answer& answer) const
    {
        py::array out =
            new_array<T>(single_ ? std::vector<py::ssize_t>{} : std::vector<py::ssize_t>{count_});
        T* const to = static_cast<T*>(out.mutable_data());
        {
            const py::gil_scoped_release others;
            for (py::ssize_t i = 0; i < count_; ++i) to[i] = answer(row(i));
        }
        if (single_) return out.attr("item")();
        return out;
    }
    [[nodiscard]] py::array logits(const Classifier& classifier) const
    {
        const auto width = static_cast<py::ssize_t>(classifier.outputs());
        py::array out = new_array<double>(single_ ? std::vector<py::ssize_t>{width}
                                                  : std::vector<py::ssize_t>{count_, width});
        auto* const to = static_cast<double*>(out.mutable_data());
        const py::gil_scoped_release others;
        for (py::ssize_t i = 0; i < count_; ++i) classifier.logits(row(i), to + i * width);
        return out;
    }

private:
    [[nodiscard]] const double* row(py::ssize_t i) const noexcept
    {
        return data_ + static_cast<std::size_t>(i) * width_;
    }

    const double* data_;
    std::size_t width_;
    bool single_;
    py::ssize_t count_ = 0;
};

[[nodiscard]] py::array pairs(const std::vector<ValueRange>& intervals)
{
    py::array out = new_array<double>({static_cast<py::ssize_t>(intervals.size()), 2});
    auto* to = static_cast<double*>(out.mutable_data());
    for (const ValueRange& interval : intervals) {
        *to++ = interval.lower;
        *to++ = interval.upper;
    }
    return out;
}

[[nodiscard]] const Model& model_of(const py::object& self)
{
    return *py::cast<const PyNetwork&>(self).model();
}

[[nodiscard]] py::bytes bytes_of_file(const PyNetwork& self)
{
    const std::vector<std::byte> bytes = to_safetensors(*self.model());
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

[[nodiscard]] PyNetwork network_from(const py::bytes& bytes, const std::string& name)
{
    const std::string_view text = bytes;
    return PyNetwork(parse_model(std::as_bytes(std::span(text.data(), text.size())), name));
}

[[nodiscard]] py::list layers_of(const py::object& self)
{
    py::list out;
    for (const DenseLayer& layer : model_of(self).layers) {
        const auto inputs = static_cast<py::ssize_t>(layer.inputs);
        const auto outputs = static_cast<py::ssize_t>(layer.outputs);
        out.append(py::make_tuple(view_of(layer.weight.data(), {outputs, inputs}, self),
                                  view_of(layer.bias.data(), {outputs}, self)));
    }
    return out;
}

[[nodiscard]] py::list levels_of(const Model& model)
{
    py::list out;
    for (const GateLevel& level : model.levels) {
        out.append(py::make_tuple(level.value, level.threshold));
    }
    return out;
}

[[nodiscard]] py::object calibration_of(const Model& model)
{
    const Calibration& c = model.calibration;
    if (c.events == 0) return py::none();
    using namespace py::literals;
    return py::dict("events"_a = c.events, "misses"_a = c.misses, "miss_bound"_a = c.miss_bound,
                    "steps"_a = c.steps, "seed"_a = c.seed);
}

using NetworkClass = py::class_<PyNetwork>;

[[nodiscard]] Rows rows(const PyNetwork& self, const Features& features)
{
    return Rows(features, self.classifier().inputs());
}

/// Binds what a network says about features.
void bind_answers(NetworkClass& network)
{
    network
        .def("__call__",
             [](const PyNetwork& self, const Features& features) {
                 return rows(self, features).logits(self.classifier());
             })
        .def(
            "alarm",
            [](const PyNetwork& self, const Features& features) {
                const Classifier& c = self.classifier();
                return rows(self, features).template answers<bool>([&](const double* x) {
                    return c.alarm(c.logit(x));
                });
            },
            "Whether an event is announced: the first output is not below the threshold.")
        .def(
            "in_domain",
            [](const PyNetwork& self, const Features& features) {
                const Classifier& c = self.classifier();
                return rows(self, features).template answers<bool>([&](const double* x) {
                    return c.in_domain(x);
                });
            },
            "Whether the features lie in the box that the network was trained for.")
        .def(
            "cleared",
            [](const PyNetwork& self, const Features& features) {
                const auto* const gate = self.gate();
                const auto* const certified = self.certified();
                if (!gate && !certified) {
                    throw py::type_error("cleared: found a model of the kind '" +
                                         self.model()->kind +
                                         "', expected a gate, or one with a certificate");
                }
                return rows(self, features).template answers<double>([&](const double* x) {
                    if (gate) return gate->in_domain(x) ? gate->cleared(x) : 0.0;
                    return certified->lower_bound(x);
                });
            },
            "Of a gate the largest horizon or level that it clears, 0 where it clears none; with a "
            "certificate the largest margin that the guard is proved to be above, -inf where it is "
            "above none.");
}

/// Binds what a network is for, and what is known about it.
void bind_metadata(NetworkClass& network)
{
    const auto meta = [](auto member) {
        return [member](const PyNetwork& self) { return (*self.model()).*member; };
    };
    network.def_property_readonly("kind", meta(&Model::kind), "What it is, e.g. 'gate-horizon'.")
        .def_property_readonly("system", meta(&Model::system), "The name of its system.")
        .def_property_readonly("parameters", meta(&Model::parameters),
                               "The parameters of the system that it depends on.")
        .def_property_readonly("recipe", meta(&Model::recipe),
                               "Name of the map from a state to its features.")
        .def_property_readonly("threshold", meta(&Model::threshold),
                               "An event is predicted where the output is not below it.")
        .def_property_readonly("seed", meta(&Model::seed), "The seed of its training.")
        .def_property_readonly(
            "step_range",
            [](const PyNetwork& self) {
                return std::pair(self.model()->step_min, self.model()->step_max);
            },
            "The smallest and the largest step that it was trained for.")
        .def_property_readonly(
            "levels", [](const PyNetwork& self) { return levels_of(*self.model()); },
            "Of a gate a tuple (value, threshold) for each level.")
        .def_property_readonly(
            "calibration", [](const PyNetwork& self) { return calibration_of(*self.model()); },
            "Misses of a gate on runs that it was not made from, as a dictionary, or "
            "None.")
        .def_property_readonly(
            "certified", [](const PyNetwork& self) { return self.certified() != nullptr; },
            "Whether it has a certificate that holds.");
}

/// Binds the numbers from which a network computes its outputs.
void bind_layers(NetworkClass& network)
{
    network
        .def_property_readonly(
            "activation",
            [](const PyNetwork& self) { return std::string(name(self.model()->activation)); },
            "What follows every hidden layer.")
        .def_property_readonly(
            "precision",
            [](const PyNetwork& self) {
                return self.model()->precision == Precision::f32 ? "f32" : "f64";
            },
            "How its weights are stored and evaluated.")
        .def_property_readonly(
            "domain", [](const PyNetwork& self) { return pairs(self.model()->domain); },
            "The box that it was trained in, a row (lower, upper) for each feature.")
        .def_property_readonly(
            "inputs", [](const PyNetwork& self) { return self.classifier().inputs(); },
            "How many features it takes.")
        .def_property_readonly(
            "outputs", [](const PyNetwork& self) { return self.classifier().outputs(); },
            "Number of its outputs.")
        .def_property_readonly("layers", &layers_of,
                               "A tuple (weight, bias) for each layer, as views.")
        .def_property_readonly(
            "offset",
            [](const py::object& self) {
                const auto& offset = model_of(self).offset;
                return view_of(offset.data(), {static_cast<py::ssize_t>(offset.size())}, self);
            },
            "What is subtracted from the features.")
        .def_property_readonly(
            "scale",
            [](const py::object& self) {
                const auto& scale = model_of(self).scale;
                return view_of(scale.data(), {static_cast<py::ssize_t>(scale.size())}, self);
            },
            "What they are multiplied with then.");
}

}  // namespace

void bind_network(py::module_& module)
{
    NetworkClass network(module, "Network");
    network.def(py::init(&network_from))
        .def(py::init<const PyNetwork&>())
        .def("to_bytes", &bytes_of_file, "The bytes of its file.");
    bind_answers(network);
    bind_metadata(network);
    bind_layers(network);
}

}  // namespace ricochet::python
