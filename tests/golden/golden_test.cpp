// The bits of the present runs: every system of the command line with every method, detector and
// locator that it accepts.
//
// A line of runs.txt is a run: a hash of its outcome, its events (times, states before and after,
// modes, slopes, errors) and its end, and its counts. A change of the engine that is meant to keep
// the bits keeps this file; for any other change, the commit states which lines change and why. The
// file holds for one mathematical library, which its first line identifies by a hash of its own:
// with another the runs and their numbers of events are compared. RICOCHET_WRITE_GOLDEN=1 rewrites
// runs.txt. RICOCHET_WRITE_EVENTS=<file> writes the events and the ends of all runs, of which
// tests/golden/moved.py compares two files.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "input.hpp"
#include "nonsmooth/complete.hpp"
#include "registry.hpp"

namespace ricochet::app::golden_test {
namespace {

/// FNV-1a of 64 bits.
class Hash {
public:
    void add(std::uint64_t bits)
    {
        for (int i = 0; i < 8; ++i) {
            value_ = (value_ ^ (bits & 255)) * 0x100000001b3ULL;
            bits >>= 8;
        }
    }
    void add(double x) { add(std::bit_cast<std::uint64_t>(x)); }
    void add(const std::vector<double>& x)
    {
        for (const double each : x) add(each);
    }
    [[nodiscard]] std::uint64_t value() const { return value_; }

private:
    std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

/// Hash of the functions of the mathematical library that the systems use.
std::uint64_t mathematical_library()
{
    Hash hash;
    for (int i = 1; i < 2000; ++i) {
        const double x = 0.0137 * i;
        for (const double y :
             {std::sin(x), std::cos(x), std::exp(-x), std::log(x), std::pow(x, 0.2), std::tanh(x),
              std::atan2(x, 3.0), std::hypot(x, 1.7)}) {
            hash.add(y);
        }
    }
    return hash.value();
}

void write_run(std::ostream& out, const std::string& name, const TimedRun& timed)
{
    out << name << '\n';
    for (const auto& event : timed.run.events) {
        out << fmt::format("  {:.17g} {} {} {} {} {:.17g}\n", event.t, static_cast<int>(event.kind),
                           event.guard, event.mode_before, event.mode_after, event.slope);
    }
    out << fmt::format("  end {:.17g} {} {:.17g}\n", timed.run.t,
                       static_cast<int>(timed.run.outcome), fmt::join(timed.run.x, " "));
}

/// @param events  where to write the events, too, or null
std::string line_of(const SystemEntry& system, const RunRequest& request, std::ostream* events)
{
    const auto shown = [](const std::optional<std::string>& text) { return text.value_or("-"); };
    std::string out = fmt::format("{} {} {} {} {} {}", system.name,
                                  request.step ? fmt::format("step={}", *request.step) : "control",
                                  shown(request.stepper), shown(request.detector),
                                  shown(request.locator), shown(request.integrator));
    TimedRun timed;
    try {
        timed = system.run(resolve(system, request), 1);
    } catch (const BadInput&) {
        return out + " refused";
    }
    if (events) write_run(*events, out, timed);
    const Run<std::vector<double>>& run = timed.run;
    Hash hash;
    hash.add(static_cast<std::uint64_t>(run.outcome));
    hash.add(run.t);
    hash.add(run.x);
    hash.add(static_cast<std::uint64_t>(run.mode));
    for (const auto& event : run.events) {
        hash.add(event.t);
        hash.add(static_cast<std::uint64_t>(event.kind));
        hash.add(static_cast<std::uint64_t>(event.guard));
        hash.add(static_cast<std::uint64_t>(event.mode_before));
        hash.add(static_cast<std::uint64_t>(event.mode_after));
        hash.add(event.before);
        hash.add(event.after);
        hash.add(event.slope);
        hash.add(event.error);
    }
    const Statistics& s = run.statistics;
    return out + fmt::format(" {:016x} events={} steps={} rejected={} flow={} guard={}",
                             hash.value(), run.events.size(), s.steps, s.rejected, s.flow_calls,
                             s.guard_calls);
}

std::vector<RunRequest> requests(const SystemEntry& system)
{
    std::vector<RunRequest> all;
    RunRequest request;
    request.max_steps = 20'000;
    if (!system.integrators.empty()) {
        for (const std::string_view integrator : system.integrators) {
            request.integrator = integrator;
            all.push_back(request);
        }
        if (system.integrators.front() != "event") return all;
        request.integrator.reset();
    }
    const auto add = [&](std::string_view stepper, std::string_view detector,
                         std::string_view locator) {
        request.stepper = stepper;
        request.detector = detector;
        request.locator = locator;
        all.push_back(request);
    };
    const std::vector<std::string_view> detectors{"extremum", "ends", "bernstein"};
    for (const std::string_view stepper : {"dopri5", "fehlberg78", "cash-karp54"}) {
        for (const std::string_view detector : detectors) add(stepper, detector, "newton");
    }
    for (const std::string_view locator : {"bisection", "toms748"})
        add("dopri5", "extremum", locator);
    request.step = system.comparison_step > 0 ? system.comparison_step
                                              : (system.t_end - system.t_start) / 2000;
    for (const std::string_view stepper : {"rk4", "euler", "dopri5"}) {
        for (const std::string_view detector : detectors) add(stepper, detector, "newton");
    }
    return all;
}

std::vector<std::string> all_lines()
{
    complete_set_valued_systems();
    std::vector<std::string> out{
        fmt::format("mathematical library {:016x}", mathematical_library())};
    std::ofstream file;
    const char* const events = std::getenv("RICOCHET_WRITE_EVENTS");
    if (events) file.open(events);
    for (const SystemEntry& system : systems()) {
        if (system.run == nullptr) continue;
        for (const RunRequest& request : requests(system)) {
            out.push_back(line_of(system, request, events ? &file : nullptr));
        }
    }
    return out;
}

/// The run and its number of events, without the part that depends on the last bits.
std::string without_bits(const std::string& line)
{
    const std::size_t events = line.find(" events=");
    if (events == std::string::npos) return line;
    constexpr std::size_t hash = 17;  // with the blank before it
    return line.substr(0, events - hash) + line.substr(events, line.find(" steps=") - events);
}

TEST(Golden, RunsHaveTheirBits)
{
    const std::string file = RICOCHET_GOLDEN_RUNS;
    const std::vector<std::string> lines = all_lines();
    if (std::getenv("RICOCHET_WRITE_GOLDEN") != nullptr) {
        std::ofstream out(file);
        for (const std::string& line : lines) out << line << '\n';
        return;
    }
    SCOPED_TRACE(
        "where these runs are meant to change, RICOCHET_WRITE_GOLDEN=1 golden_tests writes " +
        file + " again, and git diff shows which of them did; a new system only adds lines");
    std::vector<std::string> stored;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) stored.push_back(line);
    ASSERT_FALSE(stored.empty()) << file;
    ASSERT_EQ(stored.size(), lines.size());
    const bool same_library = stored.front() == lines.front();
    for (std::size_t i = 1; i < lines.size(); ++i) {
        if (same_library) {
            EXPECT_EQ(lines[i], stored[i]);
        } else {
            EXPECT_EQ(without_bits(lines[i]), without_bits(stored[i]));
        }
    }
}

}  // namespace
}  // namespace ricochet::app::golden_test
