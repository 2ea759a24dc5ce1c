#include "ensemble_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "../files.hpp"
#include "../input.hpp"
#include "../interrupt.hpp"
#include "../joined.hpp"
#include "../plot.hpp"
#include "../report.hpp"
#include "../say.hpp"
#include "../timing.hpp"
#include "ensemble_plot.hpp"
#include "ensemble_runs.hpp"
#include "results.hpp"
#include "ricochet/ensemble.hpp"
#include "share.hpp"

#ifdef RICOCHET_HAS_SCENE
#include "scene_runs.hpp"
#endif

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

/// The requested table.
Table table_of(const ColumnSource& source, const EnsembleRequest& request)
{
    if (request.table && request.count) {
        throw BadInput("--table and --count both give the rows; expected one or the other");
    }
    if (request.table) {
        if (!request.grid.empty()) throw BadInput("--grid gives rows, and so does --table");
        if (!request.vary.empty()) throw BadInput("--vary is for random rows, and needs --count");
        if (request.seed) throw BadInput("--seed is for random rows, and needs --count");
        return read_table(source, *request.table);
    }
    if (!request.count && request.grid.empty()) {
        throw BadInput(
            "the rows are missing: expected --table FILE, --grid name=first:last:count, or "
            "--count N with --vary");
    }
    if (request.vary.empty() && request.grid.empty()) {
        throw BadInput("--count needs at least one --vary name=lowest:highest");
    }
    return made_table(source, request.grid, request.vary, request.count.value_or(1),
                      request.seed.value_or(1));
}

/// The directory of the results, created if it does not exist.
/// @throws BadInput where it cannot be, or holds an ensemble with another number of shares.
fs::path claim_directory(const EnsembleRequest& request, const Share& share)
{
    if (!request.out) throw BadInput("--out DIR is missing: where the results are kept");
    const fs::path& directory = *request.out;
    const auto refuse = [&](std::string_view why) {
        throw BadInput(fmt::format("--out must be a directory that can be written, got '{}': {}",
                                   shortened(directory.string()), why));
    };
    std::error_code error;
    fs::create_directory(directory, error);
    if (!fs::is_directory(directory)) refuse(error ? error.message() : "it is none");
    if (access(directory.c_str(), W_OK | X_OK) != 0) {
        refuse(std::generic_category().message(errno));
    }
    for (const Share& other : shares_in(directory)) {
        if (other.count == share.count) continue;
        throw BadInput(fmt::format(
            "'{}' keeps share {}, and this is share {}; expected shares of one number, or another "
            "directory",
            shortened(directory.string()), to_string(other), to_string(share)));
    }
    return directory;
}

/// Reports progress of the rows on standard error, where a person may be waiting for them.
class RowProgress {
public:
    void show(const EnsembleProgress& now)
    {
        const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
        if (seconds < next_) return;
        next_ = seconds + (terminal_ ? 0.2 : 10.0);
        const double left =
            seconds * static_cast<double>(now.rows - now.done) / static_cast<double>(now.done);
        say("{}ricochet: {} of {} rows, {:.0f} s left{}", terminal_ ? "\r" : "", now.done, now.rows,
            left, terminal_ ? "\x1b[K" : "\n");
        shown_ = true;
    }
    ~RowProgress()
    {
        if (terminal_ && shown_) say("\n");
    }

private:
    Clock::time_point start_ = Clock::now();
    bool terminal_ = isatty(STDERR_FILENO) == 1;
    bool shown_ = false;
    double next_ = 2;  ///< [s]
};

/// The picture that a request asks for.
struct Picture {
    EnsemblePicture shown;
    std::string title;
    fs::path file;

    void draw(const std::vector<Field>& fields, const AllBlocks& blocks) const
    {
        plot_ensemble(shown, fields, title, blocks, file);
    }
};

/// The picture of an ensemble of this set-up, nothing without `--plot`.
/// @throws BadInput
std::optional<Picture> requested_picture(const EnsembleRequest& request, const Json& setup)
{
    if (!request.plot) {
        if (!request.show.empty()) throw BadInput("--show is of --plot, which is missing");
        return {};
    }
    check_plot(*request.plot);
    return Picture{.shown = ensemble_picture(fields_from(setup["fields"]), setup["columns"].size(),
                                             request.show),
                   .title = setup["system"],
                   .file = *request.plot};
}

/// The execution of one process's share of the rows.
class ShareRun {
public:
    ShareRun(const RowRuns& runs, const Share& share, const fs::path& directory)
        : runs_(runs),
          all_(runs.table().rows, share.count),
          setup_(runs.setup(share.count)),
          fields_(fields_from(setup_["fields"])),
          file_(directory, share, setup_,
                [this](std::string_view rows) { tally_.add(fields_, rows); })
    {
        std::vector<bool> kept(all_.size(), false);
        for (const BlockPlace& place : file_.blocks()) {
            if (place.block < kept.size()) kept[place.block] = true;
        }
        for (std::size_t b = share.index - 1; b < kept.size(); b += share.count) {
            rows_ += all_.rows_of(b);
            if (!kept[b]) missing_.push_back(b);
        }
    }

    /// Runs the missing blocks.
    void run(unsigned threads)
    {
        // The rows of the current blocks, which several threads may run.
        using Rows = std::array<std::string, block_rows>;
        std::vector<std::unique_ptr<Rows>> results(missing_.size());
        std::vector<std::once_flag> begun(missing_.size());
        // Chunks of rows are blocks: only the last of the share may be shorter.
        const std::size_t rows =
            missing_.empty() ? 0
                             : (missing_.size() - 1) * block_rows + all_.rows_of(missing_.back());
        RowProgress progress;
        EnsembleOptions options{.threads = threads, .cancelled = Interrupts::flag()};
        options.progress = [&](const EnsembleProgress& now) {
            // An interrupted row is run again.
            if (Interrupts::any()) return false;
            const std::size_t chunk = now.first / block_rows;
            const auto parts = std::exchange(results[chunk], nullptr);
            std::string block;
            for (const std::string& row : *parts) block += row;
            file_.append(missing_[chunk], block);
            tally_.add(fields_, block);
            rows_run_ += now.count;
            progress.show(now);
            return true;
        };
        const auto all = ricochet::detail::run_rows(
            rows,
            [&](const EnsembleRow& row) {
                const std::size_t chunk = row.index / block_rows;
                const std::size_t i = row.index % block_rows;
                try {
                    std::call_once(begun[chunk],
                                   [&] { results[chunk] = std::make_unique<Rows>(); });
                    runs_.run_row(all_.row(missing_[chunk], i), (*results[chunk])[i]);
                } catch (...) {
                    // Apart from the runs themselves only memory can fail: this block lacks a row,
                    // and must not be kept.
                    Interrupts::raise_for(Cause::memory);
                    throw;
                }
            },
            options);
        if (!all.failures.empty()) std::rethrow_exception(all.failures.front().exception);
    }

    /// Runs blocks numbered by `next` until there are no more, except those in `kept`.
    void run_dealt(const std::function<std::size_t()>& next, const AllBlocks& kept)
    {
        for (std::size_t b = next(); b < all_.size(); b = next()) {
            if (kept.has(b)) continue;
            std::string block;
            for (std::size_t i = 0; i < all_.rows_of(b); ++i) runs_.run_row(all_.row(b, i), block);
            if (Interrupts::any()) return;
            file_.append(b, block);
        }
    }

    [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
    [[nodiscard]] std::size_t rows_run() const noexcept { return rows_run_; }
    [[nodiscard]] const EnsembleTally& tally() const noexcept { return tally_; }
    [[nodiscard]] std::size_t rows_kept() const
    {
        std::size_t out = 0;
        for (const auto& [outcome, count] : tally_.outcomes) out += count;
        return out;
    }

    /// Writes the results where this is the only share, and draws them.
    void write(const fs::path& directory, const std::optional<Picture>& picture) const
    {
        AllBlocks blocks(all_.size());
        blocks.add(directory / file_name({}), file_.blocks());
        write_results(directory, fields_, runs_.table().rows, 1, blocks);
        if (picture) picture->draw(fields_, blocks);
    }

private:
    const RowRuns& runs_;
    Blocks all_;
    Json setup_;
    std::vector<Field> fields_;
    EnsembleTally tally_;
    ShareFile file_;
    std::size_t rows_ = 0;      ///< of the share
    std::size_t rows_run_ = 0;  ///< by this process
    std::vector<std::size_t> missing_;
};

/// Result of a command, for people and as JSON.
struct Summary {
    std::string system;
    Share share;
    std::size_t rows = 0;
    std::size_t rows_run = 0;
    std::size_t rows_kept = 0;
    EnsembleTally tally;
    double seconds = 0;
    std::vector<std::string> files{};

    [[nodiscard]] std::string json() const
    {
        return json_text({{"system", system},
                          {"share", {share.index, share.count}},
                          {"rows", rows},
                          {"rows_kept", rows_kept},
                          {"rows_run", rows_run},
                          {"outcomes", tally.outcomes},
                          {"events", tally.events},
                          {"first_failure", tally.first_failure},
                          {"files", files},
                          {"seconds", seconds}});
    }

    [[nodiscard]] std::string text(bool merged) const
    {
        std::vector<std::string> ends;
        for (const auto& [outcome, count] : tally.outcomes) {
            ends.push_back(fmt::format("{} {}", count, outcome));
        }
        std::string out = fmt::format("{}: {} of {} rows", system, rows_kept, rows);
        if (share.count > 1) out += fmt::format(" of share {}", to_string(share));
        out += fmt::format("; {}; {} events\n", joined(ends, ", "), tally.events);
        if (!tally.first_failure.empty()) {
            out += fmt::format("first failure: {}\n", tally.first_failure);
        }
        if (rows_run > 0) {
            out += fmt::format("{} rows in {}\n", rows_run, duration(seconds));
        } else if (!merged) {
            out += "all of them were there\n";
        }
        return out + (files.empty() ? "" : fmt::format("results: {}\n", joined(files, ", ")));
    }
};

std::vector<std::string> result_files(const fs::path& directory)
{
    return {(directory / "results.npy").string(), (directory / "results.csv").string()};
}

std::unique_ptr<RowRuns> runs_of(const EnsembleRequest& request)
{
    if (request.system.empty()) throw BadInput("ensemble needs a SYSTEM, or --merge DIR");
    const std::size_t events = request.events.value_or(0);
    if (request.system.ends_with(".json")) {
#ifdef RICOCHET_HAS_SCENE
        const SceneText text(request.system, request.run);
        return std::make_unique<SceneRuns>(text, table_of(text.columns(), request), events);
#else
        throw BadInput("this program was built without scenes; expected the name of a system");
#endif
    }
    const SystemEntry& system = find_system(request.system);
    if (system.run == nullptr) {
        throw BadInput(
            fmt::format("{} is run by ricochet{} simulate alone", system.name,
                        system.program.empty() ? "" : fmt::format("-{}", system.program)));
    }
    return std::make_unique<EnsembleRuns>(system, request.run,
                                          table_of(columns_of(system), request), events);
}

int run_share(const EnsembleRequest& request)
{
    const std::unique_ptr<RowRuns> runs = runs_of(request);
    const Share share = chosen_share(request.share);
    if (request.plot && share.count > 1) {
        throw BadInput("a share is not drawn; expected --plot with --merge");
    }
    const std::optional<Picture> picture = requested_picture(request, runs->setup(share.count));
    const fs::path directory = claim_directory(request, share);

    const Interrupts interrupts;
    ShareRun work(*runs, share, directory);
    const auto start = Clock::now();
    work.run(request.threads.value_or(0));
    const std::chrono::duration<double> spent = Clock::now() - start;
    Summary summary{.system = runs->name(),
                    .share = share,
                    .rows = work.rows(),
                    .rows_run = work.rows_run(),
                    .rows_kept = work.rows_kept(),
                    .tally = work.tally(),
                    .seconds = spent.count()};
    const bool complete = summary.rows_kept == summary.rows;
    if (complete && share.count == 1) {
        work.write(directory, picture);
        summary.files = result_files(directory);
        if (picture) summary.files.push_back(picture->file.string());
    }
    print(request.json ? summary.json() : summary.text(false));
    if (!complete) {
        return ended_early(fmt::format("after {} of {} rows, and the same call goes on from there",
                                       summary.rows_kept, summary.rows));
    }
    if (share.count > 1 && !request.json) {
        print(
            fmt::format("once all shares are: ricochet ensemble --merge {}\n", directory.string()));
    }
    return 0;
}

/// The set-up of all shares of a directory, and the places of their blocks.
struct Merged {
    Json setup;
    std::size_t shares = 0;
    std::optional<AllBlocks> blocks;
    EnsembleTally tally;
};

/// @throws BadInput where the shares have different set-ups.
Merged read_shares(const fs::path& directory)
{
    const std::vector<Share> shares = shares_in(directory);
    if (shares.empty()) {
        throw BadInput(
            fmt::format("there is no share of an ensemble in '{}'", shortened(directory.string())));
    }
    if (shares.front().count != shares.back().count) {
        throw BadInput(fmt::format(
            "'{}' keeps share {} and share {}; expected shares of one number",
            shortened(directory.string()), to_string(shares.front()), to_string(shares.back())));
    }
    Merged out;
    out.shares = shares.front().count;
    for (const Share& share : shares) {
        // Blocks are tallied below, where none counts twice.
        ShareContent content = read_share(directory / file_name(share), [](std::string_view) {});
        if (!out.blocks) {
            out.setup = content.setup;
            const std::size_t rows = out.setup["rows"];
            out.blocks.emplace(Blocks(rows, out.shares).size());
        }
        if (const std::string other = difference(content.setup, out.setup); !other.empty()) {
            throw BadInput(fmt::format("share {} in '{}' is of another set-up: {}",
                                       to_string(share), shortened(directory.string()), other));
        }
        out.blocks->add(content.file, content.blocks);
    }
    return out;
}

int merge(const EnsembleRequest& request)
{
    const fs::path& directory = *request.merge;
    Merged all = read_shares(directory);
    const std::optional<Picture> picture = requested_picture(request, all.setup);
    for (std::size_t b = 0; b < all.blocks->size(); ++b) {
        if (all.blocks->has(b)) continue;
        const Share share{.index = b % all.shares + 1, .count = all.shares};
        throw BadInput(fmt::format("share {} in '{}' is not complete: its call is to be repeated",
                                   to_string(share), shortened(directory.string())));
    }
    const std::vector<Field> fields = fields_from(all.setup["fields"]);
    for (std::size_t b = 0; b < all.blocks->size(); ++b) all.tally.add(fields, all.blocks->rows(b));
    const std::size_t rows = all.setup["rows"];
    write_results(directory, fields, rows, all.shares, *all.blocks);
    if (picture) picture->draw(fields, *all.blocks);
    Summary summary{.system = all.setup["system"],
                    .share = {},
                    .rows = rows,
                    .rows_run = 0,
                    .rows_kept = rows,
                    .tally = all.tally,
                    .files = result_files(directory)};
    if (picture) summary.files.push_back(picture->file.string());
    print(request.json ? summary.json() : summary.text(true));
    return 0;
}

}  // namespace

int run_ensemble(const EnsembleRequest& request)
{
    if (!request.merge) return run_share(request);
    if (request != EnsembleRequest{.merge = request.merge,
                                   .plot = request.plot,
                                   .show = request.show,
                                   .json = request.json}) {
        throw BadInput(
            "--merge runs nothing; expected it alone, or with --plot, --show and --json");
    }
    return merge(request);
}

int run_ensemble_dealt(const EnsembleRequest& request, const BlockDealer& dealer)
{
    if (request.share || request.merge || request.threads) {
        throw BadInput(
            "blocks are dealt to processes of one thread; --share, --merge and --threads "
            "are for ricochet ensemble");
    }
    const std::unique_ptr<RowRuns> runs = runs_of(request);
    const fs::path directory = claim_directory(request, dealer.place);
    const Interrupts interrupts;
    {
        ShareRun work(*runs, dealer.place, directory);
        dealer.wait_for_all();  // now all files exist
        const Merged there = read_shares(directory);
        work.run_dealt(dealer.next, *there.blocks);
    }
    dealer.wait_for_all();  // now all of them are complete
    if (Interrupts::any()) return ended_early("and the same call goes on");
    if (dealer.place.index != 1) return 0;
    return merge(
        {.merge = directory, .plot = request.plot, .show = request.show, .json = request.json});
}

}  // namespace ricochet::app
