// A stiff hybrid system: a buck converter whose switch and diode are resistors, against its exact
// solution.
#include <boost/multiprecision/cpp_bin_float.hpp>

#include "cells.hpp"
#include "hosts/stiff_systems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/rosenbrock.hpp"
#ifdef RICOCHET_REPORT_CVODE
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "hosts/sundials_setup.hpp"
#include "ricochet/monitor.hpp"
#include "sundials.hpp"
#endif

namespace ricochet::report {

namespace {

using hosts_test::BuckConverter;

constexpr Mode start_mode = BuckConverter::switched_on;
constexpr double end = 25.5 * BuckConverter::half_period;  ///< [s]

// --- the exact solution ---

using Real = boost::multiprecision::cpp_bin_float_50;
using Vector = std::array<Real, 4>;  ///< the state, and 1
using Matrix = std::array<Vector, 4>;

[[nodiscard]] Matrix product(const Matrix& a, const Matrix& b)
{
    Matrix out{};
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = 0; j < 4; ++j) {
            for (std::size_t k = 0; k < 4; ++k) out[i][j] += a[i][k] * b[k][j];
        }
    }
    return out;
}

[[nodiscard]] Vector product(const Matrix& a, const Vector& x)
{
    Vector out{};
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t k = 0; k < 4; ++k) out[i] += a[i][k] * x[k];
    }
    return out;
}

/// Exponentials of the flow of one mode over longest 2^-j, j = 0 to `halvings`.
class Propagators {
public:
    static constexpr std::size_t halvings = 95;
    static constexpr double longest = 0x1p-27;  ///< [s] 7.5 ns, a six-hundredth of an oscillation

    explicit Propagators(Mode mode)
    {
        const Matrix a = matrix(mode);
        const Real h = boost::multiprecision::ldexp(Real(longest), -static_cast<int>(halvings));
        Matrix term{};
        for (std::size_t i = 0; i < 4; ++i) term[i][i] = 1;
        Matrix sum = term;
        for (int k = 1; k <= 4; ++k) {  // |h A| is 1e-27
            term = product(term, a);
            for (std::size_t i = 0; i < 4; ++i) {
                for (std::size_t j = 0; j < 4; ++j) {
                    term[i][j] *= h / k;
                    sum[i][j] += term[i][j];
                }
            }
        }
        powers_[halvings] = sum;
        for (std::size_t j = halvings; j > 0; --j) {
            powers_[j - 1] = product(powers_[j], powers_[j]);
        }
    }

    [[nodiscard]] Vector after(std::size_t j, const Vector& x) const
    {
        return product(powers_[j], x);
    }

private:
    /// Matrix of the affine flow; its columns are differences.
    [[nodiscard]] static Matrix matrix(Mode mode)
    {
        const BuckConverter buck;
        Matrix out{};
        BuckConverter::State x{};
        BuckConverter::State constant{};
        buck.flow(mode, 0.0, x, constant);
        for (std::size_t k = 0; k < 3; ++k) {
            x = {};
            x[k] = 1;
            BuckConverter::State rate{};
            buck.flow(mode, 0.0, x, rate);
            for (std::size_t i = 0; i < 3; ++i) out[i][k] = Real(rate[i]) - Real(constant[i]);
        }
        for (std::size_t i = 0; i < 3; ++i) out[i][3] = constant[i];
        return out;
    }

    std::array<Matrix, halvings + 1> powers_;
};

/// Exact times at which the diode starts and stops conducting.
class ExactBuck {
public:
    [[nodiscard]] std::vector<Expected> events()
    {
        std::vector<Expected> out;
        while (t_ < Real(end)) {
            if (!cross()) {
                mode_ ^= BuckConverter::switched_on;
                ++switchings_;
                continue;
            }
            const bool conducts = mode_ & BuckConverter::conducts;
            if (t_ < Real(end)) out.push_back({static_cast<double>(t_), conducts ? 1U : 0U});
            mode_ ^= BuckConverter::conducts;
        }
        return out;
    }

private:
    /// Advances to the next event of the diode, or to the next switching. Returns whether it was
    /// the diode.
    [[nodiscard]] bool cross()
    {
        const Real stop = Real(BuckConverter::half_period) * (switchings_ + 1);
        std::size_t j = 30;  // from 7e-18 s, twice as long after every eighth step
        for (int steps = 1; t_ < stop; ++steps) {
            if (steps % 8 == 0 && j > 0) --j;
            std::size_t fits = j;
            while (fits < Propagators::halvings && t_ + length(fits) > stop) ++fits;
            if (fits == Propagators::halvings) break;
            const Vector next = flow().after(fits, x_);
            if (left(next)) {
                descend(fits);
                return true;
            }
            t_ += length(fits);
            x_ = next;
        }
        t_ = stop;
        return false;
    }

    /// Advances to the crossing in the next step of length j, by bisection.
    void descend(std::size_t j)
    {
        for (++j; j <= Propagators::halvings; ++j) {
            const Vector next = flow().after(j, x_);
            if (left(next)) continue;
            t_ += length(j);
            x_ = next;
        }
    }

    [[nodiscard]] bool left(const Vector& x) const
    {
        return mode_ & BuckConverter::conducts ? x[2] > 0 : x[2] < 0;
    }
    [[nodiscard]] static Real length(std::size_t j)
    {
        return boost::multiprecision::ldexp(Real(Propagators::longest), -static_cast<int>(j));
    }
    [[nodiscard]] const Propagators& flow() const { return flows_[mode_]; }

    std::vector<Propagators> flows_{Propagators(0), Propagators(1), Propagators(2), Propagators(3)};
    Real t_ = 0;
    Vector x_{0, 0, 0, 1};
    Mode mode_ = start_mode;
    int switchings_ = 0;
};

// --- ricochet ---

template <class Method>
Answer by(double tolerance)
{
    const auto run = integrate(BuckConverter{}, {0, 0, 0},
                               {.t_end = end,
                                .mode = start_mode,
                                .rtol = tolerance,
                                .atol = tolerance,
                                .event_states = false},
                               ErrorControlled<Method>{});
    Answer answer{.finished = run.outcome == Outcome::reached_end,
                  .steps = run.statistics.steps,
                  .flow_calls = run.statistics.flow_calls,
                  .guard_calls = run.statistics.guard_calls};
    for (const auto& event : run.events) {
        if (changes_sign(event.kind)) answer.add(event.t, event.guard);
    }
    if (!answer.finished) answer.note = describe(run.outcome);
    return answer;
}

template <class Solve>
void add(Cells& cells, const std::string& peer, const std::string& how, Solve solve)
{
    for (const double tolerance : tolerances_of("buck")) {
        cells.add({"buck", peer, how, tolerance, [=] { return [=] { return solve(tolerance); }; }});
    }
}

// --- CVODE ---

#ifdef RICOCHET_REPORT_CVODE

Answer by_monitor(double tolerance)
{
    Mode mode = start_mode;
    const BuckConverter buck;
    const BuckConverter::State x0{};
    hosts_test::CvodeOf<BuckConverter, CV_BDF> made(buck, mode, x0, {tolerance, tolerance});
    EventMonitor monitor(buck, x0);
    Answer answer;
    const auto at_cut = [&](const auto& cut) {
        if ((cut.mode_after ^ cut.mode_before) & BuckConverter::conducts) {
            answer.add(cut.t.value, cut.mode_before & BuckConverter::conducts ? 1 : 0);
        }
        mode = cut.mode_after;
    };
    answer.finished = hosts::run(made.host(), monitor, end, at_cut, mode) == Verdict::stands;
    if (!answer.finished) answer.note = describe(monitor.outcome());
    return answer;
}

int node_voltage(double /*t*/, N_Vector x, double* g, void* /*user*/)
{
    g[0] = NV_Ith_S(x, 2);
    return 0;
}

/// As recommended by the manual: a dense Jacobian by differences, stop times at the switchings, one
/// root with the direction in which the diode changes, and a new initialisation after each of them.
Answer by_roots(double tolerance)
{
    Mode mode = start_mode;
    const BuckConverter buck;
    const BuckConverter::State x0{};
    hosts_test::CvodeOf<BuckConverter, CV_BDF> made(buck, mode, x0, {tolerance, tolerance});
    void* memory = made.memory();
    const State at(3);
    N_VConst(0, at.x);
    require(CVodeRootInit(memory, 1, node_voltage), "CVodeRootInit");
    require(CVodeSetNoInactiveRootWarn(memory), "CVodeSetNoInactiveRootWarn");
    const auto again = [&](double t) {
        int direction = mode & BuckConverter::conducts ? 1 : -1;
        CVodeSetRootDirection(memory, &direction);
        require(CVodeReInit(memory, t, at.x), "CVodeReInit");
        CVodeSetStopTime(memory, std::min(end, buck.next_time_event(t)));
    };
    again(0);
    Answer answer;
    for (double t = 0; t < end;) {
        const int flag = CVode(memory, end, at.x, &t, CV_NORMAL);
        if (flag < 0) {
            answer.note = "error flag " + std::to_string(flag);
            return answer;
        }
        if (flag == CV_ROOT_RETURN) {
            answer.add(t, mode & BuckConverter::conducts ? 1 : 0);
            mode ^= BuckConverter::conducts;
        } else {
            mode ^= BuckConverter::switched_on;
        }
        again(t);
    }
    answer.finished = true;
    return answer;
}

#endif

}  // namespace

void add_stiff(Cells& cells)
{
    cells.add_reference([] {
        return Reference{.problem = "buck",
                         .title = "Buck converter, stiffness 1e6, 25 switchings",
                         .t_end = end,
                         .events = ExactBuck().events()};
    });
    add(cells, "ricochet", "dopri5", by<Dopri5>);
    add(cells, "ricochet", "Rosenbrock4", by<Rosenbrock4>);
#ifdef RICOCHET_REPORT_CVODE
    add(cells, "ricochet", "monitor in CVODE, BDF", by_monitor);
    add(cells, "CVODE", "BDF, root finding", by_roots);
#endif
}

}  // namespace ricochet::report
