// libFuzzer on the command line: one word per line, up to the point where a run would begin. A
// request is resolved, with all its values and models, and nothing is run or written.
#include <cstdint>
#include <string>
#include <vector>

#include "program.hpp"
#include "registry.hpp"
#include "settings.hpp"

namespace {

using namespace ricochet::app;

int resolve_only(const SimulateRequest& request)
{
    (void)resolve(find_system(request.system), request.run);
    return 0;
}

int compare_nothing(const CompareRequest& request)
{
    (void)parameter_values(find_system(request.system), request.set);
    return 0;
}

void add_commands(CLI::App& app, int& status)
{
    add_systems(app, status, [](ListFormat) { return 0; });
    add_simulate(app, status, resolve_only);
    add_inspect(app, status, [](const InspectRequest&) { return 0; });
    add_compare(app, status, compare_nothing);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    std::vector<std::string> words{"ricochet", ""};
    for (std::size_t i = 0; i < size; ++i) {
        if (data[i] == '\n') {
            words.emplace_back();
        } else if (data[i] != 0) {  // no word of a command line contains it
            words.back() += static_cast<char>(data[i]);
        }
    }
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const int status = run_program(add_commands, static_cast<int>(words.size()), arguments.data());
    // Success, or bad input; nothing else is possible before a run.
    if (status != 0 && status != 2) __builtin_trap();
    return 0;
}
