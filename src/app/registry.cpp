#include "registry.hpp"

#include "input.hpp"

namespace ricochet::app {

namespace {

std::vector<SystemEntry>& entries()
{
    static std::vector<SystemEntry> all = all_entries();
    return all;
}

}  // namespace

const std::vector<SystemEntry>& systems()
{
    return entries();
}

void complete_system(std::string_view name, void (*complete)(SystemEntry& entry))
{
    for (SystemEntry& entry : entries()) {
        if (entry.name == name) complete(entry);
    }
}

const SystemEntry& find_system(std::string_view name)
{
    std::vector<std::string_view> known;
    for (const SystemEntry& system : systems()) {
        if (system.name == name) return system;
        known.push_back(system.name);
    }
    throw unknown("system", name, known);
}

}  // namespace ricochet::app
