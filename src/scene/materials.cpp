// Coefficients of restitution that depend on the speed of approach.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/require.hpp"
#include "scene/materials.hpp"

namespace ricochet {

using namespace detail;

namespace {

constexpr std::string_view of_scene = "Scene";

double in_table(const TableOfSpeed& table, double speed)
{
    const auto next = std::ranges::upper_bound(table.speeds, speed);
    const auto k = static_cast<std::size_t>(next - table.speeds.begin());
    if (k == 0) return table.restitutions.front();
    if (k == table.speeds.size()) return table.restitutions.back();
    const double part = (speed - table.speeds[k - 1]) / (table.speeds[k] - table.speeds[k - 1]);
    return table.restitutions[k - 1] + part * (table.restitutions[k] - table.restitutions[k - 1]);
}

}  // namespace

double restitution_at(const SpeedLaw& law, double restitution, double speed)
{
    if (const auto* power = std::get_if<PowerOfSpeed>(&law)) {
        if (speed >= power->speed) return restitution;
        return 1 - (1 - restitution) * std::pow(speed / power->speed, power->exponent);
    }
    if (const auto* table = std::get_if<TableOfSpeed>(&law)) return in_table(*table, speed);
    if (const auto* given = std::get_if<std::function<double(double)>>(&law)) {
        const double value = (*given)(speed);
        return std::isnan(value) ? 0 : std::clamp(value, 0.0, 1.0);
    }
    return restitution;
}

namespace detail {

void check_coefficients(double restitution, double friction, const SpeedLaw& law,
                        const std::string& label)
{
    require(restitution >= 0 && restitution <= 1, of_scene, label + "restitution", "lie in [0, 1]",
            restitution);
    require_not_negative(of_scene, label + "friction", friction);
    if (const auto* power = std::get_if<PowerOfSpeed>(&law)) {
        require_positive(of_scene, label + "speed", power->speed);
        require_positive(of_scene, label + "exponent", power->exponent);
    }
    if (const auto* given = std::get_if<std::function<double(double)>>(&law)) {
        if (!*given) Refuse{of_scene}(label + "by_speed is an empty function");
    }
    const auto* table = std::get_if<TableOfSpeed>(&law);
    if (!table) return;
    if (table->speeds.empty() || table->speeds.size() != table->restitutions.size()) {
        Refuse{of_scene}(
            fmt::format("{}expected as many restitutions as speeds, and one at least, got {} "
                        "and {}",
                        label, table->restitutions.size(), table->speeds.size()));
    }
    for (std::size_t k = 0; k < table->speeds.size(); ++k) {
        require_not_negative(of_scene, label + "a speed", table->speeds[k]);
        require(table->restitutions[k] >= 0 && table->restitutions[k] <= 1, of_scene,
                label + "a restitution", "lie in [0, 1]", table->restitutions[k]);
        if (k == 0) continue;
        require_above(of_scene, label + "a speed", table->speeds[k], "the one before it,",
                      table->speeds[k - 1]);
    }
}

}  // namespace detail

}  // namespace ricochet
