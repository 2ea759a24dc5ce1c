// Steps by Rosenbrock's method, for stiff systems.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formula_adapter.hpp"
#include "forwarding.hpp"
#include "implicit.hpp"
#include "ricochet/rosenbrock.hpp"
#include "source.hpp"

namespace ricochet::python {

namespace {

/// Length of a difference at x, as in rosenbrock.hpp: it changes x however large x is.
[[nodiscard]] double reach_of(double x) noexcept
{
    constexpr double epsilon = std::numeric_limits<double>::epsilon();
    const double size = std::fabs(x);
    return std::max(std::sqrt(epsilon * std::max(1e-5, size)), 4 * epsilon * size);
}

/// Forward differences along the flow, which exists ahead of the state.
void jacobian_by_differences(RunAdapter& of, Mode mode, double t, const State& x,
                             std::span<double> rows)
{
    const std::size_t n = x.size();
    State here(n), there(n), moved = x;
    const auto flow = [&](const State& at, State& rate) {
        ++of.implicit().flow_calls;
        of.table().flow(of.adapter(), mode, t, at, rate);
    };
    flow(x, here);
    for (std::size_t j = 0; j < n; ++j) {
        moved[j] = x[j] + std::copysign(reach_of(x[j]), here[j]);
        const double delta = moved[j] - x[j];
        flow(moved, there);
        for (std::size_t i = 0; i < n; ++i) rows[i * n + j] = (there[i] - here[i]) / delta;
        moved[j] = x[j];
    }
}

/// The flow behind a adapter, with its Jacobian: the caller's, or differences.
class ImplicitSystem {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;

    explicit ImplicitSystem(RunAdapter& callbacks)
        : name(callbacks.table().name(callbacks.adapter())), callbacks_(&callbacks)
    {
    }

    std::string name;

    [[nodiscard]] RunAdapter& callbacks() const noexcept { return *callbacks_; }
    [[nodiscard]] std::size_t mode_count() const
    {
        return callbacks_->table().mode_count(callbacks_->adapter());
    }
    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        callbacks_->table().flow(callbacks_->adapter(), mode, t, x, dxdt);
    }
    void jacobian(Mode mode, double t, const State& x, std::span<double> rows) const
    {
        ++callbacks_->implicit().jacobians;
        if (callbacks_->jacobian(mode, t, x, rows)) return;
        jacobian_by_differences(*callbacks_, mode, t, x, rows);
    }

private:
    RunAdapter* callbacks_;
};

/// The kernel of the method, whose factorizations are counted at the adapter of the caller's
/// system.
template <class System>
class CountedKernel {
    using Step = detail::StepState<State>;
    using Kernel = detail::StepKernel<State>;
    using SystemAdapter = detail::StepperAdapter<System, State, Rosenbrock4>;

    static constexpr Kernel plain = detail::KernelOf<System, State, Rosenbrock4>::make();

    /// Counts what one call of the kernel factorizes. That is one matrix at most: where the call
    /// has computed another Jacobian, or the factors are of another length of step.
    class Count {
    public:
        explicit Count(void* adapter)
            : of_(*static_cast<SystemAdapter*>(
                  static_cast<detail::SystemAdapter<System, State>*>(adapter))),
              counts_(of_.system().callbacks().implicit()),
              length_(of_.room.factored),
              jacobians_(counts_.jacobians)
        {
        }
        Count(const Count&) = delete;
        Count& operator=(const Count&) = delete;
        ~Count()
        {
            const bool is_new = counts_.jacobians != jacobians_ || of_.room.factored != length_;
            counts_.factorizations += is_new && std::isfinite(of_.room.factored);
        }

    private:
        SystemAdapter& of_;
        ImplicitCounts& counts_;
        double length_;
        std::uint64_t jacobians_;
    };

    static bool take(void* adapter, Step& step, double h)
    {
        const Count count(adapter);
        return plain.take(adapter, step, h);
    }
    static double attempt(void* adapter, Step& step, double h, double rtol, double atol)
    {
        const Count count(adapter);
        return plain.attempt(adapter, step, h, rtol, atol);
    }
    static void depart(void* adapter, Step& step, double s, State& w, State& rate)
    {
        const Count count(adapter);
        plain.depart(adapter, step, s, w, rate);
    }
    static bool sample(void* adapter, Step& step, double s, double rtol, double atol, State& w)
    {
        const Count count(adapter);
        return plain.sample(adapter, step, s, rtol, atol, w);
    }
    static double roughness(void* adapter, Step& step, double rtol, double atol)
    {
        const Count count(adapter);
        return plain.roughness(adapter, step, rtol, atol);
    }

    [[nodiscard]] static constexpr Kernel make()
    {
        Kernel kernel = plain;
        kernel.take = &take;
        kernel.attempt = &attempt;
        kernel.depart = &depart;
        kernel.sample = &sample;
        kernel.roughness = &roughness;
        return kernel;
    }

public:
    static const Kernel& counted()
    {
        static constexpr Kernel kernel = make();
        return kernel;
    }
};

/// The adapter of a run by this method to functions of Python, or to a ready system.
class ImplicitAdapter final : public RunAdapter {
public:
    ImplicitAdapter(std::unique_ptr<RunAdapter> callbacks, const State& x0)
        : callbacks_(std::move(callbacks)), system_(*callbacks_), adapter_(system_, x0)
    {
        Forwarding<ImplicitSystem>::all(table_, callbacks_->table());
    }

    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept override
    {
        return table_;
    }
    [[nodiscard]] void* adapter() noexcept override
    {
        return static_cast<detail::SystemAdapter<ImplicitSystem, State>*>(&adapter_);
    }
    [[nodiscard]] bool is_free() const noexcept override { return callbacks_->is_free(); }
    void choose_method(detail::RunBindings<State>& setup) override
    {
        setup.kernel = &CountedKernel<ImplicitSystem>::counted();
    }
    [[nodiscard]] bool has_inclusion() const noexcept override
    {
        return callbacks_->has_inclusion();  // which is refused beside this method
    }
    [[nodiscard]] SignalWatch& watch() noexcept override { return callbacks_->watch(); }
    [[nodiscard]] ImplicitCounts& implicit() noexcept override { return callbacks_->implicit(); }

private:
    std::unique_ptr<RunAdapter> callbacks_;
    detail::SystemTable<State> table_;
    ImplicitSystem system_;
    detail::StepperAdapter<ImplicitSystem, State, Rosenbrock4> adapter_;
};

}  // namespace

template <>
void FormulaAdapter<Rosenbrock4>::choose_method(detail::RunBindings<State>& setup)
{
    setup.kernel = &CountedKernel<FormulaSystem>::counted();
}

std::unique_ptr<RunAdapter> implicit_adapter(std::unique_ptr<RunAdapter> callbacks, const State& x0)
{
    return std::make_unique<ImplicitAdapter>(std::move(callbacks), x0);
}

std::unique_ptr<RunAdapter> implicit_formula_adapter(std::unique_ptr<RunAdapter> callbacks,
                                                     std::shared_ptr<const FormulaSeries> series,
                                                     const State& x0)
{
    return std::make_unique<FormulaAdapter<Rosenbrock4>>(std::move(callbacks), std::move(series),
                                                         x0);
}

}  // namespace ricochet::python
