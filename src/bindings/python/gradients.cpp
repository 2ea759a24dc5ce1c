// The module `_gradients`: runs of formulas, networks and Python functions with parameters, and
// their gradients by the adjoint; what users call is in python/ricochet/_gradient.py.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "formula_code.hpp"
#include "ricochet/sensitivity/adjoint.hpp"
#include "ricochet/sensitivity/network.hpp"

namespace ricochet::python {

namespace {

using State = std::vector<double>;
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

[[nodiscard]] std::vector<double> vector_of(const Numbers& numbers)
{
    return {numbers.data(), numbers.data() + numbers.size()};
}

class Networks;

/// Arguments of a function of a system.
struct Point {
    double t;
    const double* x;
    const double* p;
    const Networks* networks = nullptr;
    std::size_t own = 0;  ///< parameters before those of the networks
};

/// A function of time, state and parameters, with its vector-Jacobian products.
class Function {
public:
    Function() = default;
    Function(const Function&) = delete;
    Function& operator=(const Function&) = delete;
    virtual ~Function() = default;
    [[nodiscard]] virtual std::size_t results() const noexcept = 0;
    virtual void value(const Point& at, double* out) const = 0;
    virtual void back(const Point& at, const double* weights, const Cotangent& to) const = 0;
};

using Code = FormulaCode;

/// A network and the place of its first parameter.
struct PlacedNetwork {
    DifferentiableMlp network;
    std::size_t first;
};

/// The networks of a system: they stand behind its own parameters.
class Networks {
public:
    void add(const Model& model)
    {
        DifferentiableMlp network(model);
        const std::size_t first = count_;
        count_ += network.parameters();
        all_.push_back({std::move(network), first});
    }
    /// The same with these parameters.
    [[nodiscard]] Networks with(std::span<const double> p) const
    {
        Networks out;
        out.count_ = count_;
        for (const PlacedNetwork& each : all_) {
            out.all_.push_back(
                {each.network.with(p.subspan(each.first, each.network.parameters())), each.first});
        }
        return out;
    }
    [[nodiscard]] std::size_t parameters() const noexcept { return count_; }
    [[nodiscard]] const PlacedNetwork& operator[](std::size_t i) const noexcept { return all_[i]; }
    [[nodiscard]] std::size_t size() const noexcept { return all_.size(); }

private:
    std::vector<PlacedNetwork> all_;
    std::size_t count_ = 0;
};

using Op = std::tuple<std::string, std::size_t, std::size_t, double>;

/// A formula: operations on results of operations before them.
class Program final : public Function {
public:
    Program(const std::vector<Op>& ops, std::vector<std::size_t> operands,
            std::vector<std::size_t> results)
        : operands_(std::move(operands)), results_(std::move(results))
    {
        for (const auto& [name, a, b, value] : ops) {
            const auto found = std::ranges::find(formula_names, name);
            if (found == formula_names.end()) {
                throw std::invalid_argument("formula: found no operation '" + name + "'");
            }
            ops_.push_back({static_cast<Code>(found - formula_names.begin()), a, b, value});
        }
    }

    [[nodiscard]] std::size_t results() const noexcept override { return results_.size(); }

    void value(const Point& at, double* out) const override
    {
        std::vector<double>& v = evaluated(at);
        for (std::size_t i = 0; i < results_.size(); ++i) out[i] = v[results_[i]];
    }

    void back(const Point& at, const double* weights, const Cotangent& to) const override
    {
        std::vector<double>& v = evaluated(at);
        thread_local std::vector<double> w;
        w.assign(ops_.size(), 0.0);
        for (std::size_t i = 0; i < results_.size(); ++i) w[results_[i]] += weights[i];
        for (std::size_t i = ops_.size(); i-- > 0;) {
            const Each& op = ops_[i];
            if (op.code == Code::network) {
                back_through_network(op, i, at, v, w, to);
            } else if (w[i] != 0) {
                back_through(op, i, v, w, to);
            }
        }
    }

private:
    struct Each {
        Code code;
        std::size_t a, b;
        double value;
    };

    [[nodiscard]] std::vector<double>& evaluated(const Point& at) const
    {
        thread_local std::vector<double> v, in, out;
        v.resize(ops_.size());
        for (std::size_t i = 0; i < ops_.size(); ++i) {
            const Each& op = ops_[i];
            switch (op.code) {
                case Code::component: v[i] = at.x[op.a]; break;
                case Code::time: v[i] = at.t; break;
                case Code::parameter: v[i] = at.p[op.a]; break;
                case Code::constant: v[i] = op.value; break;
                case Code::network: {
                    // Its outputs are the operations behind it.
                    const DifferentiableMlp& network = (*at.networks)[op.a].network;
                    gather(op, v, network.inputs(), in);
                    out.resize(network.outputs());
                    network.forward(in.data(), out.data());
                    for (std::size_t k = 0; k < out.size(); ++k) v[i + 1 + k] = out[k];
                    i += out.size();
                    break;
                }
                case Code::output: break;
                default: v[i] = apply(op.code, v[op.a], v[op.b]);
            }
        }
        return v;
    }

    void gather(const Each& op, const std::vector<double>& v, std::size_t n,
                std::vector<double>& in) const
    {
        in.resize(n);
        for (std::size_t k = 0; k < n; ++k) in[k] = v[operands_[op.b + k]];
    }

    void back_through(const Each& op, std::size_t i, const std::vector<double>& v,
                      std::vector<double>& w, const Cotangent& to) const
    {
        const double by = w[i];
        switch (op.code) {
            case Code::component: to.x[op.a] += by; return;
            case Code::time: to.t += by; return;
            case Code::parameter: to.p[op.a] += by; return;
            case Code::constant: return;
            case Code::output: return;
            default: break;
        }
        const double a = v[op.a], b = v[op.b], f = v[i];
        const auto one = [&](double slope) { w[op.a] += by * slope; };
        const auto two = [&](double by_a, double by_b) {
            w[op.a] += by * by_a;
            w[op.b] += by * by_b;
        };
        switch (op.code) {
            case Code::add: return two(1, 1);
            case Code::subtract: return two(1, -1);
            case Code::multiply: return two(b, a);
            case Code::divide: return two(1 / b, -f / b);
            case Code::power: {
                const bool constant = ops_[op.b].code == Code::constant;
                return two(b == 0 ? 0 : b * std::pow(a, b - 1), constant ? 0 : f * std::log(a));
            }
            case Code::atan2: return two(b / (a * a + b * b), -a / (a * a + b * b));
            case Code::hypot: return two(a / f, b / f);
            case Code::negate: return one(-1);
            case Code::sqrt: return one(0.5 / f);
            case Code::cbrt: return one(1 / (3 * f * f));
            case Code::exp: return one(f);
            case Code::log: return one(1 / a);
            case Code::sin: return one(std::cos(a));
            case Code::cos: return one(-std::sin(a));
            case Code::tan: return one(1 + f * f);
            case Code::asin: return one(1 / std::sqrt(1 - a * a));
            case Code::acos: return one(-1 / std::sqrt(1 - a * a));
            case Code::atan: return one(1 / (1 + a * a));
            case Code::sinh: return one(std::cosh(a));
            case Code::cosh: return one(std::sinh(a));
            default: return one(1 - f * f);
        }
    }

    void back_through_network(const Each& op, std::size_t i, const Point& at,
                              const std::vector<double>& v, std::vector<double>& w,
                              const Cotangent& to) const
    {
        const PlacedNetwork& placed = (*at.networks)[op.a];
        thread_local std::vector<double> in, by_in;
        gather(op, v, placed.network.inputs(), in);
        by_in.assign(in.size(), 0.0);
        placed.network.vjp(in.data(), w.data() + i + 1, by_in.data(),
                           to.p.data() + at.own + placed.first);
        for (std::size_t k = 0; k < in.size(); ++k) w[operands_[op.b + k]] += by_in[k];
    }

    std::vector<Each> ops_;
    std::vector<std::size_t> operands_, results_;
};

/// A function of Python; its products are differences of fourth order.
class Callback final : public Function {
public:
    Callback(py::object function, std::size_t components, std::size_t parameters,
             std::size_t results)
        : function_(std::move(function)), n_(components), m_(parameters), results_(results)
    {
    }
    [[nodiscard]] std::size_t results() const noexcept override { return results_; }

    void value(const Point& at, double* out) const override
    {
        const auto n = static_cast<py::ssize_t>(n_), m = static_cast<py::ssize_t>(m_);
        const py::object returned = function_(at.t, Numbers(n, at.x), Numbers(m, at.p));
        const Numbers numbers = py::cast<Numbers>(returned);
        if (static_cast<std::size_t>(numbers.size()) != results_) {
            throw std::invalid_argument("gradient: found a function that returned " +
                                        std::to_string(numbers.size()) + " numbers, expected " +
                                        std::to_string(results_));
        }
        std::copy_n(numbers.data(), results_, out);
    }

    void back(const Point& at, const double* weights, const Cotangent& to) const override
    {
        std::vector<double> x(at.x, at.x + n_), p(at.p, at.p + m_);
        double t = at.t;
        const auto product = [&] {
            std::vector<double> out(results_);
            value({t, x.data(), p.data()}, out.data());
            double sum = 0;
            for (std::size_t i = 0; i < results_; ++i) sum += weights[i] * out[i];
            return sum;
        };
        const auto slope = [&](double& number) {
            const double from = number;
            const double h = 1e-3 * std::max(1.0, std::fabs(from));
            double sum = 0;
            for (std::size_t k = 0; k < 4; ++k) {
                number = from + detail::central_stencil.offset[k] * h;
                sum += detail::central_stencil.weight[k] / h * product();
            }
            number = from;
            return sum;
        };
        to.t += slope(t);
        for (std::size_t i = 0; i < n_; ++i) to.x[i] += slope(x[i]);
        for (std::size_t j = 0; j < m_; ++j) to.p[j] += slope(p[j]);
    }

private:
    py::object function_;
    std::size_t n_, m_, results_;
};

using Shared = std::shared_ptr<const Function>;

/// What a guard is, and its functions in each mode; null where it has none.
struct PyGuard {
    std::string name;
    GuardInfo info;
    std::vector<Shared> value, reset, rest;
    std::vector<Mode> next, next_of_rest;
};

/// The functions of a system, for any values of its parameters.
struct Recorded {
    std::size_t components = 0;
    std::size_t own = 0;  ///< parameters without those of networks
    std::vector<Shared> flow, time_reset;
    std::vector<Mode> next_of_time_reset;
    std::vector<PyGuard> guards;
    Times times{std::vector<double>{}};
    bool calls_python = false;
    Networks networks;  ///< with any values

    [[nodiscard]] bool rests() const
    {
        return std::ranges::any_of(guards, [](const PyGuard& each) { return !each.rest.empty(); });
    }
};

/// A system of such functions with values of its parameters.
template <bool rests>
class PySystemOf {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;

    PySystemOf(std::shared_ptr<const Recorded> of, std::shared_ptr<const Networks> networks,
               std::vector<double> p)
        : of_(std::move(of)), networks_(std::move(networks)), p_(std::move(p))
    {
    }

    [[nodiscard]] std::size_t parameter_count() const noexcept { return p_.size(); }
    [[nodiscard]] std::size_t mode_count() const noexcept { return of_->flow.size(); }
    [[nodiscard]] std::size_t guard_count() const noexcept { return of_->guards.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return of_->guards[which].info; }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return of_->guards[which].value[mode] != nullptr;
    }

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        of_->flow[mode]->value(at(t, x), dxdt.data());
    }
    void flow_vjp(Mode mode, double t, const State& x, const State& w, const Cotangent& to) const
    {
        of_->flow[mode]->back(at(t, x), w.data(), to);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        double g = 1;
        if (const Shared& f = of_->guards[which].value[mode]) f->value(at(t, x), &g);
        return g;
    }
    void guard_vjp(std::size_t which, Mode mode, double t, const State& x, double w,
                   const Cotangent& to) const
    {
        if (const Shared& f = of_->guards[which].value[mode]) f->back(at(t, x), &w, to);
    }
    /// (dg/dx) s, of which the rules for events ask.
    [[nodiscard]] double guard_derivative(std::size_t which, Mode mode, double t, const State& x,
                                          const State& s) const
    {
        State by_x(x.size(), 0.0), by_p(p_.size(), 0.0);
        double by_t = 0, along = 0;
        guard_vjp(which, mode, t, x, 1, {by_x, by_t, by_p});
        for (std::size_t i = 0; i < x.size(); ++i) along += by_x[i] * s[i];
        return along;
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& x) const
    {
        const PyGuard& guard = of_->guards[which];
        return apply(guard.reset, guard.next, mode, t, x);
    }
    void reset_vjp(std::size_t which, Mode mode, double t, const State& x, const State& w,
                   const Cotangent& to) const
    {
        back(of_->guards[which].reset, mode, t, x, w, to);
    }
    [[nodiscard]] Mode rest(std::size_t which, Mode mode, double t, State& x) const requires rests
    {
        const PyGuard& guard = of_->guards[which];
        return apply(guard.rest, guard.next_of_rest, mode, t, x);
    }
    void rest_vjp(std::size_t which, Mode mode, double t, const State& x, const State& w,
                  const Cotangent& to) const
    {
        back(of_->guards[which].rest, mode, t, x, w, to);
    }
    [[nodiscard]] double next_time_event(double t) const { return of_->times.next(t); }
    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x) const
    {
        return apply(of_->time_reset, of_->next_of_time_reset, mode, t, x);
    }
    void time_reset_vjp(Mode mode, double t, const State& x, const State& w,
                        const Cotangent& to) const
    {
        back(of_->time_reset, mode, t, x, w, to);
    }

private:
    [[nodiscard]] Point at(double t, const State& x) const
    {
        return {t, x.data(), p_.data(), networks_.get(), of_->own};
    }

    [[nodiscard]] Mode apply(const std::vector<Shared>& functions, const std::vector<Mode>& next,
                             Mode mode, double t, State& x) const
    {
        if (functions.empty() || !functions[mode]) return mode;
        State after(functions[mode]->results());
        functions[mode]->value(at(t, x), after.data());
        x = std::move(after);
        return next[mode];
    }
    void back(const std::vector<Shared>& functions, Mode mode, double t, const State& x,
              const State& w, const Cotangent& to) const
    {
        if (functions.empty() || !functions[mode]) {
            for (std::size_t i = 0; i < x.size(); ++i) to.x[i] += w[i];
        } else {
            functions[mode]->back(at(t, x), w.data(), to);
        }
    }

    std::shared_ptr<const Recorded> of_;
    std::shared_ptr<const Networks> networks_;
    std::vector<double> p_;
};

/// Options as Python gives them.
[[nodiscard]] Options options_of(const py::dict& given)
{
    Options o;
    o.t_start = given["t_start"].cast<double>();
    o.t_end = given["t_end"].cast<double>();
    o.mode = given["mode"].cast<Mode>();
    o.step = given["step"].cast<double>();
    o.rtol = given["rtol"].cast<double>();
    o.atol = given["atol"].cast<double>();
    o.stop_at_event = given["stop_at_event"].cast<bool>();
    o.max_steps = given["max_steps"].cast<std::uint64_t>();
    o.sample_times = given["sample_times"].cast<std::vector<double>>();
    return o;
}

[[nodiscard]] MethodByName method_of(const std::string& spelled)
{
    const auto found = method_named(spelled);
    if (!found) {
        throw std::invalid_argument("method: found '" + spelled + "', expected " +
                                    detail::spelled_methods(false, "'"));
    }
    return {*found};
}

/// A run and the system of it.
template <bool rests>
[[nodiscard]] Adjoint<State> run_system(const PySystemOf<rests>& system, const State& x0,
                                        const Options& options, const MethodByName& method)
{
    if (options.step > 0 || !estimates_error(method.name)) {
        return adjoint(system, x0, options, FixedStep<MethodByName>{method});
    }
    return adjoint(system, x0, options, ErrorControlled<MethodByName>{method});
}

/// Values of the parameters of a system: its own, and those of each network.
struct Values {
    std::vector<double> p;
    std::shared_ptr<const Networks> networks;

    Values(const Recorded& of, const Numbers& own, const std::vector<Numbers>& given)
        : p(vector_of(own))
    {
        if (p.size() != of.own) {
            throw std::invalid_argument("args: found " + std::to_string(p.size()) +
                                        " numbers, expected " + std::to_string(of.own));
        }
        for (const Numbers& each : given) p.insert(p.end(), each.data(), each.data() + each.size());
        const std::span<const double> weights = std::span(std::as_const(p)).subspan(of.own);
        if (weights.size() != of.networks.parameters()) {
            throw std::invalid_argument("networks: found " + std::to_string(weights.size()) +
                                        " parameters, expected " +
                                        std::to_string(of.networks.parameters()));
        }
        networks = std::make_shared<const Networks>(of.networks.with(weights));
    }
};

[[nodiscard]] Adjoint<State> run_recorded(const std::shared_ptr<const Recorded>& of,
                                          const Values& values, const State& start,
                                          const Options& options, const MethodByName& method)
{
    if (start.size() != of->components) {
        throw std::invalid_argument("x0: found " + std::to_string(start.size()) +
                                    " numbers, expected " + std::to_string(of->components));
    }
    if (options.mode >= of->flow.size()) throw std::invalid_argument("mode: found an unknown one");
    if (of->rests()) {
        return run_system(PySystemOf<true>(of, values.networks, values.p), start, options, method);
    }
    return run_system(PySystemOf<false>(of, values.networks, values.p), start, options, method);
}

/// Calls `work` without the interpreter where no function needs it.
template <class Work>
auto without_interpreter(const Recorded& of, const Work& work)
{
    if (of.calls_python) return work();
    const py::gil_scoped_release others;
    return work();
}

/// Derivatives of the state at the end: a row for each component, columns for the start and the
/// parameters.
[[nodiscard]] Eigen::MatrixXd rows_of_end(const Adjoint<State>& run)
{
    const std::size_t n = run.run().x.size();
    Eigen::MatrixXd rows;
    for (std::size_t i = 0; i < n; ++i) {
        LossSlopes<State> unit{.end = State(n, 0.0)};
        (*unit.end)[i] = 1;
        const Gradient by = run.gradient(unit);
        const auto a = static_cast<Eigen::Index>(by.start.size());
        const auto b = static_cast<Eigen::Index>(by.parameters.size());
        if (i == 0) rows.resize(static_cast<Eigen::Index>(n), a + b);
        const auto row = static_cast<Eigen::Index>(i);
        rows.row(row).head(a) = Eigen::Map<const Eigen::RowVectorXd>(by.start.data(), a);
        rows.row(row).tail(b) = Eigen::Map<const Eigen::RowVectorXd>(by.parameters.data(), b);
    }
    return rows;
}

[[nodiscard]] py::array array_of_matrix(const Eigen::MatrixXd& matrix)
{
    py::array out = new_array<double>({matrix.rows(), matrix.cols()});
    auto* to = static_cast<double*>(out.mutable_data());
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        for (Eigen::Index j = 0; j < matrix.cols(); ++j) *to++ = matrix(i, j);
    }
    return out;
}

template <class Rows>
[[nodiscard]] py::array array_of_rows(const Rows& rows, std::size_t width)
{
    py::array out =
        new_array<double>({static_cast<py::ssize_t>(rows.size()), static_cast<py::ssize_t>(width)});
    auto* to = static_cast<double*>(out.mutable_data());
    for (const State& row : rows) {
        // A state of another dimension is filled up.
        for (std::size_t i = 0; i < width; ++i) {
            *to++ = i < row.size() ? row[i] : std::numeric_limits<double>::quiet_NaN();
        }
    }
    return out;
}

class PyAdjoint {
public:
    PyAdjoint(std::shared_ptr<const Recorded> of, const Numbers& x0, const Numbers& own,
              const std::vector<Numbers>& networks, const py::dict& options,
              const std::string& method)
        : of_(std::move(of)), run_([&] {
              const Values values(*of_, own, networks);
              const State start = vector_of(x0);
              const Options all = options_of(options);
              const MethodByName by = method_of(method);
              return without_interpreter(*of_,
                                         [&] { return run_recorded(of_, values, start, all, by); });
          }())
    {
    }

    [[nodiscard]] const Run<State>& run() const noexcept { return run_.run(); }
    [[nodiscard]] std::size_t bytes() const noexcept { return run_.bytes(); }

    [[nodiscard]] py::object undefined() const
    {
        if (!run_.undefined_at()) return py::none();
        const UndefinedAt& at = *run_.undefined_at();
        return py::make_tuple(at.event, std::string(name(at.reason)),
                              std::string(describe(at.reason)));
    }

    [[nodiscard]] py::tuple gradient(const std::optional<Numbers>& end,
                                     const std::optional<Numbers>& samples,
                                     const std::optional<Numbers>& times,
                                     const std::optional<Numbers>& before,
                                     const std::optional<Numbers>& after) const
    {
        LossSlopes<State> slopes;
        if (end) slopes.end = vector_of(*end);
        if (samples && samples->size() > 0) slopes.samples = rows_of(*samples);
        add_events(times, before, after, slopes);
        const Gradient by = without_interpreter(*of_, [&] { return run_.gradient(slopes); });
        const std::span<const double> p(by.parameters);
        py::list networks;
        for (std::size_t i = 0; i < of_->networks.size(); ++i) {
            const PlacedNetwork& each = of_->networks[i];
            networks.append(array_of(p.subspan(of_->own + each.first, each.network.parameters())));
        }
        return py::make_tuple(array_of(by.start), array_of(p.first(of_->own)), networks,
                              by.t_start);
    }

    [[nodiscard]] py::array end_rows() const
    {
        return array_of_matrix(without_interpreter(*of_, [&] { return rows_of_end(run_); }));
    }

private:
    void add_events(const std::optional<Numbers>& times, const std::optional<Numbers>& before,
                    const std::optional<Numbers>& after, LossSlopes<State>& slopes) const
    {
        if (!times && !before && !after) return;
        const std::size_t n = run().events.size();
        std::vector<EventSlope<State>> events(n);
        for (std::size_t k = 0; k < n; ++k) events[k].event = k;
        const auto require = [&](std::size_t given) {
            if (given != n) detail::throw_wrong_slopes("events", n, given);
        };
        if (times) {
            require(static_cast<std::size_t>(times->size()));
            for (std::size_t k = 0; k < n; ++k) events[k].t = times->data()[k];
        }
        const auto put = [&](const std::optional<Numbers>& given, auto member) {
            if (!given || (n == 0 && given->size() == 0)) return;
            std::vector<State> rows = rows_of(*given);
            require(rows.size());
            for (std::size_t k = 0; k < n; ++k) events[k].*member = std::move(rows[k]);
        };
        put(before, &EventSlope<State>::before);
        put(after, &EventSlope<State>::after);
        slopes.events = std::move(events);
    }

    [[nodiscard]] static std::vector<State> rows_of(const Numbers& given)
    {
        if (given.ndim() != 2) {
            throw std::invalid_argument("gradient: found an array of " +
                                        std::to_string(given.ndim()) +
                                        " dimensions, expected two: a row for each");
        }
        const auto rows = static_cast<std::size_t>(given.shape(0));
        const auto width = static_cast<std::size_t>(given.shape(1));
        std::vector<State> out;
        for (std::size_t k = 0; k < rows; ++k) {
            out.emplace_back(given.data() + k * width, given.data() + (k + 1) * width);
        }
        return out;
    }

    std::shared_ptr<const Recorded> of_;
    Adjoint<State> run_;
};

/// A periodic orbit by shooting, as a dictionary.
// Long: one list of what is given, of the shot that the search repeats, and of what it has found.
[[nodiscard]] py::dict find_orbit(const std::shared_ptr<const Recorded>& of, const Numbers& guess,
                                  const Numbers& own, const std::vector<Numbers>& networks,
                                  const py::dict& options, const std::string& method, double period,
                                  bool autonomous, double tolerance, int max_iterations)
{
    const Values values(*of, own, networks);
    const Options all = options_of(options);
    const MethodByName by = method_of(method);
    const Shooting shooting{.period = period,
                            .autonomous = autonomous,
                            .tolerance = tolerance,
                            .max_iterations = max_iterations};
    validate(shooting);
    const auto rate_at = [&](Mode mode, double t, const State& x) {
        State rate(x.size());
        of->flow[mode]->value({t, x.data(), values.p.data(), values.networks.get(), of->own},
                              rate.data());
        return detail::vector_of(rate);
    };
    bool first = true;
    const auto shoot = [&](const Eigen::VectorXd& v, double length) -> detail::Shot {
        Options one = all;
        one.t_end = all.t_start + length;
        const auto x = detail::state_from<State>(v);
        try {
            const Adjoint<State> run = run_recorded(of, values, x, one, by);
            first = false;
            const Run<State>& end = run.run();
            detail::Shot shot{.problem = ShootingEnd::closed,
                              .end = detail::vector_of(end.x),
                              .monodromy = rows_of_end(run).leftCols(v.size()),
                              .start_rate = rate_at(all.mode, all.t_start, x),
                              .end_rate = rate_at(end.mode, end.t, end.x)};
            if (end.outcome != Outcome::reached_end) {
                shot.problem = ShootingEnd::run_ended;
            } else if (end.mode != all.mode || end.x.size() != x.size()) {
                shot.problem = ShootingEnd::other_mode;
            } else if (!shot.monodromy.allFinite()) {
                shot.problem = ShootingEnd::undefined_derivative;
            }
            return shot;
        } catch (const std::invalid_argument&) {
            if (first) throw;
            return {.problem = ShootingEnd::run_ended};
        }
    };
    const State start = vector_of(guess);
    const detail::ShotOrbit found = without_interpreter(
        *of, [&] { return detail::shoot_orbit(shoot, detail::vector_of(start), shooting); });
    py::dict out;
    out["converged"] = found.end == ShootingEnd::closed;
    out["end"] = std::string(name(found.end));
    out["message"] = std::string(describe(found.end));
    out["x"] = array_of(detail::state_from<State>(found.x));
    out["period"] = found.period;
    out["residual"] = found.residual;
    out["iterations"] = found.iterations;
    out["monodromy"] = array_of_matrix(found.monodromy);
    std::vector<std::complex<double>> multipliers(found.multipliers.begin(),
                                                  found.multipliers.end());
    out["multipliers"] = multipliers;
    return out;
}

[[nodiscard]] std::vector<Shared> functions_of(const py::handle& given)
{
    std::vector<Shared> out;
    for (const py::handle each : given) {
        out.push_back(each.is_none() ? nullptr : each.cast<std::shared_ptr<Function>>());
    }
    return out;
}

[[nodiscard]] PyGuard guard_of(const py::handle& given)
{
    PyGuard guard;
    guard.name = given["name"].cast<std::string>();
    const int direction = given["direction"].cast<int>();
    guard.info.crossing = direction < 0   ? Crossing::falling
                          : direction > 0 ? Crossing::rising
                                          : Crossing::either;
    guard.info.unilateral = given["unilateral"].cast<bool>();
    guard.info.boolean = given["boolean"].cast<bool>();
    guard.info.touch = given["touch"].cast<double>();
    guard.info.stop_after = given["stop_after"].cast<std::uint32_t>();
    guard.value = functions_of(given["value"]);
    guard.reset = functions_of(given["reset"]);
    guard.rest = functions_of(given["rest"]);
    guard.next = given["next"].cast<std::vector<Mode>>();
    guard.next_of_rest = given["next_of_rest"].cast<std::vector<Mode>>();
    guard.info.resets = !guard.reset.empty();
    return guard;
}

[[nodiscard]] Model model_of(const py::handle& given)
{
    const auto [activation, layers] =
        given.cast<std::pair<std::string, std::vector<std::pair<Numbers, Numbers>>>>();
    if (activation != "relu" && activation != "tanh") {
        throw std::invalid_argument("network: found the activation '" + activation +
                                    "', expected 'relu' or 'tanh'");
    }
    Model model;
    model.activation = activation == "relu" ? Activation::relu : Activation::tanh;
    model.precision = Precision::f64;
    for (const auto& [weight, bias] : layers) {
        if (weight.ndim() != 2)
            throw std::invalid_argument("network: found weights that are no matrix");
        model.layers.push_back({static_cast<std::size_t>(weight.shape(1)),
                                static_cast<std::size_t>(weight.shape(0)), vector_of(weight),
                                vector_of(bias)});
    }
    return model;
}

[[nodiscard]] std::shared_ptr<Recorded> recorded_of(const py::dict& given)
{
    auto out = std::make_shared<Recorded>();
    out->components = given["components"].cast<std::size_t>();
    out->own = given["own"].cast<std::size_t>();
    out->flow = functions_of(given["flow"]);
    out->time_reset = functions_of(given["time_reset"]);
    out->next_of_time_reset = given["next_of_time_reset"].cast<std::vector<Mode>>();
    for (const py::handle each : given["guards"]) {
        out->guards.push_back(guard_of(each));
    }
    // Names are kept where they do not move any more.
    for (PyGuard& each : out->guards) each.info.name = each.name;
    out->times = Times(given["times"].cast<std::vector<double>>());
    out->calls_python = given["calls_python"].cast<bool>();
    for (const py::handle each : given["networks"]) out->networks.add(model_of(each));
    return out;
}

/// The value of a formula of numbers x, and its derivatives.
[[nodiscard]] py::tuple value_and_slopes(const Program& program, const Numbers& x)
{
    double value = 0, t = 0;
    const double one = 1;
    std::vector<double> by_x(static_cast<std::size_t>(x.size()), 0.0);
    const Point at{0, x.data(), nullptr};
    program.value(at, &value);
    program.back(at, &one, {by_x, t, {}});
    return py::make_tuple(value, array_of(by_x));
}

template <class Of>
[[nodiscard]] py::list of_events(const Run<State>& run, const Of& of)
{
    py::list out;
    for (const Event<State>& event : run.events) out.append(of(event));
    return out;
}

[[nodiscard]] py::array states_of_events(const Run<State>& run, State Event<State>::*side)
{
    std::vector<State> rows;
    for (const Event<State>& event : run.events) rows.push_back(event.*side);
    return array_of_rows(rows, run.x.size());
}

}  // namespace

}  // namespace ricochet::python

namespace py = pybind11;

// Long: a list of what the module has.
PYBIND11_MODULE(_gradients, module)
{
    using namespace ricochet;
    using namespace ricochet::python;
    using Of = Event<python::State>;
    py::class_<Function, std::shared_ptr<Function>>(module, "Function");
    py::class_<Program, Function, std::shared_ptr<Program>>(module, "Program")
        .def(py::init<const std::vector<Op>&, std::vector<std::size_t>, std::vector<std::size_t>>())
        .def("value_and_slopes", &value_and_slopes);
    py::class_<Callback, Function, std::shared_ptr<Callback>>(module, "Callback")
        .def(py::init<py::object, std::size_t, std::size_t, std::size_t>());
    py::class_<Recorded, std::shared_ptr<Recorded>>(module, "Recorded").def(py::init(&recorded_of));
    py::class_<PyAdjoint>(module, "Adjoint")
        .def(py::init<std::shared_ptr<const Recorded>, const Numbers&, const Numbers&,
                      const std::vector<Numbers>&, const py::dict&, const std::string&>())
        .def("gradient", &PyAdjoint::gradient)
        .def("end_rows", &PyAdjoint::end_rows)
        .def_property_readonly("t", [](const PyAdjoint& self) { return self.run().t; })
        .def_property_readonly("x", [](const PyAdjoint& self) { return array_of(self.run().x); })
        .def_property_readonly("mode", [](const PyAdjoint& self) { return self.run().mode; })
        .def_property_readonly(
            "outcome", [](const PyAdjoint& self) { return std::string(name(self.run().outcome)); })
        .def_property_readonly("message",
                               [](const PyAdjoint& self) { return describe(self.run()); })
        .def_property_readonly("steps",
                               [](const PyAdjoint& self) { return self.run().statistics.steps; })
        .def_property_readonly("bytes", &PyAdjoint::bytes)
        .def_property_readonly("undefined", &PyAdjoint::undefined)
        .def_property_readonly(
            "sample_t", [](const PyAdjoint& self) { return array_of(self.run().trajectory.t); })
        .def_property_readonly("samples",
                               [](const PyAdjoint& self) {
                                   return array_of_rows(self.run().trajectory.x,
                                                        self.run().x.size());
                               })
        .def_property_readonly("event_t",
                               [](const PyAdjoint& self) {
                                   std::vector<double> t;
                                   for (const Of& each : self.run().events) t.push_back(each.t);
                                   return array_of(t);
                               })
        .def_property_readonly("event_guard",
                               [](const PyAdjoint& self) {
                                   return of_events(self.run(), [](const Of& event) {
                                       return event.guard == no_guard
                                                  ? py::object(py::none())
                                                  : py::object(py::int_(event.guard));
                                   });
                               })
        .def_property_readonly("event_kind",
                               [](const PyAdjoint& self) {
                                   return of_events(self.run(), [](const Of& event) {
                                       return py::str(std::string(name(event.kind)));
                                   });
                               })
        .def_property_readonly(
            "before",
            [](const PyAdjoint& self) { return states_of_events(self.run(), &Of::before); })
        .def_property_readonly("after", [](const PyAdjoint& self) {
            return states_of_events(self.run(), &Of::after);
        });
    module.def("find_orbit", &find_orbit);
}
