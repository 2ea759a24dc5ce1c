// ricochet-training-data: writes the data sets that the models were trained on.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "studies/table_files.hpp"
#include "studies/training_sets.hpp"

namespace ricochet::studies {

namespace {

namespace fs = std::filesystem;

/// Error that a user can correct: status 2.
class BadInput : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct Request {
    std::vector<std::string> models{};
    bool all = false;
    bool list = false;
    bool force = false;
    fs::path out{};
    long long rows = 1000;  ///< of the CSV, at most
};

void print(std::string_view text)
{
    std::fwrite(text.data(), 1, text.size(), stdout);
    std::fputc('\n', stdout);
    if (std::fflush(stdout) != 0) {
        throw std::runtime_error("cannot write to the standard output");
    }
}

void print_list()
{
    for (const ModelData& data : model_data()) {
        print(fmt::format("{:<34}{:<6}{}", data.model, data.make ? "set" : "none", data.origin));
    }
}

const ModelData& find(std::string_view model)
{
    std::vector<std::string_view> known;
    for (const ModelData& data : model_data()) {
        known.push_back(data.model);
        if (data.model != model) continue;
        if (data.make) return data;
        throw BadInput(fmt::format("{} has no training set: it is from {}", model, data.origin));
    }
    throw BadInput(fmt::format("unknown model '{}'; known are {}", model, fmt::join(known, ", ")));
}

/// The requested models, each once.
std::vector<const ModelData*> wanted(const Request& request)
{
    std::vector<const ModelData*> out;
    if (request.all) {
        for (const ModelData& data : model_data()) {
            if (data.make) out.push_back(&data);
        }
        return out;
    }
    for (const std::string& model : request.models) {
        const ModelData* data = &find(model);
        if (std::find(out.begin(), out.end(), data) == out.end()) out.push_back(data);
    }
    if (out.empty()) throw BadInput("expected the name of a model, --all or --list, found none");
    return out;
}

fs::path file_of(const Request& request, const ModelData& data, std::string_view extension)
{
    return request.out / fmt::format("{}{}", data.model, extension);
}

/// Checks the output files before any work is done.
void check_files(const Request& request, const std::vector<const ModelData*>& models)
{
    std::error_code error;
    if (request.out.empty()) throw BadInput("expected --out with a directory, found none");
    if (!fs::is_directory(request.out, error)) {
        throw BadInput(fmt::format("--out must be a directory, got '{}'", request.out.string()));
    }
    for (const ModelData* data : models) {
        for (const std::string_view extension : {".npy", ".csv"}) {
            const fs::path file = file_of(request, *data, extension);
            const fs::file_status status = fs::symlink_status(file, error);
            if (!fs::exists(status)) continue;
            if (!request.force) {
                throw BadInput(
                    fmt::format("'{}' is there already; --force replaces it", file.string()));
            }
            if (!fs::is_regular_file(status)) {
                throw BadInput(
                    fmt::format("'{}' must be a file, found something else there", file.string()));
            }
        }
    }
}

/// Reports progress on standard error, one line every two seconds.
class Reporter {
public:
    explicit Reporter(std::string_view model) : model_(model) {}

    bool operator()(const learn::Progress& progress)
    {
        const auto now = std::chrono::steady_clock::now();
        if (now - last_ < std::chrono::seconds(2)) return true;
        last_ = now;
        fmt::print(stderr, "ricochet-training-data: {}: {}, {} of {} events\n", model_,
                   progress.stage, progress.iteration, progress.total);
        return true;
    }

private:
    std::string_view model_;
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

void write_sets(const Request& request)
{
    const std::vector<const ModelData*> models = wanted(request);
    check_files(request, models);
    print(checksum_header);
    if (request.all) {
        const TrainingSet functions = elementary_functions();
        print(checksum_line("elementary-functions", functions, to_npy(functions)));
    }
    for (const ModelData* data : models) {
        const TrainingSet set = data->make(Reporter(data->model));
        const std::string npy = to_npy(set);
        write_whole(file_of(request, *data, ".npy"), npy);
        write_whole(file_of(request, *data, ".csv"),
                    to_csv(set, static_cast<std::size_t>(request.rows)));
        print(checksum_line(data->model, set, npy));
    }
}

void run(int count, char** arguments, int& status)
{
    CLI::App app(
        "Writes the set that a model was trained on as MODEL.npy, its first rows as MODEL.csv,\n"
        "and a line with the checksum of the first to standard output.",
        "ricochet-training-data");
    Request request;
    app.add_option("model", request.models, "models, as --list names them");
    app.add_flag("--all", request.all, "all models that have a set");
    app.add_flag("--list", request.list, "say which models have a set, and write nothing");
    app.add_option("--out", request.out, "directory that the files are written to");
    app.add_option("--rows", request.rows, "of the CSV, at most; default 1000")
        ->check(CLI::NonNegativeNumber);
    app.add_flag("--force", request.force, "replace files that are there");
    try {
        app.parse(count, arguments);
    } catch (const CLI::Success& help) {
        status = app.exit(help);
        return;
    } catch (const CLI::ParseError& error) {
        throw BadInput(error.what());
    }
    if (request.list) return print_list();
    write_sets(request);
}

}  // namespace

}  // namespace ricochet::studies

int main(int count, char** arguments)
{
    int status = 0;
    const auto fail = [&](int with, const std::exception& error) {
        fmt::print(stderr, "ricochet-training-data: {}\n", error.what());
        status = with;
    };
    try {
        ricochet::studies::run(count, arguments, status);
    } catch (const ricochet::studies::BadInput& error) {
        fail(2, error);
    } catch (const std::exception& error) {
        fail(1, error);
    }
    return status;
}
