#include "certify.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <cstdio>
#include <stdexcept>
#include <system_error>

#include "files.hpp"
#include "guard_problems.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "joined.hpp"
#include "json_text.hpp"
#include "keep_model.hpp"
#include "model_lookup.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/learn/certify.hpp"
#include "ricochet/nn/model.hpp"
#include "run_watch.hpp"
#include "say.hpp"
#include "timing.hpp"
#include "train.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

std::string text(const learn::Estimate& e)
{
    return fmt::format("about {:.2g} boxes and {}", e.boxes, duration(e.seconds));
}

/// Shows the estimate of each level, then a bar on a terminal; elsewhere a line every tenth.
class Bar {
public:
    void show(const learn::CertifyProgress& now)
    {
        if (now.boxes == 0) {
            clear();
            say("certifying level {} of {}, guard > {} below {:.6g}: {}\n", now.level + 1,
                now.levels, now.margin, now.threshold, text(now.estimate));
            tenth_ = 0;
            return;
        }
        const auto percent = static_cast<int>(100 * now.share);
        const std::string figures =
            fmt::format("{:>3} %  {} boxes  {:.0f} boxes/s  {} left", percent, now.boxes, now.rate,
                        duration(now.seconds_left));
        if (terminal_) {
            const auto full = static_cast<std::size_t>(percent / 5);
            say("\r[{}{}] {}\x1b[K", std::string(full, '#'), std::string(20 - full, '.'), figures);
            std::fflush(stderr);
            drawn_ = true;
        } else if (percent / 10 != tenth_) {
            tenth_ = percent / 10;
            say("certifying: {}\n", figures);
        }
    }

    /// Frees the line for other output.
    void clear()
    {
        if (drawn_) say("\n");
        drawn_ = false;
    }

private:
    bool terminal_ = isatty(STDERR_FILENO) == 1;
    bool drawn_ = false;
    int tenth_ = 0;
};

learn::CertifyOptions options_of(const CertifyRequest& request)
{
    learn::CertifyOptions o;
    o.margin = request.margin.value_or(o.margin);
    o.levels = request.levels.value_or(o.levels);
    o.ratio = request.ratio.value_or(o.ratio);
    o.search = !request.keep_threshold;
    o.smallest = request.smallest.value_or(o.smallest);
    o.max_unproved = request.max_unproved.value_or(o.max_unproved);
    o.limit = request.limit.value_or(o.limit);
    o.time_limit = request.time_limit.value_or(o.time_limit);
    o.threads = static_cast<unsigned>(request.threads.value_or(o.threads));
    o.resume = request.resume;
    return o;
}

learn::GuardProblem problem_of(const Model& model, const fs::path& file)
{
    const auto refuse = [&](const std::string& why) -> BadInput {
        return BadInput(fmt::format("model '{}' {}", file.string(), why));
    };
    std::vector<std::string_view> known;
    for (const GuardProblemOf& problem : guard_problems()) {
        if (problem.system == model.system) return problem.make(model);
        known.push_back(problem.system);
    }
    throw refuse(
        fmt::format("is for the system '{}'; those that bound how much their guard can "
                    "change are {}",
                    model.system, joined(known, ", ")));
}

std::string to_text(const learn::CertifyReport& report)
{
    std::string out;
    for (std::size_t i = 0; i < report.levels.size(); ++i) {
        const CertificateLevel& level = report.levels[i];
        out += fmt::format(
            "guard > {} where the logit is below {}, in {:.2g} % of the domain: {} boxes in {}, {} "
            "unproved\n",
            level.margin, level.threshold, 100 * report.clears[i], level.boxes,
            duration(level.seconds), level.unproved.size());
    }
    if (!report.counterexample.empty()) {
        out += fmt::format("counterexample: ({})\n", joined(report.counterexample, ", "));
    }
    return out + fmt::format("{}\n", learn::describe(report));
}

std::string_view name(learn::CertifyOutcome outcome)
{
    switch (outcome) {
        case learn::CertifyOutcome::proved: return "proved";
        case learn::CertifyOutcome::partly_proved: return "partly_proved";
        case learn::CertifyOutcome::refuted: return "refuted";
        case learn::CertifyOutcome::not_provable: return "not_provable";
        case learn::CertifyOutcome::too_long: return "too_long";
        case learn::CertifyOutcome::out_of_time: return "out_of_time";
        case learn::CertifyOutcome::out_of_memory: return "out_of_memory";
        case learn::CertifyOutcome::interrupted: return "interrupted";
    }
    return "";
}

std::string to_json(const learn::CertifyReport& report, const fs::path& out, bool written)
{
    Json levels = Json::array();
    for (std::size_t i = 0; i < report.levels.size(); ++i) {
        const CertificateLevel& level = report.levels[i];
        levels.push_back({{"margin", level.margin},
                          {"threshold", level.threshold},
                          {"clears", report.clears[i]},
                          {"boxes", level.boxes},
                          {"seconds", level.seconds},
                          {"unproved", level.unproved.size()}});
    }
    Json estimates = Json::array();
    for (const learn::Estimate& e : report.estimates) {
        estimates.push_back({{"boxes", e.boxes}, {"seconds", e.seconds}});
    }
    return json_text(
        {{"outcome", name(report.outcome)},
         {"levels", levels},
         {"estimates", estimates},
         {"counterexample", report.counterexample.empty() ? Json() : Json(report.counterexample)},
         {"seconds", report.seconds},
         {"model", written ? Json(out.string()) : Json()}});
}

bool stopped(learn::CertifyOutcome outcome)
{
    return outcome == learn::CertifyOutcome::interrupted ||
           outcome == learn::CertifyOutcome::out_of_time ||
           outcome == learn::CertifyOutcome::out_of_memory;
}

/// @throws BadInput if the checkpoint to resume does not exist or is of another proof.
learn::CertifiedModel run(const Model& model, const learn::GuardProblem& problem,
                          const learn::CertifyOptions& options,
                          const learn::CertifyCallback& progress)
{
    bool started = false;
    try {
        return learn::certify(model, problem, options, [&](const learn::CertifyProgress& now) {
            started = true;
            return progress(now);
        });
    } catch (const std::runtime_error& error) {
        if (options.resume && !started) throw BadInput(error.what());
        throw;
    }
}

}  // namespace

int certify(const CertifyRequest& request)
{
    const fs::path file = find_model(request.model);
    const Model model = load_model(file);
    const fs::path out = request.out.empty() ? file : request.out;
    learn::CertifyOptions options = options_of(request);
    options.checkpoint = request.checkpoint;
    if (options.checkpoint.empty()) options.checkpoint = file.string() + ".checkpoint";
    Claims claims;  // the model file itself may receive the certificate
    std::error_code error;
    if (out != file && !fs::equivalent(out, file, error)) claims.reads("the model", file);
    claims.replaces("--out", out);
    claims.keeps("--checkpoint", options.checkpoint, options.resume);
    // Bounds of a guard may take long to prepare.
    const Interrupts interrupts;
    const RunWatch watch(0.5);
    const learn::GuardProblem problem = problem_of(model, file);

    Bar bar;
    const learn::CertifiedModel certified =
        run(model, problem, options, [&](const learn::CertifyProgress& now) {
            bar.show(now);
            return !Interrupts::any();
        });
    bar.clear();

    const learn::CertifyReport& report = certified.report;
    const bool goes_on = stopped(report.outcome);
    if (report.outcome == learn::CertifyOutcome::too_long && report.levels.empty()) {
        std::error_code ignored;
        if (request.checkpoint.empty()) fs::remove(options.checkpoint, ignored);
        throw BadInput(fmt::format("the proof takes {}, above the limit of {}; --limit raises it",
                                   text(report.estimates.back()), duration(options.limit)));
    }
    // A checkpoint refers to the unchanged model: while one is left the file is not modified.
    const bool write = !report.levels.empty() && !(goes_on && out == file);
    deliver({[&] {
                 if (write) keep_model(certified.model, out, options.checkpoint);
             },
             [&] { print(request.json ? to_json(report, out, write) : to_text(report)); }});
    if (!goes_on && request.checkpoint.empty()) {
        std::error_code ignored;
        fs::remove(options.checkpoint, ignored);
    }
    if (write) say("ricochet: the model is in '{}'\n", out.string());
    if (goes_on) {
        say_what_is_kept(options.checkpoint, report.checkpoint_trouble);
    }
    return certified.proved() ? 0 : 1;
}

}  // namespace ricochet::app
