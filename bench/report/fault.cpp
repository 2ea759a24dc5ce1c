// A strike-slip fault with rate-and-state friction that is driven by plates at a millimetre a
// second. Slip of all elements is compared at 101 times.
//
// CVODE takes the same equations by BDF, in the logarithms of the slip rates.
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "cells.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#ifdef RICOCHET_REPORT_CVODE
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "hosts/sundials_setup.hpp"
#include "sundials.hpp"
#endif

namespace ricochet::report {

namespace {

constexpr double fault_end = 30;  ///< [s]
constexpr std::size_t fault_intervals = 100;

[[nodiscard]] double fault_time(std::size_t k)
{
    return fault_end * static_cast<double>(k) / static_cast<double>(fault_intervals);
}

[[nodiscard]] StrikeSlipFault fault()
{
    return StrikeSlipFault({.elements = 3});
}

[[nodiscard]] FaultFriction fault_friction()
{
    return {.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3};
}

[[nodiscard]] Answer by_variational_steps(const StrikeSlipFault& fault, int order, double tolerance)
{
    RuptureOptions options{
        .t_end = fault_end, .rtol = tolerance, .polynomial_bound = std::min(1e-4, tolerance)};
    for (std::size_t k = 0; k <= fault_intervals; ++k) {
        options.snapshot_times.push_back(fault_time(k));
    }
    const RateStateRupture run =
        simulate(fault, options, fault_friction(),
                 {.order = order, .tolerance = std::clamp(1e-3 * tolerance, 1e-13, 1e-11)});
    Answer answer{.finished = run.rupture.outcome == Outcome::reached_end,
                  .steps = run.rupture.statistics.steps};
    for (const RuptureSnapshot& at : run.rupture.snapshots) {
        answer.samples.emplace_back(at.slip.begin(), at.slip.end());
    }
    if (!answer.finished) answer.note = describe(run.rupture.outcome);
    return answer;
}

#ifdef RICOCHET_REPORT_CVODE

/// State: of all elements u = slip - plate_velocity t, log(V / V*) and xi; nondimensional as in
/// `StrikeSlipFault`.
class FaultSystem {
public:
    using State = std::vector<double>;

    FaultSystem()
    {
        const Eigen::Index n = fault_.size();
        StiffnessProduct product(fault_.stiffness());
        stiffness_.resize(n, n);
        for (Eigen::Index i = 0; i < n; ++i) {
            const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, i);
            product(unit.data(), stiffness_.col(i).data());
        }
        damping_ = 2 * fault_.parameters().damping *
                   Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(stiffness_).operatorSqrt();
        stress_ = (1 + friction_.overload) *
                  law_.friction(friction_.slip_rate, law_.steady_state(friction_.slip_rate)) *
                  fault_.weight();
    }

    [[nodiscard]] State start() const
    {
        const auto n = static_cast<std::size_t>(fault_.size());
        State x(3 * n, 0.0);
        std::fill_n(x.begin() + static_cast<std::ptrdiff_t>(n), n,
                    std::log(friction_.slip_rate / friction_.law.v_star));
        std::fill_n(x.begin() + static_cast<std::ptrdiff_t>(2 * n), n,
                    law_.steady_state(friction_.slip_rate));
        return x;
    }

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        const Eigen::Index n = fault_.size();
        const Eigen::Map<const Eigen::VectorXd> u(x.data(), n);
        const Eigen::Map<const Eigen::ArrayXd> log_rate(x.data() + n, n);
        const Eigen::Map<const Eigen::ArrayXd> xi(x.data() + 2 * n, n);
        const Eigen::ArrayXd v = friction_.law.v_star * log_rate.exp();  // [m/s]
        Eigen::Map<Eigen::VectorXd> du(dxdt.data(), n);
        Eigen::Map<Eigen::ArrayXd> dlog(dxdt.data() + n, n);
        du = ((v - friction_.plate_velocity) / fault_.velocity_unit()).matrix();
        const Eigen::VectorXd force = stress_ - stiffness_ * u - damping_ * du;
        for (Eigen::Index i = 0; i < n; ++i) {
            const FrictionAndRate f = law_.evaluate(v[i], xi[i]);
            dlog[i] = (force[i] - fault_.weight()[i] * f.friction) * fault_.velocity_unit() / v[i];
            dxdt[static_cast<std::size_t>(2 * n + i)] = f.rate * fault_.time_unit();
        }
    }

    [[nodiscard]] double time_unit() const { return fault_.time_unit(); }
    /// Slips [m] at t [s].
    [[nodiscard]] std::vector<double> slips(double t, const double* u) const
    {
        std::vector<double> out(u, u + fault_.size());
        for (double& s : out) s = s * fault_.slip_unit() + friction_.plate_velocity * t;
        return out;
    }

private:
    StrikeSlipFault fault_ = fault();
    FaultFriction friction_ = fault_friction();
    AgeingLaw<> law_{friction_.law};
    Eigen::MatrixXd stiffness_, damping_;
    Eigen::VectorXd stress_;
};

/// As CVODE's manual recommends: a dense Jacobian by differences.
[[nodiscard]] Answer by_cvode(const FaultSystem& system, double tolerance)
{
    Mode mode{};
    const FaultSystem::State x0 = system.start();
    hosts_test::CvodeOf<FaultSystem, CV_BDF> made(system, mode, x0, {tolerance, tolerance});
    const State at(x0.size());
    Answer answer;
    answer.samples.push_back(system.slips(0, x0.data()));
    for (std::size_t k = 1; k <= fault_intervals; ++k) {
        double t = 0;
        const double to = fault_time(k) / system.time_unit();
        const int flag = CVode(made.memory(), to, at.x, &t, CV_NORMAL);
        if (flag < 0) {
            answer.note = "error flag " + std::to_string(flag);
            return answer;
        }
        answer.samples.push_back(system.slips(fault_time(k), NV_DATA_S(at.x)));
    }
    long steps = 0;
    CVodeGetNumSteps(made.memory(), &steps);
    answer.steps = static_cast<std::uint64_t>(steps);
    answer.finished = true;
    return answer;
}

#endif

/// ricochet at a tolerance of 1e-12; with CVODE at 1e-12 it agrees to 6e-11.
[[nodiscard]] Reference fault_reference()
{
    Reference out{.problem = "fault",
                  .title = "Strike-slip fault of 3 x 3 elements, driven",
                  .t_end = fault_end,
                  .samples = by_variational_steps(fault(), 4, 1e-12).samples};
    for (std::size_t k = 0; k <= fault_intervals; ++k) out.sample_times.push_back(fault_time(k));
    return out;
}

}  // namespace

void add_fault(Cells& cells)
{
    cells.add_reference(fault_reference);
    for (const double tolerance : {1e-3, 1e-4, 1e-6, 1e-8, 1e-10}) {
        for (const int order : {2, 4}) {
            if (order == 2 && tolerance < 1e-8) continue;  // a run would take seconds
            cells.add({"fault", "ricochet", "variational, order " + std::to_string(order),
                       tolerance, [=] {
                           return [made = fault(), order, tolerance] {
                               return by_variational_steps(made, order, tolerance);
                           };
                       }});
        }
#ifdef RICOCHET_REPORT_CVODE
        cells.add({"fault", "CVODE", "BDF", tolerance, [=] {
                       return [system = std::make_shared<FaultSystem>(), tolerance] {
                           return by_cvode(*system, tolerance);
                       };
                   }});
#endif
    }
}

}  // namespace ricochet::report
