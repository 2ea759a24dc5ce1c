#include "plot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <tuple>

#include "files.hpp"
#include "input.hpp"
#include "joined.hpp"
#include "report.hpp"

extern char** environ;

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;
using PlainRun = Run<std::vector<double>>;

/// t, x; the flights between events are separated by blank lines.
std::string flights(const SystemEntry& system, const PlainRun& run)
{
    std::string out;
    for (const Row& row : rows(system, run)) {
        if (row.event.starts_with("after")) out += '\n';
        out += fmt::format("{} {}\n", row.t, joined(row.x, " "));
    }
    return out;
}

/// t, x before and t, x after of each event, separated by blank lines.
std::string jumps(const PlainRun& run)
{
    std::string out;
    for (const auto& event : run.events) {
        out += fmt::format("{0} {1}\n{0} {2}\n\n", event.t, joined(event.before, " "),
                           joined(event.after, " "));
    }
    return out;
}

/// t, x after of each event.
std::string marks(const PlainRun& run)
{
    std::string out;
    for (const auto& event : run.events) {
        out += fmt::format("{} {}\n", event.t, joined(event.after, " "));
    }
    return out;
}

/// Whether component i jumps by more than a rounding at some event.
bool jumps_in(const PlainRun& run, std::size_t i)
{
    double size = 0;
    double jump = 0;
    for (const auto& event : run.events) {
        size = std::max({size, std::fabs(event.before[i]), std::fabs(event.after[i])});
        jump = std::max(jump, std::fabs(event.after[i] - event.before[i]));
    }
    for (const auto& x : run.trajectory.x) size = std::max(size, std::fabs(x[i]));
    return jump > 1e-6 * size;
}

/// Label of an axis: meaning, symbol and unit. The symbol is omitted if the meaning contains it
/// ("angle of the bird [rad]"), and the unit if there is none.
std::string axis_label(const Component& component)
{
    std::string_view symbol = component.name;
    while (symbol.ends_with('\'')) symbol.remove_suffix(1);
    std::string out(component.meaning);
    if (symbol.size() < 3 || component.meaning.find(symbol) == std::string_view::npos) {
        out += fmt::format(" {}", component.name);
    }
    return component.unit == "1" ? out : fmt::format("{} [{}]", out, component.unit);
}

/// A title for gnuplot in as many lines as its width of about 110 letters requires.
std::string wrapped_title(std::string_view text)
{
    constexpr std::size_t width = 110;
    std::string out;
    while (text.size() > width) {
        const std::size_t cut = text.rfind(", ", width);
        if (cut == std::string_view::npos) break;
        out += single_quoted(text.substr(0, cut + 1)) + ".\"\\n\".";
        text.remove_prefix(cut + 2);
    }
    return out + single_quoted(text) + ".\"\\n\"";
}

/// A curve in two columns of the files, such as "1:2", with its events and where they jump.
std::string curves(std::string_view columns, std::string_view title, std::string_view event,
                   bool has_events, bool jumps)
{
    std::vector<std::string> out{fmt::format("'flights' using {} with lines linestyle 1 title {}",
                                             columns, single_quoted(title))};
    if (has_events && jumps) {
        out.push_back(fmt::format("'jumps' using {} with lines linestyle 12 notitle", columns));
        out.push_back(
            fmt::format("'jumps' using {} with points linestyle 12 pointsize 0.7 "
                        "title {}",
                        columns, single_quoted(fmt::format("{}: before and after", event))));
    } else if (has_events) {
        out.push_back(fmt::format("'marks' using {} with points linestyle 12 title {}", columns,
                                  single_quoted(event)));
    }
    return joined(out, ", \\\n     ");
}

std::string_view event_word(const SystemEntry& system)
{
    return system.guards.size() == 1 ? system.guards[0].event : "event";
}

/// The title of a picture.
std::string picture_title(const SystemEntry& system, const RunSettings& settings,
                          const PlainRun& run)
{
    return wrapped_title(title(system, settings) +
                         (run.outcome == Outcome::cancelled ? " (incomplete)" : ""));
}

std::string script(const SystemEntry& system, const RunSettings& settings, const PlainRun& run)
{
    const std::size_t panels = system.state.size();
    std::string out = fmt::format(
        "set multiplot layout {},1 title {}\n"
        "set lmargin 15\n"
        "set rmargin 3\n"
        "set tmargin 2.5\n"
        "set key outside top right horizontal Left reverse samplen 2.5\n"
        "set offsets graph 0, graph 0, graph 0.06, graph 0.06\n",
        panels, picture_title(system, settings, run));
    if (run.t != settings.options.t_start) {
        const auto [left, right] = std::minmax(settings.options.t_start, run.t);
        out += fmt::format("set xrange [{}:{}]\n", left, right);
    }
    for (std::size_t i = 0; i < panels; ++i) {
        if (i + 1 == panels) out += "set xlabel 'time t [s]'\n";
        const Component& component = system.state[i];
        out += fmt::format("set ylabel {}\nplot {}\n", single_quoted(axis_label(component)),
                           curves(fmt::format("1:{}", i + 2), component.meaning, event_word(system),
                                  !run.events.empty(), jumps_in(run, i)));
    }
    return out + "unset multiplot\n";
}

/// One component over another.
std::string script(const SystemEntry& system, const RunSettings& settings, const PlainRun& run,
                   const PhasePlane& plane)
{
    return fmt::format(
        "set title {}\n"
        "set lmargin 15\n"
        "set rmargin 3\n"
        "set key outside bottom center horizontal Left reverse samplen 2.5\n"
        "set offsets graph 0.04, graph 0.04, graph 0.04, graph 0.04\n"
        "set xlabel {}.\"\\n\"\n"
        "set ylabel {}\n"
        "plot {}\n",
        picture_title(system, settings, run), single_quoted(axis_label(system.state[plane.across])),
        single_quoted(axis_label(system.state[plane.up])),
        curves(fmt::format("{}:{}", plane.across + 2, plane.up + 2), "motion", event_word(system),
               !run.events.empty(), jumps_in(run, plane.across) || jumps_in(run, plane.up)));
}

std::string content(const fs::path& file)
{
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// Runs gnuplot on `script` in `directory`; its output goes to the file `messages`.
void run_gnuplot(const fs::path& directory)
{
    const std::string program = "gnuplot";
    const std::string messages = (directory / "messages").string();
    // The script's own names are relative; the script changes to their directory.
    std::string no_settings = "--default-settings";
    std::string file = (directory / "script").string();
    std::array<char*, 4> arguments{const_cast<char*>(program.c_str()), no_settings.data(),
                                   file.data(), nullptr};

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 1, messages.c_str(), O_WRONLY | O_CREAT, 0600);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    pid_t child = 0;
    const int error =
        posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
        throw WriteError(error == ENOENT
                             ? std::string("the plot needs gnuplot, which was not found; "
                                           "get it with: apt-get install gnuplot-nox")
                             : "gnuplot cannot be run: " + std::generic_category().message(error));
    }
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        std::string said = content(messages);
        std::replace(said.begin(), said.end(), '\n', ' ');
        throw WriteError(fmt::format("gnuplot failed: {}", said));
    }
}

}  // namespace

void check_plot(const fs::path& file)
{
    if (file.extension() != ".svg" && file.extension() != ".png") {
        throw BadInput(
            fmt::format("--plot must be a file ending in .svg or .png, got '{}'", file.string()));
    }
}

std::optional<PhasePlane> phase_plane(const SystemEntry& system, const SimulateRequest& request)
{
    if (!request.phase) return {};
    if (!request.plot) throw BadInput("--phase is of --plot, which is missing");
    const std::string_view both = *request.phase;
    std::vector<std::string_view> names;
    for (const Component& component : system.state) names.push_back(component.name);
    const auto place = [&](std::string_view name) {
        const auto found = std::find(names.begin(), names.end(), name);
        if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
        throw BadInput(
            fmt::format("--phase must be two components of the state of {}, as U,V, of "
                        "{}; got '{}'",
                        system.name, joined(names, ", "), both));
    };
    const std::size_t comma = both.find(',');
    if (comma == std::string_view::npos) return PhasePlane{place(both), place("")};
    return PhasePlane{place(both.substr(0, comma)), place(both.substr(comma + 1))};
}

void plot(const SystemEntry& system, const RunSettings& settings, const PlainRun& run,
          const fs::path& file, const std::optional<PhasePlane>& plane)
{
    const auto [width, height, text] =
        plane ? std::tuple(900, 900, script(system, settings, run, *plane))
              : std::tuple(1200, static_cast<int>(100 + 320 * system.state.size()),
                           script(system, settings, run));
    draw({{"flights", flights(system, run)}, {"jumps", jumps(run)}, {"marks", marks(run)}},
         plot_head(file, width, height) + text, file);
}

std::string single_quoted(std::string_view text)
{
    std::string out = "'";
    for (const char c : text) {
        if (static_cast<unsigned char>(c) < ' ') continue;
        out += c == '\'' ? std::string("''") : std::string(1, c);
    }
    return out + '\'';
}

std::string plot_head(const fs::path& file, int width, int height)
{
    const bool svg = file.extension() == ".svg";
    std::string out = "set encoding utf8\n";
    out += svg ? fmt::format(
                     "set terminal svg noenhanced size {},{} font 'sans-serif,15' "
                     "background rgb 'white'\n",
                     width, height)
               : fmt::format("set terminal pngcairo noenhanced size {},{} font 'Sans,13'\n", width,
                             height);
    // The colours are those of Okabe and Ito, which are distinct for the colour-blind, each with
    // its own dash and point for print in grey; line style 12 marks events. The palette grows
    // lighter throughout.
    constexpr std::array colours{"#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#404040"};
    for (std::size_t i = 0; i < colours.size(); ++i) {
        out += fmt::format(
            "set style line {0} linecolor rgb '{1}' linewidth 2 dashtype {0} "
            "pointtype {2} pointsize 0.8\n",
            i + 1, colours[i], i + 4);
    }
    return out +
           "set style line 12 linecolor rgb '#d55e00' linewidth 1.2 dashtype 2 pointtype 7 "
           "pointsize 0.9\n"
           "set grid linecolor rgb '#d8d8d8' linetype 1\n"
           "set border 3 linecolor rgb '#404040'\n"
           "set tics nomirror out\n"
           "set palette defined (0 '#081d58', 1 '#225ea8', 2 '#41b6c4', 3 '#c7e9b4', 4 '#ffffd9')\n"
           "set output 'plot'\n";
}

void draw(const PlotFiles& files, const std::string& script, const fs::path& file)
{
    const TemporaryDirectory directory;
    const fs::path& path = directory.path();
    for (const auto& [name, text] : files) write_file(path / name, text);
    write_file(path / "script",
               fmt::format("cd {}\n", single_quoted(path.string())) + script + "unset output\n");
    run_gnuplot(path);
    const std::string drawing = content(path / "plot");
    if (drawing.empty()) throw WriteError("gnuplot drew nothing");
    write_file(file, drawing);
}

}  // namespace ricochet::app
