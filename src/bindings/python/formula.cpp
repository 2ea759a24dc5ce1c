#include "formula.hpp"

#include "formula_rate.hpp"
#include "formula_series.hpp"
#include "ricochet/taylor/detail/taylor_adapter.hpp"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace ricochet::python {

namespace {

/// Operations of formulas without networks.
constexpr auto plain =
    std::span(formula_names).first<static_cast<std::size_t>(FormulaCode::parameter) + 1>();

}  // namespace

Formula::Formula(std::size_t components,
                 const std::vector<std::tuple<std::string, std::size_t, std::size_t, double>>& ops,
                 std::vector<std::size_t> outputs)
    : components_(components),
      outputs_(std::move(outputs)),
      code_(std::make_unique<LateCode<ValuesCode>>())
{
    for (const auto& [name, a, b, value] : ops) {
        const auto found = std::ranges::find(plain, name);
        if (found == plain.end()) {
            throw std::invalid_argument("formula: found no operation '" + name + "'");
        }
        const auto code = static_cast<FormulaCode>(found - plain.begin());
        const bool is_parameter = code == FormulaCode::parameter;
        if (is_parameter) parameters_ = std::max(parameters_, a + 1);
        const bool is_leaf = code <= FormulaCode::constant;
        const std::size_t before = code == FormulaCode::component ? components
                                   : is_parameter                 ? parameters_
                                   : is_leaf                      ? 1
                                                                  : ops_.size();
        if (std::max(a, b) >= before) {
            throw std::invalid_argument("formula: found an operand " +
                                        std::to_string(std::max(a, b)) + " of '" + name +
                                        "', expected one below " + std::to_string(before));
        }
        ops_.push_back({.code = code, .a = a, .b = b, .value = value});
    }
    for (const std::size_t output : outputs_) {
        if (output >= ops_.size()) {
            throw std::invalid_argument("formula: found a result " + std::to_string(output) +
                                        " of " + std::to_string(ops_.size()) + " operations");
        }
    }
}

namespace {

std::vector<double>& scratch()
{
    thread_local std::vector<double> values;
    return values;
}

}  // namespace

void Formula::interpret(double t, const double* x, const double* parameters, double* out) const
{
    // As many as a method of six stages asks for in fifty steps; less time than the code takes.
    constexpr std::uint32_t enough = 300;
    code_->count(enough, [&] { return code(); });
    evaluate(t, x, parameters, out, scratch());
}

Formula Formula::rate() const
{
    FormulaRate of(components_, ops_);
    const std::size_t result = of.derivative(outputs_.front());
    auto [ops, output] = of.only(result);
    return {2 * components_, parameters_, std::move(ops), {output}};
}

ModedFormula ModedFormula::rate() const
{
    ModedFormula out;
    for (const Formula& formula : by_mode) out.by_mode.push_back(formula.rate());
    return out;
}

double ModedFormula::value_along(std::uint32_t mode, double t, const double* x, const double* dxdt,
                                 const double* parameters) const
{
    thread_local std::vector<double> both;
    const std::size_t n = in(mode).components() / 2;
    both.resize(2 * n);
    std::copy_n(x, n, both.begin());
    std::copy_n(dxdt, n, both.begin() + static_cast<std::ptrdiff_t>(n));
    return value(mode, t, both.data(), parameters);
}

std::size_t ModedFormula::parameters() const noexcept
{
    std::size_t most = 0;
    for (const Formula& formula : by_mode) most = std::max(most, formula.parameters());
    return most;
}

double ModedFormula::value(std::uint32_t mode, double t, const double* x,
                           const double* parameters) const
{
    double out = 0;
    in(mode).compute(t, x, parameters, &out);
    return out;
}

std::uint32_t ModedFormula::edit(std::uint32_t mode, double t, double* x,
                                 const double* parameters) const
{
    thread_local std::vector<double> after;
    const Formula& formula = in(mode);
    after.resize(formula.components());
    formula.compute(t, x, parameters, after.data());
    std::copy(after.begin(), after.end(), x);
    return mode < following.size() ? following[mode] : mode;
}

const detail::LazyTape& FormulaSeries::tape(Mode mode, const std::string& name) const
{
    InMode& of = in(mode);
    std::call_once(of.recorded, [&] { of.tape = record(mode); });
    if (!of.tape.is_finite()) detail::throw_constant_not_finite(name);
    return of.tape;
}

detail::LazyTape FormulaSeries::record(Mode mode) const
{
    using detail::Recorded;
    const std::size_t n = flow_->in(mode).components();
    detail::Recording recording;
    std::vector<Recorded> x(n), results(n + guards_.size()), values;
    for (Recorded& component : x) component = {recording, recording.push_back({})};
    const Recorded t(recording, recording.push_back({}));
    flow_->in(mode).evaluate(t, x, parameters_, results, values);
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        guards_[i]->in(mode).evaluate(t, x, parameters_, &results[n + i], values);
    }
    std::vector<int> outputs;
    for (const Recorded& result : results) {
        const auto constant = [&] {
            return recording.push_back(
                {.op = detail::TaylorOp::constant, .value = result.value(), .from = result.from()});
        };
        outputs.push_back(result.is_constant() ? constant() : result.index());
    }
    return {n, recording, std::move(outputs)};
}

}  // namespace ricochet::python
