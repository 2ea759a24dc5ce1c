// The fault and the spring-slider in the lists of the command line. The program ricochet-fault
// simulates them: this one takes the defaults from the headers of ricochet::faults, and does not
// link to it.
#include <limits>
#include <vector>

#include "entries.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::app {

namespace {

/// Adds the laws of rate-and-state friction.
void add_rate_state_laws(std::vector<std::string_view>& equations)
{
    for (const std::string_view line :
         {"f = a asinh(V / w),  w = 2 v_star exp(-(f_star + b log(v_star theta / d_rs)) / a);",
          "    where V >> w: f = f_star + a log(V / v_star) + b log(v_star theta / d_rs)",
          "law 0, ageing:            theta' = 1 - s theta / d_rs,  s = sqrt(V^2 + w^2) - w",
          "law 1, slip:              theta' = -(s theta / d_rs) log(s theta / d_rs)",
          "law 2, Perrin-Rice-Zheng: theta' = 1 - (s theta / (2 d_rs))^2"}) {
        equations.push_back(line);
    }
}

/// Parameters of rate-and-state friction, which follow the others.
std::vector<Parameter> rate_state_parameters()
{
    constexpr Range positive{.lower = 0};
    constexpr Range not_negative{.lower = 0, .lower_included = true};
    const FaultFriction friction;
    const RateStateOptions options;
    return {
        {"rate_and_state",
         0,
         "1",
         {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
         "1: rate-and-state friction, with all that follows"},
        {"a", friction.law.a, "1", positive, "direct effect"},
        {"b", friction.law.b, "1", positive, "effect of the state"},
        {"f_star", friction.law.f_star, "1", positive, "steady friction coefficient at v_star"},
        {"v_star", friction.law.v_star, "m/s", positive, "reference slip rate"},
        {"d_rs", friction.law.d_rs, "m", positive, "characteristic slip distance"},
        {"law",
         0,
         "1",
         {.lower = 0, .upper = 2, .lower_included = true, .upper_included = true},
         "0 ageing, 1 slip, 2 Perrin-Rice-Zheng"},
        {"plate_velocity", friction.plate_velocity, "m/s", not_negative, "that loads the fault"},
        {"slip_rate", friction.slip_rate, "m/s", positive, "at the start"},
        {"theta", 0, "s", not_negative, "state at the start; 0: that of steady sliding"},
        {"normal_stress", friction.normal_stress, "Pa", not_negative,
         "effective, everywhere; 0: by depth"},
        {"threshold", options.threshold, "m/s", positive, "slip rate of an earthquake"},
        {"order",
         static_cast<double>(options.order),
         "1",
         {.lower = 1, .upper = 4, .lower_included = true, .upper_included = true},
         "of the steps: 1, 2 or 4"}};
}

}  // namespace

// Long: one entry of the list of systems.
SystemEntry fault_entry()
{
    constexpr double inf = std::numeric_limits<double>::infinity();
    const Range positive{.lower = 0};
    const Range not_negative{.lower = 0, .lower_included = true};
    const Range share{.lower = 0, .upper = 1, .lower_included = true, .upper_included = true};
    const StrikeSlipFault::Parameters fault;
    SystemEntry entry{
        .name = "fault",
        .description = "A strike-slip fault of n x n elements slips in an earthquake.",
        .equations = {"of each element, with the accumulated slip s and the normal stress sigma:",
                      "|tau| <= sigma (residual_friction + friction_drop exp(-s / slip_distance))",
                      "with rate_and_state = 1, at the slip rate V: tau = sigma f,"},
        .parameters = {{.name = "elements",
                        .initial = 1,
                        .unit = "1",
                        .range = {.lower = 1, .upper = inf, .lower_included = true},
                        .meaning = "per side, a whole number"},
                       {.name = "side",
                        .initial = fault.side,
                        .unit = "m",
                        .range = positive,
                        .meaning = "of the square"},
                       {.name = "shear_modulus",
                        .initial = fault.shear_modulus,
                        .unit = "Pa",
                        .range = positive,
                        .meaning = "of the rock"},
                       {.name = "poisson",
                        .initial = fault.poisson,
                        .unit = "1",
                        .range = {.lower = 0, .upper = 0.5, .lower_included = true},
                        .meaning = "Poisson's ratio"},
                       {.name = "density",
                        .initial = fault.density,
                        .unit = "kg/m³",
                        .range = positive,
                        .meaning = "of the rock"},
                       {.name = "damping",
                        .initial = fault.damping,
                        .unit = "1",
                        .range = not_negative,
                        .meaning = "damping ratio of every mode"},
                       {.name = "stress_gradient",
                        .initial = fault.stress_gradient,
                        .unit = "Pa/m",
                        .range = positive,
                        .meaning = "effective normal stress by depth"},
                       {.name = "residual_friction",
                        .initial = fault.residual_friction,
                        .unit = "1",
                        .range = not_negative,
                        .meaning = "coefficient after much slip"},
                       {.name = "friction_drop",
                        .initial = fault.friction_drop,
                        .unit = "1",
                        .range = positive,
                        .meaning = "by which it begins higher"},
                       {.name = "slip_distance",
                        .initial = fault.slip_distance,
                        .unit = "m",
                        .range = positive,
                        .meaning = "over which friction falls"},
                       {.name = "overload",
                        .initial = fault.overload,
                        .unit = "1",
                        .range = positive,
                        .meaning = "stress beyond strength at the start"},
                       {.name = "half_space",
                        .initial = 0,
                        .unit = "1",
                        .range = share,
                        .meaning = "1: under a free surface (Okada)"},
                       {.name = "tip_corrected",
                        .initial = 0,
                        .unit = "1",
                        .range = share,
                        .meaning = "1: elements a quarter off the edges"},
                       {.name = "memory",
                        .initial = fault.memory_limit / 1048576,
                        .unit = "MiB",
                        .range = positive,
                        .meaning = "a larger mesh is refused"}},
        .state = {{.name = "slip", .unit = "m", .meaning = "mean slip"},
                  {.name = "velocity", .unit = "m/s", .meaning = "mean velocity"}},
        .t_end = 30,
        .start = nullptr,
        .run = nullptr,
        .program = "fault",
    };
    for (const Parameter& p : rate_state_parameters()) entry.parameters.push_back(p);
    add_rate_state_laws(entry.equations);
    return entry;
}

SystemEntry spring_slider_entry()
{
    constexpr Range positive_range{.lower = 0};
    const RateStateParameters law;
    SystemEntry entry{
        .name = "spring-slider",
        .description = "A block with rate-and-state friction, pulled by a spring: stick-slip.",
        .source =
            "critical stiffness: J. R. Rice and A. L. Ruina, Stability of steady frictional "
            "slipping, Journal of Applied Mechanics 50, 1983",
        .equations = {"mass x'' = k (f_star force / k + velocity t - x) - force f,  V = x'",
                      "k = ratio k_critical,",
                      "k_critical = force (b - a) / d_rs (1 + mass velocity^2 / (force a d_rs)):",
                      "    below it steady sliding at the load's velocity, with the inertia of the",
                      "    block, is unstable"},
        .parameters = {{"ratio", 0.5, "1", positive_range, "stiffness over k_critical"},
                       {"velocity", 1.5e-4, "m/s", positive_range, "of the load"},
                       {"a", law.a, "1", positive_range, "direct effect"},
                       {"b", law.b, "1", positive_range, "effect of the state, above a"},
                       {"f_star", law.f_star, "1", positive_range,
                        "steady friction coefficient at v_star"},
                       {"v_star", law.v_star, "m/s", positive_range, "reference slip rate"},
                       {"d_rs", law.d_rs, "m", positive_range, "characteristic slip distance"},
                       {"mass", 1, "kg", positive_range, "of the block"},
                       {"force", 9.81, "N", positive_range, "normal force"},
                       {"law",
                        0,
                        "1",
                        {.lower = 0, .upper = 2, .lower_included = true, .upper_included = true},
                        "0 ageing, 1 slip, 2 Perrin-Rice-Zheng"},
                       {"threshold",
                        1e-3,
                        "m/s",
                        {.lower = 0, .lower_included = true},
                        "slip rate of onset and arrest"},
                       {"order",
                        4,
                        "1",
                        {.lower = 1, .upper = 4, .lower_included = true, .upper_included = true},
                        "of the steps: 1, 2 or 4"}},
        .state = {{"x", "m", "slip"},
                  {"V", "m/s", "slip rate"},
                  {"lg V", "1", "log10 of V / v_star"},
                  {"f", "1", "friction coefficient"},
                  {"theta", "s", "state"}},
        .guards = {{"onset", "onset"}, {"arrest", "arrest"}, {"reversal", "reversal"}},
        .t_end = 2,
        .start = nullptr,
        .run = nullptr,
        .program = "fault"};
    add_rate_state_laws(entry.equations);
    return entry;
}

}  // namespace ricochet::app
