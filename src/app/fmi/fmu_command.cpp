#include "fmu_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>

#include "../files.hpp"
#include "../input.hpp"
#include "../interrupt.hpp"
#include "../plot.hpp"
#include "../report.hpp"
#include "base/read_file.hpp"
#include "fmu_report.hpp"
#include "isolated.hpp"
#include "ricochet/fmi/ready.hpp"

namespace ricochet::app {

namespace {

constexpr std::size_t default_samples = 1001;
constexpr std::uintmax_t longest_table = std::uintmax_t{1} << 30;

fmi::Fmu open_fmu(const std::string& file)
{
    try {
        return fmi::Fmu(file);
    } catch (const fmi::Error& error) {
        throw BadInput(error.what());
    }
}

std::vector<std::string> parts(std::string_view text, char separator)
{
    std::vector<std::string> out;
    while (true) {
        const std::size_t end = std::min(text.find(separator), text.size());
        std::string_view part = text.substr(0, end);
        while (part.starts_with(' ')) part.remove_prefix(1);
        while (part.ends_with(' ') || part.ends_with('\r')) part.remove_suffix(1);
        out.emplace_back(part);
        if (end == text.size()) return out;
        text.remove_prefix(end + 1);
    }
}

/// The columns of a CSV file with a header: the time, then inputs. Names may have units behind
/// them, as `--csv` writes them: "u [V]".
std::vector<fmi::Input> read_inputs(const std::filesystem::path& file)
{
    const std::string text = ricochet::detail::read_file(
        file,
        [&](std::string_view why) {
            throw BadInput(fmt::format("--input {}: {}", file.string(), why));
        },
        longest_table);
    std::vector<fmi::Input> inputs;
    std::size_t line_number = 0;
    for (const std::string& line : parts(text, '\n')) {
        ++line_number;
        if (line.empty() || line.starts_with('#')) continue;
        const std::vector<std::string> cells = parts(line, ',');
        if (inputs.empty()) {
            for (std::size_t i = 1; i < cells.size(); ++i) {
                inputs.push_back(
                    {.name = cells[i].substr(0, cells[i].find(" [")), .t = {}, .values = {}});
            }
            if (inputs.empty()) {
                throw BadInput(
                    fmt::format("--input {}: found one column; expected the time and an "
                                "input",
                                file.string()));
            }
            continue;
        }
        const std::string where = fmt::format("--input {}:{}", file.string(), line_number);
        if (cells.size() != inputs.size() + 1) {
            throw BadInput(fmt::format("{}: found {} columns; expected {}", where, cells.size(),
                                       inputs.size() + 1));
        }
        for (std::size_t i = 0; i < inputs.size(); ++i) {
            inputs[i].t.push_back(number(where, cells[0]));
            inputs[i].values.push_back(number(where, cells[i + 1]));
        }
    }
    return inputs;
}

fmi::Method method_of(const FmuRequest& request)
{
    const std::string wanted = request.method.value_or("automatic");
    constexpr std::array all = {fmi::Method::automatic, fmi::Method::dopri5,
                                fmi::Method::fehlberg78, fmi::Method::rosenbrock4};
    std::vector<std::string_view> names;
    for (const fmi::Method method : all) {
        names.push_back(fmi::name(method));
        if (wanted == names.back()) return method;
    }
    throw unknown("method of FMUs", wanted, names);
}

fmi::Options options_of(const FmuRequest& request, const fmi::Description& d)
{
    fmi::Options options;
    options.t_start = request.t_start;
    options.t_end = request.t_end;
    options.rtol = request.rtol.value_or(options.rtol);
    options.step = request.step;
    options.method = method_of(request);
    options.max_steps = request.max_steps.value_or(2'000'000);
    if (request.co_simulation) options.co_simulation = true;
    for (const std::string& text : request.set) {
        const Assignment one = assignment("--set", text);
        options.start.emplace_back(one.name, one.value);
    }
    for (const std::string& text : request.watch) {
        const Assignment one = assignment("--watch", text);
        options.watch.push_back({.name = one.name, .level = one.value});
    }
    if (!options.watch.empty()) options.co_simulation = true;
    if (request.input) options.inputs = read_inputs(*request.input);
    if (request.output) options.output = parts(*request.output, ',');
    if (request.samples || request.csv || request.plot) {
        const double start = request.t_start.value_or(d.t_start.value_or(0));
        const double end = request.t_end.value_or(std::max(d.t_end.value_or(start + 1), start));
        const std::size_t n = request.samples.value_or(default_samples);
        for (std::size_t i = 0; i < n; ++i) {
            const double part = static_cast<double>(i) / static_cast<double>(n - 1);
            options.sample_times.push_back(std::min(start + part * (end - start), end));
        }
        options.sample_times.back() = end;
    }
    return options;
}

}  // namespace

int simulate_fmu(const FmuRequest& request)
{
    Claims claims;
    claims.reads("the FMU", request.file);
    if (request.input) claims.reads("--input", *request.input);
    if (request.csv) claims.writes("--csv", *request.csv);
    if (request.plot) {
        check_plot(*request.plot);
        claims.writes("--plot", *request.plot);
    }
    const fmi::Fmu fmu = open_fmu(request.file);
    fmi::Options options = options_of(request, fmu.description());
    const Interrupts interrupts;
    options.cancelled = Interrupts::flag();
    const auto begin = std::chrono::steady_clock::now();
    const fmi::Run run = run_isolated(fmu, options);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    const FmuRun timed{fmu.description(), options, run, taken.count()};
    deliver({[&] {
                 print(request.json ? fmu_run_json(timed, request.samples.has_value())
                                    : fmu_run_text(timed));
             },
             [&] {
                 if (request.csv) write_file(*request.csv, fmu_run_csv(timed));
             },
             [&] {
                 if (request.plot) plot_fmu_run(timed, *request.plot);
             }});
    if (run.integration == Outcome::cancelled && Interrupts::any()) {
        return ended_early(fmt::format("at t = {} s", run.t));
    }
    return run.end == fmi::End::reached_end || run.end == fmi::End::terminated ? 0 : 1;
}

namespace {

int check_fmu(const FmuRequest& request, const fmi::Fmu& fmu)
{
    const std::vector<fmi::Finding> findings = check_isolated(fmu);
    print(request.json ? findings_json(findings) : findings_text(findings));
    return std::ranges::any_of(findings, &fmi::Finding::fault) ? 1 : 0;
}

int export_fmu(const FmuRequest& request)
{
    if (!request.out) throw BadInput("fmu export: found no --out; expected a file");
    const std::string& what = request.words[1];
    const int version = static_cast<int>(request.version);
    std::vector<std::pair<std::string, double>> set;
    for (const std::string& text : request.set) {
        const Assignment one = assignment("--set", text);
        set.emplace_back(one.name, one.value);
    }
    Claims claims;
    const bool is_scene = what.ends_with(".json");
    if (is_scene) claims.reads("the scene", what);
    claims.writes("--out", *request.out);
    try {
        if (is_scene) {
            fmi::export_scene({.scene = what, .set = set, .version = version}, *request.out);
        } else {
            fmi::export_ready({.system = what, .set = set, .version = version}, *request.out);
        }
    } catch (const fmi::Error& error) {
        throw BadInput(error.what());
    }
    return 0;
}

}  // namespace

int describe_fmu(const FmuRequest& request)
{
    if (request.words.size() == 2 && request.words[0] == "export") return export_fmu(request);
    if (request.out || !request.set.empty()) {
        throw BadInput("fmu: found --out or --set, which are for export");
    }
    const bool checks = request.words.size() == 2;
    if (checks && request.words[0] != "check") {
        throw BadInput(fmt::format("found '{}' before the FMU; expected check, export or nothing",
                                   request.words[0]));
    }
    const fmi::Fmu fmu = open_fmu(request.words.back());
    if (checks) return check_fmu(request, fmu);
    print(request.json ? fmu_json(fmu) : fmu_text(fmu));
    return 0;
}

}  // namespace ricochet::app
