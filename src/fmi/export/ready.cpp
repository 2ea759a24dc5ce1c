// The ready systems as FMUs: one library, which is told by the token which of them an instance is,
// and with which parameters and start.
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/fmi/export.hpp"
#include "ricochet/systems/ready.hpp"

namespace ricochet::fmi::detail {

namespace {

/// A name as FMI's structured names are: without hyphens.
[[nodiscard]] const char* structured(std::string_view name)
{
    // The names are few, and live as long as the library.
    static std::vector<std::unique_ptr<std::string>> all;
    all.push_back(std::make_unique<std::string>(name));
    std::ranges::replace(*all.back(), '-', '_');
    return all.back()->c_str();
}
[[nodiscard]] const char* unit_of(std::string_view unit)
{
    return unit == "1" ? "" : unit.data();
}

template <class System>
struct Ready {
    using Method = Fehlberg78;  // whose steps round less than those of dopri5
    static constexpr double rtol = 1e-12;
    static inline const std::string_view name = System::name;
    static inline const double t_end = System::descriptor().t_end;
    static inline const std::vector<Exported> states = [] {
        std::vector<Exported> out;
        for (const ComponentInfo& each : System::descriptor().state) {
            out.push_back({each.title.data(), each.start, unit_of(each.unit), each.meaning.data()});
        }
        return out;
    }();
    static inline const std::vector<Exported> parameters = [] {
        std::vector<Exported> out;
        for (const ParameterInfo& each : System::descriptor().parameters) {
            out.push_back(
                {structured(each.name), each.initial, unit_of(each.unit), each.meaning.data()});
        }
        return out;
    }();
    [[nodiscard]] static System make(std::span<const double> p)
    {
        return with_parameters<System>(p);
    }
    [[nodiscard]] static Mode mode_at(const System& system, const typename System::State& x)
    {
        if constexpr (requires { system.mode_at(x[0], x[1]); }) return system.mode_at(x[0], x[1]);
        if constexpr (requires { System::start_mode; }) return System::start_mode;
        return 0;
    }
};

template <class System>
[[nodiscard]] std::unique_ptr<ExportedModel> made(std::string_view told)
{
    using Of = ExportedOf<Ready<System>>;
    std::string identifier(System::name);
    std::ranges::replace(identifier, '-', '_');
    ModelFacts facts = Of::facts_of(identifier.c_str(), true, true);
    facts.told = told;
    told.remove_prefix(std::min(told.size(), System::name.size() + 1));
    facts.take_starts(told);
    std::vector<double> parameters;
    for (const Exported& parameter : facts.parameters) parameters.push_back(parameter.start);
    (void)with_parameters<System>(parameters);  // refuses what is out of range
    return std::make_unique<Of>(std::move(facts));
}

}  // namespace

std::unique_ptr<ExportedModel> make_exported_model(const ModelSource& source)
{
    const std::string_view told = source.told;
    std::unique_ptr<ExportedModel> model;
    ReadySystems::for_each([&]<class System>() {
        if (told.substr(0, told.find(' ')) == System::name) model = made<System>(told);
    });
    if (model) return model;
    throw std::invalid_argument(fmt::format("found no ready system in '{}'", told));
}

}  // namespace ricochet::fmi::detail
