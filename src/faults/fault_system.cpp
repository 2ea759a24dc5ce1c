#include "ricochet/faults/fault_system.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "base/require.hpp"
#include "fault_forces.hpp"
#include "ricochet/faults/friction.hpp"

namespace ricochet {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

using Law = std::variant<AgeingLaw<DirectEffect::log>, AgeingLaw<DirectEffect::asinh>,
                         SlipLaw<DirectEffect::log>, SlipLaw<DirectEffect::asinh>,
                         PrzLaw<DirectEffect::log>, PrzLaw<DirectEffect::asinh>>;

template <StateEvolution evolution>
[[nodiscard]] Law law_of(const FaultFriction& friction)
{
    if (friction.effect == DirectEffect::log) {
        return RateStateLaw<evolution, DirectEffect::log>(friction.law);
    }
    return RateStateLaw<evolution, DirectEffect::asinh>(friction.law);
}

[[nodiscard]] Law law_of(const FaultFriction& friction)
{
    switch (friction.evolution) {
        case StateEvolution::slip: return law_of<StateEvolution::slip>(friction);
        case StateEvolution::prz: return law_of<StateEvolution::prz>(friction);
        case StateEvolution::ageing: break;
    }
    return law_of<StateEvolution::ageing>(friction);
}

/// The law at log(V / V*), which spares the logarithm of V where the asinh is that logarithm.
template <class L>
[[nodiscard]] FrictionAndRate evaluate(const L& law, double log_v, double v, double xi)
{
    const RateStateParameters& p = law.parameters();
    const double friction = p.f_star + p.a * log_v + p.b * xi;
    if (L::effect == DirectEffect::log || friction > 40 * p.a) {
        return {friction, detail::state_rate<L::evolution>(p, v, xi)};
    }
    return law.evaluate(v, xi);
}

}  // namespace

/// Everything is in metres and seconds over D_RS and V; forces are per mass rho L.
struct RateStateFaultSystem::Parts {
    /// Products with K and sqrt(K) by transforms, with their scratch memory.
    struct Transforms {
        StiffnessProduct product;
        StiffnessSeries::Scratch scratch{};
        VectorXd in, out;

        explicit Transforms(const StiffnessSeries& root, const FaultStiffness& stiffness)
            : product(stiffness),
              in(static_cast<Index>(stiffness.size())),
              out(static_cast<Index>(stiffness.size())),
              root_(&root)
        {
        }

        void root_of(const VectorXd& x, VectorXd& y) { root_->apply(product, x, y, scratch); }

    private:
        const StiffnessSeries* root_;
    };

    Parts(const StrikeSlipFault& of, const FaultFriction& with, double polynomial_bound)
        : fault(of), friction(with), law(law_of(with)), size(of.size())
    {
        const double unit = fault.velocity_unit() / fault.time_unit();  // [m/s^2]
        normal = unit * detail::normal_forces(fault, friction);
        std::visit(
            [&](const auto& l) {
                xi = friction.theta ? l.xi_of_theta(*friction.theta)
                                    : l.steady_state(friction.slip_rate);
                stress = (1 + friction.overload) * l.friction(friction.slip_rate, xi) * normal;
            },
            law);
        by_slip = unit * friction.law.d_rs / fault.slip_unit();
        by_rate = 2 * fault.parameters().damping * unit * friction.law.d_rs / fault.velocity_unit();
        if (polynomial_bound == 0 && size <= most_stored) {
            store_matrices();
        } else {
            root = StiffnessSeries::within(detail::FaultForces::root, fault.stiffness().spectrum(),
                                           polynomial_bound > 0 ? polynomial_bound : 1e-8);
        }
    }

    void store_matrices()
    {
        StiffnessProduct product(fault.stiffness());
        stiffness.resize(size, size);
        for (Index i = 0; i < size; ++i) {
            const VectorXd one = VectorXd::Unit(size, i);
            product(one.data(), stiffness.col(i).data());
        }
        damping = by_rate * Eigen::SelfAdjointEigenSolver<MatrixXd>(stiffness).operatorSqrt();
        stiffness *= by_slip;
    }

    [[nodiscard]] bool stored() const { return stiffness.size() > 0; }

    /// Calls `work(transforms)` with transforms that no other thread is using.
    template <class Work>
    void with_transforms(const Work& work) const
    {
        std::unique_ptr<Transforms> own;
        {
            const std::lock_guard lock(guard);
            if (!idle.empty()) {
                own = std::move(idle.back());
                idle.pop_back();
            }
        }
        if (!own) own = std::make_unique<Transforms>(root, fault.stiffness());
        work(*own);
        const std::lock_guard lock(guard);
        idle.push_back(std::move(own));
    }

    /// Subtracts K u and H u' from `force`.
    void resist(const double* u, const double* du, double* force) const
    {
        Eigen::Map<VectorXd> f(force, size);
        const Eigen::Map<const VectorXd> x(u, size);
        const Eigen::Map<const VectorXd> dx(du, size);
        if (stored()) {
            f.noalias() -= stiffness * x;
            f.noalias() -= damping * dx;
            return;
        }
        with_transforms([&](Transforms& by) {
            by.in = x;
            by.product(by.in, by.out);
            f -= by_slip * by.out;
            by.in = dx;
            by.root_of(by.in, by.out);
            f -= by_rate * by.out;
        });
    }

    /// Calls `use(j, column of K, column of H)` for every element.
    template <class Use>
    void for_columns(const Use& use) const
    {
        if (stored()) {
            for (Index j = 0; j < size; ++j) use(j, stiffness.col(j), damping.col(j));
            return;
        }
        with_transforms([&](Transforms& by) {
            VectorXd column(size);
            for (Index j = 0; j < size; ++j) {
                by.in = VectorXd::Unit(size, j);
                by.product(by.in, column);
                by.root_of(by.in, by.out);
                column *= by_slip;
                by.out *= by_rate;
                use(j, column, by.out);
            }
        });
    }

    void check(std::span<const double> x) const
    {
        if (x.size() == static_cast<std::size_t>(3 * size)) return;
        throw std::invalid_argument(
            fmt::format("RateStateFaultSystem: a state must have 3 components for each of {} "
                        "elements, got {} in all",
                        size, x.size()));
    }

    StrikeSlipFault fault;
    FaultFriction friction;
    Law law;
    Index size;
    double xi = 0;                  ///< at the start
    VectorXd normal, stress;        ///< sigma and tau, over rho L [m/s^2]
    double by_slip = 0;             ///< of K on u / D_RS [m/s^2]
    double by_rate = 0;             ///< of sqrt(K) on its rate [m/s]
    MatrixXd stiffness, damping{};  ///< with these factors; empty: by transforms
    StiffnessSeries root;           ///< sqrt(K), for transforms

    mutable std::mutex guard;
    mutable std::vector<std::unique_ptr<Transforms>> idle;
};

RateStateFaultSystem::RateStateFaultSystem(const StrikeSlipFault& fault,
                                           const FaultFriction& friction, double polynomial_bound)
{
    constexpr std::string_view who = "RateStateFaultSystem";
    validate(friction);
    detail::require_positive(who, "slip_rate", friction.slip_rate);
    detail::require_not_negative(who, "polynomial_bound", polynomial_bound);
    parts_ = std::make_shared<const Parts>(fault, friction, polynomial_bound);
}

const StrikeSlipFault& RateStateFaultSystem::fault() const noexcept
{
    return parts_->fault;
}

const FaultFriction& RateStateFaultSystem::friction() const noexcept
{
    return parts_->friction;
}

RateStateFaultSystem::State RateStateFaultSystem::start() const
{
    const auto n = static_cast<std::size_t>(parts_->size);
    State x(3 * n, 0.0);
    std::fill_n(x.data() + n, n, std::log(friction().slip_rate / friction().law.v_star));
    std::fill_n(x.data() + 2 * n, n, parts_->xi);
    return x;
}

void RateStateFaultSystem::rates(std::span<const double> x, double* dxdt) const
{
    const Parts& of = *parts_;
    of.check(x);
    const Index n = of.size;
    const RateStateParameters& p = of.friction.law;
    const double* const log_v = x.data() + n;
    const double* const xi = x.data() + 2 * n;
    double* const du = dxdt;
    double* const force = dxdt + n;
    double* const v = dxdt + 2 * n;  // until the rate of xi takes its place
    const double inverse_d_rs = 1 / p.d_rs;
    Eigen::Map<Eigen::ArrayXd>(v, n) = p.v_star * Eigen::Map<const Eigen::ArrayXd>(log_v, n).exp();
    for (Index i = 0; i < n; ++i) du[i] = (v[i] - of.friction.plate_velocity) * inverse_d_rs;
    std::copy_n(of.stress.data(), n, force);
    of.resist(x.data(), du, force);
    std::visit(
        [&](const auto& law) {
            for (Index i = 0; i < n; ++i) {
                const FrictionAndRate f = evaluate(law, log_v[i], v[i], xi[i]);
                force[i] = (force[i] - of.normal[i] * f.friction) / v[i];
                v[i] = f.rate;
            }
        },
        of.law);
}

void RateStateFaultSystem::slopes(std::span<const double> x, std::span<double> rows) const
{
    const Parts& of = *parts_;
    State rate(x.size());
    rates(x, rate.data());
    if (rows.size() != x.size() * x.size()) {
        throw std::invalid_argument(
            fmt::format("RateStateFaultSystem: a Jacobian must have {} entries, got {}",
                        x.size() * x.size(), rows.size()));
    }
    const Index n = of.size;
    const VectorXd v = velocity(x);
    Eigen::Map<RowMajor> j(rows.data(), 3 * n, 3 * n);
    j.setZero();
    const VectorXd inverse_v = v.cwiseInverse();
    of.for_columns([&](Index k, const auto& stiffness, const auto& damping) {
        j.col(k).segment(n, n) = -inverse_v.cwiseProduct(stiffness);
        j.col(n + k).segment(n, n) =
            -(v[k] / of.friction.law.d_rs) * inverse_v.cwiseProduct(damping);
    });
    std::visit(
        [&](const auto& law) {
            for (Index i = 0; i < n; ++i) {
                const FrictionAndRateGradient f =
                    law.gradient(v[i], x[static_cast<std::size_t>(2 * n + i)]);
                j(i, n + i) = v[i] / of.friction.law.d_rs;
                j(n + i, n + i) -=
                    of.normal[i] * f.friction_v + rate[static_cast<std::size_t>(n + i)];
                j(n + i, 2 * n + i) = -of.normal[i] * f.friction_xi * inverse_v[i];
                j(2 * n + i, n + i) = f.rate_v * v[i];
                j(2 * n + i, 2 * n + i) = f.rate_xi;
            }
        },
        of.law);
}

VectorXd RateStateFaultSystem::slip(double t, std::span<const double> x) const
{
    parts_->check(x);
    const FaultFriction& f = friction();
    return f.law.d_rs * Eigen::Map<const VectorXd>(x.data(), parts_->size).array() +
           f.plate_velocity * t;
}

VectorXd RateStateFaultSystem::velocity(std::span<const double> x) const
{
    parts_->check(x);
    const Index n = parts_->size;
    return friction().law.v_star * Eigen::Map<const VectorXd>(x.data() + n, n).array().exp();
}

}  // namespace ricochet
