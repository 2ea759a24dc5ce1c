#include "ricochet/learn/certify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <fstream>
#include <mutex>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>

#include "branch_and_bound.hpp"
#include "ricochet/learn/random.hpp"

namespace ricochet::learn {

namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

constexpr std::size_t frontier_boxes = 2048;
constexpr double infinity = std::numeric_limits<double>::infinity();

double seconds_since(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

void check(const CertifyOptions& o)
{
    const auto require = [](bool holds, std::string_view what, double given) {
        if (holds) return;
        throw std::invalid_argument(fmt::format("certify: {}, got {}", what, given));
    };
    const auto number = [](std::size_t n) { return static_cast<double>(n); };
    require(std::isfinite(o.margin) && o.margin >= 0, "margin must be finite and not negative",
            o.margin);
    require(o.levels >= 1 && o.levels <= 32, "levels must lie in [1, 32]", number(o.levels));
    require(std::isfinite(o.ratio) && o.ratio > 1, "ratio must be above 1", o.ratio);
    require(o.levels == 1 || o.margin > 0, "several levels need a positive margin", o.margin);
    require(o.closest > 0 && o.closest < 1, "closest must lie in (0, 1)", o.closest);
    require(o.smallest > 0 && o.smallest <= 1, "smallest must lie in (0, 1]", o.smallest);
    require(o.limit > 0, "limit must be positive", o.limit);
    require(o.time_limit > 0, "time_limit must be positive", o.time_limit);
    require(o.threads >= 1 && o.threads <= 64, "threads must lie in [1, 64]", o.threads);
}

void check_recipe(const Model& model)
{
    if (model.recipe == name(Recipe::state)) return;
    throw std::invalid_argument(
        fmt::format("certify: expected a model with the recipe 'state', whose features are the "
                    "components of the state, got the recipe '{}'",
                    model.recipe));
}

/// A random state of the domain.
void draw(const Model& model, Random& random, std::vector<double>& x)
{
    for (std::size_t i = 0; i < x.size(); ++i) {
        x[i] = random.uniform(model.domain[i].lower, model.domain[i].upper);
    }
}

/// What a checkpoint must agree in. The guard is known by its values at a few states.
std::string key(const Model& model, const GuardProblem& problem, const CertifyOptions& o)
{
    Random random(1);
    std::vector<double> x(model.domain.size());
    std::string out =
        fmt::format("{} {} {} {} {} {} {} {} {}", fingerprint(model), o.margin, o.levels, o.ratio,
                    o.search, o.closest, o.smallest, o.max_unproved, o.seed);
    for (int i = 0; i < 4; ++i) {
        draw(model, random, x);
        out += fmt::format(" {} {}", problem.guard(x.data()), problem.slack(x.data()));
    }
    return out;
}

// --- checkpoints ---

/// A level that was begun.
struct Begun {
    double threshold = 0;
    double lowering = 0;  ///< of the threshold that is allowed, to take unproved boxes in
    Estimate estimate{};
    double seconds = 0;
    std::vector<std::optional<Tally>> done{};  ///< per box of the frontier
};

/// Where the search for a threshold is: attempts that failed have moved these.
struct Attempt {
    int number = 0;
    double highest = 0;  ///< threshold that could be proved at best
    double spread = 0;   ///< of the logits, what a distance between thresholds is measured in
    double closest = 0;  ///< to `highest`
};

struct Progressed {
    std::vector<CertificateLevel> levels{};
    std::vector<Estimate> estimates{};
    std::optional<Attempt> attempt{};  ///< at the level after these
    std::optional<Begun> current{};
};

Json json(const std::vector<std::vector<Interval>>& boxes)
{
    Json out = Json::array();
    for (const auto& box : boxes) {
        Json one = Json::array();
        for (const Interval& range : box) one.push_back({range.lower, range.upper});
        out.push_back(one);
    }
    return out;
}

std::vector<std::vector<Interval>> boxes_of(const Json& from)
{
    std::vector<std::vector<Interval>> out;
    for (const Json& box : from) {
        out.emplace_back();
        for (const Json& range : box) {
            out.back().push_back({range.at(0).get<double>(), range.at(1).get<double>()});
        }
    }
    return out;
}

Json json(const Estimate& e)
{
    return Json::array({e.boxes, e.seconds, e.unproved, e.error});
}

Estimate estimate_of(const Json& from)
{
    return {.boxes = from.at(0).get<double>(),
            .seconds = from.at(1).get<double>(),
            .unproved = from.at(2).get<double>(),
            .error = from.at(3).get<double>()};
}

Json json(const Attempt& a)
{
    return Json::array({a.number, a.highest, a.spread, a.closest});
}

Attempt attempt_of(const Json& from)
{
    return {.number = from.at(0).get<int>(),
            .highest = from.at(1).get<double>(),
            .spread = from.at(2).get<double>(),
            .closest = from.at(3).get<double>()};
}

/// Only finished parts that are not refuted are kept.
Json json(const Begun& begun)
{
    Json done = Json::array();
    for (std::size_t i = 0; i < begun.done.size(); ++i) {
        if (!begun.done[i]) continue;
        const Tally& tally = *begun.done[i];
        done.push_back(
            Json::array({i, tally.boxes, tally.unproved.empty() ? Json() : Json(tally.lowest),
                         json(tally.unproved)}));
    }
    return {{"threshold", begun.threshold},     {"lowering", begun.lowering},
            {"estimate", json(begun.estimate)}, {"seconds", begun.seconds},
            {"parts", begun.done.size()},       {"done", done}};
}

[[noreturn]] void refuse(const std::filesystem::path& file, std::string_view what)
{
    throw std::runtime_error(fmt::format("checkpoint '{}' {}", file.string(), what));
}

constexpr std::string_view checkpoint_format = "ricochet certification 1";

void save(const Progressed& all, const std::string& key, const std::filesystem::path& file)
{
    Json levels = Json::array();
    for (const CertificateLevel& level : all.levels) {
        levels.push_back({{"margin", level.margin},
                          {"threshold", level.threshold},
                          {"boxes", level.boxes},
                          {"seconds", level.seconds},
                          {"unproved", json(level.unproved)}});
    }
    Json estimates = Json::array();
    for (const Estimate& e : all.estimates) estimates.push_back(json(e));
    const Json out{{"format", checkpoint_format},
                   {"key", key},
                   {"levels", levels},
                   {"estimates", estimates},
                   {"attempt", all.attempt ? json(*all.attempt) : Json()},
                   {"current", all.current ? json(*all.current) : Json()}};
    const std::filesystem::path fresh = file.string() + ".part";
    {
        std::ofstream stream(fresh, std::ios::binary | std::ios::trunc);
        stream << out.dump() << '\n';
        stream.close();
        if (!stream) refuse(file, "cannot be written");
    }
    std::error_code error;
    std::filesystem::rename(fresh, file, error);
    if (error) refuse(file, "cannot be written: " + error.message());
}

Begun begun_of(const Json& from)
{
    Begun out{.threshold = from.at("threshold").get<double>(),
              .lowering = from.at("lowering").get<double>(),
              .estimate = estimate_of(from.at("estimate")),
              .seconds = from.at("seconds").get<double>()};
    out.done.resize(std::min<std::size_t>(from.at("parts").get<std::size_t>(), 2 * frontier_boxes));
    for (const Json& part : from.at("done")) {
        Tally tally;
        tally.boxes = part.at(1).get<std::uint64_t>();
        if (!part.at(2).is_null()) tally.lowest = part.at(2).get<double>();
        tally.unproved = boxes_of(part.at(3));
        out.done.at(part.at(0).get<std::size_t>()) = std::move(tally);
    }
    return out;
}

Progressed load(const std::string& key, const std::filesystem::path& file)
{
    std::ifstream in(file, std::ios::binary);
    if (!in) refuse(file, "cannot be read");
    try {
        const Json from = Json::parse(in);
        if (from.at("format") != checkpoint_format) {
            refuse(file, "is not a certification of this version");
        }
        if (from.at("key") != key) {
            refuse(file, "belongs to another model, another guard or other options");
        }
        Progressed out;
        for (const Json& level : from.at("levels")) {
            out.levels.push_back({.margin = level.at("margin").get<double>(),
                                  .threshold = level.at("threshold").get<double>(),
                                  .boxes = level.at("boxes").get<std::uint64_t>(),
                                  .seconds = level.at("seconds").get<double>(),
                                  .unproved = boxes_of(level.at("unproved"))});
        }
        for (const Json& e : from.at("estimates")) out.estimates.push_back(estimate_of(e));
        if (!from.at("attempt").is_null()) out.attempt = attempt_of(from.at("attempt"));
        if (!from.at("current").is_null()) out.current = begun_of(from.at("current"));
        return out;
    } catch (const Json::exception&) {
        refuse(file, "is cut short or has been altered");
    } catch (const std::out_of_range&) {
        refuse(file, "is cut short or has been altered");
    }
}

// --- one statement ---

enum class Stop { none, interrupted, out_of_time, out_of_memory };

/// Examines the parts below a frontier on several threads, in order. Stops as soon as the parts
/// that are done without a gap contain a counterexample or too many unproved boxes, so that
/// neither depends on the speed of the threads.
class Proof {
public:
    Proof(const Statement& statement, Frontier frontier, std::size_t max_unproved, Begun& begun)
        : statement_(statement),
          frontier_(std::move(frontier)),
          max_unproved_(max_unproved),
          begun_(begun),
          total_(frontier_.tally)
    {
        begun_.done.resize(frontier_.open.size());
        for (const auto& part : begun_.done) {
            if (part) boxes_ += part->boxes;
        }
        boxes_ += total_.boxes;
        advance();
    }

    /// @param wait  called about twenty times a second, while the workers are held; not none: stop
    template <class Wait>
    void run(unsigned threads, const Wait& wait)
    {
        std::vector<std::thread> workers;
        try {
            for (unsigned i = 0; i < threads; ++i) workers.emplace_back([this] { work(); });
        } catch (const std::system_error&) {
            if (workers.empty()) throw;  // fewer threads do as well
        }
        {
            std::unique_lock lock(mutex_);
            while (!wake_.wait_for(lock, std::chrono::milliseconds(50), [&] { return idle(); })) {
                try {
                    const Stop asked = wait(boxes_);
                    if (asked != Stop::none && stop_ == Stop::none) stop_ = asked;
                } catch (...) {
                    if (!error_) error_ = std::current_exception();
                }
            }
        }
        for (std::thread& worker : workers) worker.join();
        if (error_) std::rethrow_exception(error_);
    }

    [[nodiscard]] Stop stopped() const noexcept { return finished() ? Stop::none : stop_; }
    [[nodiscard]] const Tally& total() const noexcept { return total_; }
    [[nodiscard]] bool refuted() const noexcept { return !total_.counterexample.empty(); }
    [[nodiscard]] bool too_many() const noexcept { return total_.unproved.size() > max_unproved_; }

private:
    [[nodiscard]] bool finished() const noexcept
    {
        return refuted() || too_many() || settled_ == begun_.done.size();
    }
    [[nodiscard]] bool idle() const noexcept
    {
        return running_ == 0 &&
               (finished() || stop_ != Stop::none || error_ || next_ >= frontier_.open.size());
    }

    /// Adds up what is done without a gap.
    void advance()
    {
        while (!finished() && begun_.done[settled_]) {
            const Tally& part = *begun_.done[settled_];
            total_.boxes += part.boxes;
            total_.lowest = std::min(total_.lowest, part.lowest);
            total_.unproved.insert(total_.unproved.end(), part.unproved.begin(),
                                   part.unproved.end());
            total_.counterexample = part.counterexample;
            ++settled_;
        }
    }

    [[nodiscard]] std::optional<std::size_t> claim()
    {
        const std::scoped_lock lock(mutex_);
        if (finished() || stop_ != Stop::none || error_) return std::nullopt;
        while (next_ < begun_.done.size() && begun_.done[next_]) ++next_;
        if (next_ >= begun_.done.size()) return std::nullopt;
        ++running_;
        return next_++;
    }

    void work()
    {
        while (const auto part = claim()) {
            Tally tally;
            bool whole = false;
            Stop failed = Stop::none;
            std::exception_ptr error;
            try {
                whole = explore(statement_, frontier_.open[*part], max_unproved_, tally,
                                [this](std::uint64_t boxes) {
                                    const std::scoped_lock lock(mutex_);
                                    boxes_ += boxes;
                                    return finished() || stop_ != Stop::none || error_ != nullptr;
                                });
            } catch (const std::bad_alloc&) {
                failed = Stop::out_of_memory;
            } catch (...) {
                error = std::current_exception();
            }
            const std::scoped_lock lock(mutex_);
            --running_;
            if (failed != Stop::none && stop_ == Stop::none) stop_ = failed;
            if (error && !error_) error_ = error;
            if (whole) {
                begun_.done[*part] = std::move(tally);
                advance();
            }
            wake_.notify_all();
        }
        const std::scoped_lock lock(mutex_);
        wake_.notify_all();
    }

    const Statement& statement_;
    Frontier frontier_;
    std::size_t max_unproved_;
    Begun& begun_;
    Tally total_;  ///< of the frontier and of the first `settled_` parts
    std::size_t settled_ = 0;
    std::size_t next_ = 0;  ///< part that nobody has claimed
    unsigned running_ = 0;
    std::uint64_t boxes_ = 0;  ///< for the progress; parts that are not finished included
    Stop stop_ = Stop::none;
    std::exception_ptr error_{};
    std::mutex mutex_;
    std::condition_variable wake_;
};

// --- all levels ---

class Certifier {
public:
    Certifier(const Model& model, const GuardProblem& problem, const CertifyOptions& options,
              const CertifyCallback& progress)
        : model_(model),
          problem_(problem),
          o_(options),
          progress_(progress),
          classifier_(model),
          bounds_(model),
          key_(key(model, problem, options))
    {
        if (o_.resume) all_ = load(key_, o_.checkpoint);
    }

    CertifiedModel run()
    {
        CertifyOutcome outcome = CertifyOutcome::proved;
        try {
            while (all_.levels.size() < o_.levels && outcome == CertifyOutcome::proved) {
                outcome = level();
            }
        } catch (const std::bad_alloc&) {
            outcome = CertifyOutcome::out_of_memory;
        }
        if (!o_.checkpoint.empty()) save(all_, key_, o_.checkpoint);
        return result(outcome);
    }

    Estimate estimate_statement(double margin, double threshold, std::size_t rounds)
    {
        const Statement statement = state(margin, threshold);
        const auto start = Clock::now();
        const Frontier frontier = grow(statement, frontier_boxes);
        const double growing = seconds_since(start);
        Estimate out = estimate_below(statement, frontier, rounds, o_.seed);
        out.seconds = frontier.open.empty()
                          ? growing
                          : growing + out.seconds / static_cast<double>(o_.threads);
        return out;
    }

private:
    static constexpr std::size_t few_rounds = 2;
    static constexpr std::size_t many_rounds = 12;
    static constexpr double checkpoint_every = 5;  // [s]

    [[nodiscard]] Statement state(double margin, double threshold) const
    {
        return {classifier_, bounds_, problem_, o_.smallest, margin, threshold};
    }

    [[nodiscard]] double margin_of(std::size_t level) const
    {
        return o_.margin * std::pow(o_.ratio, static_cast<double>(level));
    }

    [[nodiscard]] Attempt first_attempt(double margin) const
    {
        constexpr std::size_t sampled = 4096;
        constexpr std::size_t sought = 20'000;
        Random random(o_.seed);
        std::vector<double> x(model_.domain.size());
        std::vector<double> logits;
        for (std::size_t i = 0; i < sampled; ++i) {
            draw(model_, random, x);
            logits.push_back(classifier_.logit(x.data()));
        }
        std::sort(logits.begin(), logits.end());
        const double low = logits[sampled / 20];
        const LowestLogit found = lowest_logit(model_, problem_, margin, sought, o_.seed);
        const double highest = std::min(found.logit, logits.back());
        return {.highest = highest, .spread = highest - low, .closest = o_.closest};
    }

    /// Descends from cheap thresholds to dear ones.
    /// @returns nothing if even the cheapest is above the limit, or the logits do not tell the
    ///          states within the margin from the others
    std::optional<Begun> search(double margin, const Attempt& attempt)
    {
        constexpr double first = 0.9;
        constexpr double factor = 0.7;
        std::optional<Begun> best;
        for (double gap = std::max(first, attempt.closest);;
             gap = std::max(attempt.closest, gap * factor)) {
            double threshold = attempt.highest - gap * attempt.spread;
            if (!all_.levels.empty()) {
                threshold = std::min(threshold, all_.levels.back().threshold);
            }
            const Estimate e = estimate_statement(margin, threshold, few_rounds);
            const bool cheap = e.seconds <= (best ? o_.limit / 2 : o_.limit) &&
                               e.unproved <= static_cast<double>(o_.max_unproved);
            if (!cheap) {
                if (!best) last_estimate_ = e;
                break;
            }
            best = Begun{.threshold = threshold, .estimate = e};
            if (gap <= attempt.closest) break;
        }
        if (best) {
            best->estimate = estimate_statement(margin, best->threshold, many_rounds);
            best->lowering = attempt.highest - best->threshold;
        }
        return best;
    }

    CertifyOutcome level()
    {
        const std::size_t index = all_.levels.size();
        const double margin = margin_of(index);
        if (o_.search || index > 0) return search_and_prove(margin);
        if (all_.current) return prove(margin);
        return begin({.threshold = model_.threshold,
                      .estimate = estimate_statement(margin, model_.threshold, many_rounds)},
                     margin);
    }

    /// What fails is tried again further from what cannot be proved.
    CertifyOutcome search_and_prove(double margin)
    {
        constexpr int attempts = 6;
        if (!all_.attempt) all_.attempt = first_attempt(margin);
        if (!(all_.attempt->spread > 0)) return CertifyOutcome::not_provable;
        for (;;) {
            CertifyOutcome outcome = CertifyOutcome::proved;
            if (all_.current) {
                outcome = prove(margin);
            } else if (const auto begun = search(margin, *all_.attempt)) {
                outcome = begin(*begun, margin);
            } else {
                all_.estimates.push_back(last_estimate_);
                return last_estimate_.seconds > o_.limit ? CertifyOutcome::too_long
                                                         : CertifyOutcome::not_provable;
            }
            const bool failed =
                outcome == CertifyOutcome::refuted || outcome == CertifyOutcome::not_provable;
            if (!failed) return outcome;
            Attempt& attempt = *all_.attempt;
            if (++attempt.number == attempts) return outcome;
            attempt.closest = std::min(1.0, 2 * attempt.closest);
            if (outcome == CertifyOutcome::refuted) {
                attempt.highest =
                    std::min(attempt.highest, classifier_.logit(counterexample_.data()));
            }
        }
    }

    CertifyOutcome begin(const Begun& begun, double margin)
    {
        all_.estimates.resize(all_.levels.size());
        all_.estimates.push_back(begun.estimate);
        if (begun.estimate.seconds > o_.limit) return CertifyOutcome::too_long;
        all_.current = begun;
        return prove(margin);
    }

    [[nodiscard]] Stop report(const Begun& begun, double margin, std::uint64_t boxes,
                              double seconds)
    {
        if (seconds_since(start_) > o_.time_limit) return Stop::out_of_time;
        if (!progress_) return Stop::none;
        CertifyProgress now{.level = all_.levels.size(),
                            .levels = o_.levels,
                            .margin = margin,
                            .threshold = begun.threshold,
                            .estimate = begun.estimate,
                            .boxes = boxes,
                            .seconds = begun.seconds + seconds};
        const auto done = static_cast<double>(boxes);
        now.rate = now.seconds > 0 ? done / now.seconds : 0;
        now.seconds_left = now.rate > 0 ? std::max(0.0, begun.estimate.boxes - done) / now.rate
                                        : begun.estimate.seconds;
        now.share = std::min(1.0, done / std::max(begun.estimate.boxes, 1.0));
        return progress_(now) ? Stop::none : Stop::interrupted;
    }

    CertifyOutcome prove(double margin)
    {
        Begun& begun = *all_.current;
        if (const Stop stop = report(begun, margin, 0, 0); stop != Stop::none) {
            return outcome_of(stop);
        }
        const auto start = Clock::now();
        const Statement statement = state(margin, begun.threshold);
        Proof proof(statement, grow(statement, frontier_boxes), o_.max_unproved, begun);
        auto saved = Clock::now();
        proof.run(o_.threads, [&](std::uint64_t boxes) {
            if (!o_.checkpoint.empty() && seconds_since(saved) > checkpoint_every) {
                const double before = begun.seconds;
                begun.seconds += seconds_since(start);
                save(all_, key_, o_.checkpoint);
                begun.seconds = before;
                saved = Clock::now();
            }
            return report(begun, margin, boxes, seconds_since(start));
        });
        begun.seconds += seconds_since(start);
        if (proof.stopped() != Stop::none) return outcome_of(proof.stopped());
        if (proof.refuted()) {
            counterexample_ = proof.total().counterexample;
            all_.current.reset();
            return CertifyOutcome::refuted;
        }
        if (proof.too_many()) {
            all_.current.reset();
            return CertifyOutcome::not_provable;
        }
        finish(proof.total(), margin);
        return CertifyOutcome::proved;
    }

    /// Every box is proved or has no logit below `lowest`, so that with this threshold all are.
    void finish(const Tally& total, double margin)
    {
        const Begun& begun = *all_.current;
        CertificateLevel level{.margin = margin,
                               .threshold = begun.threshold,
                               .boxes = total.boxes,
                               .seconds = begun.seconds,
                               .unproved = total.unproved};
        const double lowest = std::min(total.lowest, begun.threshold);
        if (begun.threshold - lowest <= begun.lowering) {
            level.threshold = lowest;
            level.unproved.clear();
        }
        all_.levels.push_back(std::move(level));
        all_.current.reset();
        all_.attempt.reset();
    }

    [[nodiscard]] static CertifyOutcome outcome_of(Stop stop)
    {
        switch (stop) {
            case Stop::out_of_time: return CertifyOutcome::out_of_time;
            case Stop::out_of_memory: return CertifyOutcome::out_of_memory;
            default: return CertifyOutcome::interrupted;
        }
    }

    CertifiedModel result(CertifyOutcome outcome)
    {
        CertifiedModel out{.model = model_, .report = {}};
        out.model.certificate.clear();
        if (!all_.levels.empty()) {
            out.model.threshold = all_.levels.front().threshold;
            out.model.certificate = to_text(Certificate{.tool = RICOCHET_TOOL,
                                                        .fingerprint = fingerprint(out.model),
                                                        .system = model_.system,
                                                        .parameters = model_.parameters,
                                                        .box = model_.domain,
                                                        .levels = all_.levels});
        }
        const bool listed = std::any_of(all_.levels.begin(), all_.levels.end(),
                                        [](const auto& l) { return !l.unproved.empty(); });
        if (outcome == CertifyOutcome::proved && listed) outcome = CertifyOutcome::partly_proved;
        out.report = {.outcome = outcome,
                      .levels = all_.levels,
                      .estimates = all_.estimates,
                      .counterexample = outcome == CertifyOutcome::refuted ? counterexample_
                                                                           : std::vector<double>{},
                      .seconds = seconds_since(start_)};
        return out;
    }

    const Model& model_;
    const GuardProblem& problem_;
    const CertifyOptions& o_;
    const CertifyCallback& progress_;
    Classifier classifier_;
    NetworkBounds bounds_;
    std::string key_;
    Progressed all_{};
    Estimate last_estimate_{};
    std::vector<double> counterexample_{};
    Clock::time_point start_ = Clock::now();
};

}  // namespace

std::string_view describe(CertifyOutcome outcome) noexcept
{
    switch (outcome) {
        case CertifyOutcome::proved: return "proved over the whole domain";
        case CertifyOutcome::partly_proved:
            return "proved over the domain but for the boxes that the record lists, where the "
                   "exact guard is asked; a smaller edge or a lower threshold leaves fewer";
        case CertifyOutcome::refuted:
            return "a state clears although its guard is within the margin; lower the threshold, "
                   "or "
                   "let it be searched for";
        case CertifyOutcome::not_provable:
            return "too many boxes are left over; lower the threshold or the margin, or train the "
                   "network further";
        case CertifyOutcome::too_long:
            return "the estimate is above the limit and nothing was begun; raise the limit, or "
                   "lower the threshold";
        case CertifyOutcome::out_of_time:
            return "the time is up; what is done is kept in the checkpoint, to be resumed";
        case CertifyOutcome::out_of_memory:
            return "the memory is used up; what is done is kept in the checkpoint, to be resumed";
        case CertifyOutcome::interrupted:
            return "interrupted; what is done is kept in the checkpoint, to be resumed";
    }
    return "";
}

CertifiedModel certify(const Model& model, const GuardProblem& problem,
                       const CertifyOptions& options, const CertifyCallback& progress)
{
    check(options);
    check_recipe(model);
    return Certifier(model, problem, options, progress).run();
}

Estimate estimate(const Model& model, const GuardProblem& problem, double margin, double threshold,
                  const CertifyOptions& options)
{
    check(options);
    check_recipe(model);
    constexpr std::size_t rounds = 12;
    CertifyOptions alone = options;
    alone.resume = false;
    return Certifier(model, problem, alone, {}).estimate_statement(margin, threshold, rounds);
}

LowestLogit lowest_logit(const Model& model, const GuardProblem& problem, double margin,
                         std::size_t states, std::uint64_t seed)
{
    struct Found {
        std::vector<double> x;
        double logit, guard;
    };
    constexpr std::size_t pool = 32;
    const Classifier classifier(model);
    Random random(seed);
    const std::size_t n = model.domain.size();
    // Outside the margin a state is the better the nearer it is, within it the lower its logit.
    const auto better = [margin](const Found& a, const Found& b) {
        const bool in_a = a.guard <= margin;
        const bool in_b = b.guard <= margin;
        if (in_a != in_b) return in_a;
        return in_a ? a.logit < b.logit : a.guard < b.guard;
    };
    const auto look = [&](std::vector<double> x) {
        const double logit = classifier.logit(x.data());
        const double guard = problem.guard(x.data());
        return Found{.x = std::move(x), .logit = logit, .guard = guard};
    };
    std::vector<Found> best;
    std::vector<double> x(n);
    for (std::size_t i = 0; i < states / 2; ++i) {
        draw(model, random, x);
        Found found = look(x);
        if (best.size() == pool && !better(found, best.back())) continue;
        best.insert(std::upper_bound(best.begin(), best.end(), found, better), std::move(found));
        if (best.size() > pool) best.pop_back();
    }
    const std::size_t steps = best.empty() ? 0 : (states - states / 2) / best.size();
    for (Found& at : best) {
        for (std::size_t i = 0; i < steps; ++i) {
            const double radius = random.log_uniform(1e-6, 0.2);
            x = at.x;
            for (std::size_t k = 0; k < n; ++k) {
                const Interval& range = model.domain[k];
                const double step = radius * (range.upper - range.lower) * random.uniform(-1, 1);
                x[k] = std::clamp(x[k] + step, range.lower, range.upper);
            }
            Found found = look(x);
            if (better(found, at)) at = std::move(found);
        }
    }
    LowestLogit out;
    for (const Found& found : best) {
        if (found.guard <= margin && found.logit < out.logit) {
            out = {.logit = found.logit, .x = found.x};
        }
    }
    return out;
}

void detail::check_certifiable(const Model& model, std::string_view system, std::size_t components)
{
    check_recipe(model);
    if (model.system != system) {
        throw std::invalid_argument(fmt::format(
            "certify: the model is for the system '{}', expected '{}'", model.system, system));
    }
    if (model.layers.empty() || model.layers.front().inputs != components) {
        throw std::invalid_argument(fmt::format(
            "certify: the model takes {} features, but the state of {} has {} "
            "components",
            model.layers.empty() ? 0 : model.layers.front().inputs, system, components));
    }
}

void detail::check_parameter(const std::string& name, double trained, std::optional<double> value)
{
    if (value == trained) return;
    throw std::invalid_argument(
        value
            ? fmt::format("certify: the model is for {} = {}, the system has {}", name, trained,
                          *value)
            : fmt::format("certify: the model depends on the parameter '{}', which the system does "
                          "not tell",
                          name));
}

}  // namespace ricochet::learn
