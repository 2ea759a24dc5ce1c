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
