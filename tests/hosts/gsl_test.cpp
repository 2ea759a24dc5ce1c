// Events of the steps of GSL's odeiv2.
#include "ricochet/hosts/gsl.hpp"

#include "hosts/host_cases.hpp"

namespace ricochet::hosts_test::gsl_test {

namespace {

/// The flow and the number of its components, as GSL passes one pointer.
template <class System>
struct GslFlow {
    FlowOf<System> flow;
    std::size_t n;

    static int call(double t, const double x[], double dxdt[], void* self)
    {
        const auto& that = *static_cast<const GslFlow*>(self);
        that.flow(t, x, dxdt, that.n);
        return GSL_SUCCESS;
    }
};

template <class System>
class GslOf {
public:
    GslOf(const System& system, const Mode& mode, const typename System::State& x0,
          const Tolerances& tolerances, const gsl_odeiv2_step_type* type)
        : flow_{{&system, &mode}, x0.size()},
          system_{&GslFlow<System>::call, nullptr, x0.size(), &flow_},
          driver_(gsl_odeiv2_driver_alloc_y_new(&system_, type, 1e-3, tolerances.atol,
                                                tolerances.rtol)),
          host_(*driver_, 0, x0)
    {
    }
    GslOf(const GslOf&) = delete;
    GslOf& operator=(const GslOf&) = delete;
    ~GslOf() { gsl_odeiv2_driver_free(driver_); }
    [[nodiscard]] hosts::Gsl& host() noexcept { return host_; }

private:
    GslFlow<System> flow_;
    gsl_odeiv2_system system_;
    gsl_odeiv2_driver* driver_;
    hosts::Gsl host_;
};

template <class System>
struct Rk8pdOf : GslOf<System> {
    template <class... Arguments>
    explicit Rk8pdOf(const Arguments&... arguments)
        : GslOf<System>(arguments..., gsl_odeiv2_step_rk8pd)
    {
    }
};
template <class System>
struct Rkf45Of : GslOf<System> {
    template <class... Arguments>
    explicit Rkf45Of(const Arguments&... arguments)
        : GslOf<System>(arguments..., gsl_odeiv2_step_rkf45)
    {
    }
};

struct Rk8pd {
    template <class System>
    using Of = Rk8pdOf<System>;
    static constexpr double impact_error = 2e-13;
    static constexpr double finest = 1e-13;
    static constexpr double least_depth = 1e-10;
};
struct Rkf45 {
    template <class System>
    using Of = Rkf45Of<System>;
    static constexpr double impact_error = 2e-13;
    static constexpr double finest = 1e-13;
    static constexpr double least_depth = 1e-10;
};

using Methods = testing::Types<Rk8pd, Rkf45>;
INSTANTIATE_TYPED_TEST_SUITE_P(Gsl, InHost, Methods);

/// A point at a constant speed of 1 m/s, and a guard that dips below zero for 6 ms.
struct Passing {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt[0] = 1; }
    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const
    {
        const double away = (x[0] - 3.7) / 1e-2;
        return 1 - 1.1 * std::exp(-away * away);
    }
};

TEST(Gsl, TheShortestAndTheLongestStepOfTheDriverHold)
{
    const Passing system;
    const Mode mode = 0;
    FlowOf<Passing> passing{&system, &mode};
    GslFlow<Passing> flow{passing, 1};
    gsl_odeiv2_system equations{&GslFlow<Passing>::call, nullptr, 1, &flow};
    gsl_odeiv2_driver* driver =
        gsl_odeiv2_driver_alloc_y_new(&equations, gsl_odeiv2_step_rkf45, 0.01, 1e-6, 1e-6);
    gsl_odeiv2_driver_set_hmax(driver, 0.01);
    hosts::Gsl host(*driver, 0, std::array{0.0});
    EventMonitor monitor(system, Passing::State{0});
    EXPECT_EQ(hosts::run(host, monitor, 10), Verdict::stands);
    EXPECT_EQ(monitor.events().size(), 1u);
    EXPECT_GE(monitor.statistics().steps, 999u);

    gsl_odeiv2_driver_set_hmax(driver, 1);
    driver->h = 1;
    gsl_odeiv2_driver_set_hmin(driver, 0.5);
    driver->h = 0.25;
    EXPECT_THROW(host.step(20), std::runtime_error);
    gsl_odeiv2_driver_free(driver);
}

TEST(Gsl, RefusesAMultistepMethod)
{
    gsl_odeiv2_system system{nullptr, nullptr, 1, nullptr};
    gsl_odeiv2_driver* driver =
        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_msadams, 1e-3, 1e-6, 1e-6);
    EXPECT_THROW(hosts::Gsl(*driver, 0, std::array{1.0}), std::invalid_argument);
    gsl_odeiv2_driver_free(driver);
}

}  // namespace

}  // namespace ricochet::hosts_test::gsl_test
