// Events of ARKODE's steps.
#include "ricochet/hosts/arkode.hpp"

#include <memory>

#include "hosts/host_cases.hpp"
#include "hosts/sundials_setup.hpp"

namespace ricochet::hosts_test::arkode_test {

namespace {

template <class System>
class ErkOf {
public:
    ErkOf(const System& system, const Mode& mode, const typename System::State& x0,
          const Tolerances& tolerances)
        : parts_(x0),
          flow_{&system, &mode},
          memory_(ERKStepCreate(sundials_flow<System>, 0, parts_.x, parts_.context))
    {
        ERKStepSetOrder(memory_, 5);
        ERKStepSStolerances(memory_, tolerances.rtol, tolerances.atol);
        ERKStepSetUserData(memory_, &flow_);
        host_ =
            std::make_unique<hosts::ErkStep>(memory_, sundials_flow<System>, &flow_, 0, parts_.x);
    }
    ErkOf(const ErkOf&) = delete;
    ErkOf& operator=(const ErkOf&) = delete;
    ~ErkOf() { ERKStepFree(&memory_); }
    [[nodiscard]] hosts::ErkStep& host() noexcept { return *host_; }

private:
    SundialsParts parts_;
    FlowOf<System> flow_;
    void* memory_;
    std::unique_ptr<hosts::ErkStep> host_;
};

/// The flow is integrated implicitly.
template <class System>
class ArkOf {
public:
    ArkOf(const System& system, const Mode& mode, const typename System::State& x0,
          const Tolerances& tolerances)
        : parts_(x0),
          flow_{&system, &mode},
          memory_(ARKStepCreate(nullptr, sundials_flow<System>, 0, parts_.x, parts_.context))
    {
        ARKStepSetOrder(memory_, 5);
        ARKStepSStolerances(memory_, tolerances.rtol, tolerances.atol);
        ARKStepSetUserData(memory_, &flow_);
        ARKStepSetMaxNumSteps(memory_, 1000000);
        parts_.make_dense();
        ARKStepSetLinearSolver(memory_, parts_.dense, parts_.matrix);
        host_ = std::make_unique<hosts::ArkStep>(memory_, nullptr, sundials_flow<System>, &flow_, 0,
                                                 parts_.x);
    }
    ArkOf(const ArkOf&) = delete;
    ArkOf& operator=(const ArkOf&) = delete;
    ~ArkOf() { ARKStepFree(&memory_); }
    [[nodiscard]] hosts::ArkStep& host() noexcept { return *host_; }

private:
    SundialsParts parts_;
    FlowOf<System> flow_;
    void* memory_;
    std::unique_ptr<hosts::ArkStep> host_;
};

struct Explicit {
    template <class System>
    using Of = ErkOf<System>;
    static constexpr double impact_error = 1e-12;
    static constexpr double finest = 1e-12;
    static constexpr double least_depth = 1e-10;
};
struct Implicit {
    template <class System>
    using Of = ArkOf<System>;
    static constexpr double impact_error = 1e-9;
    static constexpr double finest = 1e-12;
    static constexpr double least_depth = 1e-9;
};

using Methods = testing::Types<Explicit, Implicit>;
INSTANTIATE_TYPED_TEST_SUITE_P(Arkode, InHost, Methods);

}  // namespace

}  // namespace ricochet::hosts_test::arkode_test
