#include "run_watch.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <system_error>

#include "interrupt.hpp"

namespace ricochet::app {

namespace {

constexpr double unlimited = std::numeric_limits<double>::infinity();
constexpr double reserve = 64 << 20;  ///< [bytes] needed by the rest of the program

/// The start of a small file, without an allocation; empty if there is none.
std::array<char, 4096> start_of(const char* file)
{
    std::array<char, 4096> text{};
    const int descriptor = open(file, O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return text;
    const ssize_t n = read(descriptor, text.data(), text.size() - 1);
    text[static_cast<std::size_t>(std::max<ssize_t>(n, 0))] = '\0';
    close(descriptor);
    return text;
}

/// [bytes] in a file that holds one number; "max" and no file: unlimited.
double number_in(const char* file)
{
    const auto text = start_of(file);
    char* end = nullptr;
    const double value = std::strtod(text.data(), &end);
    return end == text.data() ? unlimited : value;
}

struct Held {
    double all = 0;       ///< [bytes] of addresses
    double resident = 0;  ///< [bytes]
};

Held held()
{
    const auto text = start_of("/proc/self/statm");
    const auto page = static_cast<double>(sysconf(_SC_PAGESIZE));
    char* rest = nullptr;
    const double all = std::strtod(text.data(), &rest);
    return {.all = all * page, .resident = std::strtod(rest, nullptr) * page};
}

/// [bytes] that the program may still allocate: limits of the machine, its group and its own.
double available()
{
    double most = unlimited;
    const auto text = start_of("/proc/meminfo");
    if (const char* line = std::strstr(text.data(), "MemAvailable:")) {
        most = std::strtod(line + std::strlen("MemAvailable:"), nullptr) * 1024;
    }
    const double group = number_in("/sys/fs/cgroup/memory.max");
    if (group < unlimited)
        most = std::min(most, group - number_in("/sys/fs/cgroup/memory.current"));
    const Held now = held();
    for (const auto& [resource, used] :
         {std::pair{RLIMIT_AS, now.all}, std::pair{RLIMIT_DATA, now.resident}}) {
        rlimit limit{};
        if (getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
            most = std::min(most, static_cast<double>(limit.rlim_cur) - used);
        }
    }
    return std::max(most, 0.0);
}

}  // namespace

RunWatch::RunWatch(double share)
    : most_(held().resident + share * std::max(available() - reserve, 0.0))
{
    try {
        thread_ = std::thread([this] { watch(); });
    } catch (const std::system_error&) {
        // Without the thread no progress is shown.
    }
}

RunWatch::~RunWatch()
{
    {
        const std::lock_guard lock(mutex_);
        ended_ = true;
    }
    condition_.notify_one();
    if (thread_.joinable()) thread_.join();
}

void RunWatch::watch()
{
    constexpr std::chrono::milliseconds often(5);
    constexpr std::chrono::seconds patience(5);
    const auto start = std::chrono::steady_clock::now();
    bool said = false;
    std::unique_lock lock(mutex_);
    while (!condition_.wait_for(lock, often, [this] { return ended_; })) {
        if (held().resident > most_) {
            Interrupts::raise_for(Cause::memory);
            return;
        }
        if (!said && !Interrupts::any() && std::chrono::steady_clock::now() - start > patience) {
            said = true;
            std::fputs("ricochet: still running; Ctrl-C ends it with what there is\n", stderr);
        }
    }
}

}  // namespace ricochet::app
