// Converts the parameters of the fault as typed to those of the library.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "fault.hpp"
#include "input.hpp"
#include "registry.hpp"

namespace ricochet::app {

bool given(const std::vector<std::string>& set, std::string_view name)
{
    return std::any_of(set.begin(), set.end(), [name](const std::string& text) {
        return text.size() > name.size() && text.starts_with(name) && text[name.size()] == '=';
    });
}

double whole(std::string_view name, double value)
{
    if (value != std::floor(value)) {
        throw BadInput(fmt::format("{} of fault must be a whole number, got {}", name, value));
    }
    return value;
}

bool has_rate_and_state(const std::vector<double>& values)
{
    return whole("rate_and_state", values[weakening_parameters]) != 0;
}

void refuse_rate_and_state(const std::vector<std::string>& set, const SystemEntry& system)
{
    for (std::size_t i = weakening_parameters + 1; i < system.parameters.size(); ++i) {
        const std::string_view name = system.parameters[i].name;
        if (given(set, name)) {
            throw BadInput(fmt::format("{} of fault is for rate_and_state=1", name));
        }
    }
}

StrikeSlipFault::Parameters fault_parameters(const std::vector<double>& p,
                                             const std::optional<std::filesystem::path>& kernel)
{
    constexpr double most = 1e9;  // far beyond any memory
    constexpr double mib = 1048576;
    StrikeSlipFault::Parameters out{
        .elements = static_cast<int>(std::min(whole("elements", p[0]), most)),
        .side = p[1],
        .shear_modulus = p[2],
        .poisson = p[3],
        .density = p[4],
        .damping = p[5],
        .stress_gradient = p[6],
        .residual_friction = p[7],
        .friction_drop = p[8],
        .slip_distance = p[9],
        .overload = p[10],
        .medium =
            whole("half_space", p[11]) != 0 ? FaultMedium::half_space : FaultMedium::full_space,
        .mesh = whole("tip_corrected", p[12]) != 0 ? FaultMesh::tip_corrected : FaultMesh::plain,
        .memory_limit = p[13] * mib};
    if (kernel) out.kernel = *kernel;
    if (kernel && out.medium == FaultMedium::half_space) {
        throw BadInput("--kernel stands for the medium: half_space must be 0 with it");
    }
    return out;
}

}  // namespace ricochet::app
