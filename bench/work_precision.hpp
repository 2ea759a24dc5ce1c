// Work against precision: cost of an answer, and its error.
//
// A case is one problem, solved by one method at one step or tolerance. It is solved once and
// scored against the reference before it is timed. Only `integrate` of this library is called, so
// that any other solver of events can be in the same table: a rival is a function that returns
// event times.
//
//     CaseList cases;
//     cases.add(b1(), {"dopri5", "extremum", "rtol", 1e-8},
//               {.t_end = 20.5, .rtol = 1e-8}, ErrorControlled<Dopri5>{}, Extremum{});
//     cases.add_rival("b1", reference, {"by-hand", "ends", "rtol", 1e-8}, solve);
//     const std::vector<Row> rows = run(cases, yardstick_timing);
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "problems.hpp"
#include "ricochet/integrate.hpp"
#include "score.hpp"
#include "timing.hpp"

namespace ricochet::bench {

/// Parameters that distinguish the cases of a problem.
struct Setting {
    std::string method;    ///< e.g. "dopri5"
    std::string detector;  ///< e.g. "extremum"
    std::string knob;      ///< "step" [s], "rtol", or empty
    double value = 0;      ///< of the knob
};

/// Result of one run; a rival leaves out what it does not count.
struct Answer {
    std::vector<double> times{};  ///< [s] of events, ascending
    bool finished = true;         ///< the run reached its end
    std::optional<std::uint64_t> steps{};
    std::optional<std::uint64_t> flow_calls{};
    std::optional<std::uint64_t> guard_calls{};
    std::optional<std::uint64_t> network_calls{};
};

struct Case {
    std::string problem;
    Setting setting;
    std::vector<double> reference;  ///< [s]
    std::function<Answer()> solve;
    Work work;  ///< the same run, repeated for timing

    /// e.g. "b1/dopri5/extremum/rtol=1e-08"
    [[nodiscard]] std::string name() const;
};

/// Event times and counts of a run.
template <class State>
[[nodiscard]] Answer answer_of(const Run<State>& run)
{
    Answer answer{.finished = run.outcome == Outcome::reached_end,
                  .steps = run.statistics.steps,
                  .flow_calls = run.statistics.flow_calls,
                  .guard_calls = run.statistics.guard_calls,
                  .network_calls = run.statistics.network_calls};
    for (const auto& event : run.events) answer.times.push_back(event.t);
    return answer;
}

class CaseList {
public:
    /// One run of `integrate`; its end is the problem's.
    template <class System, class X, class Stepping, class Detector>
    void add(const Problem<System, X>& problem, Setting setting, Options options,
             const Stepping& stepping, const Detector& detector)
    {
        options.t_end = problem.t_end;
        const auto solve = [=, system = problem.system, x0 = problem.x0] {
            return integrate(system, x0, options, stepping, detector);
        };
        cases_.push_back({.problem = problem.name,
                          .setting = std::move(setting),
                          .reference = problem.events,
                          .solve = [solve] { return answer_of(solve()); },
                          .work = repeated(solve)});
    }

    /// Adds another way to compute the event times; `to_answer` is not timed.
    template <class Solve, class ToAnswer>
    void add_rival(const std::string& problem, const std::vector<double>& reference,
                   Setting setting, Solve solve, ToAnswer to_answer)
    {
        cases_.push_back({.problem = problem,
                          .setting = std::move(setting),
                          .reference = reference,
                          .solve = [=] { return to_answer(solve()); },
                          .work = repeated(solve)});
    }

    [[nodiscard]] const std::vector<Case>& all() const noexcept { return cases_; }

    /// The cases for which `wanted(case)` is true.
    template <class Predicate>
    [[nodiscard]] std::vector<Case> select(Predicate wanted) const
    {
        std::vector<Case> selected;
        for (const Case& c : cases_) {
            if (wanted(c)) selected.push_back(c);
        }
        return selected;
    }

private:
    std::vector<Case> cases_;
};

/// The problems and methods of the comparison so far.
///
/// @param models  directory of the trained networks
[[nodiscard]] CaseList standard_cases(const std::filesystem::path& models);

struct Row {
    std::string problem;
    Setting setting;
    std::size_t events = 0;  ///< in the reference
    Score score;
    Answer answer;
    std::optional<Timing> time{};  ///< absent where the answer was wrong
};

/// Solves and scores a case; does not time it.
[[nodiscard]] Row solve(const Case& c);

/// Solves, scores and times. An answer that misses or invents events is not timed.
[[nodiscard]] Row run(const Case& c, const TimingOptions& options = {});

/// The rows as a readable table.
[[nodiscard]] std::string table(std::span<const Row> rows, const Timing& yardstick);

/// The same for programs; times in seconds, absent counts null.
[[nodiscard]] nlohmann::json to_json(std::span<const Row> rows, const Timing& yardstick);

}  // namespace ricochet::bench
